//! Evaluation on a split that training did not see.

use ghand_avatar::{Avatar, Scene};
use ghand_capture::{Capture, CaptureError, SplitView};
use ghand_core::Pose;
use ghand_render::splat::Purpose;
use ghand_render::{Gpu, RenderError};
use serde::Serialize;

use crate::floor::{Floor, FloorError};
use crate::metrics::{Comparator, ImageSimilarity, quantize};

/// Why an evaluation failed.
#[derive(Debug, thiserror::Error)]
pub enum EvaluateError {
    /// An image is unusable.
    #[error(transparent)]
    Capture(#[from] CaptureError),
    /// The device failed.
    #[error(transparent)]
    Render(#[from] RenderError),
    /// The floor could not be drawn.
    #[error(transparent)]
    Floor(#[from] FloorError),
}

/// One evaluated view with its pictures.
#[derive(Debug, Clone)]
pub struct EvaluatedView {
    /// Name of the camera and of the frame.
    pub name: [String; 2],
    /// Size, pixels.
    pub size: [u32; 2],
    /// The truth: red, green, blue, mask.
    pub truth: Vec<[u8; 4]>,
    /// The avatar's picture.
    pub render: Vec<[u8; 3]>,
    /// The floor's picture.
    pub floor: Vec<[u8; 3]>,
    /// Similarity of the avatar's picture to the truth.
    pub likeness: ImageSimilarity,
    /// Similarity of the floor's picture to the truth.
    pub floor_likeness: ImageSimilarity,
}

/// Means over the views of a split.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Evaluation {
    /// Number of views.
    pub views: usize,
    /// Similarity of the avatar's pictures to the truth.
    pub avatar: ImageSimilarity,
    /// Similarity of the floor's pictures to the truth.
    pub floor: ImageSimilarity,
}

/// Renders every view of a split in the capture's own poses and compares avatar and floor with the truth. `each` is
/// called once per view.
///
/// # Errors
/// [`EvaluateError`] if an image is unusable or the device failed.
pub fn evaluate(
    gpu: &Gpu,
    avatar: &Avatar,
    capture: &Capture,
    split_name: &str,
    floor: &Floor,
    mut each: impl FnMut(EvaluatedView),
) -> Result<Evaluation, EvaluateError> {
    let split = capture.split(split_name)?;
    let largest = |axis: fn(&ghand_core::Camera) -> u32| {
        split.cameras.iter().map(|c| axis(&capture.cameras[*c])).max().unwrap_or(1)
    };
    let max_size = [largest(|c| c.width), largest(|c| c.height)];
    let mut scene = Scene::new(gpu, &[avatar], Purpose::Images, 1, max_size)?;
    let mut comparator = Comparator::new(gpu, max_size[0] as usize * max_size[1] as usize)?;
    let background = capture.background;
    let mut sum = [ImageSimilarity::default(); 2];
    let mut views = 0;
    let mut posed = None;
    for &SplitView { frame, camera: camera_index, .. } in &split.views {
        let pose: &Pose = &capture.frames[frame].pose;
        if posed != Some(frame) {
            scene.set_pose(gpu, 0, 0, pose)?;
            posed = Some(frame);
        }
        let camera = &capture.cameras[camera_index];
        let truth = capture.load_view(camera_index, frame)?;
        let size = [truth.width, truth.height];
        let image = scene.render(gpu, 0, camera, background.map(|b| b as f32))?;
        let render: Vec<[u8; 3]> = image.rgba.iter().map(|p| quantize([p[0], p[1], p[2]])).collect();
        let floor_picture: Vec<[u8; 3]> = floor.render(pose, camera, background)?.into_iter().map(quantize).collect();
        let likeness = comparator.compare(gpu, size, &render, &truth.rgba)?;
        let floor_likeness = comparator.compare(gpu, size, &floor_picture, &truth.rgba)?;
        for (sum, l) in sum.iter_mut().zip([likeness, floor_likeness]) {
            sum.psnr += l.psnr;
            sum.psnr_hand += l.psnr_hand;
            sum.ssim += l.ssim;
        }
        views += 1;
        each(EvaluatedView {
            name: [camera.id.clone(), capture.frames[frame].id.clone()],
            size,
            truth: truth.rgba,
            render,
            floor: floor_picture,
            likeness,
            floor_likeness,
        });
    }
    let n = views.max(1) as f64;
    let [avatar, floor] =
        sum.map(|s| ImageSimilarity { psnr: s.psnr / n, psnr_hand: s.psnr_hand / n, ssim: s.ssim / n });
    Ok(Evaluation { views, avatar, floor })
}

/// Contents of `metrics.json`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Metrics {
    /// The figures on images; absent if there were no images to evaluate.
    #[serde(flatten)]
    pub images: Option<ImageMetrics>,
    /// Mean joint-angle error of the training poses, degrees, if the true poses are known.
    pub pose_error_deg: Option<PoseError>,
    /// Wall-clock time of training, seconds.
    pub seconds: f64,
    /// Training iterations done.
    pub iterations: u64,
    /// Whether the run was told to stop before all its iterations were done.
    pub stopped_early: bool,
    /// Number of Gaussians.
    pub gaussians: usize,
}

/// The part of [`Metrics`] that needs images.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ImageMetrics {
    /// The evaluated split.
    pub split: String,
    /// Number of evaluated images.
    pub frames: usize,
    /// Mean PSNR, dB.
    pub psnr: f64,
    /// Mean PSNR over the masks, dB.
    pub psnr_hand: f64,
    /// Mean SSIM.
    pub ssim: f64,
    /// The same figures for the floor.
    pub floor: FloorMetrics,
    /// Whether the avatar's PSNR is above the floor's.
    pub beats_floor: bool,
}

/// The floor's part of [`ImageMetrics`].
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct FloorMetrics {
    /// Mean PSNR, dB.
    pub psnr: f64,
    /// Mean PSNR over the masks, dB.
    pub psnr_hand: f64,
    /// Mean SSIM.
    pub ssim: f64,
}

/// Joint-angle errors, degrees.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct PoseError {
    /// Of the capture's poses.
    pub before: f64,
    /// Of the refined poses.
    pub after: f64,
}
