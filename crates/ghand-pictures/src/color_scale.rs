//! Colours of numbers on a hand, and their legend.

use ghand_core::statistics::quantile;
use ghand_render::viridis::viridis;
use glam::DVec3;
use image::{Rgb, RgbImage};

use crate::plot::{label, label_width};

/// From nothing to much, or from below zero to above.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Colors {
    /// Dark violet to yellow, from 0.
    Viridis,
    /// Blue through grey to orange, around 0.
    Diverging,
}

/// Ends and middle of the diverging colours: blue and vermilion are told apart with any colour vision.
const BELOW: DVec3 = DVec3::new(0.0, 0.32, 0.65);
const MIDDLE: DVec3 = DVec3::new(0.88, 0.88, 0.88);
const ABOVE: DVec3 = DVec3::new(0.82, 0.33, 0.0);
/// The part of the numbers that the colours tell apart. The largest, often single Gaussians, share the last colour.
const SHOWN: f64 = 0.995;
/// Limits, as multiples of a power of ten.
const STEPS: [f64; 8] = [1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0];
/// Colours of the legend and its text, and height of its letters, pixels.
const PAPER: [u8; 3] = [255; 3];
const INK: [u8; 3] = [40, 40, 46];
const LETTERS: f64 = 14.0;
/// Width of the legend's bar, and of its picture, pixels.
const BAR: u32 = 16;
const WIDTH: u32 = 84;

/// Colours of numbers with one unit.
#[derive(Debug, Clone, PartialEq)]
pub struct ColorScale {
    colors: Colors,
    /// The number with the last colour.
    pub limit: f64,
    /// Whether some numbers are larger.
    clamped: bool,
    unit: &'static str,
}

impl ColorScale {
    /// Colours for these numbers.
    pub fn new(colors: Colors, values: impl Iterator<Item = f64> + Clone, unit: &'static str) -> ColorScale {
        let sizes = values.map(f64::abs);
        let limit = round_up(quantile(sizes.clone().filter(|size| *size > 0.0), SHOWN), &STEPS);
        ColorScale { colors, limit, clamped: sizes.fold(0.0, f64::max) > limit, unit }
    }

    /// The colour of a number, display values.
    pub fn color(&self, value: f64) -> DVec3 {
        let t = value / self.limit;
        match self.colors {
            Colors::Viridis => viridis(t),
            Colors::Diverging => diverging(t),
        }
    }

    /// A bar of the colours with numbers, of this height, pixels.
    pub fn legend(&self, height: u32) -> RgbImage {
        let mut picture = RgbImage::from_pixel(WIDTH, height, Rgb(PAPER));
        let (top, bottom) = (34, height.saturating_sub(12).max(36));
        label(&mut picture, [6, 0], LETTERS, Rgb(INK), self.unit);
        let low = if self.colors == Colors::Viridis { 0.0 } else { -self.limit };
        for y in top..bottom {
            let t = f64::from(bottom - 1 - y) / f64::from(bottom - 1 - top);
            let color = self.color(low + t * (self.limit - low)).to_array().map(|v| (v * 255.0).round() as u8);
            (6..6 + BAR).for_each(|x| picture.put_pixel(x, y, Rgb(color)));
        }
        for part in 0..=4u32 {
            let value = low + f64::from(part) / 4.0 * (self.limit - low);
            let y = bottom - 1 - part * (bottom - 1 - top) / 4;
            (6 + BAR..10 + BAR).for_each(|x| picture.put_pixel(x, y, Rgb(INK)));
            let sign = match part {
                4 if self.clamped => "≥ ",
                0 if self.clamped && low < 0.0 => "≤ ",
                _ => "",
            };
            let text = format!("{sign}{}", short(value));
            label(&mut picture, [13 + BAR as i32, y as i32 - 11], LETTERS, Rgb(INK), &text);
            debug_assert!(label_width(LETTERS, &text) < WIDTH);
        }
        picture
    }
}

/// The diverging colour of a number from -1 to 1, display values; numbers beyond have the colours of the ends.
pub fn diverging(t: f64) -> DVec3 {
    MIDDLE.lerp(if t < 0.0 { BELOW } else { ABOVE }, t.abs().min(1.0))
}

/// The next larger one of some ascending numbers from 1 on and of 10, times a power of ten; 1 for what is hardly above 0.
pub fn round_up(value: f64, steps: &[f64]) -> f64 {
    if !(value.is_finite() && value > 1e-9) {
        return 1.0;
    }
    let power = 10f64.powf(value.log10().floor());
    steps.iter().copied().find(|step| step * power >= value * (1.0 - 1e-9)).unwrap_or(10.0) * power
}

/// A number with the three digits that it needs at most.
pub fn short(value: f64) -> String {
    if value == 0.0 {
        return "0".into();
    }
    let digits = (2 - value.abs().log10().floor() as i32).clamp(0, 12) as usize;
    let text = format!("{value:.digits$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn limits_and_labels_are_round_numbers() {
        assert_eq!(
            [0.9, 1.0, 1.2, 0.031, 47.0, 9.0, 0.0].map(|v| short(round_up(v, &STEPS))),
            ["1", "1", "1.5", "0.04", "50", "10", "1"]
        );
        assert_eq!([0.0, 0.375, -1.5, 1234.0, 2e-5].map(short), ["0", "0.375", "-1.5", "1234", "0.00002"]);
    }

    #[test]
    fn colours_go_both_ways_from_zero_and_stay_within_the_limit() {
        let scale = ColorScale::new(Colors::Diverging, [-0.2, 0.0, 0.1].into_iter(), "");
        assert_eq!((scale.limit, scale.clamped), (0.2, false));
        assert_eq!([scale.color(0.0), scale.color(-1.0), scale.color(0.2)], [MIDDLE, BELOW, ABOVE]);
        let many = (0..1000).map(|k| if k == 7 { 50.0 } else { 0.8 });
        let scale = ColorScale::new(Colors::Viridis, many, "mm");
        assert_eq!((scale.limit, scale.clamped), (0.8, true));
        assert_eq!(scale.color(50.0), viridis(1.0));
        assert_eq!(scale.legend(200).dimensions(), (WIDTH, 200));
    }
}
