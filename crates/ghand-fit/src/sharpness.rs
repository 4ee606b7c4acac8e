//! How sharp images of a hand are, relative to the others of their camera: frames in fast motion are blurred, and an avatar
//! that takes them as they are becomes so, too.

use ghand_capture::images::blur::blurred;
use ghand_capture::mask::depths;
use ghand_core::statistics::{median, quantile};
use rayon::prelude::*;

use crate::views::reduced;

/// Fine detail is what this blur (standard deviation, pixels) takes away; it is compared with what the second one takes away
/// beyond that.
const FINE: f64 = 1.0;
const COARSE: f64 = 4.0;
/// Larger hands are reduced to about this size (square root of the mask's area), pixels: finer blur is no matter.
const SIZE: f64 = 200.0;
/// Variance of white noise of variance 1 less its blur of [`FINE`].
const FINE_NOISE: f64 = 0.76;
/// With more noise in fine detail, blurred images do not have less of it than sharp ones: then all images of a camera count
/// fully.
const MOST_NOISE: f64 = 0.25;
/// Pixels nearer to the mask's outline are left out: the background may be a plain one.
const BORDER: f64 = 3.0;
/// Fewer pixels do not tell.
const LEAST_PIXELS: usize = 200;
/// Sharpness is relative to this quantile of the camera's images: most of a camera may be blurred.
const SHARP: f64 = 0.75;
/// Images of fewer frames do not tell what is usual.
const LEAST_VIEWS: usize = 4;
/// Sharp images of one camera in various poses have 0.73 of that quantile or more, most of those blurred along 5 % of the hand's
/// size 0.75 or less. An image counts fully from `FULL` on, and least below `BLURRED`.
const FULL: f64 = 0.72;
const BLURRED: f64 = 0.5;
/// What a blurred image counts: it may be the only one that shows a part of the hand.
const LEAST_WEIGHT: f64 = 0.1;

/// What an image tells of its sharpness.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sharpness {
    /// The contrast of fine detail inside the mask, relative to that of coarser detail.
    detail: f64,
    /// The part of fine detail's variance that is noise.
    noise: f64,
}

/// The sharpness of an image of a hand. `None` if the mask is too small or the skin without any detail.
pub fn sharpness(pixels: &[[u8; 4]], size: [u32; 2]) -> Option<Sharpness> {
    let area = pixels.iter().filter(|pixel| pixel[3] >= 128).count() as f64;
    let factor = (area.sqrt() / SIZE).round().max(1.0) as u32;
    let (pixels, size) = reduced(pixels, size, factor);
    let inside: Vec<bool> =
        depths(pixels.iter().map(|pixel| pixel[3] >= 128), size).iter().map(|depth| *depth > BORDER).collect();
    let count = inside.iter().filter(|inside| **inside).count();
    if count < LEAST_PIXELS {
        return None;
    }
    let luma = |[r, g, b, _]: [u8; 4]| (0.299 * f32::from(r) + 0.587 * f32::from(g) + 0.114 * f32::from(b)) / 255.0;
    let values: Vec<f32> =
        pixels.iter().zip(&inside).map(|(pixel, inside)| if *inside { luma(*pixel) } else { 0.0 }).collect();
    let weights: Vec<f32> = inside.iter().map(|inside| f32::from(u8::from(*inside))).collect();
    let smooth = |deviation: f64| -> Vec<f32> {
        let [values, weights] = [&values, &weights].map(|image| blurred(image, size, deviation));
        values.iter().zip(weights).map(|(value, weight)| value / weight.max(1e-6)).collect()
    };
    let [fine, coarse] = [FINE, COARSE].map(smooth);
    let contrast = |a: &[f32], b: &[f32]| -> f64 {
        let squares = a.iter().zip(b).zip(&inside).filter(|(_, inside)| **inside);
        squares.map(|((a, b), _)| f64::from(a - b).powi(2)).sum::<f64>()
    };
    let detail = contrast(&values, &fine);
    let shape = contrast(&fine, &coarse);
    // Less than half a step of 8 bits is no detail.
    if shape <= count as f64 * (0.5f64 / 255.0).powi(2) {
        return None;
    }
    let noise = noise_variance(&values, &inside, size[0] as usize);
    Some(Sharpness { detail: (detail / shape).sqrt(), noise: FINE_NOISE * noise * count as f64 / detail.max(1e-12) })
}

/// The variance of white noise in an image: mean squared differences of pixels at a distance grow with a power of it, noise adds
/// the same to each.
fn noise_variance(values: &[f32], inside: &[bool], width: usize) -> f64 {
    let difference = |distance: usize| -> f64 {
        let (mut sum, mut count) = (0.0, 0usize);
        for i in (0..values.len()).filter(|i| inside[*i]) {
            // To the right and down; inside the mask there is a border, so that rows do not run into each other.
            for j in [i + distance, i + distance * width] {
                if inside.get(j).copied().unwrap_or(false) {
                    sum += f64::from(values[i] - values[j]).powi(2);
                    count += 1;
                }
            }
        }
        sum / count.max(1) as f64
    };
    let [one, two, four] = [1, 2, 4].map(difference);
    let power = ((four - two) / (two - one).max(1e-12)).max(1e-12).log2().clamp(0.3, 2.0);
    ((one - (two - one) / (power.exp2() - 1.0)) / 2.0).max(0.0)
}

