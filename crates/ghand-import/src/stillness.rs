//! Whether a camera stands still: how far what is behind the hand shifts in its images.

use glam::DVec2;

use crate::rig::LANDMARKS;

/// Columns that images are reduced to.
const COLUMNS: usize = 160;
/// Half the width of a patch, and how far it is searched, reduced pixels.
const HALF: usize = 5;
const REACH: i64 = 8;
/// Distance between patches, reduced pixels.
const STEP: usize = 12;
/// Least standard deviation of a patch that can be found again, levels of 255.
const LEAST_CONTRAST: f64 = 8.0;
/// A patch is found where its squared difference is below this part of its variance.
const MOST_DIFFERENCE: f64 = 0.3;
/// Fewer patches tell nothing.
const LEAST_PATCHES: usize = 6;
/// This part of them shifts alike if the camera moves: others are on something that moves itself.
const LEAST_AGREEING: f64 = 0.6;
/// How far shifts may differ then, reduced pixels.
const ALIKE: f64 = 1.0;
/// Patches keep this distance from a hand, relative to its size.
const AROUND_HAND: f64 = 0.5;

/// A reduced image, and where hands are in it: first and last corner.
struct Reduced {
    columns: usize,
    rows: usize,
    grey: Vec<f64>,
    hands: Vec<[DVec2; 2]>,
}

/// Follows the shift of a camera's images.
#[derive(Default)]
pub struct Stillness {
    last: Option<Reduced>,
    shift: DVec2,
    largest: f64,
}

impl Stillness {
    /// Looks at an image (red, green and blue, row by row) in which these hands are (pixels).
    pub fn add(&mut self, rgb: &[u8], width: usize, height: usize, hands: &[[DVec2; LANDMARKS]]) {
        let Some(now) = Reduced::of(rgb, width, height, hands) else { return };
        if let Some(shift) = self.last.as_ref().and_then(|last| shift(last, &now)) {
            self.shift += shift;
            self.largest = self.largest.max(self.shift.length());
        }
        self.last = Some(now);
    }

    /// How far images shifted from the first one at most, relative to their width.
    pub fn largest_shift(&self) -> f64 {
        self.largest / COLUMNS as f64
    }
}

impl Reduced {
    fn of(rgb: &[u8], width: usize, height: usize, hands: &[[DVec2; LANDMARKS]]) -> Option<Reduced> {
        let scale = width as f64 / COLUMNS as f64;
        let (columns, rows) = (COLUMNS.min(width), (height as f64 / scale.max(1.0)) as usize);
        let scale = scale.max(1.0);
        let mut grey = vec![0.0; columns * rows];
        for (row, line) in grey.chunks_exact_mut(columns.max(1)).enumerate() {
            for (column, value) in line.iter_mut().enumerate() {
                let [x0, x1] = [column, column + 1].map(|x| (x as f64 * scale) as usize);
                let [y0, y1] = [row, row + 1].map(|y| (y as f64 * scale) as usize);
                let mut sum = 0u64;
                for y in y0..y1 {
                    let pixels = rgb.get(3 * (y * width + x0)..3 * (y * width + x1))?;
                    sum += pixels.iter().map(|level| u64::from(*level)).sum::<u64>();
                }
                *value = sum as f64 / (3 * (x1 - x0) * (y1 - y0)).max(1) as f64;
            }
        }
        let around = |points: &[DVec2; LANDMARKS]| {
            let least = points.iter().copied().fold(DVec2::INFINITY, DVec2::min) / scale;
            let most = points.iter().copied().fold(DVec2::NEG_INFINITY, DVec2::max) / scale;
            let margin = DVec2::splat(AROUND_HAND * (most - least).max_element() + (HALF as f64));
            [least - margin, most + margin]
        };
        Some(Reduced { columns, rows, grey, hands: hands.iter().map(around).collect() })
    }

    fn patch(&self, x: i64, y: i64) -> Option<impl Iterator<Item = f64> + '_> {
        let half = HALF as i64;
        let fits = x >= half && y >= half && x + half < self.columns as i64 && y + half < self.rows as i64;
        fits.then(|| {
            (y - half..=y + half).flat_map(move |y| {
                let start = y as usize * self.columns + (x - half) as usize;
                self.grey[start..=start + 2 * HALF].iter().copied()
            })
        })
    }

    fn is_at_hand(&self, x: i64, y: i64) -> bool {
        let at = DVec2::new(x as f64, y as f64);
        self.hands.iter().any(|[least, most]| at.cmpge(*least).all() && at.cmple(*most).all())
    }

    /// The squared difference of two patches, without that of their means: light may change.
    fn difference(&self, other: &Reduced, from: [i64; 2], to: [i64; 2]) -> Option<f64> {
        let count = ((2 * HALF + 1) * (2 * HALF + 1)) as f64;
        let pairs = self.patch(from[0], from[1])?.zip(other.patch(to[0], to[1])?);
        let (sum, squares) = pairs.fold((0.0, 0.0), |(sum, squares), (a, b)| (sum + a - b, squares + (a - b).powi(2)));
        Some(squares / count - (sum / count).powi(2))
    }
}

