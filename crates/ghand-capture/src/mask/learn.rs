//! The colours of a camera, learned over its frames.

use std::hash::{DefaultHasher, Hash, Hasher};

use glam::DVec3;
use rayon::prelude::*;

use super::aligned::posed;
use super::distance::squared_distances;
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
/// Pixels this far inside the posed model are hand, and this far outside surroundings, relative to the hand's size, whatever
/// the poses' errors.
const INSIDE: f64 = 0.10;
const OUTSIDE: f64 = 0.35;
/// Pixels this far from a first mask are surroundings, relative to the hand's size.
const BESIDE: f64 = 0.04;

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
pub(super) fn key(capture: &Capture, camera: usize, frames: &[usize]) -> Result<u64, CaptureError> {
    let mut hasher = DefaultHasher::new();
    for &frame in frames {
        let (_, vertices, poses) = posed(capture, frame)?;
        poses.hash(&mut hasher);
        vertices.iter().flat_map(DVec3::to_array).for_each(|v| v.to_bits().hash(&mut hasher));
        for file in [Some(capture.image_file(camera, frame)?), capture.other_hands_file(camera, frame)?] {
            let data = file.as_ref().and_then(|file| std::fs::metadata(file).ok());
            let length = data.as_ref().map(std::fs::Metadata::len);
            (file, length, data.and_then(|data| data.modified().ok())).hash(&mut hasher);
        }
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
    /// Whether a pixel is certainly hand.
    hand: Vec<bool>,
    guide: Guide,
    poses: Poses,
}

/// Alpha of pixels near the hand or on its arm.
const NEAR: u8 = 128;

/// Learns the colours of a camera. Images that cannot be read, and frames without the hand, teach nothing.
///
/// # Errors
/// [`CaptureError`] if a pose does not fit the hand model.
pub(super) fn learn(capture: &Capture, camera: usize, frames: &[usize]) -> Result<Colors, CaptureError> {
    let (view_camera, _) = capture.camera_and_frame(camera, frames.first().copied().unwrap_or(0))?;
    let width = view_camera.width as usize;
    let example = |&frame: &usize| -> Result<Option<Example>, CaptureError> {
        let (model, vertices, poses) = posed(capture, frame)?;
        let guide = Guide::new(view_camera, model, &vertices, poses.reach().max(OUTSIDE));
        let image = capture.undistorted_image(camera, frame).ok();
        Ok(guide.zip(image).map(|(guide, rgba)| Example::new(rgba, guide, poses, width)))
    };
    let mut examples: Vec<Example> =
        frames.par_iter().map(example).collect::<Result<Vec<_>, _>>()?.into_iter().flatten().collect();
    let first = colors(&examples, width);
    // Fingers are often narrower than poses are exact, and things beside the hand may never be far from it: first masks
    // tell more of both.
    examples.par_iter_mut().for_each(|example| {
        let mask = first.mask(&example.rgba, width, &example.guide, example.poses);
        example.set_mask(mask, width);
    });
    let second = colors(&examples, width);
    Ok(Colors { hand: first.hand.mixed(&second.hand), ..second })
}

/// What examples show.
fn colors(examples: &[Example], width: usize) -> Colors {
    let mut hand = Histogram::new();
    let mut surroundings = Histogram::new();
    for Example { rgba, hand: is_hand, guide, .. } in examples {
        for i in guide.rows.clone().flat_map(|y| guide.columns.clone().map(move |x| y * width + x)) {
            match (rgba.get(i), is_hand.get(i)) {
                (Some([r, g, b, _]), Some(true)) => hand.add([*r, *g, *b]),
                (Some([r, g, b, 255]), _) => surroundings.add([*r, *g, *b]),
                _ => {}
            }
        }
    }
    let still = Still::of(examples.iter().map(|example| example.rgba.as_slice()).collect());
    Colors { hand: hand.smoothed(), surroundings: surroundings.smoothed(), still }
}

impl Example {
    fn new(mut rgba: Vec<[u8; 4]>, guide: Guide, poses: Poses, width: usize) -> Example {
        let mut hand = vec![false; rgba.len()];
        for (i, (pixel, hand)) in rgba.iter_mut().zip(&mut hand).enumerate().filter(|(_, (pixel, _))| pixel[3] > 0) {
            let (x, y) = (i % width, i / width);
            let distance = guide.distance(x, y);
            let is_far = distance.is_none_or(|d| d > OUTSIDE) && !guide.may_be_arm(x, y);
            pixel[3] = if is_far { 255 } else { NEAR };
            *hand = distance.is_some_and(|d| d < -INSIDE);
        }
        Example { rgba, hand, guide, poses }
    }

    /// Pixels in a mask are hand, those beside it surroundings.
    fn set_mask(&mut self, mask: Vec<bool>, width: usize) {
        let (columns, rows) = (self.guide.columns.clone(), self.guide.rows.clone());
        let at = |x: usize, y: usize| (rows.start + y) * width + columns.start + x;
        let size = [columns.len(), rows.len()];
        let pixels = || (0..size[1]).flat_map(|y| (0..size[0]).map(move |x| [x, y]));
        let start = pixels().map(|[x, y]| if mask[at(x, y)] { 0.0 } else { f64::INFINITY }).collect();
        let squared = squared_distances(start, size);
        let least = (BESIDE * self.guide.size).powi(2);
        for ([x, y], _) in pixels().zip(squared).filter(|(_, squared)| *squared > least) {
            let pixel = &mut self.rgba[at(x, y)];
            if pixel[3] == NEAR && !self.guide.may_be_arm(columns.start + x, rows.start + y) {
                pixel[3] = 255;
            }
        }
        self.hand = mask;
    }
}
