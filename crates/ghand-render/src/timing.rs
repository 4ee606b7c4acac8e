//! How long passes take.

use std::time::Instant;

use crate::{Gpu, RenderError, buffers};

/// Submits what is encoded, then `count` compute passes that `encode` fills, and tells how long each took, milliseconds: by
/// timestamps where the device has them, else by waiting for each.
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
