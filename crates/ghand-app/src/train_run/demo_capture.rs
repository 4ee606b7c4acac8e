//! The synthetic capture for runs without a capture.

use std::path::{Path, PathBuf};

use ghand_render::Gpu;
use ghand_synthetic::SyntheticOptions;
use ghand_synthetic::make_capture::make_capture_unless;

use crate::cli::Stopped;
use crate::say;
use crate::train_run::interruption::{Interruption, STOPPED_BEFORE_TRAINING};

/// Shared by runs without `--out`; relative to the current folder.
pub const DEMO_CAPTURE: &str = "out/demo-capture";

/// Makes the capture, if it does not exist yet.
///
/// # Errors
/// [`Stopped`] if a stop was requested meanwhile; an error that names the folder if it cannot be written, or the device
/// if it failed.
pub fn demo_capture(gpu: &mut Gpu, folder: PathBuf, interruption: &Interruption) -> anyhow::Result<PathBuf> {
    let is_there = |folder: &Path| folder.join("capture.json").exists();
    if is_there(&folder) {
        return Ok(folder);
    }
    say!("making a synthetic capture in {}", folder.display());
    interruption.stop_first();
    let made = gpu.retry_on_device_loss("the synthetic capture", |gpu| -> anyhow::Result<bool> {
        Ok(make_capture_unless(gpu, &SyntheticOptions::default(), &folder, interruption.stop())?)
    });
    interruption.end_with(STOPPED_BEFORE_TRAINING.into());
    match made {
        Ok(true) => Ok(folder),
        Ok(false) => {
            Err(Stopped("stopped while the synthetic capture was being made: nothing was written".into()).into())
        }
        // Another run has made the same capture meanwhile.
        Err(_) if is_there(&folder) => Ok(folder),
        Err(error) => Err(error),
    }
}
