//! The colours of a camera, learned over its frames.

use std::hash::{DefaultHasher, Hash, Hasher};

use ghand_core::posing::pose_hand;
use ghand_core::{HandModel, Pose};
use glam::DVec3;
use rayon::prelude::*;

use super::guide::Guide;
use super::histogram::Histogram;
use super::segment::{Colors, Poses};
use super::still::Still;
use crate::capture::Capture;
use crate::error::CaptureError;

/// Most frames that colours are learned from, evenly chosen; fewer of large images, so that they take no more than so many
/// bytes in all, but not fewer than the least.
const MOST_FRAMES: usize = 48;
const MOST_BYTES: usize = 1 << 28;
const LEAST_FRAMES: usize = 8;
/// Frames whose first masks tell more about the hand's colours: fingers are often narrower than poses are exact.
const MASKED_FRAMES: usize = 12;
/// Pixels this far inside the posed model are hand, and this far outside surroundings, relative to the hand's size, whatever
/// the poses' errors.
const INSIDE: f64 = 0.10;
const OUTSIDE: f64 = 0.35;

/// A hand model and poses better than the capture's own, by frame.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct AlignedHand {
    pub model: HandModel,
    /// `None` for a frame that keeps its pose.
    pub poses: Vec<Option<Pose>>,
}

/// The hand of a frame: the model, its vertices (world, metres), and how exact they are.
pub(super) fn posed<'a>(
    capture: &'a Capture,
    aligned: Option<&'a AlignedHand>,
    frame: usize,
) -> Result<(&'a HandModel, Vec<DVec3>, Poses), CaptureError> {
    let better = aligned.and_then(|aligned| Some((&aligned.model, aligned.poses.get(frame)?.as_ref()?)));
    let found = match better {
        Some((model, pose)) => pose_hand(model, &[], pose).map(|hand| (model, hand.vertices, Poses::Aligned)),
        None => {
            let frame = capture.frame(frame)?;
            pose_hand(&capture.hand_model, &frame.shape, &frame.pose)
                .map(|hand| (&capture.hand_model, hand.vertices, Poses::Given))
        }
    };
    found.map_err(|source| CaptureError::HandModel { path: capture.root.clone(), source: source.into() })
}

/// The frames that a camera's colours are learned from.
pub(super) fn frames_to_learn(capture: &Capture, camera: usize) -> Vec<usize> {
    let views = capture.splits.values().flat_map(|split| &split.views);
    let mut frames: Vec<usize> = views.filter(|view| view.camera == camera).map(|view| view.frame).collect();
    frames.sort_unstable();
    frames.dedup();
    let pixels = capture.cameras.get(camera).map_or(1, |c| c.width as usize * c.height as usize);
    let most = (MOST_BYTES / (4 * pixels.max(1))).clamp(LEAST_FRAMES, MOST_FRAMES).min(frames.len());
    (0..most).filter_map(|k| frames.get(k * frames.len() / most).copied()).collect()
}

/// A number that changes with what the colours of a camera are learned from.
pub(super) fn key(
    capture: &Capture,
    aligned: Option<&AlignedHand>,
    camera: usize,
    frames: &[usize],
) -> Result<u64, CaptureError> {
    let mut hasher = DefaultHasher::new();
    for &frame in frames {
        let (_, vertices, poses) = posed(capture, aligned, frame)?;
        poses.hash(&mut hasher);
        vertices.iter().flat_map(DVec3::to_array).for_each(|v| v.to_bits().hash(&mut hasher));
        let file = capture.image_file(camera, frame)?;
        let data = std::fs::metadata(&file).ok();
        (file, data.as_ref().map(std::fs::Metadata::len), data.and_then(|data| data.modified().ok())).hash(&mut hasher);
    }
    if let Some(camera) = capture.cameras.get(camera) {
        format!("{camera:?}").hash(&mut hasher);
    }
    Ok(hasher.finish())
}

/// A frame that is learned from.
struct Example {
    /// Alpha is 255 where neither hand nor arm can be, 0 outside what the camera sees.
    rgba: Vec<[u8; 4]>,
    guide: Guide,
    poses: Poses,
}

/// Alpha of pixels near the hand or on its arm.
const NEAR: u8 = 128;

/// Learns the colours of a camera. Images that cannot be read, and frames without the hand, teach nothing.
///
/// # Errors
/// [`CaptureError`] if a pose does not fit the hand model.
pub(super) fn learn(
    capture: &Capture,
    aligned: Option<&AlignedHand>,
    camera: usize,
    frames: &[usize],
) -> Result<Colors, CaptureError> {
    let (view_camera, _) = capture.camera_and_frame(camera, frames.first().copied().unwrap_or(0))?;
    let width = view_camera.width as usize;
    let example = |&frame: &usize| -> Result<Option<Example>, CaptureError> {
        let (model, vertices, poses) = posed(capture, aligned, frame)?;
        let Some(guide) = Guide::new(view_camera, model, &vertices, poses.reach().max(OUTSIDE)) else {
            return Ok(None);
        };
        let Ok(mut rgba) = capture.undistorted_image(camera, frame) else { return Ok(None) };
        for (i, pixel) in rgba.iter_mut().enumerate().filter(|(_, pixel)| pixel[3] > 0) {
            let (x, y) = (i % width, i / width);
            let is_far = guide.distance(x, y).is_none_or(|d| d > OUTSIDE) && !guide.may_be_arm(x, y);
            pixel[3] = if is_far { 255 } else { NEAR };
        }
        Ok(Some(Example { rgba, guide, poses }))
    };
    let mut examples: Vec<Example> =
        frames.par_iter().map(example).collect::<Result<Vec<_>, _>>()?.into_iter().flatten().collect();
    let (mut hand, mut surroundings) = (Histogram::new(), Histogram::new());
    for Example { rgba, guide, .. } in &examples {
        for y in guide.rows.clone() {
            for x in guide.columns.clone() {
                let Some([r, g, b, alpha]) = rgba.get(y * width + x).copied() else { continue };
                match guide.distance(x, y) {
                    Some(d) if d < -INSIDE && alpha > 0 => hand.add([r, g, b]),
                    _ if alpha == 255 => surroundings.add([r, g, b]),
                    _ => {}
                }
            }
        }
    }
    let pictures: Vec<Vec<[u8; 4]>> = examples.iter_mut().map(|example| std::mem::take(&mut example.rgba)).collect();
    let still = Still::of(&pictures, view_camera.width as usize * view_camera.height as usize);
    let mut colors = Colors { hand: hand.clone().smoothed(), surroundings: surroundings.smoothed(), still };

    let step = examples.len().div_ceil(MASKED_FRAMES).max(1);
    let chosen: Vec<usize> = (0..examples.len()).step_by(step).collect();
    let masks: Vec<Vec<bool>> =
        (chosen.par_iter()).map(|&k| colors.mask(&pictures[k], width, &examples[k].guide, examples[k].poses)).collect();
    let mut masked = Histogram::new();
    for (k, mask) in chosen.into_iter().zip(masks) {
        let inside = pictures[k].iter().zip(mask).filter(|(_, inside)| *inside);
        inside.for_each(|([r, g, b, _], _)| masked.add([*r, *g, *b]));
    }
    log::debug!(
        "camera {}: colours learned from {} frames, {} and {} pixels of the hand",
        view_camera.id,
        examples.len(),
        hand.total(),
        masked.total()
    );
    colors.hand = colors.hand.mixed(&masked.smoothed());
    Ok(colors)
}
