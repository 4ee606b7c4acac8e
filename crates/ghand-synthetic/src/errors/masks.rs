//! Errors of masks as a segmentation makes them: an outline that is a little off, and sometimes a missing bite.

use ghand_capture::mask::depths;
use glam::DVec3;

use crate::noise::{lattice, noise};

/// Pixels over which the error of the outline is about the same.
const CORRELATION: f64 = 15.0;
/// Standard deviation of [`noise`] in a plane of its lattice: numbers even in `[-1, 1]` (1/3) under smoothstep weights
/// in two directions (26/35 each).
const NOISE_DEVIATION: f64 = 0.4289;
/// The part of the masks with a bite, and its radius in standard deviations of the outline.
const BITTEN: f64 = 1.0 / 8.0;
const BITE_RADIUS: f64 = 4.0;

/// Errors of the masks of a capture.
pub(crate) struct MaskErrors {
    /// Standard deviation of the outline's distance from the true one, pixels.
    pub pixels: f64,
    pub seed: u64,
}

impl MaskErrors {
    /// A row-major mask with the errors of an image.
    pub(crate) fn of(&self, mask: &[bool], width: usize, camera: usize, frame: usize) -> Vec<bool> {
        if self.pixels == 0.0 || width == 0 {
            return mask.to_vec();
        }
        let drawn = |k: i64| lattice(camera as i64, frame as i64, k, self.seed ^ 0x3A5C);
        // Each image has its own field, far from all others.
        let field_seed = (drawn(0) * 1e15) as u64;
        // The field is hardly ever greater than this.
        let reach = (3.5 * self.pixels).ceil() + 1.0;
        let distances = signed_distances(mask, width, reach);
        let mut bad: Vec<bool> = (distances.iter().enumerate())
            .map(|(i, distance)| *distance < self.pixels * field([(i % width) as f64, (i / width) as f64], field_seed))
            .collect();
        if drawn(1) < BITTEN {
            // The outline of the true mask is half a pixel outside of these.
            let rim: Vec<usize> = (0..mask.len()).filter(|&i| distances[i] == -0.5).collect();
            if let Some(&center) = rim.get((drawn(2) * rim.len() as f64) as usize) {
                let radius = BITE_RADIUS * self.pixels;
                let away = |i: usize| {
                    let [dx, dy] = [i % width, i / width].map(|v| v as f64);
                    (dx - (center % width) as f64).hypot(dy - (center / width) as f64)
                };
                bad.iter_mut().enumerate().filter(|(i, _)| away(*i) <= radius).for_each(|(_, inside)| *inside = false);
            }
        }
        bad
    }
}

/// A smooth random field of standard deviation 1 at a pixel.
fn field([x, y]: [f64; 2], seed: u64) -> f64 {
    // Noise varies least between the points of its lattice; four lattices between each other vary alike everywhere.
    let shifts = [[0.0, 0.0], [0.5, 0.0], [0.0, 0.5], [0.5, 0.5]];
    let sum: f64 = (shifts.into_iter().zip(0..))
        .map(|([u, v], k)| noise(DVec3::new(x + u * CORRELATION, y + v * CORRELATION, 0.0), CORRELATION, seed + k))
        .sum();
    sum / (2.0 * NOISE_DEVIATION)
}

/// Distances of pixels from the outline, pixels: negative inside, and at most `reach` on both sides.
fn signed_distances(mask: &[bool], width: usize, reach: f64) -> Vec<f64> {
    let size = [width as u32, (mask.len() / width) as u32];
    let inside = depths(mask.iter().copied(), size);
    let outside = depths(mask.iter().map(|inside| !inside), size);
    let distance =
        |(inside, outside): (&f64, &f64)| if *inside > 0.0 { -inside.min(reach) } else { outside.min(reach) };
    inside.iter().zip(&outside).map(distance).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: usize = 160;

    /// A disc of radius 50 pixels.
    fn disc() -> Vec<bool> {
        let away = |i: usize| (i % SIZE) as f64 - 80.0;
        (0..SIZE * SIZE).map(|i| away(i).hypot((i / SIZE) as f64 - 80.0) < 50.0).collect()
    }

    #[test]
    fn outlines_move_by_the_given_amount_and_neighbours_alike() {
        let mask = disc();
        let errors = MaskErrors { pixels: 2.0, seed: 5 };
        let mut squares = 0.0_f64;
        let mut apart = 0.0_f64;
        let mut alike = 0.0;
        let mut count = 0.0;
        let mut bites = 0;
        for frame in 0..80 {
            let bad = errors.of(&mask, SIZE, 3, frame);
            assert!(bad == errors.of(&mask, SIZE, 3, frame) && bad != errors.of(&mask, SIZE, 4, frame));
            // The radius of the disc along 120 directions.
            let radii: Vec<f64> = (0..120)
                .map(|k| {
                    let (sin, cos) = (f64::from(k) * std::f64::consts::TAU / 120.0).sin_cos();
                    let inside =
                        |r: f64| bad[(80.0 + r * sin).round() as usize * SIZE + (80.0 + r * cos).round() as usize];
                    (0..290).map(|k| f64::from(k) * 0.25).find(|r| !inside(*r)).unwrap() - 50.0
                })
                .collect();
            if radii.iter().any(|r| *r < -7.5) {
                bites += 1;
                continue;
            }
            for (k, r) in radii.iter().enumerate() {
                squares += r * r;
                // 2.6 pixels along the outline, and 52.
                alike += r * radii[(k + 1) % 120];
                apart += r * radii[(k + 20) % 120];
                count += 1.0;
            }
        }
        // The disc's own pixels add 0.3.
        let deviation: f64 = (squares / count).sqrt();
        assert!((1.7..2.3).contains(&deviation), "{deviation} pixels");
        assert!(alike / squares > 0.8 && (apart / squares).abs() < 0.2, "{} {}", alike / squares, apart / squares);
        assert!((4..=18).contains(&bites), "{bites} of 80 have a bite");
    }

    #[test]
    fn a_bite_is_a_disc_on_the_outline_and_no_error_is_no_change() {
        let mask = disc();
        assert!(MaskErrors { pixels: 0.0, seed: 5 }.of(&mask, SIZE, 1, 2) == mask);
        let empty = vec![false; SIZE * SIZE];
        assert!((0..40).all(|frame| MaskErrors { pixels: 3.0, seed: 5 }.of(&empty, SIZE, 1, frame) == empty));
        // Half a disc of radius 12 is missing in those with a bite; the outline itself moves by less than 9 or so.
        let missing = |frame: usize| {
            let bad = MaskErrors { pixels: 3.0, seed: 5 }.of(&mask, SIZE, 1, frame);
            let deep = |i: usize| ((i % SIZE) as f64 - 80.0).hypot((i / SIZE) as f64 - 80.0) < 40.0;
            (0..mask.len()).filter(|&i| deep(i) && !bad[i]).count()
        };
        let bites = (0..80).filter(|frame| missing(*frame) > 15).count();
        assert!((4..=18).contains(&bites), "{bites} of 80 have a bite");
    }

    #[test]
    fn distances_are_those_to_the_outline_between_pixels() {
        let mask: Vec<bool> = (0..100).map(|i| i % 10 >= 5).collect();
        let distances = signed_distances(&mask, 10, 3.0);
        // Beyond three pixels it is only known to be farther.
        assert_eq!(distances[20..30], [3.0, 3.0, 2.5, 1.5, 0.5, -0.5, -1.5, -2.5, -3.0, -3.0]);
    }
}
