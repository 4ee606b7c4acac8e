//! Ways to compare the picture with the truth, the image that a capture has of the same view.

use clap::ValueEnum;
use egui::{Color32, ColorImage};
use ghand_measure::metrics::quantize;
use ghand_render::viridis::viridis;

/// What is shown of picture and truth.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash, ValueEnum)]
pub enum Comparison {
    /// The picture alone
    #[default]
    Picture,
    /// The capture's image
    Truth,
    /// Picture on the left and truth on the right of a line that can be dragged
    Split,
    /// Picture and truth in turn, each for half a second
    Flicker,
    /// How far the colours of picture and truth are apart
    Difference,
}

impl Comparison {
    /// What it shows, one sentence.
    pub const fn summary(self) -> &'static str {
        match self {
            Comparison::Picture => "Shows the picture alone.",
            Comparison::Truth => "Shows the capture's image of this camera and frame.",
            Comparison::Split => "Shows the picture left and the capture's image right of a line that can be dragged.",
            Comparison::Flicker => "Shows the picture and the capture's image in turn, each for half a second.",
            Comparison::Difference => "Shows how far the colours of the picture and the capture's image are apart.",
        }
    }
}

/// The difference, display values, that has the last colour; larger ones share it. It is the same for all views, so that
/// they can be compared.
pub const LARGEST_DIFFERENCE: f64 = 0.25;

/// The mean absolute difference of red, green and blue in each pixel as colours, dark violet for none. Both pictures have
/// 8-bit display values and this size.
pub fn difference_image(size: [u32; 2], picture: &[[u8; 3]], truth: &[[u8; 4]]) -> ColorImage {
    let color = |(p, t): (&[u8; 3], &[u8; 4])| {
        let sum: f64 = p.iter().zip(t).map(|(p, t)| f64::from(p.abs_diff(*t))).sum();
        let [r, g, b] = quantize(viridis(sum / (3.0 * 255.0) / LARGEST_DIFFERENCE).as_vec3().to_array());
        Color32::from_rgb(r, g, b)
    };
    ColorImage::new(size.map(|edge| edge as usize), picture.iter().zip(truth).map(color).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn differences_are_coloured_by_their_mean_over_the_channels() {
        let truth = [[10, 20, 30, 0], [0, 0, 0, 255], [255, 255, 255, 255]];
        let image = difference_image([3, 1], &[[10, 20, 30], [0, 96, 0], [0, 0, 0]], &truth);
        let expected = [0.0, 32.0 / 255.0 / LARGEST_DIFFERENCE, 1.0].map(|value| {
            let [r, g, b] = viridis(value).to_array().map(|v| (v * 255.0).round() as u8);
            Color32::from_rgb(r, g, b)
        });
        assert_eq!(image.pixels, expected);
    }
}
