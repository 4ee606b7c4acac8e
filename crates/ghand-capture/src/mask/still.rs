//! What a camera sees where the hand is not: the median of its pixels over the frames.

use rayon::prelude::*;

/// A pixel that is free of the hand in fewer frames than this has no median.
const LEAST_FRAMES: usize = 5;
/// Standard deviation of a camera's noise, display values, that no pixel is below.
const LEAST_NOISE: f64 = 3.0;
/// Standard deviation of a normal distribution in its median absolute deviations.
const DEVIATION: f64 = 1.4826;
/// Where a pixel varies more than this (display values) while the hand is elsewhere, nothing stands still.
const MOST_NOISE: f64 = 40.0;
/// Parts of a pixel without the hand: as in the median, in the hand's shadow, and anything else.
const STILL: f64 = 0.6;
const SHADOW: f64 = 0.25;
/// The darkest shadow, relative to the light.
const DARKEST: f64 = 0.35;

/// The still scene of a camera.
#[derive(Debug, Clone)]
pub(super) struct Still {
    /// By pixel: the median and the standard deviation of the noise; `None` where that is unknown.
    pixels: Vec<Option<([u8; 3], f32)>>,
}

impl Still {
    /// The scene of frames of one size, in which alpha is 255 where neither hand nor arm can be.
    pub fn of(frames: Vec<&[[u8; 4]]>) -> Still {
        let count = frames.iter().map(|frame| frame.len()).max().unwrap_or(0);
        let pixel = |i: usize| {
            let seen = || frames.iter().filter_map(|frame| frame.get(i)).filter(|pixel| pixel[3] == 255);
            if seen().count() < LEAST_FRAMES {
                return None;
            }
            let middle = [0, 1, 2].map(|c| median(seen().map(|pixel| pixel[c]).collect()));
            let off = |pixel: &[u8; 4]| (0..3).map(|c| u16::from(pixel[c].abs_diff(middle[c]))).sum::<u16>();
            let noise = DEVIATION * f64::from(median(seen().map(|pixel| (off(pixel) / 3) as u8).collect()));
            (noise <= MOST_NOISE).then_some((middle, noise.max(LEAST_NOISE) as f32))
        };
        Still { pixels: (0..count).into_par_iter().map(pixel).collect() }
    }

    /// Probability of a colour at a pixel without the hand, given that of the colour anywhere there.
    pub fn probability(&self, pixel: usize, rgb: [u8; 3], anywhere: f64) -> f64 {
        let Some(Some((middle, noise))) = self.pixels.get(pixel) else { return anywhere };
        let seen = rgb.map(f64::from);
        let still = middle.map(f64::from);
        let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
        let squared = |a: [f64; 3], factor: f64, b: [f64; 3]| {
            (0..3).map(|c| (a[c] - factor * b[c]).powi(2)).sum::<f64>() / f64::from(*noise).powi(2)
        };
        // Densities over the colours: normal in three dimensions, and normal around the segment of darker colours.
        let unit = (std::f64::consts::TAU).sqrt() * f64::from(*noise);
        let as_median = (-0.5 * squared(seen, 1.0, still)).exp() / unit.powi(3);
        let length = dot(still, still).sqrt().max(1.0);
        let factor = (dot(seen, still) / (length * length)).clamp(DARKEST, 1.0);
        let segment = ((1.0 - DARKEST) * length).max(unit);
        let shaded = (-0.5 * squared(seen, factor, still)).exp() / (unit.powi(2) * segment);
        STILL * as_median + SHADOW * shaded + (1.0 - STILL - SHADOW) * anywhere
    }
}

fn median(mut values: Vec<u8>) -> u8 {
    let middle = values.len() / 2;
    *values.select_nth_unstable(middle).1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_scene_is_known_where_the_hand_was_elsewhere_often_enough() {
        // Two pixels: the hand covers the second one in all but four of ten frames.
        let frames: Vec<Vec<[u8; 4]>> = (0..10u8)
            .map(|k| vec![[100 + k % 3, 80, 60, 255], if k < 4 { [10, 20, 30, 255] } else { [200, 150, 120, 0] }])
            .collect();
        let still = Still::of(frames.iter().map(Vec::as_slice).collect());
        let anywhere = 1e-6;
        let at = |pixel, rgb| still.probability(pixel, rgb, anywhere);
        assert_eq!(at(1, [10, 20, 30]), anywhere);
        let [same, shaded, other] = [[101, 80, 60], [70, 56, 42], [70, 90, 42]].map(|rgb| at(0, rgb));
        assert!(same > 10.0 * shaded && shaded > 2.0 * other && other < anywhere, "{same} {shaded} {other}");
    }
}
