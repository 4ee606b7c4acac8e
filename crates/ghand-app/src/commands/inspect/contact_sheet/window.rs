//! The part of an image that is shown: a small hand is shown with its surroundings only.

use ghand_core::Camera;
use glam::{DVec2, DVec3};

/// Fraction of the window, from edge to edge, that mask and template may fill.
const FILL: f64 = 0.8;
/// A window that is not smaller than this fraction of the image becomes the whole image: views are cropped only if it
/// helps.
const LARGEST: f64 = 0.7;

/// The window (x, y, width, height; pixels), with the image's aspect ratio, around the mask (alpha of `rgba`) and the
/// projected `points` (world, metres) inside the image; the whole image if there are none.
pub fn window(camera: &Camera, rgba: &[[u8; 4]], points: impl Iterator<Item = DVec3>) -> [u32; 4] {
    let whole = [0, 0, camera.width, camera.height];
    let size = DVec2::new(f64::from(camera.width), f64::from(camera.height));
    let (mut low, mut high) = (DVec2::INFINITY, DVec2::NEG_INFINITY);
    let mut add = |at: DVec2| {
        if at.cmpge(DVec2::ZERO).all() && at.cmple(size).all() {
            (low, high) = (low.min(at), high.max(at));
        }
    };
    points.map(|point| camera.project(point)).filter(|(_, depth)| *depth > 0.0).for_each(|(at, _)| add(at));
    for (y, row) in (0u32..).zip(rgba.chunks_exact(camera.width.max(1) as usize)) {
        let on_hand = |p: &[u8; 4]| p[3] >= 128;
        for x in [row.iter().position(on_hand), row.iter().rposition(on_hand)].into_iter().flatten() {
            add(DVec2::new(x as f64 + 0.5, f64::from(y) + 0.5));
        }
    }
    let scale = ((high - low) / size).max_element() / FILL;
    // The box of no points is infinite.
    if !(scale.is_finite() && scale < LARGEST) || high.cmplt(low).any() {
        return whole;
    }
    let part = (size * scale).ceil().max(DVec2::ONE);
    let corner = ((low + high) * 0.5 - part * 0.5).round().clamp(DVec2::ZERO, size - part);
    [corner.x as u32, corner.y as u32, part.x as u32, part.y as u32]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The window of a 400 x 200 image whose mask is the box `x`, `y`, `width`, `height`.
    fn of_box([left, top, width, height]: [u32; 4], points: &[DVec3]) -> [u32; 4] {
        let camera = Camera::look_at(DVec3::NEG_Z, DVec3::ZERO, DVec3::NEG_Y, 0.5, 400, 200);
        let inside = |i: u32| (left..left + width).contains(&(i % 400)) && (top..top + height).contains(&(i / 400));
        let rgba: Vec<[u8; 4]> = (0..400 * 200).map(|i| [0, 0, 0, if inside(i) { 255 } else { 0 }]).collect();
        window(&camera, &rgba, points.iter().copied())
    }

    #[test]
    fn small_hands_fill_their_window_and_large_ones_get_the_whole_image() {
        // 39 of 200 rows between the outermost centres, over 0.8: 0.24375 of the image, rounded up.
        assert_eq!(of_box([100, 80, 40, 40], &[]), [71, 76, 98, 49]);
        assert_eq!(of_box([0, 0, 40, 40], &[]), [0, 0, 98, 49]);
        assert_eq!(of_box([360, 160, 40, 40], &[]), [302, 151, 98, 49]);
        assert_eq!(of_box([100, 20, 40, 150], &[]), [0, 0, 400, 200]);
        assert_eq!(of_box([0; 4], &[]), [0, 0, 400, 200]);
    }

    #[test]
    fn a_template_widens_the_window_if_it_is_inside_the_image() {
        let far_right = DVec3::new(0.4, 0.0, 0.0);
        assert_eq!(of_box([10, 80, 40, 40], &[far_right]), [0, 0, 400, 200]);
        let alone = of_box([100, 80, 40, 40], &[]);
        for unseen in [DVec3::new(9.0, 0.0, 0.0), DVec3::new(0.0, 0.0, -2.0), DVec3::NAN] {
            assert_eq!(of_box([100, 80, 40, 40], &[unseen]), alone, "{unseen}");
        }
    }
}
