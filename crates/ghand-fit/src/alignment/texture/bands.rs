//! Images of the skin's contrast against its surroundings, in two bands. Light changes it far less than colours.

use ghand_capture::View;
use glam::DVec2;

use ghand_capture::mask::squared_distances;

use crate::alignment::blur::blurred;

/// A band of spatial frequencies.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Band {
    /// Spots of some 10 pixels: found from farther away.
    Coarse,
    /// Spots of some 3 pixels.
    Fine,
}

impl Band {
    fn filter(self) -> Filter {
        match self {
            Band::Coarse => Filter { blurs: [2.5, 10.0], step: 2, margin: 4.0 },
            Band::Fine => Filter { blurs: [0.8, 4.0], step: 1, margin: 2.5 },
        }
    }
}

/// How a band is made.
struct Filter {
    /// Standard deviations of the blurs whose difference it is, pixels.
    blurs: [f64; 2],
    /// Pixels per sample.
    step: usize,
    /// There are no values nearer than this to the mask's outline, pixels.
    margin: f64,
}

/// Steps per unit of contrast in which it is stored.
const STEPS: f64 = 8192.0;
/// Stored where there is no value.
const NONE: i16 = i16::MIN;
/// Contrast is relative to at least this brightness: in black nothing is seen.
const DARK: f32 = 0.02;

/// The contrast of an image, within the box of its mask.
#[derive(Debug, Clone)]
pub struct Contrast {
    /// Left column and top row of the box.
    origin: [usize; 2],
    coarse: Samples,
    fine: Samples,
}

/// One band, row-major.
#[derive(Debug, Clone)]
struct Samples {
    step: usize,
    size: [usize; 2],
    values: Vec<i16>,
}

impl Contrast {
    /// The contrast of a view; `None` if its mask is empty.
    pub fn of_view(view: &View) -> Option<Contrast> {
        let (width, height) = (view.width as usize, view.height as usize);
        let is_inside = |x: usize, y: usize| view.rgba[y * width + x][3] >= 128;
        let rows: Vec<usize> = (0..height).filter(|&y| (0..width).any(|x| is_inside(x, y))).collect();
        let columns: Vec<usize> = (0..width).filter(|&x| rows.iter().any(|&y| is_inside(x, y))).collect();
        let (left, right) = (*columns.first()?, columns.last()? + 1);
        let (top, bottom) = (*rows.first()?, rows.last()? + 1);
        let samples = |band: Band| {
            let filter = band.filter();
            let size = [right - left, bottom - top].map(|length| length.div_ceil(filter.step));
            // Sums over a sample's pixels within the mask, and their number.
            let mut light = vec![0.0; size[0] * size[1]];
            let mut mask = vec![0.0; size[0] * size[1]];
            for y in top..bottom {
                for x in left..right {
                    let [r, g, b, a] = view.rgba[y * width + x];
                    if a >= 128 {
                        let at = (y - top) / filter.step * size[0] + (x - left) / filter.step;
                        light[at] += (f32::from(r) + f32::from(g) + f32::from(b)) / 765.0;
                        mask[at] += 1.0;
                    }
                }
            }
            Samples::new(&filter, &light, &mask, size)
        };
        Some(Contrast { origin: [left, top], coarse: samples(Band::Coarse), fine: samples(Band::Fine) })
    }

    /// Contrast and its gradient (per pixel) at a point of the image, bilinear; `None` where there is none.
    pub fn at(&self, band: Band, pixel: DVec2) -> Option<(f64, DVec2)> {
        let samples = match band {
            Band::Coarse => &self.coarse,
            Band::Fine => &self.fine,
        };
        samples.at(pixel - DVec2::new(self.origin[0] as f64, self.origin[1] as f64))
    }
}

impl Samples {
    fn new(filter: &Filter, light: &[f32], mask: &[f32], size: [usize; 2]) -> Samples {
        let blurred = |values: &[f32]| filter.blurs.map(|blur| blurred(values, size, blur / filter.step as f64));
        let [near_light, far_light] = blurred(light);
        let [near_mask, far_mask] = blurred(mask);
        let outside = mask.iter().map(|covered| if *covered == 0.0 { 0.0 } else { f64::INFINITY }).collect();
        let to_outside = squared_distances(outside, size);
        let value = |i: usize| {
            let (x, y) = (i % size[0], i / size[0]);
            // Whatever is beyond the box is outside.
            let to_border = (x + 1).min(y + 1).min(size[0] - x).min(size[1] - y) as f64;
            if to_outside[i].sqrt().min(to_border) * (filter.step as f64) < filter.margin {
                return NONE;
            }
            let (near, far) = (near_light[i] / near_mask[i], far_light[i] / far_mask[i]);
            let contrast = f64::from((near - far) / far.max(DARK)) * STEPS;
            contrast.clamp(f64::from(-i16::MAX), f64::from(i16::MAX)) as i16
        };
        Samples { step: filter.step, size, values: (0..light.len()).map(value).collect() }
    }

