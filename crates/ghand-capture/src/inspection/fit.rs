//! The fraction of an image that is hand, and how well the posed template matches it.

use ghand_core::Pose;
use ghand_core::posing::pose_hand;
use glam::DVec3;
use rayon::prelude::*;

use super::overlap::iou;
use crate::capture::Capture;
use crate::error::CaptureError;
use crate::images::mask_values::MaskSort;
use crate::images::view::View;
use crate::mask::{EDGES_AND_CORNERS, covered_pixels, parts};

/// Facts from the pixels of one image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ViewFit {
    /// The camera, an index into those of the capture.
    pub camera: usize,
    /// The frame, an index into those of the capture.
    pub frame: usize,
    /// Fraction of the image that is hand, `[0, 1]`; `None` if the image has no mask, so that all of it may be hand.
    pub coverage: Option<f64>,
    /// Intersection over union of the mask with the posed template, `[0, 1]`, in the frame's own pose; `None` if there
    /// is no mask, or if both the mask and the template's image are empty.
    pub iou_given: Option<f64>,
    /// The same in the true pose, if known.
    pub iou_true: Option<f64>,
    /// Whether any part of the posed template, in the frame's own pose, is in the image.
    pub shows_template: bool,
    /// The largest value of any channel on the hand, or of the whole image where no hand is marked.
    pub brightest: u8,
    /// The largest difference of two values of a channel, over the whole image as it is filmed.
    pub contrast: u8,
    /// The one colour that the image has beside the hand, if it is another than the capture's background.
    pub other_background: Option<[u8; 3]>,
    /// What the values in the mask's file are.
    pub mask_sort: MaskSort,
    /// The largest part of the mask that the posed template hardly covers, as a fraction of the mask; 0 if it covers no part.
    pub other_part: f64,
    /// Pixels of the image's file with a channel that is not a number.
    pub nan_pixels: usize,
}

/// The capture's hand model in a frame's shape and pose, its vertices (world, metres): first in the frame's own pose,
/// then in the true one if known.
///
/// # Errors
/// [`CaptureError::HandModel`] if shape or pose do not match the hand model, [`CaptureError::Invalid`] if there is no
/// such frame.
pub fn posed_template(capture: &Capture, frame: usize) -> Result<(Vec<DVec3>, Option<Vec<DVec3>>), CaptureError> {
    let truth = true_pose(capture, frame).map(|pose| template_in(capture, frame, pose)).transpose()?;
    Ok((given_template(capture, frame)?, truth))
}

/// The vertices of [`posed_template`] in the frame's own pose alone.
///
/// # Errors
/// As for [`posed_template`].
pub(super) fn given_template(capture: &Capture, frame: usize) -> Result<Vec<DVec3>, CaptureError> {
    template_in(capture, frame, &capture.frame(frame)?.pose)
}

fn template_in(capture: &Capture, frame: usize, pose: &Pose) -> Result<Vec<DVec3>, CaptureError> {
    match pose_hand(&capture.hand_model, &capture.frame(frame)?.shape, pose) {
        Ok(hand) => Ok(hand.vertices),
        Err(source) => Err(CaptureError::HandModel { path: capture.root.clone(), source: source.into() }),
    }
}

/// The true pose of a frame, if known.
pub fn true_pose(capture: &Capture, frame: usize) -> Option<&Pose> {
    capture.truth.as_ref()?.get(frame)?.as_ref()
}

/// Decodes images and compares their masks with the posed template; an image that cannot be decoded gives its error.
/// `pairs` (camera, frame) are in the order of frames, each of which is posed once; the results are in the order of the
/// pairs.
///
/// # Errors
/// [`CaptureError::HandModel`] as for [`posed_template`].
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
    let (view, notes) = capture.load_view_with_notes(camera_index, frame)?;
    let mask: Option<Vec<bool>> = notes.has_mask.then(|| view.rgba.iter().map(|pixel| pixel[3] >= 128).collect());
    let outline = |vertices: &[DVec3]| covered_pixels(camera, vertices, &capture.hand_model.faces);
    let agreement = |outline: &[bool]| mask.as_ref().and_then(|mask| iou(mask, outline));
    let given = outline(given);
    let coverage =
        mask.as_ref().map(|mask| mask.iter().filter(|hand| **hand).count() as f64 / mask.len().max(1) as f64);
    Ok(ViewFit {
        camera: camera_index,
        frame,
        coverage,
        iou_given: agreement(&given),
        iou_true: truth.and_then(|truth| agreement(&outline(truth))),
        shows_template: given.contains(&true),
        brightest: brightest(&view),
        contrast: notes.contrast,
        other_background: notes.other_background,
        mask_sort: notes.mask_sort,
        other_part: mask.as_ref().map_or(0.0, |mask| other_part(mask, &given, camera.width as usize)),
        nan_pixels: notes.nan_pixels,
    })
}

/// A part of a mask of which the template covers less than this is not the hand.
const LEAST_COVERED: f64 = 0.15;

/// The largest part of a mask that the template hardly covers, as a fraction of the mask; 0 if it covers no part.
fn other_part(mask: &[bool], template: &[bool], width: usize) -> f64 {
    let found = parts(mask, width, EDGES_AND_CORNERS);
    let is_covered = |part: &Vec<usize>| {
        let covered = part.iter().filter(|pixel| template.get(**pixel) == Some(&true)).count();
        covered as f64 >= LEAST_COVERED * part.len() as f64
    };
    let (covered, apart): (Vec<_>, Vec<_>) = found.iter().partition(|part| is_covered(part));
    let all: usize = found.iter().map(Vec::len).sum();
    let largest = apart.iter().map(|part| part.len()).max().unwrap_or(0);
    if covered.is_empty() { 0.0 } else { largest as f64 / all.max(1) as f64 }
}

/// The largest value of any channel on the hand, or of the whole image where no hand is marked.
fn brightest(view: &View) -> u8 {
    let value = |[r, g, b, _]: &[u8; 4]| *r.max(g).max(b);
    let on_hand = view.rgba.iter().filter(|pixel| pixel[3] >= 128).map(value).max();
    on_hand.or_else(|| view.rgba.iter().map(value).max()).unwrap_or(0)
}
