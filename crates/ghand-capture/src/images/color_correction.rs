//! What makes the colours of a capture's images those of one camera.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

/// An affine map of display values 0..1: rows red, green, blue; columns red, green, blue, 1.
pub type ColorMap = [[f64; 4]; 3];

/// The map that changes nothing.
pub const IDENTITY: ColorMap = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];

/// Applies a map to display values 0..1. The result may be outside.
pub fn mapped(map: &ColorMap, color: [f64; 3]) -> [f64; 3] {
    map.map(|[r, g, b, one]| r * color[0] + g * color[1] + b * color[2] + one)
}

/// Corrections of the images of a capture, on display values. Empty: none.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct ColorCorrection {
    /// The map of a camera, by its index: exposure and white balance.
    pub cameras: BTreeMap<usize, ColorMap>,
}

impl ColorCorrection {
    /// Whether nothing is corrected.
    pub fn is_empty(&self) -> bool {
        self.cameras.is_empty()
    }

    /// A display value 0..1 of an image of a camera, corrected; it may be outside 0..1.
    pub fn corrected(&self, camera: usize, color: [f64; 3]) -> [f64; 3] {
        mapped(self.cameras.get(&camera).unwrap_or(&IDENTITY), color)
    }

    /// Corrects the colours of an image, except pixels of exactly the colour `behind`: nothing was photographed there.
    pub(crate) fn apply(&self, camera: usize, behind: [u8; 3], rgba: &mut [[u8; 4]]) {
        if !self.cameras.contains_key(&camera) {
            return;
        }
        for pixel in rgba.iter_mut().filter(|pixel| pixel[..3] != behind) {
            let color = [0, 1, 2].map(|c| f64::from(pixel[c]) / 255.0);
            let corrected = self.corrected(camera, color);
            for (slot, value) in pixel.iter_mut().zip(corrected) {
                *slot = (255.0 * value).round().clamp(0.0, 255.0) as u8;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_images_of_a_corrected_camera_change_and_no_background() {
        let mut swap = IDENTITY;
        swap.swap(0, 2);
        let correction = ColorCorrection { cameras: [(1, swap)].into() };
        let image = [[10, 20, 30, 255], [7, 7, 7, 0], [200, 0, 0, 255]];
        let corrected = |camera| {
            let mut pixels = image;
            correction.apply(camera, [7; 3], &mut pixels);
            pixels
        };
        assert_eq!(corrected(0), image);
        assert_eq!(corrected(1), [[30, 20, 10, 255], [7, 7, 7, 0], [0, 0, 200, 255]]);
        assert!(!correction.is_empty() && ColorCorrection::default().is_empty());
    }
}
