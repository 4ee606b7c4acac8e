//! Signed distance to the outline of a mask, with its gradient.

use ghand_capture::{Capture, CaptureError, SplitView};
use glam::DVec2;
use rayon::prelude::*;

/// Distances beyond this are cut off, pixels; the field has that margin around the mask.
const FARTHEST: f64 = 60.0;
/// Steps per pixel in which distances are stored.
const STEPS: f64 = 256.0;

/// Distances from a mask's outline, pixels: negative inside.
#[derive(Debug, Clone)]
pub struct DistanceField {
    /// Left column and top row of the field in the image.
    origin: [usize; 2],
    /// Columns and rows.
    size: [usize; 2],
    /// Row-major distances of pixel centres, in steps.
    values: Vec<i16>,
}

impl DistanceField {
    /// The fields of a capture's masks; `None` where the mask has no outline.
    ///
    /// # Errors
    /// [`CaptureError`] if a mask is unusable.
    pub fn of_views(capture: &Capture, views: &[SplitView]) -> Result<Vec<Option<DistanceField>>, CaptureError> {
        let field = |view: &SplitView| {
            let mask = capture.load_hand_mask(view.camera, view.frame)?;
            Ok(DistanceField::of_mask(&mask, capture.cameras[view.camera].width as usize))
        };
        views.par_iter().map(field).collect()
    }

    /// The field of a row-major mask; `None` if the mask is empty or covers the whole image.
    pub fn of_mask(mask: &[bool], width: usize) -> Option<DistanceField> {
        let height = mask.len().checked_div(width)?;
        let is_inside = |x: usize, y: usize| mask[y * width + x];
        let rows: Vec<usize> = (0..height).filter(|&y| (0..width).any(|x| is_inside(x, y))).collect();
        let columns: Vec<usize> = (0..width).filter(|&x| rows.iter().any(|&y| is_inside(x, y))).collect();
        if mask.iter().all(|inside| *inside) {
            return None;
        }
        let margin = FARTHEST as usize;
        let range = |used: &[usize], size: usize| {
            Some((used.first()?.saturating_sub(margin), (used.last()? + margin + 1).min(size)))
        };
        let ((left, right), (top, bottom)) = (range(&columns, width)?, range(&rows, height)?);
        let size = [right - left, bottom - top];
        let cropped: Vec<bool> = (top..bottom).flat_map(|y| (left..right).map(move |x| is_inside(x, y))).collect();
        let squared = |wanted: bool| {
            let start = cropped.iter().map(|inside| if *inside == wanted { 0.0 } else { f64::INFINITY }).collect();
            squared_distances(start, size)
        };
        let (to_inside, to_outside) = (squared(true), squared(false));
        // Centres of pixels are half a pixel from the outline between them.
        let value =
            |(inside, outside): (&f64, &f64)| if *outside > 0.0 { 0.5 - outside.sqrt() } else { inside.sqrt() - 0.5 };
        let values = to_inside.iter().zip(&to_outside).map(value);
        let values = values.map(|d| (d.clamp(-FARTHEST, FARTHEST) * STEPS) as i16).collect();
        Some(DistanceField { origin: [left, top], size, values })
    }

    /// Pixels of the mask.
    pub fn area(&self) -> usize {
        self.values.iter().filter(|value| **value < 0).count()
    }

    /// Intersection over union of the mask and another one of the same image, row-major.
    pub fn overlap(&self, other: &[bool], width: usize) -> f64 {
        let ([left, top], [columns, rows]) = (self.origin, self.size);
        let mut both = 0;
        for y in 0..rows {
            let start = (top + y) * width + left;
            let line = self.values[y * columns..(y + 1) * columns].iter().zip(&other[start..start + columns]);
            both += line.filter(|(value, other)| **value < 0 && **other).count();
        }
        let all = self.area() + other.iter().filter(|other| **other).count() - both;
        both as f64 / all.max(1) as f64
    }

    /// Distance (pixels) and its gradient at a point of the image, bilinear; `None` outside the field.
    pub fn at(&self, pixel: DVec2) -> Option<(f64, DVec2)> {
        let local = pixel - DVec2::new(self.origin[0] as f64, self.origin[1] as f64) - 0.5;
        let [columns, rows] = self.size;
        if !(local.x >= 0.0 && local.y >= 0.0 && local.x < columns as f64 - 1.0 && local.y < rows as f64 - 1.0) {
            return None;
        }
        let (x, y) = (local.x as usize, local.y as usize);
        let (u, v) = (local.x - x as f64, local.y - y as f64);
        let value = |x: usize, y: usize| f64::from(self.values[y * columns + x]) / STEPS;
        let [a, b, c, d] = [value(x, y), value(x + 1, y), value(x, y + 1), value(x + 1, y + 1)];
        let distance = (a * (1.0 - u) + b * u) * (1.0 - v) + (c * (1.0 - u) + d * u) * v;
        let gradient = DVec2::new((b - a) * (1.0 - v) + (d - c) * v, (c - a) * (1.0 - u) + (d - b) * u);
        Some((distance, gradient))
    }
}

