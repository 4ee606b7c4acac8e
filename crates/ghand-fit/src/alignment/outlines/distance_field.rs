//! Signed distance to the outline of a mask, with its gradient.

use ghand_capture::mask::squared_distances;
use ghand_hand_model::surface::arm_end::ArmEndInImage;
use glam::DVec2;

/// Distances beyond this are cut off, pixels; the field has that margin around the mask.
const FARTHEST: f64 = 60.0;
/// Steps per pixel in which distances are stored.
const STEPS: f64 = 256.0;

/// Distances from a mask's outline, pixels of the field: negative inside.
#[derive(Debug, Clone)]
pub struct DistanceField {
    /// Pixels of the image's side per pixel of the field's, more than 1 if the field is of a smaller image.
    pub image_pixels: f64,
    /// Left column and top row of the field in the image.
    origin: [usize; 2],
    /// Columns and rows.
    size: [usize; 2],
    /// Row-major distances of pixel centres, in steps.
    values: Vec<i16>,
}

impl DistanceField {
    /// The field of a row-major mask in an image that is smaller by a whole number, `by`: partial pixels at the right and below
    /// are dropped. Distances are those from the mask as it is. `None` if the mask is empty or covers the whole image.
    pub fn of_mask(mask: &[bool], width: usize, by: usize) -> Option<DistanceField> {
        let height = mask.len().checked_div(width)?;
        let is_inside = |x: usize, y: usize| mask[y * width + x];
        let rows: Vec<usize> = (0..height).filter(|&y| (0..width).any(|x| is_inside(x, y))).collect();
        let columns: Vec<usize> = (0..width).filter(|&x| rows.iter().any(|&y| is_inside(x, y))).collect();
        if mask.iter().all(|inside| *inside) {
            return None;
        }
        let margin = FARTHEST as usize;
        // In pixels of the smaller image.
        let range = |used: &[usize], size: usize| {
            let end = (used.last()? / by + margin + 1).min(size / by);
            Some(((used.first()? / by).saturating_sub(margin), end)).filter(|(start, end)| start < end)
        };
        let (left, right) = range(&columns, width)?;
        let (top, bottom) = range(&rows, height)?;
        let size = [right - left, bottom - top];
        let full = size.map(|pixels| by * pixels);
        let cropped: Vec<bool> =
            (by * top..by * bottom).flat_map(|y| (by * left..by * right).map(move |x| is_inside(x, y))).collect();
        let squared = |wanted: bool| {
            let start = cropped.iter().map(|inside| if *inside == wanted { 0.0 } else { f64::INFINITY }).collect();
            squared_distances(start, full)
        };
        let (to_inside, to_outside) = (squared(true), squared(false));
        // Centres of pixels are half a pixel from the outline between them.
        let value =
            |(inside, outside): (&f64, &f64)| if *outside > 0.0 { 0.5 - outside.sqrt() } else { inside.sqrt() - 0.5 };
        let limit = FARTHEST * by as f64;
        let exact: Vec<f64> =
            to_inside.iter().zip(&to_outside).map(value).map(|distance| distance.clamp(-limit, limit)).collect();
        let mean = |i: usize| {
            let (x, y) = (by * (i % size[0]), by * (i / size[0]));
            let sum: f64 = (y..y + by).flat_map(|y| &exact[y * full[0] + x..][..by]).sum();
            sum / (by * by) as f64
        };
        let values = (0..size[0] * size[1]).map(|i| (mean(i) / by as f64 * STEPS) as i16).collect();
        Some(DistanceField { image_pixels: by as f64, origin: [left, top], size, values })
    }

    /// Pixels of the mask.
    pub fn area(&self) -> usize {
        self.values.iter().filter(|value| **value < 0).count()
    }

    /// Intersection over union of the mask and another one of the same image, row-major, on the hand's side of the
    /// template's end.
    pub fn overlap(&self, other: &[bool], width: usize, arm_end: Option<ArmEndInImage>) -> f64 {
        let [left, top] = self.origin;
        let [columns, rows] = self.size;
        let is_hand_side = |x: usize, y: usize| {
            arm_end.is_none_or(|end| end.beyond(DVec2::new(x as f64 + 0.5, y as f64 + 0.5)) <= 0.0)
        };
        let mut both = 0;
        let mut all = 0;
        for (y, line) in other.chunks_exact(width.max(1)).enumerate() {
            for (x, other) in line.iter().enumerate() {
                let local = [x.wrapping_sub(left), y.wrapping_sub(top)];
                let own = local[0] < columns && local[1] < rows && self.values[local[1] * columns + local[0]] < 0;
                if (own || *other) && is_hand_side(x, y) {
                    both += usize::from(own && *other);
                    all += 1;
                }
            }
        }
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_are_those_to_the_nearest_pixel_of_the_other_kind() {
        let (width, height) = (40, 30);
        let inside = |x: usize, y: usize| (5..20).contains(&x) && (8..12).contains(&y) || (x, y) == (30, 25);
        let mask: Vec<bool> = (0..height).flat_map(|y| (0..width).map(move |x| inside(x, y))).collect();
        let field = DistanceField::of_mask(&mask, width, 1).unwrap();
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
        assert_eq!(field.overlap(&mask, width, None), 1.0);
        // Half of the block, and as much elsewhere.
        let other: Vec<bool> =
            (0..width * height).map(|i| (8..10).contains(&(i / width)) && (5..35).contains(&(i % width))).collect();
        assert!((field.overlap(&other, width, None) - 30.0 / 91.0).abs() < 1e-12);
        assert!(
            DistanceField::of_mask(&[true; 12], 4, 1).is_none() && DistanceField::of_mask(&[false; 12], 4, 1).is_none()
        );
    }
    #[test]
    fn fields_of_smaller_images_keep_the_outline_of_the_mask() {
        // A disc whose radius and place are no multiples of the smaller image's pixels.
        let (size, by, centre, radius) = (300, 4, DVec2::new(151.3, 140.7), 90.6);
        let at = |i: usize| DVec2::new((i % size) as f64 + 0.5, (i / size) as f64 + 0.5);
        let mask: Vec<bool> = (0..size * size).map(|i| at(i).distance(centre) < radius).collect();
        let field = DistanceField::of_mask(&mask, size, by).unwrap();
        let small = by as f64;
        let mut worst = 0.0_f64;
        for k in 0..360 {
            let away = DVec2::from_angle(f64::from(k).to_radians());
            for from_outline in [-8.0, -2.0, 0.0, 2.0, 8.0] {
                let (distance, slope) = field.at((centre + (radius + from_outline) * away) / small).unwrap();
                worst = worst.max((small * distance - from_outline).abs());
                assert!(slope.dot(away) > 0.85, "{slope} {away}");
            }
        }
        println!("worst {worst:.3} pixels");
        assert!(worst < 0.6, "{worst}");
        let area = field.area() as f64 * field.image_pixels.powi(2);
        assert!((area / (std::f64::consts::PI * radius.powi(2)) - 1.0).abs() < 0.01, "{area}");
        // Images that are no multiple: what remains at the right and below is no part of it.
        assert!(DistanceField::of_mask(&mask[..299 * 300], 300, 8).unwrap().at(DVec2::new(36.6, 36.6)).is_none());
        assert!(DistanceField::of_mask(&[true, false], 2, 4).is_none());
    }
}
