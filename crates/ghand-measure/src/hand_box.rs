//! Images as the evaluation of HandAvatar (Chen et al., CVPR 2023) takes them: a square around the hand, scaled to one
//! size, on black.

use ghand_core::Camera;
use glam::DVec2;
use image::imageops::{FilterType, resize};
use image::{Rgba, RgbaImage};

/// Width and height of the scaled square, pixels.
pub const SIDE: u32 = 256;
/// Side of the square relative to that of the mask's box.
const MARGIN: f64 = 1.3;

/// A scaled square of an image.
#[derive(Debug, Clone)]
pub struct HandBox {
    /// The camera that takes it.
    pub camera: Camera,
    /// Red, green, blue, mask; `SIDE` x `SIDE`. Black outside the mask.
    pub rgba: Vec<[u8; 4]>,
}

impl HandBox {
    /// The square around the mask of an image (red, green, blue, mask); `None` if the mask is empty. Parts of the square
    /// outside the image are black.
    pub fn of(camera: &Camera, rgba: &[[u8; 4]]) -> Option<HandBox> {
        let square = Square::around_mask(rgba, camera.width)?;
        let size = [camera.width, camera.height];
        let scale = square.scale();
        let camera = Camera {
            width: SIDE,
            height: SIDE,
            focal: camera.focal * scale,
            principal: (camera.principal - square.corner) * scale,
            ..camera.clone()
        };
        let masked: Vec<[u8; 4]> =
            (rgba.iter()).map(|&[r, g, b, mask]| if mask >= 128 { [r, g, b, 255] } else { [0; 4] }).collect();
        let scaled = square.scaled(&masked, size, [0; 4]);
        Some(HandBox { rgba: scaled, camera })
    }
}

/// A square of an image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Square {
    /// Its top left corner in the image, pixels; may be outside.
    pub corner: DVec2,
    /// Its side, pixels.
    pub side: f64,
}

impl Square {
    /// The square around the mask of an image (red, green, blue, mask) with so many columns; `None` if the mask is empty.
    pub fn around_mask(rgba: &[[u8; 4]], width: u32) -> Option<Square> {
        let width = width.max(1) as usize;
        let inside =
            || rgba.iter().enumerate().filter(|(_, pixel)| pixel[3] >= 128).map(|(i, _)| [i % width, i / width]);
        let least = inside().reduce(|a, b| [a[0].min(b[0]), a[1].min(b[1])])?;
        let most = inside().reduce(|a, b| [a[0].max(b[0]), a[1].max(b[1])])?;
        let longest = [0, 1].map(|axis| most[axis] + 1 - least[axis]).into_iter().max()?;
        let side = (MARGIN * longest as f64).ceil();
        let corner = [0, 1].map(|axis| ((least[axis] + most[axis] + 1) as f64 / 2.0 - side / 2.0).floor());
        Some(Square { corner: corner.into(), side })
    }

    /// How many times larger it is when scaled.
    pub fn scale(&self) -> f64 {
        f64::from(SIDE) / self.side
    }

    /// The square of an image of this size, scaled to `SIDE` x `SIDE`. Parts outside the image have the colour `outside`.
    pub fn scaled(&self, pixels: &[[u8; 4]], [width, height]: [u32; 2], outside: [u8; 4]) -> Vec<[u8; 4]> {
        let square = RgbaImage::from_fn(self.side as u32, self.side as u32, |x, y| {
            let (x, y) = (self.corner.x + f64::from(x), self.corner.y + f64::from(y));
            let is_in_image = x >= 0.0 && y >= 0.0 && x < f64::from(width) && y < f64::from(height);
            let at = y.max(0.0) as usize * width as usize + x.max(0.0) as usize;
            Rgba(is_in_image.then(|| pixels.get(at).copied()).flatten().unwrap_or(outside))
        });
        resize(&square, SIDE, SIDE, FilterType::Triangle).pixels().map(|pixel| pixel.0).collect()
    }
}

#[cfg(test)]
mod tests {
    use glam::{DMat3, DVec3};

    use super::*;

    #[test]
    fn the_box_is_1_3_times_the_mask_and_its_camera_sees_the_same_points() {
        let camera = Camera {
            id: "a".into(),
            width: 60,
            height: 40,
            focal: DVec2::new(70.0, 80.0),
            principal: DVec2::new(31.0, 19.0),
            rotation: DMat3::IDENTITY,
            translation: DVec3::ZERO,
        };
        // A mask of 20 x 10 pixels near the top edge: the square of 26 pixels reaches out of the image.
        let inside = |x: usize, y: usize| (30..50).contains(&x) && (2..12).contains(&y);
        let pixel = |i: usize| if inside(i % 60, i / 60) { [200, 100, 50, 255] } else { [90, 90, 90, 0] };
        let rgba: Vec<[u8; 4]> = (0..60 * 40).map(pixel).collect();
        let found = HandBox::of(&camera, &rgba).unwrap();
        let scale = 256.0 / 26.0;
        let point = DVec3::new(0.1, -0.2, 1.0);
        let expected = (camera.project(point).0 - DVec2::new(27.0, -6.0)) * scale;
        assert!(found.camera.project(point).0.distance(expected) < 1e-9);
        let at = |x: f64, y: f64| found.rgba[(scale * (y + 6.0)) as usize * 256 + (scale * (x - 27.0)) as usize];
        assert_eq!([at(40.0, 7.0), at(31.5, 3.5), at(48.5, 10.5)], [[200, 100, 50, 255]; 3]);
        // Black beside the mask, and above the image.
        assert_eq!([at(40.0, 15.0), at(28.0, 7.0), at(40.0, -3.0)], [[0; 4]; 3]);
        assert!(HandBox::of(&camera, &[[9, 9, 9, 0]; 2400]).is_none());
    }
}
