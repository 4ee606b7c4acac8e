//! Creating, filling and reading storage buffers.

use std::future::poll_fn;
use std::sync::{Arc, Mutex, PoisonError, mpsc};
use std::task::{Poll, Waker};
use std::time::Duration;

use bytemuck::Pod;

use crate::{Gpu, RenderError};

const USAGE: wgpu::BufferUsages =
    wgpu::BufferUsages::STORAGE.union(wgpu::BufferUsages::COPY_SRC).union(wgpu::BufferUsages::COPY_DST);

/// Readback buffers larger than this are checked for lack of memory, bytes.
const LARGE: u64 = 1 << 20;

/// Number and duration of the waits for the result of a mapping, once the device has finished.
const ANSWER_TRIES: u32 = 100;
const ANSWER_PAUSE: Duration = Duration::from_millis(100);

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
    // Not `create_buffer_init`, which panics if the buffer cannot be made.
    let buffer = zeroed(gpu, label, bytes.len().div_ceil(4));
    write(gpu, &buffer, bytes);
    buffer
}

/// A uniform buffer with this value.
pub fn uniform<T: Pod>(gpu: &Gpu, label: &str, value: &T) -> wgpu::Buffer {
    let bytes = bytemuck::bytes_of(value);
    let buffer = gpu.device.create_buffer(&wgpu::BufferDescriptor {
        label: Some(label),
        size: bytes.len().next_multiple_of(4) as u64,
        usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    });
    write(gpu, &buffer, bytes);
    buffer
}

/// Writes bytes, padded to whole words, to the start of a buffer that is large enough.
fn write(gpu: &Gpu, buffer: &wgpu::Buffer, bytes: &[u8]) {
    let (words, rest) = bytes.split_at(bytes.len() / 4 * 4);
    gpu.queue.write_buffer(buffer, 0, words);
    if !rest.is_empty() {
        let mut word = [0; 4];
        word[..rest.len()].copy_from_slice(rest);
        gpu.queue.write_buffer(buffer, words.len() as u64, &word);
    }
}

/// Reads the first `count` values of a buffer; waits for the device.
///
/// # Errors
/// [`RenderError`] if the device failed or was lost, or has too little memory to read that much at once.
pub fn read<T: Pod>(gpu: &Gpu, buffer: &wgpu::Buffer, count: usize) -> Result<Vec<T>, RenderError> {
    read_from(gpu, buffer, 0, count)
}

/// As [`read`], from value number `first` on. `T` consists of whole words, or `first` is 0.
///
/// # Errors
/// As [`read`].
pub fn read_from<T: Pod>(gpu: &Gpu, buffer: &wgpu::Buffer, first: usize, count: usize) -> Result<Vec<T>, RenderError> {
    let Some(staging) = staging::<T>(gpu, buffer, first, count)? else { return Ok(Vec::new()) };
    map(gpu, &staging)?;
    contents(&staging, count)
}

/// As [`read`], without blocking the thread, as browsers demand. Elsewhere the device must be polled until it is done, by
/// [`Gpu::poll`] or by later submissions.
///
/// # Errors
/// As [`read`].
pub async fn read_async<T: Pod>(gpu: &Gpu, buffer: &wgpu::Buffer, count: usize) -> Result<Vec<T>, RenderError> {
    let Some(staging) = staging::<T>(gpu, buffer, 0, count)? else { return Ok(Vec::new()) };
    let answer = Arc::new(Mutex::new(Answer::default()));
    let from_device = answer.clone();
    staging.map_async(wgpu::MapMode::Read, .., move |result| {
        let mut answer = from_device.lock().unwrap_or_else(PoisonError::into_inner);
        answer.result = Some(result);
        answer.waker.take().into_iter().for_each(Waker::wake);
    });
    let mapped = poll_fn(move |context| {
        let mut answer = answer.lock().unwrap_or_else(PoisonError::into_inner);
        match answer.result.take() {
            Some(result) => Poll::Ready(result),
            None => {
                answer.waker = Some(context.waker().clone());
                Poll::Pending
            }
        }
    });
    mapped.await.map_err(|e| unreadable(&e))?;
    contents(&staging, count)
}

/// What the device says about a mapping, and who waits for it.
#[derive(Default)]
struct Answer {
    result: Option<Result<(), wgpu::BufferAsyncError>>,
    waker: Option<Waker>,
}

fn unreadable(reason: &dyn std::fmt::Display) -> RenderError {
    RenderError::Device(format!("a buffer could not be read: {reason}"))
}

/// Submits the copy of values to a buffer that can be mapped. `None` for no values.
fn staging<T: Pod>(
    gpu: &Gpu,
    buffer: &wgpu::Buffer,
    first: usize,
    count: usize,
) -> Result<Option<wgpu::Buffer>, RenderError> {
    let offset = (first * size_of::<T>()) as u64;
    let size = (count * size_of::<T>()) as u64;
    if size == 0 {
        return Ok(None);
    }
    let make = || {
        gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("read back"),
            size: size.next_multiple_of(4),
            usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        })
    };
    // Training reads a few words in every step, without the cost of a scope.
    let staging = if size <= LARGE { make() } else { gpu.scoped(&format!("reading {size} bytes back"), make)? };
    let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    encoder.copy_buffer_to_buffer(buffer, offset, &staging, 0, size.next_multiple_of(4));
    gpu.queue.submit([encoder.finish()]);
    Ok(Some(staging))
}

/// The values in a mapped buffer.
fn contents<T: Pod>(staging: &wgpu::Buffer, count: usize) -> Result<Vec<T>, RenderError> {
    let view = staging.get_mapped_range(..).map_err(|e| unreadable(&e))?;
    let mut values = vec![T::zeroed(); count];
    let size = count * size_of::<T>();
    bytemuck::cast_slice_mut::<T, u8>(&mut values).copy_from_slice(&view[..size]);
    Ok(values)
}

/// Maps a buffer for reading and waits until it is mapped. Several threads can do this on one device.
///
/// # Errors
/// [`RenderError`] if the device failed or was lost, or does not respond.
pub(crate) fn map(gpu: &Gpu, buffer: &wgpu::Buffer) -> Result<(), RenderError> {
    if cfg!(target_arch = "wasm32") {
        return Err(unreadable(&"a browser does not let a program wait; use the function whose name ends in `_async`"));
    }
    let (sender, receiver) = mpsc::channel();
    buffer.map_async(wgpu::MapMode::Read, .., move |result| {
        // The receiver outlives the wait below; if it is gone, nobody needs the result.
        let _ = sender.send(result);
    });
    for _ in 0..ANSWER_TRIES {
        gpu.wait()?;
        // By now the mapping is done, but another waiting thread may be the one that runs the callback. Not `recv`:
        // after a loss some callbacks are never called.
        match receiver.recv_timeout(ANSWER_PAUSE) {
            Ok(result) => {
                return result.map_err(|e| unreadable(&e));
            }
            Err(mpsc::RecvTimeoutError::Timeout) => {}
            Err(mpsc::RecvTimeoutError::Disconnected) => break,
        }
    }
    gpu.check()?;
    Err(unreadable(&"the device does not respond"))
}
