//! Exposure and white balance of cameras that are not alike: for each an affine map of its colours, near the identity,
//! that makes texels look the same from all cameras of a frame.

use std::collections::BTreeMap;

use ghand_capture::images::color_correction::{ColorMap, IDENTITY, mapped};
use nalgebra::{Matrix4, Matrix4x3, Vector4};
use serde::{Deserialize, Serialize};

use crate::texels::frames::{TexelFrames, TexelImage};

/// How cameras with other exposures are treated.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ExposureChoice {
    /// Corrected if, in frames left out, cameras agree better with it, and both light and gloss explain more: [`crate::exposure`].
    #[default]
    Auto,
    /// Each camera's images are corrected.
    PerCamera,
    /// All cameras are taken to be alike.
    Off,
}

/// Turns of maps and mean colours.
const ROUNDS: usize = 12;
/// Ridge on what a map changes, as a mean over its texels: skin has few colours, which do not determine twelve numbers.
const RIDGE: f64 = 2e-3;
/// Display values; differences of this count half: shine differs between views.
const LARGE: f64 = 0.06;
/// Every this many frames, one is held out.
const HOLD_OUT: usize = 3;
/// Maps must reduce how much cameras disagree in frames left out to less than this fraction, and what light and gloss leave
/// unexplained, too: shine also differs from camera to camera.
pub const WORTHWHILE: f64 = 0.9;

/// What was found of the cameras' exposures.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ExposureFit {
    /// Whether the images are corrected.
    pub corrected: bool,
    /// By how much the exposures differ: standard deviation of the maps' mean factor over the cameras.
    pub spread: f64,
    /// Mean squared difference of a texel in one camera from its mean over the frame's others, display values, in frames
    /// left out of the fit: without and with maps.
    pub squared_difference_left_out: [f64; 2],
    /// What light and gloss leave unexplained in such frames, without and with maps; `None` if that was not asked.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unexplained: Option<[f64; 2]>,
    /// The maps, by the camera's index.
    #[serde(skip)]
    pub maps: BTreeMap<usize, ColorMap>,
}

/// Finds the maps of a split's cameras.
pub fn fit_exposure(seen: &TexelFrames, choice: ExposureChoice) -> ExposureFit {
    let held_out = |frame: usize| frame % HOLD_OUT == HOLD_OUT - 1 && seen.images.len() >= HOLD_OUT;
    let frames = |wanted: &dyn Fn(usize) -> bool| -> Vec<&[TexelImage]> {
        seen.images.iter().enumerate().filter(|(f, _)| wanted(*f)).map(|(_, images)| &images[..]).collect()
    };
    let others = fit_maps(&frames(&|f| !held_out(f)));
    let left_out = frames(&held_out);
    let squared_difference_left_out = [difference(&left_out, &BTreeMap::new()), difference(&left_out, &others)];
    let maps = fit_maps(&frames(&|_| true));
    let corrected = match choice {
        ExposureChoice::Auto => squared_difference_left_out[1] < WORTHWHILE * squared_difference_left_out[0],
        ExposureChoice::PerCamera => true,
        ExposureChoice::Off => false,
    };
    let factors: Vec<f64> = maps.values().map(|map| mapped(map, [0.5; 3]).iter().sum::<f64>() / 1.5).collect();
    let mean = factors.iter().sum::<f64>() / factors.len().max(1) as f64;
    let variance = factors.iter().map(|f| (f - mean).powi(2)).sum::<f64>() / factors.len().max(1) as f64;
    ExposureFit { corrected, spread: variance.sqrt(), squared_difference_left_out, unexplained: None, maps }
}

/// Each texel that several images of a frame show, in each of them: the camera, its colour there, the mean colour of the
/// others after their maps, and the weight.
fn compared(
    images: &[TexelImage],
    maps: &BTreeMap<usize, ColorMap>,
    each: &mut dyn FnMut(usize, [f64; 3], [f64; 3], f64),
) {
    let map_of = |camera: usize| maps.get(&camera).unwrap_or(&IDENTITY);
    for t in 0..images.first().map_or(0, |image| image.texels.len()) {
        let views = || images.iter().filter_map(|image| image.texels[t].map(|view| (image.camera, view)));
        let mut sum = [0.0; 4];
        for (camera, view) in views() {
            let color = mapped(map_of(camera), view.color);
            (0..3).for_each(|c| sum[c] += view.weight * color[c]);
            sum[3] += view.weight;
        }
        for (camera, view) in views() {
            let rest = sum[3] - view.weight;
            // A clipped colour says nothing about exposure.
            if rest > 1e-9 && view.color.iter().all(|value| *value < 0.98) {
                let own = mapped(map_of(camera), view.color);
                each(camera, view.color, [0, 1, 2].map(|c| (sum[c] - view.weight * own[c]) / rest), view.weight);
            }
        }
    }
}

