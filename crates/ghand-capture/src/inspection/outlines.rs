//! Whether masks belong to their images: a mask's outline runs along edges of its image, and along fewer of another's.

use std::collections::BTreeMap;

use rayon::prelude::*;

use super::findings::{Finding, finding, names};
use super::{ViewFit, spread_evenly};
use crate::capture::Capture;

/// Images and masks are compared at this size of the longer side, pixels: edges are then a pixel or two wide.
const SIZE: usize = 256;
/// Images of all cameras together that are compared, and the fewest and the most of one camera.
const MOST_IMAGES: usize = 72;
const LEAST_VIEWS: usize = 3;
const MOST_VIEWS: usize = 8;
/// Frames by which masks are tried to be late or early.
const MOST_SHIFT: i32 = 3;
/// Another mask belongs to an image if its outline is on edges this many times as strong, in this part of a camera's images.
const STRONGER: f64 = 1.2;
const MOST: f64 = 0.75;
/// Colours change across an outline this far from it, pixels.
const ACROSS: usize = 2;
/// Pixels by which masks are tried to be too narrow or too wide: outlines beside the edges meet more of them in any place.
const WIDTHS: [isize; 6] = [-6, -4, -2, 2, 4, 6];

/// What would make masks and images belong together.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Change {
    /// The mask of a frame this much later.
    Shift(i32),
    Mirrored,
    Flipped,
    Turned,
    /// A mask that is so many pixels wider on each side.
    Wider(isize),
}

/// Cameras whose masks are on stronger edges of their images if they are shifted in time, mirrored or turned.
pub(super) fn images_and_masks(capture: &Capture, views: &[&ViewFit]) -> Vec<Finding> {
    let mut cameras: Vec<usize> = views.iter().filter(|view| is_marked(view)).map(|view| view.camera).collect();
    cameras.sort_unstable();
    cameras.dedup();
    if cameras.is_empty() || !has_mask_files(capture) {
        return vec![];
    }
    let share = (MOST_IMAGES / cameras.len()).clamp(LEAST_VIEWS, MOST_VIEWS);
    let found: Vec<(usize, Change)> = cameras
        .par_iter()
        .filter_map(|&camera| {
            let of_camera: Vec<&ViewFit> =
                views.iter().filter(|view| view.camera == camera && is_marked(view)).copied().collect();
            let chosen = spread_evenly(&of_camera, |view| view.frame, share, &mut std::collections::HashMap::new());
            let frames: Vec<usize> = chosen.into_iter().map(|view| view.frame).collect();
            Some((camera, change_of(capture, camera, &frames)?))
        })
        .collect();
    let mut of_change: BTreeMap<Change, Vec<&str>> = BTreeMap::new();
    // Masks of another width still belong to their images.
    for (camera, change) in found.into_iter().filter(|(_, change)| !matches!(change, Change::Wider(_))) {
        let name = capture.cameras.get(camera).map_or("", |camera| camera.id.as_str());
        of_change.entry(change).or_default().push(name);
    }
    let all = cameras.len();
    let text = |(change, ids): (Change, Vec<&str>)| {
        let what = match change {
            Change::Shift(frames) => {
                let count = frames.unsigned_abs();
                let which = if frames > 0 { "later" } else { "earlier" };
                let s = if count == 1 { "" } else { "s" };
                format!("shifted by {count} frame{s}? The masks of frames {count} {which} fit the images")
            }
            Change::Mirrored => "mirrored, left for right? Mirrored masks fit the images".into(),
            Change::Flipped => "mirrored, top for bottom? Masks upside down fit the images".into(),
            Change::Turned | Change::Wider(_) => "turned by 180 degrees? Turned masks fit the images".into(),
        };
        let text = format!(
            "images and masks of {} of {all} cameras ({}) do not belong together; {what}",
            ids.len(),
            names(&ids)
        );
        finding(2 * ids.len() > all, text)
    };
    of_change.into_iter().map(text).collect()
}

fn is_marked(view: &ViewFit) -> bool {
    view.coverage.is_some_and(|coverage| coverage > 0.0 && coverage < 1.0)
}

fn has_mask_files(capture: &Capture) -> bool {
    capture.images.made_masks.is_none() && capture.mask_file(0, 0).ok().flatten().is_some()
}

/// The change after which the masks of a camera fit its images much better.
fn change_of(capture: &Capture, camera: usize, frames: &[usize]) -> Option<Change> {
    let shifts = (-MOST_SHIFT..=MOST_SHIFT).filter(|shift| *shift != 0).map(Change::Shift);
    let turns = [Change::Mirrored, Change::Flipped, Change::Turned];
    let changes: Vec<Change> = shifts.chain(turns).chain(WIDTHS.map(Change::Wider)).collect();
    let mut gains: BTreeMap<Change, Vec<f64>> = BTreeMap::new();
    for &frame in frames {
        let Some(image) = Edges::of(capture, camera, frame) else { continue };
        let Some(own) = small_mask(capture, camera, frame, &image) else { continue };
        let as_is = image.along(&own);
        for &change in &changes {
            let mask = match change {
                Change::Shift(shift) => {
                    let other = frame.checked_add_signed(shift as isize);
                    other.and_then(|other| small_mask(capture, camera, other, &image))
                }
                Change::Mirrored => Some(own.chunks(image.width).flat_map(|row| row.iter().rev().copied()).collect()),
                Change::Flipped => Some(own.chunks(image.width).rev().flatten().copied().collect()),
                Change::Turned => Some(own.iter().rev().copied().collect()),
                Change::Wider(pixels) => Some(wider(&own, image.width, pixels)),
            };
            if let Some(mask) = mask {
                gains.entry(change).or_default().push(image.along(&mask) / as_is.max(f64::MIN_POSITIVE));
            }
        }
    }
    let is_better = |gains: &Vec<f64>| {
        let better = gains.iter().filter(|gain| **gain > STRONGER).count();
        gains.len() >= LEAST_VIEWS && better as f64 >= MOST * gains.len() as f64
    };
    let mean = |gains: &Vec<f64>| gains.iter().map(|gain| gain.ln()).sum::<f64>() / gains.len() as f64;
    let better = gains.iter().filter(|(_, gains)| is_better(gains));
    better.max_by(|a, b| mean(a.1).total_cmp(&mean(b.1))).map(|(change, _)| *change)
}

