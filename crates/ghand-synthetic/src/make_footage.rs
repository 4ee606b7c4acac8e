//! Made footage whose frames the device's mesh rasteriser draws.

use std::path::Path;

use ghand_capture::CaptureError;
use ghand_pictures::PictureError;
use ghand_render::Gpu;
use ghand_render::mesh::MeshError;

use crate::footage::{FootageOptions, record};
use crate::rasteriser::renderer;

/// Why footage could not be made.
#[derive(Debug, thiserror::Error)]
pub enum FootageError {
    /// It could not be written or its options are unusable.
    #[error(transparent)]
    Capture(#[from] CaptureError),
    /// A video could not be encoded.
    #[error(transparent)]
    Video(#[from] PictureError),
    /// The rasteriser could not be made.
    #[error(transparent)]
    Mesh(#[from] MeshError),
}

/// Samples per pixel along each axis, of each moment of an exposure.
const SUPERSAMPLE: u32 = 2;

/// Makes footage in an empty or absent folder, and tells `progress` how many frames of how many are done. Returns the
/// number of frames.
///
/// # Errors
/// [`FootageError`] if options are unusable, ffmpeg is missing, the folder is not empty or cannot be written, or
/// drawing fails.
pub fn make_footage(
    gpu: &Gpu,
    options: &FootageOptions,
    folder: &Path,
    mut progress: impl FnMut(usize, usize),
) -> Result<usize, FootageError> {
    record(options, folder, &mut renderer(gpu, SUPERSAMPLE)?, &mut progress)
}