    fn at(&self, place: DVec2) -> Option<(f64, DVec2)> {
        let step = self.step as f64;
        let local = place / step - 0.5;
        let [columns, rows] = self.size;
        if !(local.x >= 0.0 && local.y >= 0.0 && local.x < columns as f64 - 1.0 && local.y < rows as f64 - 1.0) {
            return None;
        }
        let (x, y) = (local.x as usize, local.y as usize);
        let (u, v) = (local.x - x as f64, local.y - y as f64);
        let corner = y * columns + x;
        let stored = [corner, corner + 1, corner + columns, corner + columns + 1].map(|i| self.values[i]);
        if stored.contains(&NONE) {
            return None;
        }
        let [a, b, c, d] = stored.map(|value| f64::from(value) / STEPS);
        let value = (a * (1.0 - u) + b * u) * (1.0 - v) + (c * (1.0 - u) + d * u) * v;
        let gradient = DVec2::new((b - a) * (1.0 - v) + (d - c) * v, (c - a) * (1.0 - u) + (d - b) * u);
        Some((value, gradient / step))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A disc of radius 40 with waves of some length on it, under some light.
    fn disc(length: f64, light: impl Fn(f64, f64) -> f64) -> View {
        let pixel = |i: usize| {
            let (x, y) = ((i % 100) as f64 + 0.5, (i / 100) as f64 + 0.5);
            let wave = 0.5 + 0.1 * (x * std::f64::consts::TAU / length).sin();
            let value = (255.0 * wave * light(x, y)).round() as u8;
            if (x - 50.0).hypot(y - 50.0) < 40.0 { [value, value, value, 255] } else { [90, 200, 10, 0] }
        };
        View { width: 100, height: 100, rgba: (0..10_000).map(pixel).collect() }
    }

    #[test]
    fn contrast_is_that_of_the_band_whatever_the_light_and_the_background() {
        for (length, band, least) in [(7.0, Band::Fine, 0.1), (20.0, Band::Coarse, 0.1)] {
            let even = Contrast::of_view(&disc(length, |_, _| 1.0)).unwrap();
            let shaded = Contrast::of_view(&disc(length, |x, y| 0.4 + 0.004 * (x + 0.5 * y))).unwrap();
            let (mut largest, mut worst): (f64, f64) = (0.0, 0.0);
            for y in 26..74 {
                for x in 26..74 {
                    let at = DVec2::new(f64::from(x) + 0.3, f64::from(y) + 0.6);
                    let [a, b] = [&even, &shaded].map(|image| image.at(band, at).unwrap().0);
                    (largest, worst) = (largest.max(a.abs()), worst.max((a - b).abs()));
                }
            }
            // 8-bit steps of dark pixels, and light that varies within the blur.
            assert!(largest > least && worst < 0.35 * largest, "{band:?}: {worst} of {largest}");
        }
        // What is much coarser is not in the band.
        let flat = Contrast::of_view(&disc(1e6, |_, _| 1.0)).unwrap();
        assert!(flat.at(Band::Fine, DVec2::splat(50.0)).unwrap().0.abs() < 1e-3);
        // Nothing at the mask's outline or outside.
        for outside in [DVec2::new(9.0, 50.0), DVec2::new(11.0, 50.0), DVec2::new(50.0, 89.0), DVec2::new(-5.0, 1e9)] {
            assert!(flat.at(Band::Fine, outside).is_none() && flat.at(Band::Coarse, outside).is_none());
        }
        assert!(Contrast::of_view(&View { width: 4, height: 4, rgba: vec![[9, 9, 9, 0]; 16] }).is_none());
    }

    #[test]
    fn gradients_are_those_of_the_contrast() {
        let contrast = Contrast::of_view(&disc(9.0, |x, _| 0.5 + 0.005 * x)).unwrap();
        for band in [Band::Coarse, Band::Fine] {
            for at in [DVec2::new(40.3, 51.8), DVec2::new(61.9, 33.1)] {
                let (_, gradient) = contrast.at(band, at).unwrap();
                for (axis, found) in [(DVec2::X, gradient.x), (DVec2::Y, gradient.y)] {
                    let value = |by: f64| contrast.at(band, at + by * axis).unwrap().0;
                    assert!(((value(1e-4) - value(-1e-4)) / 2e-4 - found).abs() < 1e-9);
                }
            }
        }
    }
}
