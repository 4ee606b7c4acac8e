//! How much of an image is hand, and how well the posed template meets it.

use ghand_core::posing::pose_hand;
use ghand_core::{Camera, Pose};
use glam::DVec3;
use rayon::prelude::*;

use super::overlap::iou;
use crate::capture::{Capture, Frame};
use crate::error::CaptureError;
use crate::mask::fill;
use crate::view::View;

/// What the pixels of one image say.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ViewFit {
    /// The camera, an index into those of the capture.
    pub camera: usize,
    /// The frame, an index into those of the capture.
    pub frame: usize,
    /// Part of the image that is hand, `[0, 1]`; `None` where the image has no mask, so that all of it may be hand.
    pub coverage: Option<f64>,
    /// Intersection over union of the mask with the posed template, `[0, 1]`, in the frame's own pose; `None` where there is no
    /// mask, or nothing on it and nothing of the template in the image.
    pub iou_given: Option<f64>,
    /// The same in the true pose, where that is known.
    pub iou_true: Option<f64>,
}

/// The capture's hand model in a frame's shape and pose, its vertices (world, metres): first in the frame's own pose, then in
/// the true one where it is known.
///
/// # Errors
/// [`CaptureError::HandModel`] when shape or pose do not fit the hand model, [`CaptureError::Invalid`] when there is no such
/// frame.
pub fn posed_template(capture: &Capture, frame: usize) -> Result<(Vec<DVec3>, Option<Vec<DVec3>>), CaptureError> {
    let Frame { pose, shape, .. } = capture.frame(frame)?;
    let posed = |pose: &Pose| {
        let posed = pose_hand(&capture.hand_model, shape, pose);
        posed.map(|hand| hand.vertices).map_err(|source| CaptureError::HandModel { path: capture.root.clone(), source })
    };
    let truth = true_pose(capture, frame).map(posed).transpose()?;
    Ok((posed(pose)?, truth))
}

/// The true pose of a frame, where it is known.
pub fn true_pose(capture: &Capture, frame: usize) -> Option<&Pose> {
    capture.truth.as_ref()?.get(frame)?.as_ref()
}

/// Decodes images and compares their masks with the posed template; an image that cannot be decoded has its error. `pairs`
/// (camera, frame) are in the order of frames, each of which is posed once; the results are in the order of the pairs.
///
/// # Errors
/// [`CaptureError::HandModel`] as of [`posed_template`].
pub(super) fn fits(
    capture: &Capture,
    pairs: &[(usize, usize)],
) -> Result<Vec<Result<ViewFit, CaptureError>>, CaptureError> {
    let of_frame: Vec<&[(usize, usize)]> = pairs.chunk_by(|a, b| a.1 == b.1).collect();
    let found: Result<Vec<Vec<_>>, CaptureError> = of_frame
        .into_par_iter()
        .map(|pairs| {
            let Some((_, frame)) = pairs.first() else { return Ok(vec![]) };
            let (given, truth) = posed_template(capture, *frame)?;
            let fit = |&(camera, frame): &(usize, usize)| view_fit(capture, camera, frame, &given, truth.as_deref());
            Ok(pairs.par_iter().map(fit).collect())
        })
        .collect();
    found.map(|found| found.into_iter().flatten().collect())
}

fn view_fit(
    capture: &Capture,
    camera_index: usize,
    frame: usize,
    given: &[DVec3],
    truth: Option<&[DVec3]>,
) -> Result<ViewFit, CaptureError> {
    let (camera, _) = capture.camera_and_frame(camera_index, frame)?;
    let mask = mask_of(capture, &capture.load_view(camera_index, frame)?);
    let of_template =
        |vertices: &[DVec3]| mask.as_ref().and_then(|mask| iou(mask, &outline(capture, camera, vertices)));
    let coverage =
        mask.as_ref().map(|mask| mask.iter().filter(|hand| **hand).count() as f64 / mask.len().max(1) as f64);
    Ok(ViewFit {
        camera: camera_index,
        frame,
        coverage,
        iou_given: of_template(given),
        iou_true: truth.and_then(of_template),
    })
}

/// Where the hand is; `None` if the image has no mask.
fn mask_of(capture: &Capture, view: &View) -> Option<Vec<bool>> {
    let mask: Vec<bool> = view.rgba.iter().map(|pixel| pixel[3] >= 128).collect();
    // A view of a capture without masks and without an alpha channel is hand everywhere.
    let has_mask = capture.images.mask.is_some() || mask.contains(&false);
    has_mask.then_some(mask)
}

fn outline(capture: &Capture, camera: &Camera, vertices: &[DVec3]) -> Vec<bool> {
    fill(camera, vertices, &capture.hand_model.faces)
}
