//! A synthetic capture whose images the device's mesh rasteriser draws.

use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::rasteriser::renderer;
use crate::{SyntheticOptions, generate};
use ghand_capture::CaptureError;
use ghand_render::Gpu;
use ghand_render::mesh::MeshError;

/// Why a synthetic capture could not be made.
#[derive(Debug, thiserror::Error)]
pub enum SyntheticError {
    /// The capture could not be written or its options are unusable.
    #[error(transparent)]
    Capture(#[from] CaptureError),
    /// The rasteriser could not be made.
    #[error(transparent)]
    Mesh(#[from] MeshError),
}

/// Samples per pixel along each axis.
const SUPERSAMPLE: u32 = 3;

/// Makes a synthetic capture in an empty or absent folder.
///
/// # Errors
/// [`SyntheticError`] if the folder is not empty or cannot be written, or drawing fails.
pub fn make_capture(gpu: &Gpu, options: &SyntheticOptions, folder: &Path) -> Result<(), SyntheticError> {
    make_capture_unless(gpu, options, folder, &AtomicBool::new(false)).map(|_| ())
}

/// As [`make_capture`], but stops once `stop` is true: it then returns false and leaves no folder.
///
/// # Errors
/// As [`make_capture`].
pub fn make_capture_unless(
    gpu: &Gpu,
    options: &SyntheticOptions,
    folder: &Path,
    stop: &AtomicBool,
) -> Result<bool, SyntheticError> {
    let mut render = renderer(gpu, SUPERSAMPLE)?;
    let mut stopped = false;
    let made = generate(options, folder, &mut |scene, camera| {
        if stop.load(Ordering::Relaxed) {
            stopped = true;
            return Err("stopped".into());
        }
        render(scene, camera)
    });
    match made {
        _ if stopped => Ok(false),
        Ok(()) => Ok(true),
        Err(error) => Err(error.into()),
    }
}
