//! Masks around a hand whose poses are better than the capture's own: they end where the template ends, and those that are
//! made are made anew.

use std::sync::Arc;

use ghand_core::posing::pose_hand;
use ghand_core::{HandModel, Pose};
use glam::DVec3;

use super::guide::Guide;
use super::segment::Poses;
use crate::capture::Capture;
use crate::error::CaptureError;

/// Pixels beyond the template's end, beside where its arm may be, are cut off at this distance from it, relative to the
/// hand's size: nearer ones may be fingers that point towards the arm.
const BESIDE: f64 = 0.06;
/// Masks are cut off this far beyond where the last 6 % of the hand begin, in lengths of these: some 3 mm beyond the template's
/// end. What lies further off, Gaussians would have to leave the hand for.
const END: f64 = 1.25;
/// Where exact poses are known, masks are exact, too, and are judged as they are: there a mask has an arm if more than so many
/// of its pixels are farther beyond the template's end than one and a half of these lengths.
const ARM: f64 = 2.5;
const LEAST_ARM: usize = 8;
/// Fewer pixels of skin in the last 6 % of the hand do not tell its colour there.
const LEAST_WRIST: usize = 20;
/// The mask of a pixel where the template goes on and the mask does not: neither hand nor background.
const UNKNOWN: u8 = 64;

/// What an image shows at the wrist.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(crate) struct WristPixels {
    /// The arm.
    arm: Vec<usize>,
    /// Background where the template goes on: the wrist bends, or the mask ends.
    unknown: Vec<usize>,
    /// The skin of the hand there.
    skin: Vec<usize>,
}

impl WristPixels {
    /// Takes the arm out of the mask.
    pub fn cut(&self, rgba: &mut [[u8; 4]]) {
        self.arm.iter().for_each(|i| rgba[*i][3] = 0);
    }

    /// Shows background instead of the arm. Where the template goes on without the hand in the mask, as beside a bent wrist, the
    /// image is continued in the mean colour of the skin there, and its mask says neither hand nor background: or the avatar
    /// would end in colours of the background.
    pub fn hide(&self, background: [u8; 3], rgba: &mut [[u8; 4]]) {
        let [r, g, b] = background;
        self.arm.iter().for_each(|i| rgba[*i] = [r, g, b, 0]);
        if self.skin.len() >= LEAST_WRIST {
            let mean = |c: usize| {
                let sum: u64 = self.skin.iter().map(|i| u64::from(rgba[*i][c])).sum();
                (sum / self.skin.len() as u64) as u8
            };
            let skin = [mean(0), mean(1), mean(2), UNKNOWN];
            self.unknown.iter().for_each(|i| rgba[*i] = skin);
        }
    }
}

/// A hand model and poses better than the capture's own, by frame.
#[derive(Debug, Clone, PartialEq)]
pub struct AlignedHand {
    model: HandModel,
    /// `None` for a frame that keeps its pose.
    poses: Vec<Option<Pose>>,
}

impl Capture {
    /// From now on masks are those of a better posed hand: `poses` of `frames` (indices) for a `template` without shape
    /// parameters. Masks end where the template does, so that arms are surroundings, and masks by
    /// [`MaskMethod::Colors`](super::MaskMethod::Colors) are made anew. Alignment itself needs no such cut.
    pub fn align_masks(&mut self, template: &HandModel, frames: &[usize], poses: &[Pose]) {
        let mut better = vec![None; self.frames.len()];
        for (frame, pose) in frames.iter().zip(poses) {
            if let Some(entry) = better.get_mut(*frame) {
                *entry = Some(pose.clone());
            }
        }
        self.images.aligned = Some(Arc::new(AlignedHand { model: template.clone(), poses: better }));
    }

    fn aligned(&self, frame: usize) -> Option<(&HandModel, &Pose)> {
        let aligned = self.images.aligned.as_deref()?;
        Some((&aligned.model, aligned.poses.get(frame)?.as_ref()?))
    }

    /// What a view (alpha 255 on the hand, 0 elsewhere) shows at the wrist, if its frame's pose is aligned.
    pub(crate) fn wrist_pixels(
        &self,
        camera: usize,
        frame: usize,
        rgba: &[[u8; 4]],
    ) -> Result<WristPixels, CaptureError> {
        if self.aligned(frame).is_none() {
            return Ok(WristPixels::default());
        }
        let (model, vertices, _) = posed(self, frame)?;
        let (camera, _) = self.camera_and_frame(camera, frame)?;
        let Some(guide) = Guide::new(camera, model, &vertices, BESIDE) else { return Ok(WristPixels::default()) };
        let width = camera.width as usize;
        let is_beyond = |i: usize, bands: f64| {
            let (x, y) = (i % width, i / width);
            let least = if guide.may_be_arm(x, y) { 0.0 } else { BESIDE };
            guide.is_beyond(x, y, bands) && guide.distance(x, y).is_none_or(|distance| distance > least)
        };
        let shown = || (0..rgba.len()).filter(|i| rgba[*i][3] > 0);
        let has_arm = shown().filter(|i| is_beyond(*i, ARM)).nth(LEAST_ARM).is_some();
        if self.truth.is_some() && !has_arm {
            return Ok(WristPixels::default());
        }
        let arm = shown().filter(|i| is_beyond(*i, END)).collect();
        let at_wrist = |i: &usize| {
            let (x, y) = (*i % width, *i / width);
            guide.is_beyond(x, y, 0.0) && guide.distance(x, y).is_some_and(|distance| distance < 0.0)
        };
        let (skin, unknown) = (0..rgba.len()).filter(at_wrist).partition(|i| rgba[*i][3] > 0);
        Ok(WristPixels { arm, unknown, skin })
    }
}

/// The hand of a frame: the model, its vertices (world, metres), and how exact they are.
pub(super) fn posed(capture: &Capture, frame: usize) -> Result<(&HandModel, Vec<DVec3>, Poses), CaptureError> {
    let found = match capture.aligned(frame) {
        Some((model, pose)) => pose_hand(model, &[], pose).map(|hand| (model, hand.vertices, Poses::Aligned)),
        None => {
            let frame = capture.frame(frame)?;
            pose_hand(&capture.hand_model, &frame.shape, &frame.pose)
                .map(|hand| (&capture.hand_model, hand.vertices, Poses::Given))
        }
    };
    found.map_err(|source| CaptureError::HandModel { path: capture.root.clone(), source: source.into() })
}
