//! Storage buffers: making, filling and reading them.

use std::sync::mpsc;

use bytemuck::Pod;
use wgpu::util::DeviceExt;

use crate::{Gpu, RenderError};

const USAGE: wgpu::BufferUsages =
    wgpu::BufferUsages::STORAGE.union(wgpu::BufferUsages::COPY_SRC).union(wgpu::BufferUsages::COPY_DST);

/// A zeroed storage buffer of `words` 32-bit words (at least 16, so that a shader's struct of one element always fits).
pub fn zeroed(gpu: &Gpu, label: &str, words: usize) -> wgpu::Buffer {
    gpu.device.create_buffer(&wgpu::BufferDescriptor {
        label: Some(label),
        size: (words.max(16) * 4) as u64,
        usage: USAGE,
        mapped_at_creation: false,
    })
}

/// A storage buffer with these contents.
pub fn filled<T: Pod>(gpu: &Gpu, label: &str, contents: &[T]) -> wgpu::Buffer {
    let bytes: &[u8] = bytemuck::cast_slice(contents);
    if bytes.len() < 64 {
        let buffer = zeroed(gpu, label, 16);
        gpu.queue.write_buffer(&buffer, 0, bytes);
        return buffer;
    }
    gpu.device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
        label: Some(label),
        contents: bytes,
        usage: USAGE,
    })
}

/// A uniform buffer with this value.
pub fn uniform<T: Pod>(gpu: &Gpu, label: &str, value: &T) -> wgpu::Buffer {
    gpu.device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
        label: Some(label),
        contents: bytemuck::bytes_of(value),
        usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
    })
}

/// Reads the first `count` values of a buffer; waits for the device.
///
/// # Errors
/// [`RenderError::Device`] if the device failed or the buffer could not be mapped.
pub fn read<T: Pod>(gpu: &Gpu, buffer: &wgpu::Buffer, count: usize) -> Result<Vec<T>, RenderError> {
    let size = (count * size_of::<T>()) as u64;
    if size == 0 {
        return Ok(Vec::new());
    }
    let staging = gpu.device.create_buffer(&wgpu::BufferDescriptor {
        label: Some("read back"),
        size: size.next_multiple_of(4),
        usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    });
    let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    encoder.copy_buffer_to_buffer(buffer, 0, &staging, 0, size.next_multiple_of(4));
    gpu.queue.submit([encoder.finish()]);
    let (sender, receiver) = mpsc::channel();
    staging.map_async(wgpu::MapMode::Read, .., move |r| {
        // The receiver outlives the poll below; if it is gone nobody waits for the answer.
        let _ = sender.send(r);
    });
    gpu.wait()?;
    let fail = |e: &dyn std::fmt::Display| RenderError::Device(format!("a buffer could not be read: {e}"));
    receiver.recv().map_err(|e| fail(&e))?.map_err(|e| fail(&e))?;
    let view = staging.get_mapped_range(..).map_err(|e| fail(&e))?;
    let mut values = vec![T::zeroed(); count];
    bytemuck::cast_slice_mut::<T, u8>(&mut values).copy_from_slice(&view[..size as usize]);
    Ok(values)
}
