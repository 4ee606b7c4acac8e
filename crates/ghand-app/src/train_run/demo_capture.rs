//! The synthetic capture of runs without one.

use std::path::{Path, PathBuf};

use ghand_render::Gpu;
use ghand_synthetic::SyntheticOptions;
use ghand_train::synthetic_scene::make_capture_unless;

use crate::cli::Stopped;
use crate::say;
use crate::train_run::interruption::{BEFORE_TRAINING, Interruption};

/// Where runs without a folder of their own share it, relative to the current folder.
pub const DEMO_CAPTURE: &str = "out/demo-capture";

/// Makes the capture, if it is not there yet.
///
/// # Errors
/// [`Stopped`] if a stop was asked for meanwhile, and one that names the folder if it cannot be written, or the device if
/// it failed.
pub fn demo_capture(gpu: &mut Gpu, folder: PathBuf, interruption: &Interruption) -> anyhow::Result<PathBuf> {
    let is_there = |folder: &Path| folder.join("capture.json").exists();
    if is_there(&folder) {
        return Ok(folder);
    }
    say!("making a synthetic capture in {}", folder.display());
    interruption.stop_first();
    let made = gpu.persist("the synthetic capture", |gpu| -> anyhow::Result<bool> {
        Ok(make_capture_unless(gpu, &SyntheticOptions::default(), &folder, interruption.stop())?)
    });
    interruption.end_with(BEFORE_TRAINING.into());
    match made {
        Ok(true) => Ok(folder),
        Ok(false) => {
            Err(Stopped("stopped while the synthetic capture was being made: nothing was written".into()).into())
        }
        // Another run has made the same one meanwhile.
        Err(_) if is_there(&folder) => Ok(folder),
        Err(error) => Err(error),
    }
}
