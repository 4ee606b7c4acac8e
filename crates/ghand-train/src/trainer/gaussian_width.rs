//! How wide Gaussians are in the training images, and how many there are to be by that.

use ghand_capture::{Capture, Split};
use ghand_core::statistics::median;
use ghand_hand_model::{HandModelError, surface};

use crate::settings::{Model, TrainSettings};

/// Width of a Gaussian, pixels, with which images are shown sharply.
const WANTED: f64 = 1.75;
/// The UV raster's least resolution, the one beyond which Gaussians may be wider, the largest, and the largest with
/// networks, which are slow.
const LEAST: f64 = 96.0;
const LARGE: f64 = 512.0;
/// Width of a Gaussian, pixels, beyond that: on images of 668x1024 `WANTED` took twice the time and showed no more.
const WANTED_OF_LARGE: f64 = 2.6;
const LARGEST: f64 = 768.0;
const LARGEST_OF_NETWORKS: f64 = 160.0;
/// It is a multiple of this.
const STEP: f64 = 16.0;

/// How wide a Gaussian is in the training images, pixels: the median over images of what a texel's edge covers at the
/// hand's distance, seen face on.
pub fn gaussian_width(capture: &Capture, split: &Split, uv_resolution: u32) -> Result<f64, HandModelError> {
    let edge = median(surface::sample_surface(&capture.template, uv_resolution)?.spacings);
    let root = capture.template.joints.first().copied().unwrap_or_default();
    let widths = split.views.iter().map(|view| {
        let camera = &capture.cameras[view.camera];
        let hand = capture.frames[view.frame].pose.translation + root;
        edge * camera.focal.x / camera.camera_from_world(hand).length()
    });
    Ok(median(widths))
}

/// The settings with a resolution that suits the images, if they leave it open.
pub fn with_resolution(
    capture: &Capture,
    split: &Split,
    settings: &TrainSettings,
) -> Result<TrainSettings, HandModelError> {
    let mut settings = settings.clone();
    if settings.uv_resolution == 0 {
        let largest = if settings.model == Model::Network { LARGEST_OF_NETWORKS } else { LARGEST };
        let width = gaussian_width(capture, split, LEAST as u32)?;
        let with_width = |wanted: f64| LEAST * width / wanted;
        let wanted = with_width(WANTED).min(with_width(WANTED_OF_LARGE).max(LARGE));
        let wanted = if wanted.is_finite() { wanted } else { largest };
        settings.uv_resolution = ((wanted / STEP).round() * STEP).clamp(LEAST, largest) as u32;
    }
    Ok(settings)
}