/// How strongly the colours of an image change at each pixel, at a small size.
struct Edges {
    width: usize,
    height: usize,
    strength: Vec<f64>,
}

impl Edges {
    fn of(capture: &Capture, camera: usize, frame: usize) -> Option<Edges> {
        let size = capture.cameras.get(camera)?;
        let full = [size.width as usize, size.height as usize];
        let rgba = capture.undistorted_image(camera, frame).ok()?;
        let [width, height] = small_size(full);
        let colors = |channel: usize| reduced(full, [width, height], |i| f64::from(rgba[i][channel]));
        let colors = [colors(0), colors(1), colors(2)];
        let at = |x: usize, y: usize| colors.each_ref().map(|channel| channel[y * width + x]);
        let difference = |a: [f64; 3], b: [f64; 3]| (0..3).map(|k| (a[k] - b[k]).powi(2)).sum::<f64>();
        let strength = |i: usize| {
            let (x, y) = (i % width, i / width);
            let [left, right] = [x.saturating_sub(ACROSS), (x + ACROSS).min(width - 1)];
            let [above, below] = [y.saturating_sub(ACROSS), (y + ACROSS).min(height - 1)];
            (difference(at(left, y), at(right, y)) + difference(at(x, above), at(x, below))).sqrt()
        };
        let strength = (0..width * height).map(strength).collect();
        Some(Edges { width, height, strength })
    }

    /// The mean strength of edges along the outline of a mask, without the image's border.
    fn along(&self, mask: &[bool]) -> f64 {
        let is_inside = |x: usize, y: usize| mask.get(y * self.width + x).copied().unwrap_or(false);
        let (mut sum, mut count) = (0.0, 0_usize);
        for y in 1..self.height.saturating_sub(1) {
            for x in 1..self.width.saturating_sub(1) {
                let outside = [(x - 1, y), (x + 1, y), (x, y - 1), (x, y + 1)].iter().any(|(x, y)| !is_inside(*x, *y));
                if is_inside(x, y) && outside {
                    sum += self.strength[y * self.width + x];
                    count += 1;
                }
            }
        }
        if count == 0 { 0.0 } else { sum / count as f64 }
    }
}

fn small_mask(capture: &Capture, camera: usize, frame: usize, image: &Edges) -> Option<Vec<bool>> {
    let size = capture.cameras.get(camera)?;
    let mask = capture.load_hand_mask(camera, frame).ok()?;
    let full = [size.width as usize, size.height as usize];
    let part = reduced(full, [image.width, image.height], |i| f64::from(u8::from(mask[i])));
    Some(part.into_iter().map(|part| part >= 0.5).collect())
}

/// A mask with this many pixels more on each side; fewer if negative.
fn wider(mask: &[bool], width: usize, pixels: isize) -> Vec<bool> {
    let grows = pixels > 0;
    let mut found: Vec<bool> = mask.iter().map(|inside| *inside == grows).collect();
    for _ in 0..pixels.unsigned_abs() {
        let before = found.clone();
        let at = |i: Option<usize>| i.and_then(|i| before.get(i)).copied().unwrap_or(false);
        for (i, inside) in found.iter_mut().enumerate() {
            let column = i % width.max(1);
            let below = i + width;
            let left = if column > 0 { i.checked_sub(1) } else { None };
            let right = (column + 1 < width).then_some(i + 1);
            *inside |= at(left) || at(right) || at(i.checked_sub(width)) || at(Some(below));
        }
    }
    found.into_iter().map(|inside| inside == grows).collect()
}

fn small_size([width, height]: [usize; 2]) -> [usize; 2] {
    let factor = (SIZE as f64 / width.max(height) as f64).min(1.0);
    [width, height].map(|size| ((size as f64 * factor).round() as usize).max(1))
}

/// Means of the values of a row-major image over the pixels of a smaller one.
fn reduced([width, height]: [usize; 2], [columns, rows]: [usize; 2], value: impl Fn(usize) -> f64) -> Vec<f64> {
    let range = |k: usize, count: usize, all: usize| k * all / count..((k + 1) * all / count).max(k * all / count + 1);
    let mean = |i: usize| {
        let [xs, ys] = [range(i % columns, columns, width), range(i / columns, rows, height)];
        let count = xs.len() * ys.len();
        ys.flat_map(|y| xs.clone().map(move |x| y * width + x)).map(&value).sum::<f64>() / count as f64
    };
    (0..columns * rows).map(mean).collect()
}