/// How much each image counts, 0.1 to 1, from its camera and its [`sharpness`].
pub fn weights(views: &[(usize, Option<Sharpness>)]) -> Vec<f64> {
    let usual = |camera: usize| -> Option<f64> {
        let known = || views.iter().filter(|(other, _)| *other == camera).filter_map(|(_, sharpness)| *sharpness);
        let tells = known().count() >= LEAST_VIEWS && median(known().map(|known| known.noise)) < MOST_NOISE;
        tells.then(|| quantile(known().map(|known| known.detail), SHARP))
    };
    let cameras = views.iter().map(|(camera, _)| camera + 1).max().unwrap_or(0);
    let usual: Vec<Option<f64>> = (0..cameras).into_par_iter().map(usual).collect();
    let weight = |(camera, sharpness): &(usize, Option<Sharpness>)| {
        let (Some(usual), Some(sharpness)) = (usual[*camera].filter(|usual| *usual > 0.0), sharpness) else {
            return 1.0;
        };
        let part = (sharpness.detail / usual - BLURRED) / (FULL - BLURRED);
        LEAST_WEIGHT + (1.0 - LEAST_WEIGHT) * part.clamp(0.0, 1.0)
    };
    views.iter().map(weight).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: [u32; 2] = [90, 70];

    /// Skin-like noise of several scales inside a disc; each pixel is the mean over a square of `blur` by
    /// `blur`.
    fn disc(seed: u32, blur: u32) -> Vec<[u8; 4]> {
        let noise = |x: u32, y: u32| {
            let hash = (x.wrapping_mul(0x9E37_79B1) ^ y.wrapping_mul(0x85EB_CA6B) ^ seed).wrapping_mul(0xC2B2_AE35);
            f64::from((hash ^ (hash >> 15)).wrapping_mul(0x2C1B_3C6D) >> 24) / 255.0
        };
        let skin = |x: u32, y: u32| {
            [1, 2, 4, 8].map(|scale| f64::from(scale) * noise(x / scale, y / scale)).iter().sum::<f64>() * 6.0 + 80.0
        };
        (0..SIZE[1])
            .flat_map(|y| (0..SIZE[0]).map(move |x| [x, y]))
            .map(|[x, y]| {
                let square = (0..blur * blur).map(|k| skin(x + k % blur, y + k / blur));
                let value = square.sum::<f64>() / f64::from(blur * blur);
                let inside = (f64::from(x) - 45.0).hypot(f64::from(y) - 35.0) < 30.0;
                [value as u8, (0.8 * value) as u8, (0.7 * value) as u8, if inside { 255 } else { 0 }]
            })
            .collect()
    }

    #[test]
    fn blurred_images_count_less_and_sharp_ones_fully() {
        let blurred = |k: u32| k.is_multiple_of(3);
        let views: Vec<(usize, Option<Sharpness>)> = (0..24)
            .map(|k| (usize::from(k >= 12), sharpness(&disc(k, if blurred(k) { 4 } else { 1 }), SIZE)))
            .collect();
        for (k, weight) in (0..).zip(weights(&views)) {
            assert!(if blurred(k) { weight < 0.3 } else { weight == 1.0 }, "{k}: {weight} {views:?}");
        }
        // Two images say nothing of what is usual.
        assert_eq!(weights(&views[..2]), [1.0, 1.0]);
        // A camera out of focus is compared with itself.
        let soft: Vec<(usize, Option<Sharpness>)> = (0..8).map(|k| (0, sharpness(&disc(k, 4), SIZE))).collect();
        assert!(weights(&soft).iter().all(|weight| *weight > 0.9), "{soft:?}");
    }

    #[test]
    fn noise_is_no_detail() {
        let noisy = |k: u32, blur: u32, noise: f64| -> (usize, Option<Sharpness>) {
            // Even numbers whose sum is about normal.
            let mut state = k + 1;
            let mut random = || {
                state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                f64::from(state >> 8) / f64::from(1 << 24) - 0.5
            };
            let add = |[r, g, b, m]: [u8; 4]| {
                let by = noise * 2.0 * (random() + random() + random());
                let [r, g, b] = [r, g, b].map(|c| (f64::from(c) + by).round().clamp(0.0, 255.0) as u8);
                [r, g, b, m]
            };
            (0, sharpness(&disc(k, blur).into_iter().map(add).collect::<Vec<_>>(), SIZE))
        };
        let views = |noise| (0..12).map(|k| noisy(k, if k % 2 == 0 { 4 } else { 1 }, noise)).collect::<Vec<_>>();
        assert!(weights(&views(0.0)).iter().any(|weight| *weight < 0.3));
        // Blurred images have the same noise, and less else.
        assert_eq!(weights(&views(25.0)), [1.0; 12]);
    }

    #[test]
    fn exposure_does_not_matter_and_plain_skin_does_not_tell() {
        let sharp = disc(5, 1);
        let of = |pixels: &[[u8; 4]]| sharpness(pixels, SIZE).unwrap().detail;
        let darker: Vec<[u8; 4]> = sharp.iter().map(|[r, g, b, m]| [r / 2, g / 2, b / 2, *m]).collect();
        assert!((of(&darker) / of(&sharp) - 1.0).abs() < 0.1);
        let plain: Vec<[u8; 4]> = sharp.iter().map(|pixel| [150, 120, 100, pixel[3]]).collect();
        assert_eq!(sharpness(&plain, SIZE), None);
        let small: Vec<[u8; 4]> = sharp.iter().map(|[r, g, b, _]| [*r, *g, *b, 0]).collect();
        assert_eq!(sharpness(&small, SIZE), None);
        assert_eq!(weights(&[(0, None), (3, Some(Sharpness { detail: 0.4, noise: 0.0 }))]), [1.0, 1.0]);
    }
}
