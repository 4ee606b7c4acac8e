//! Measures the time of passes and frames.

use std::time::Instant;

use crate::{Gpu, RenderError, buffers};

/// Measures a frame with the device's timestamps, without waiting for it.
pub struct FrameClock {
    queries: wgpu::QuerySet,
    resolved: wgpu::Buffer,
    ms_per_tick: f64,
}

impl FrameClock {
    /// Bytes that [`FrameClock::finish`] writes: two timestamps.
    pub const BYTES: u64 = 16;

    /// A clock, if the device supports timestamps.
    pub fn new(gpu: &Gpu) -> Option<FrameClock> {
        gpu.device.features().contains(wgpu::Features::TIMESTAMP_QUERY).then(|| FrameClock {
            queries: gpu.device.create_query_set(&wgpu::QuerySetDescriptor {
                label: Some("frame clock"),
                ty: wgpu::QueryType::Timestamp,
                count: 2,
            }),
            resolved: gpu.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("timestamps"),
                size: FrameClock::BYTES,
                usage: wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC,
                mapped_at_creation: false,
            }),
            ms_per_tick: f64::from(gpu.queue.get_timestamp_period()) * 1e-6,
        })
    }

    /// Encodes the start of the frame.
    pub fn start(&self, encoder: &mut wgpu::CommandEncoder) {
        encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
            label: Some("start of the clock"),
            timestamp_writes: Some(wgpu::ComputePassTimestampWrites {
                query_set: &self.queries,
                beginning_of_pass_write_index: Some(0),
                end_of_pass_write_index: None,
            }),
        });
    }

    /// Timestamp writes for the frame's last pass, whose end is the end of the frame.
    pub fn end(&self) -> wgpu::RenderPassTimestampWrites<'_> {
        wgpu::RenderPassTimestampWrites {
            query_set: &self.queries,
            beginning_of_pass_write_index: None,
            end_of_pass_write_index: Some(1),
        }
    }

    /// Encodes the copy of the timestamps to `offset` in a buffer.
    pub fn finish(&self, encoder: &mut wgpu::CommandEncoder, to: &wgpu::Buffer, offset: u64) {
        encoder.resolve_query_set(&self.queries, 0..2, &self.resolved, 0);
        encoder.copy_buffer_to_buffer(&self.resolved, 0, to, offset, FrameClock::BYTES);
    }

    /// The frame's time, milliseconds, from the bytes of its timestamps.
    pub fn milliseconds(&self, stamps: &[u8]) -> Option<f64> {
        let stamps: Vec<u64> = bytemuck::pod_collect_to_vec(stamps);
        let [start, end] = stamps[..] else { return None };
        Some(end.saturating_sub(start) as f64 * self.ms_per_tick)
    }
}

/// Submits the encoded commands, then `count` compute passes filled by `encode`, and returns the time of each pass,
/// milliseconds: by timestamps if the device supports them, else by waiting for each.
///
/// # Errors
/// [`RenderError`] if the device failed or was lost.
pub fn time_passes(
    gpu: &Gpu,
    mut encoder: wgpu::CommandEncoder,
    count: usize,
    encode: impl Fn(usize, &mut wgpu::ComputePass<'_>),
) -> Result<Vec<f64>, RenderError> {
    if !gpu.device.features().contains(wgpu::Features::TIMESTAMP_QUERY) {
        gpu.queue.submit([encoder.finish()]);
        gpu.wait()?;
        return (0..count)
            .map(|k| {
                let start = Instant::now();
                let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
                encode(k, &mut encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default()));
                gpu.queue.submit([encoder.finish()]);
                gpu.wait()?;
                Ok(start.elapsed().as_secs_f64() * 1e3)
            })
            .collect();
    }
    let stamps = 2 * count as u32;
    let queries = gpu.device.create_query_set(&wgpu::QuerySetDescriptor {
        label: Some("stage times"),
        ty: wgpu::QueryType::Timestamp,
        count: stamps,
    });
    for k in 0..count {
        let descriptor = wgpu::ComputePassDescriptor {
            label: Some("timed"),
            timestamp_writes: Some(wgpu::ComputePassTimestampWrites {
                query_set: &queries,
                beginning_of_pass_write_index: Some(2 * k as u32),
                end_of_pass_write_index: Some(2 * k as u32 + 1),
            }),
        };
        encode(k, &mut encoder.begin_compute_pass(&descriptor));
    }
    let resolved = gpu.device.create_buffer(&wgpu::BufferDescriptor {
        label: Some("stage times"),
        size: u64::from(stamps) * 8,
        usage: wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC,
        mapped_at_creation: false,
    });
    encoder.resolve_query_set(&queries, 0..stamps, &resolved, 0);
    gpu.queue.submit([encoder.finish()]);
    let ticks: Vec<u64> = buffers::read(gpu, &resolved, stamps as usize)?;
    let milliseconds_per_tick = f64::from(gpu.queue.get_timestamp_period()) * 1e-6;
    Ok(ticks
        .as_chunks::<2>()
        .0
        .iter()
        .map(|[from, to]| to.saturating_sub(*from) as f64 * milliseconds_per_tick)
        .collect())
}
