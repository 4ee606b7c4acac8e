//! Captures of an avatar: their truth is known down to each Gaussian.

use std::path::PathBuf;

use ghand_avatar::{Avatar, Scene};
use ghand_capture::{Capture, CaptureError};
use ghand_render::splat::Purpose;
use ghand_render::{Gpu, RenderError};
use image::{ImageError, RgbImage};

use ghand_measure::metrics::quantize;

/// Why an avatar could not be planted.
#[derive(Debug, thiserror::Error)]
pub enum PlantedError {
    /// The capture has no exact poses.
    #[error("{0}: has no exact poses")]
    NoTruth(PathBuf),
    /// The capture has no such image.
    #[error(transparent)]
    Capture(#[from] CaptureError),
    /// The device failed.
    #[error(transparent)]
    Render(#[from] RenderError),
    /// An image cannot be written.
    #[error("{path}: cannot write the image: {source}")]
    Image {
        /// The file.
        path: PathBuf,
        /// The cause.
        source: ImageError,
    },
}

/// Replaces all images and masks of a synthetic capture by those of an avatar in the exact poses.
///
/// # Errors
/// [`PlantedError`] if the capture has no exact poses, the device failed or a file cannot be written.
pub fn plant(gpu: &Gpu, capture: &Capture, avatar: &Avatar) -> Result<(), PlantedError> {
    let truth = capture.truth.as_ref().ok_or_else(|| PlantedError::NoTruth(capture.root.clone()))?;
    let largest = |axis: fn(&ghand_core::Camera) -> u32| capture.cameras.iter().map(axis).max().unwrap_or(1);
    let size = [largest(|camera| camera.width), largest(|camera| camera.height)];
    let mut scene = Scene::new(gpu, &[avatar], Purpose::Images, 1, size)?;
    for view in capture.splits.values().flat_map(|split| &split.views) {
        let pose = truth.get(view.frame).cloned().flatten();
        let pose = pose.ok_or_else(|| PlantedError::NoTruth(capture.root.clone()))?;
        scene.set_pose(gpu, 0, 0, &pose)?;
        let camera = &capture.cameras[view.camera];
        let drawn = scene.render(gpu, 0, camera, capture.background.map(|value| value as f32))?;
        let save = |image: &RgbImage, path: PathBuf| match image.save(&path) {
            Ok(()) => Ok(()),
            Err(source) => Err(PlantedError::Image { path, source }),
        };
        let picture = |values: &dyn Fn(&[f32; 4]) -> [f32; 3]| {
            let pixels: Vec<u8> = drawn.rgba.iter().flat_map(|pixel| quantize(values(pixel))).collect();
            RgbImage::from_raw(camera.width, camera.height, pixels).unwrap_or_default()
        };
        save(&picture(&|[r, g, b, _]| [*r, *g, *b]), capture.image_file(view.camera, view.frame)?)?;
        if let Some(mask) = capture.mask_file(view.camera, view.frame)? {
            save(&picture(&|[.., coverage]| [*coverage; 3]), mask)?;
        }
    }
    Ok(())
}
