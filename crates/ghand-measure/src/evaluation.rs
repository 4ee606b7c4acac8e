//! Compares an avatar with images that training did not see.

use std::ops::ControlFlow;

use ghand_avatar::{Avatar, Scene};
use ghand_capture::{Capture, CaptureError};
use ghand_core::posing::pose_hand;
use ghand_core::{Camera, Pose};
use ghand_hand_model::surface::arm_end::ArmEnd;
use ghand_render::splat::{Purpose, band_rows};
use ghand_render::{Gpu, RenderError};
use glam::DVec2;
use serde::Serialize;

use crate::baseline::{Baseline, BaselineError};
use crate::error_bands::MeanBandErrors;
use crate::hand_box::{HandBox, SIDE};
use crate::lpips::{BACKBONE, Lpips, LpipsError};
use crate::metrics::{ImageSimilarity, compare, mean_similarity, quantize};
use crate::protocol::{PosedView, Protocol, given_views};

/// Why an evaluation failed.
#[derive(Debug, thiserror::Error)]
pub enum EvaluateError {
    /// An image is unusable.
    #[error(transparent)]
    Capture(#[from] CaptureError),
    /// The device failed.
    #[error(transparent)]
    Render(#[from] RenderError),
    /// The baseline could not be drawn.
    #[error(transparent)]
    Baseline(#[from] BaselineError),
    /// LPIPS could not be computed.
    #[error("camera {camera}: {error}")]
    Lpips {
        /// The image's camera.
        camera: String,
        /// The cause.
        error: LpipsError,
    },
    /// The caller wanted an end.
    #[error("the evaluation was stopped")]
    Stopped,
}

/// The images of an evaluation, and how they are compared.
#[derive(Debug, Clone, Copy)]
pub struct TestViews<'a> {
    /// Where the images are.
    pub capture: &'a Capture,
    /// How their poses were chosen.
    pub protocol: Protocol,
    /// The images with their poses.
    pub views: &'a [PosedView],
    /// The weights for LPIPS, if there are any.
    pub lpips: Option<&'a Lpips>,
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
    /// The baseline's picture.
    pub baseline: Vec<[u8; 3]>,
    /// Similarity of the avatar's picture to the truth.
    pub likeness: ImageSimilarity,
    /// Similarity of the baseline's picture to the truth.
    pub baseline_likeness: ImageSimilarity,
}

/// Means over the views of a split.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Evaluation {
    /// Number of views.
    pub views: usize,
    /// Similarity of the avatar's pictures to the truth.
    pub avatar: ImageSimilarity,
    /// Similarity of the baseline's pictures to the truth.
    pub baseline: ImageSimilarity,
    /// The network of LPIPS, if there were weights for it.
    pub lpips_backbone: Option<&'static str>,
}

/// Renders every view of a split in the capture's own poses and compares avatar and baseline with the truth. `each` is
/// called once per view.
///
/// # Errors
/// [`EvaluateError`] if an image is unusable or the device failed.
pub fn evaluate(
    gpu: &Gpu,
    avatar: &Avatar,
    capture: &Capture,
    split_name: &str,
    baseline: &Baseline,
    mut each: impl FnMut(EvaluatedView),
) -> Result<Evaluation, EvaluateError> {
    let views = given_views(capture, capture.split(split_name)?);
    let test = TestViews { capture, protocol: Protocol::Given, views: &views, lpips: None };
    evaluate_views(gpu, avatar, &test, baseline, |view| {
        each(view);
        ControlFlow::Continue(())
    })
}

/// As [`evaluate`], for the images and poses of any protocol. Both avatar and baseline are drawn in these poses. The
/// protocol `handavatar` skips images with empty masks.
///
/// # Errors
/// [`EvaluateError`] if an image is unusable or the device failed, or `each` wants an end.
pub fn evaluate_views(
    gpu: &Gpu,
    avatar: &Avatar,
    test: &TestViews,
    baseline: &Baseline,
    mut each: impl FnMut(EvaluatedView) -> ControlFlow<()>,
) -> Result<Evaluation, EvaluateError> {
    let &TestViews { capture, protocol, views, lpips } = test;
    let boxed = protocol == Protocol::HandAvatar;
    let largest = |axis: fn(&Camera) -> u32| views.iter().map(|v| axis(&capture.cameras[v.camera])).max().unwrap_or(1);
    let max_size = if boxed { [SIDE; 2] } else { [largest(|c| c.width), largest(|c| c.height)] };
    let max_band = [max_size[0], band_rows(gpu, max_size)];
    if let Some(lpips) = lpips {
        for view in views {
            let camera = &capture.cameras[view.camera];
            let size = if boxed { [SIDE; 2] } else { [camera.width, camera.height] };
            lpips.check_size(size).map_err(|error| EvaluateError::Lpips { camera: camera.id.clone(), error })?;
        }
    }
    let mut scene = Scene::new(gpu, &[avatar], Purpose::Images, 1, max_band)?;
    let background = if boxed { [0.0; 3] } else { capture.background };
    let mut similarities: [Vec<ImageSimilarity>; 2] = Default::default();
    let mut posed: Option<&Pose> = None;
    for PosedView { frame, camera: camera_index, pose } in views {
        if posed != Some(pose) {
            scene.set_pose(gpu, 0, 0, pose)?;
            posed = Some(pose);
        }
        let loaded = capture.load_view(*camera_index, *frame)?.rgba;
        let (camera, truth) = if boxed {
            let Some(HandBox { camera, rgba }) = HandBox::of(&capture.cameras[*camera_index], &loaded) else {
                continue;
            };
            (camera, rgba)
        } else {
            (capture.cameras[*camera_index].clone(), loaded)
        };
        let size = [camera.width, camera.height];
        let mut truth = truth;
        let mut render: Vec<[u8; 3]> = vec![];
        scene.render_bands(gpu, 0, &camera, background.map(|b| b as f32), |_, band| {
            render.extend(band.rgba.iter().map(|p| quantize([p[0], p[1], p[2]])));
        })?;
        let mut baseline_picture: Vec<[u8; 3]> =
            baseline.render(pose, &camera, background)?.into_iter().map(quantize).collect();
        if protocol == Protocol::Masks
            && let Some(arm) = arm_pixels(avatar, pose, &camera)
        {
            let [r, g, b] = background.map(|v| (v * 255.0).round() as u8);
            for (i, _) in arm.iter().enumerate().filter(|(_, is_arm)| **is_arm) {
                (truth[i], render[i], baseline_picture[i]) = ([r, g, b, 0], [r, g, b], [r, g, b]);
            }
        }
        let [mut likeness, mut baseline_likeness] = compare(size, [&render, &baseline_picture], &truth);
        if let Some(lpips) = lpips {
            let colors: Vec<[u8; 3]> = truth.iter().map(|&[r, g, b, _]| [r, g, b]).collect();
            let distances = lpips_of(lpips, size, [&render, &baseline_picture], &colors);
            let [avatar, baseline] =
                distances.map_err(|error| EvaluateError::Lpips { camera: camera.id.clone(), error })?;
            (likeness.lpips, baseline_likeness.lpips) = (Some(avatar), Some(baseline));
        }
        similarities[0].push(likeness);
        similarities[1].push(baseline_likeness);
        let compared = EvaluatedView {
            name: [camera.id.clone(), capture.frames[*frame].id.clone()],
            size,
            truth,
            render,
            baseline: baseline_picture,
            likeness,
            baseline_likeness,
        };
        if each(compared).is_break() {
            return Err(EvaluateError::Stopped);
        }
    }
    let count = similarities[0].len();
    let [avatar, baseline] = similarities.map(|all| mean_similarity(&all));
    Ok(Evaluation { views: count, avatar, baseline, lpips_backbone: lpips.map(|_| BACKBONE) })
}

/// The pixels, row-major, where the template's end at the wrist and the arm behind it may be: where a mask ends there is its
/// maker's choice, and says nothing about the avatar. `None` where no end is seen.
fn arm_pixels(avatar: &Avatar, pose: &Pose, camera: &Camera) -> Option<Vec<bool>> {
    let positions = pose_hand(&avatar.model, &[], pose).ok()?.vertices;
    let end = ArmEnd::of(&avatar.model)?.seen(&positions, camera)?;
    let is_arm = |x: u32, y: u32| end.may_be_arm(DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5));
    Some((0..camera.height).flat_map(|y| (0..camera.width).map(move |x| is_arm(x, y))).collect())
}

