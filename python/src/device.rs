//! The graphics device of this process: opened when something is first drawn, shared by all avatars, and opened anew
//! where it was lost.

use std::sync::{Mutex, MutexGuard, PoisonError};

use anyhow::bail;
use ghand_app::runtime_dir::RuntimeDir;
use ghand_files::temporary;
use ghand_render::{AdapterChoice, Gpu};
use pyo3::prelude::*;

struct Opened {
    gpu: Gpu,
    /// The process that opened it: a forked one cannot use it.
    process: u32,
    /// Removed with the device.
    _runtime_dir: RuntimeDir,
}

static DEVICE: Mutex<Option<Opened>> = Mutex::new(None);

fn lock() -> MutexGuard<'static, Option<Opened>> {
    // Every change is one assignment.
    DEVICE.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Runs `work`, named `what` in messages, on the device, again on a new one if it is lost. One at a time: others wait. Must
/// be called without the interpreter's lock.
///
/// # Errors
/// The error of `work`, or that there is no device.
pub fn with_device<T>(what: &str, work: impl FnMut(&Gpu) -> anyhow::Result<T>) -> anyhow::Result<T> {
    let mut device = lock();
    let opened = match device.as_mut() {
        Some(opened) if opened.process != std::process::id() => bail!(
            "this process was forked from one that had opened the graphics device, which cannot be shared; start it with \
             multiprocessing.get_context(\"spawn\"), or draw nothing before the fork"
        ),
        Some(opened) => opened,
        None => {
            let _runtime_dir = RuntimeDir::ensure();
            let gpu = Gpu::new(&AdapterChoice::from_env())?;
            device.insert(Opened { gpu, process: std::process::id(), _runtime_dir })
        }
    };
    opened.gpu.retry_on_device_loss(what, work)
}

/// Closes the device before the interpreter ends; what is drawn later opens another one.
#[pyfunction]
pub fn close_device(py: Python<'_>) {
    py.detach(|| {
        let mut device = lock();
        if device.as_ref().is_some_and(|opened| opened.process == std::process::id()) {
            *device = None;
            temporary::remove_all();
        }
    });
}