/// The maps that make cameras agree best, with a mean of the identity.
fn fit_maps(frames: &[&[TexelImage]]) -> BTreeMap<usize, ColorMap> {
    let mut maps: BTreeMap<usize, ColorMap> =
        frames.iter().flat_map(|images| images.iter().map(|image| (image.camera, IDENTITY))).collect();
    for _ in 0..ROUNDS {
        let mut sums: BTreeMap<usize, (Matrix4<f64>, Matrix4x3<f64>, f64)> = BTreeMap::new();
        for images in frames {
            compared(images, &maps, &mut |camera, color, target, weight| {
                let own = mapped(&maps[&camera], color);
                let off = (0..3).map(|c| (own[c] - target[c]).powi(2)).sum::<f64>().sqrt();
                let weight = weight / (1.0 + (off / LARGE).powi(2));
                let row = Vector4::new(color[0], color[1], color[2], 1.0);
                let (matrix, vectors, sum) = sums.entry(camera).or_default();
                *matrix += row * row.transpose() * weight;
                *vectors += row * nalgebra::RowVector3::from(target) * weight;
                *sum += weight;
            });
        }
        for (camera, (matrix, vectors, sum)) in sums {
            let ridge = RIDGE * sum;
            let identity = Matrix4x3::<f64>::identity();
            let matrix = matrix + Matrix4::identity() * ridge;
            if let Some(solved) = matrix.cholesky().map(|factors| factors.solve(&(vectors + identity * ridge))) {
                maps.insert(camera, [0, 1, 2].map(|c| [0, 1, 2, 3].map(|k| solved[(k, c)])));
            }
        }
        center(&mut maps);
    }
    maps
}

/// Shifts all maps so that their mean is the identity: what all cameras have alike is no matter of one of them.
fn center(maps: &mut BTreeMap<usize, ColorMap>) {
    let count = maps.len().max(1) as f64;
    for c in 0..3 {
        for k in 0..4 {
            let mean = maps.values().map(|map| map[c][k]).sum::<f64>() / count;
            maps.values_mut().for_each(|map| map[c][k] += IDENTITY[c][k] - mean);
        }
    }
}

/// Mean squared difference of texels in a camera from their mean in the others.
fn difference(frames: &[&[TexelImage]], maps: &BTreeMap<usize, ColorMap>) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for images in frames {
        compared(images, maps, &mut |camera, color, target, weight| {
            let own = mapped(maps.get(&camera).unwrap_or(&IDENTITY), color);
            sum += weight * (0..3).map(|c| (own[c] - target[c]).powi(2)).sum::<f64>() / 3.0;
            count += weight;
        });
    }
    sum / f64::max(count, f64::MIN_POSITIVE)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::texels::views::TexelView;

    /// Frames of 5 cameras with these exposures, of skin with some noise.
    fn frames(exposures: &[[f64; 3]; 5]) -> Vec<Vec<TexelImage>> {
        let skin = |t: usize| [0.6, 0.45, 0.35].map(|v| v * (0.8 + 0.2 * (1.3 * t as f64).sin()));
        let noise = |n: usize| 0.004 * (78.233 * n as f64).sin();
        let texel = |t: usize, camera: usize, frame: usize| {
            let at = (t * 7 + camera * 131 + frame * 17) % 997;
            let color = [0, 1, 2].map(|c| skin(t)[c] * exposures[camera][c] + noise(at + 3 * c));
            (!at.is_multiple_of(4)).then_some(TexelView { color, weight: 0.8, edge: 1.0 })
        };
        let image = |camera: usize, frame: usize| TexelImage {
            eye: glam::DVec3::ZERO,
            camera,
            texels: (0..150).map(|t| texel(t, camera, frame)).collect(),
        };
        (0..6).map(|frame| (0..5).map(|camera| image(camera, frame)).collect()).collect()
    }

    fn borrowed(frames: &[Vec<TexelImage>]) -> Vec<&[TexelImage]> {
        frames.iter().map(|images| &images[..]).collect()
    }

    #[test]
    fn planted_exposures_and_white_balances_are_undone() {
        let exposures = [[1.1, 1.1, 1.1], [0.9, 0.9, 0.9], [1.0, 1.0, 1.06], [1.0, 0.97, 0.94], [1.0, 1.03, 1.0]];
        let frames = frames(&exposures);
        let maps = fit_maps(&borrowed(&frames));
        let before = difference(&borrowed(&frames), &BTreeMap::new());
        let after = difference(&borrowed(&frames), &maps);
        assert!(after < 0.05 * before, "{after} of {before}");
        for (camera, exposure) in exposures.iter().enumerate() {
            let skin = [0.6, 0.45, 0.35];
            let undone = mapped(&maps[&camera], [0, 1, 2].map(|c| skin[c] * exposure[c]));
            for (undone, skin) in undone.iter().zip(skin) {
                assert!((undone / skin - 1.0).abs() < 0.02, "camera {camera}: {undone} for {skin}");
            }
        }
    }

    #[test]
    fn cameras_that_are_alike_stay_as_they_are() {
        let frames = frames(&[[1.0; 3]; 5]);
        let maps = fit_maps(&borrowed(&frames));
        let [before, after] = [&BTreeMap::new(), &maps].map(|maps| difference(&borrowed(&frames), maps));
        assert!(after > WORTHWHILE * before, "{after} of {before}");
    }
}