/// LPIPS of 8-bit pictures.
fn lpips_of<const N: usize>(
    lpips: &Lpips,
    size: [u32; 2],
    pictures: [&[[u8; 3]]; N],
    truth: &[[u8; 3]],
) -> Result<[f64; N], LpipsError> {
    let display = |pixels: &[[u8; 3]]| -> Vec<[f32; 3]> {
        pixels.iter().map(|pixel| pixel.map(|value| f32::from(value) / 255.0)).collect()
    };
    let pictures = pictures.map(display);
    lpips.distances(size, std::array::from_fn(|k| pictures[k].as_slice()), &display(truth))
}

/// The figures of an evaluation, as they stand in `metrics.json`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ImageMetrics {
    /// In which poses avatar and baseline were drawn.
    pub protocol: Protocol,
    /// The evaluated split.
    pub split: String,
    /// Number of evaluated images.
    pub frames: usize,
    /// The network of LPIPS; absent without weights for it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lpips_backbone: Option<&'static str>,
    /// The avatar's figures.
    #[serde(flatten)]
    pub avatar: SimilarityMetrics,
    /// The same figures for the baseline.
    #[serde(rename = "floor")]
    pub baseline: SimilarityMetrics,
    /// Whether the avatar's PSNR is above the baseline's.
    #[serde(rename = "beats_floor")]
    pub beats_baseline: bool,
}

impl ImageMetrics {
    /// The figures of an evaluation of the split of that name.
    pub fn new(protocol: Protocol, split: &str, evaluation: &Evaluation) -> ImageMetrics {
        let [avatar, baseline] = [&evaluation.avatar, &evaluation.baseline].map(SimilarityMetrics::of);
        let beats_baseline = avatar.psnr > baseline.psnr;
        let Evaluation { views: frames, lpips_backbone, .. } = *evaluation;
        ImageMetrics { protocol, split: split.into(), frames, lpips_backbone, avatar, baseline, beats_baseline }
    }
}

/// The figures of the avatar's pictures or the baseline's.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct SimilarityMetrics {
    /// Mean PSNR, dB.
    pub psnr: f64,
    /// Mean PSNR over the squares around the hand, scaled to 256 x 256 pixels, dB; `null` if all masks are empty.
    pub psnr_square: Option<f64>,
    /// Mean PSNR over the masks, dB.
    pub psnr_hand: f64,
    /// Mean SSIM.
    pub ssim: f64,
    /// Mean LPIPS, 0 for equal pictures; absent without weights for it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lpips: Option<f64>,
    /// Mean squared errors by distance from the mask's outline.
    pub squared_error: MeanBandErrors,
}

impl SimilarityMetrics {
    fn of(similarity: &ImageSimilarity) -> SimilarityMetrics {
        let ImageSimilarity { psnr, psnr_square, psnr_hand, ssim, lpips, bands } = *similarity;
        SimilarityMetrics { psnr, psnr_square, psnr_hand, ssim, lpips, squared_error: bands.means() }
    }
}