/// By how many reduced pixels most patches shift alike; `None` if too few can be found again, or they differ.
fn shift(last: &Reduced, now: &Reduced) -> Option<DVec2> {
    let mut shifts = vec![];
    for y in (HALF..last.rows).step_by(STEP) {
        for x in (HALF..last.columns).step_by(STEP) {
            let from = [x as i64, y as i64];
            if !last.is_at_hand(from[0], from[1]) && !now.is_at_hand(from[0], from[1]) {
                shifts.extend(shift_of_patch(last, now, from));
            }
        }
    }
    if shifts.len() < LEAST_PATCHES {
        return None;
    }
    let middle = |of: fn(&DVec2) -> f64| {
        let mut values: Vec<f64> = shifts.iter().map(of).collect();
        values.sort_by(f64::total_cmp);
        values[values.len() / 2]
    };
    let median = DVec2::new(middle(|shift| shift.x), middle(|shift| shift.y));
    let alike = shifts.iter().filter(|shift| shift.distance(median) < ALIKE).count();
    (alike as f64 >= LEAST_AGREEING * shifts.len() as f64).then_some(median)
}

fn shift_of_patch(last: &Reduced, now: &Reduced, from: [i64; 2]) -> Option<DVec2> {
    let count = ((2 * HALF + 1) * (2 * HALF + 1)) as f64;
    let (sum, squares) = last.patch(from[0], from[1])?.fold((0.0, 0.0), |(s, q), value| (s + value, q + value * value));
    let variance = squares / count - (sum / count).powi(2);
    if variance < LEAST_CONTRAST.powi(2) {
        return None;
    }
    let at = |dx: i64, dy: i64| last.difference(now, from, [from[0] + dx, from[1] + dy]);
    let mut best = (f64::INFINITY, [0, 0]);
    for dy in -REACH..=REACH {
        for dx in -REACH..=REACH {
            if let Some(difference) = at(dx, dy).filter(|difference| *difference < best.0) {
                best = (difference, [dx, dy]);
            }
        }
    }
    let [dx, dy] = best.1;
    if best.0 > MOST_DIFFERENCE * variance {
        return None;
    }
    // The lowest point of the parabola through three differences.
    let part = |before: Option<f64>, after: Option<f64>| match (before, after) {
        (Some(a), Some(b)) if a + b > 2.0 * best.0 => (0.5 * (a - b) / (a + b - 2.0 * best.0)).clamp(-0.5, 0.5),
        _ => 0.0,
    };
    Some(DVec2::new(dx as f64 + part(at(dx - 1, dy), at(dx + 1, dy)), dy as f64 + part(at(dx, dy - 1), at(dx, dy + 1))))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A picture of blots, seen from `shift` pixels further right and down, before which a hand moves.
    fn picture(shift: DVec2, hand: DVec2) -> Vec<u8> {
        let mut rgb = vec![];
        for y in 0..240 {
            for x in 0..320 {
                let at = DVec2::new(f64::from(x), f64::from(y));
                let seen = at + shift;
                let blots = 90.0 * (0.11 * seen.x).sin() * (0.13 * seen.y + 0.02 * seen.x).cos();
                let level =
                    if at.distance(hand) < 40.0 { 200.0 + 40.0 * (0.3 * (at - hand).x).sin() } else { 128.0 + blots };
                rgb.extend([level as u8; 3]);
            }
        }
        rgb
    }

    fn largest(shift: impl Fn(f64) -> DVec2) -> f64 {
        let mut stillness = Stillness::default();
        for k in 0..20 {
            let hand = DVec2::new(100.0 + 6.0 * f64::from(k), 120.0);
            let mut points = [hand; LANDMARKS];
            points[0] -= 40.0;
            points[12] += 40.0;
            stillness.add(&picture(shift(f64::from(k)), hand), 320, 240, &[points]);
        }
        stillness.largest_shift()
    }

    #[test]
    fn a_camera_that_moves_is_told_from_one_that_stands_still() {
        let still = largest(|_| DVec2::ZERO);
        let moving = largest(|k| DVec2::new(3.0 * k, 0.0));
        println!("{still:.4} still, {moving:.4} moving");
        assert!(still < 0.005);
        assert!((moving - 57.0 / 320.0).abs() < 0.02);
        // Too small, or no image.
        Stillness::default().add(&[0; 10], 320, 240, &[]);
        Stillness::default().add(&[0; 12], 2, 2, &[]);
    }
}