/// Squared distances to the nearest pixel of value 0, exact, along columns and then rows (Felzenszwalb and Huttenlocher
/// 2012).
pub fn squared_distances(mut values: Vec<f64>, [columns, rows]: [usize; 2]) -> Vec<f64> {
    let mut envelope = Envelope::default();
    for x in 0..columns {
        let line: Vec<f64> = (0..rows).map(|y| values[y * columns + x]).collect();
        envelope.lower(&line, |y, d| values[y * columns + x] = d);
    }
    for row in values.chunks_exact_mut(columns) {
        let line = row.to_vec();
        envelope.lower(&line, |x, d| row[x] = d);
    }
    values
}

/// The lower envelope of parabolas.
#[derive(Default)]
struct Envelope {
    /// Each parabola's place and the place from which it is the lowest.
    parabolas: Vec<(usize, f64)>,
}

impl Envelope {
    /// Calls `set` with each place and the least of (place - q)^2 + line[q].
    fn lower(&mut self, line: &[f64], mut set: impl FnMut(usize, f64)) {
        self.parabolas.clear();
        for (q, value) in line.iter().enumerate().filter(|(_, value)| value.is_finite()) {
            let height = value + (q * q) as f64;
            let mut from = f64::NEG_INFINITY;
            while let Some(&(p, start)) = self.parabolas.last() {
                from = (height - line[p] - (p * p) as f64) / (2 * (q - p)) as f64;
                if from > start {
                    break;
                }
                self.parabolas.pop();
                from = f64::NEG_INFINITY;
            }
            self.parabolas.push((q, from));
        }
        let mut k = 0;
        for x in 0..line.len() {
            while self.parabolas.get(k + 1).is_some_and(|(_, from)| *from < x as f64) {
                k += 1;
            }
            let distance =
                self.parabolas.get(k).map_or(f64::INFINITY, |(p, _)| (x as f64 - *p as f64).powi(2) + line[*p]);
            set(x, distance);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_are_those_to_the_nearest_pixel_of_the_other_kind() {
        let (width, height) = (40, 30);
        let inside = |x: usize, y: usize| (5..20).contains(&x) && (8..12).contains(&y) || (x, y) == (30, 25);
        let mask: Vec<bool> = (0..height).flat_map(|y| (0..width).map(move |x| inside(x, y))).collect();
        let field = DistanceField::of_mask(&mask, width).unwrap();
        for y in 0..height - 1 {
            for x in 0..width - 1 {
                let own = inside(x, y);
                let others = (0..width * height).filter(|i| inside(i % width, i / width) != own);
                let nearest = others
                    .map(|i| ((i % width) as f64 - x as f64).hypot((i / width) as f64 - y as f64))
                    .fold(f64::INFINITY, f64::min);
                let expected = if own { 0.5 - nearest } else { nearest - 0.5 };
                let (found, _) = field.at(DVec2::new(x as f64 + 0.5, y as f64 + 0.5)).unwrap();
                assert!((found - expected).abs() < 0.005, "{x}, {y}: {found} against {expected}");
            }
        }
        // Left of the block the distance grows by one pixel per pixel to the left.
        let (distance, gradient) = field.at(DVec2::new(3.2, 10.0)).unwrap();
        assert!((distance - 1.8).abs() < 0.01 && (gradient - DVec2::NEG_X).length() < 0.01, "{distance} {gradient}");
        assert!(field.at(DVec2::new(-1.0, 3.0)).is_none());
        assert_eq!(field.overlap(&mask, width), 1.0);
        // Half of the block, and as much elsewhere.
        let other: Vec<bool> =
            (0..width * height).map(|i| (8..10).contains(&(i / width)) && (5..35).contains(&(i % width))).collect();
        assert!((field.overlap(&other, width) - 30.0 / 91.0).abs() < 1e-12);
        assert!(DistanceField::of_mask(&[true; 12], 4).is_none() && DistanceField::of_mask(&[false; 12], 4).is_none());
    }
}
