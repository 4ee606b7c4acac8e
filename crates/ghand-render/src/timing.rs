//! Measures the time of passes and frames.

use std::time::Instant;

use crate::{Gpu, RenderError, buffers};

/// Measures the stages of a frame with the device's timestamps, without waiting for them.
pub struct FrameClock {
    queries: wgpu::QuerySet,
    resolved: wgpu::Buffer,
    stages: u32,
    ms_per_tick: f64,
}

impl FrameClock {
    /// Bytes that [`FrameClock::finish`] writes for this many stages: a timestamp before the first and after each.
    pub const fn bytes(stages: u32) -> u64 {
        (stages as u64 + 1) * wgpu::QUERY_SIZE as u64
    }

    /// A clock for frames of this many stages, if the device supports timestamps.
    pub fn new(gpu: &Gpu, stages: u32) -> Option<FrameClock> {
        gpu.device.features().contains(wgpu::Features::TIMESTAMP_QUERY).then(|| FrameClock {
            queries: gpu.device.create_query_set(&wgpu::QuerySetDescriptor {
                label: Some("frame clock"),
                ty: wgpu::QueryType::Timestamp,
                count: 2 * (stages + 1),
            }),
            resolved: gpu.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("timestamps"),
                size: FrameClock::bytes(stages),
                usage: wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC,
                mapped_at_creation: false,
            }),
            stages,
            ms_per_tick: f64::from(gpu.queue.get_timestamp_period()) * 1e-6,
        })
    }

    /// Encodes the start of the frame.
    pub fn start(&self, encoder: &mut wgpu::CommandEncoder) {
        self.mark(encoder, 0);
    }

    /// Encodes the end of stage number `stage`, counted from 1, if it does not end with a pass that has [`FrameClock::pass`].
    pub fn mark(&self, encoder: &mut wgpu::CommandEncoder, stage: u32) {
        encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
            label: Some("mark of the clock"),
            timestamp_writes: Some(wgpu::ComputePassTimestampWrites {
                query_set: &self.queries,
                beginning_of_pass_write_index: Some(stage),
                end_of_pass_write_index: Some(self.flush(stage)),
            }),
        });
    }

    /// Timestamp writes for the last compute pass of stage number `stage`, counted from 1. Each stage must have its end in
    /// every frame; that of the last stage is [`FrameClock::end`].
    pub fn pass(&self, stage: u32) -> wgpu::ComputePassTimestampWrites<'_> {
        wgpu::ComputePassTimestampWrites {
            query_set: &self.queries,
            beginning_of_pass_write_index: Some(self.flush(stage)),
            end_of_pass_write_index: Some(stage),
        }
    }

    /// Timestamp writes for the frame's last pass, whose end is the end of the last stage.
    pub fn end(&self) -> wgpu::RenderPassTimestampWrites<'_> {
        wgpu::RenderPassTimestampWrites {
            query_set: &self.queries,
            beginning_of_pass_write_index: Some(self.flush(self.stages)),
            end_of_pass_write_index: Some(self.stages),
        }
    }

    /// A timestamp that is not read. Mesa's software rasteriser takes the time of one only when the next is written: without
    /// these, a stage would have the time of the stage behind it, too.
    fn flush(&self, stage: u32) -> u32 {
        self.stages + 1 + stage
    }

    fn resolve(&self, encoder: &mut wgpu::CommandEncoder) {
        encoder.resolve_query_set(&self.queries, 0..self.stages + 1, &self.resolved, 0);
    }

    /// Encodes the copy of the timestamps to `offset` in a buffer.
    pub fn finish(&self, encoder: &mut wgpu::CommandEncoder, to: &wgpu::Buffer, offset: u64) {
        self.resolve(encoder);
        encoder.copy_buffer_to_buffer(&self.resolved, 0, to, offset, FrameClock::bytes(self.stages));
    }

    /// The time of each stage, milliseconds, from the bytes of the timestamps.
    pub fn milliseconds(&self, stamps: &[u8]) -> Vec<f64> {
        let stamps: Vec<u64> = bytemuck::pod_collect_to_vec(stamps);
        stamps.windows(2).map(|ends| ends[1].saturating_sub(ends[0]) as f64 * self.ms_per_tick).collect()
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
    let Some(clock) = FrameClock::new(gpu, count as u32) else {
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
    };
    clock.start(&mut encoder);
    for k in 0..count {
        let descriptor =
            wgpu::ComputePassDescriptor { label: Some("timed"), timestamp_writes: Some(clock.pass(k as u32 + 1)) };
        encode(k, &mut encoder.begin_compute_pass(&descriptor));
    }
    clock.resolve(&mut encoder);
    gpu.queue.submit([encoder.finish()]);
    let stamps: Vec<u8> = buffers::read(gpu, &clock.resolved, FrameClock::bytes(clock.stages) as usize)?;
    Ok(clock.milliseconds(&stamps))
}
