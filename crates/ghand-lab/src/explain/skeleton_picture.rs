//! Draws skeletons over pictures of a hand.

use ghand_core::Camera;
use glam::{DVec2, DVec3};
use image::{Rgb, RgbImage};

/// How a skeleton is drawn.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pen {
    color: [u8; 3],
    /// Radius of a joint, and half the width of a bone, pixels.
    joint: f64,
    bone: f64,
}

/// Wide blue for the template's skeleton and narrow orange for the residual one: told apart with any colour vision, and
/// both visible where they coincide.
pub const TEMPLATE: Pen = Pen { color: [0, 84, 166], joint: 6.5, bone: 3.0 };
pub const RESIDUAL: Pen = Pen { color: [240, 120, 20], joint: 4.0, bone: 1.2 };

/// Makes a picture paler, so that lines stand out.
pub fn fade(picture: &mut RgbImage) {
    picture.pixels_mut().flat_map(|pixel| &mut pixel.0).for_each(|v| *v = 255 - (255 - *v) / 2);
}

/// Draws points at the joints (metres, world) and lines to their parents.
pub fn draw_skeleton(
    picture: &mut RgbImage,
    camera: &Camera,
    parents: &[Option<usize>],
    joints: &[DVec3],
    Pen { color, joint, bone }: Pen,
) {
    let at: Vec<DVec2> = joints.iter().map(|joint| camera.project(*joint).0).collect();
    for (k, parent) in parents.iter().enumerate() {
        if let Some([a, b]) = parent.and_then(|p| Some([*at.get(p)?, *at.get(k)?])) {
            draw_line(picture, a, b, bone, color);
        }
    }
    at.iter().for_each(|place| draw_line(picture, *place, *place, joint, color));
}

/// Draws the points that are at most `radius` from a segment, with soft edges.
fn draw_line(picture: &mut RgbImage, a: DVec2, b: DVec2, radius: f64, color: [u8; 3]) {
    let (low, high) = (a.min(b) - radius - 1.0, a.max(b) + radius + 1.0);
    if !(low.is_finite() && high.is_finite()) {
        return;
    }
    let edge = |value: f64, most: u32| value.clamp(0.0, f64::from(most)) as u32;
    for y in edge(low.y, picture.height())..edge(high.y.ceil(), picture.height()) {
        for x in edge(low.x, picture.width())..edge(high.x.ceil(), picture.width()) {
            let point = DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5);
            let along = ((point - a).dot(b - a) / (b - a).length_squared().max(1e-12)).clamp(0.0, 1.0);
            let cover = (radius + 0.5 - point.distance(a.lerp(b, along))).clamp(0.0, 1.0);
            let Rgb(pixel) = picture.get_pixel_mut(x, y);
            for (value, color) in pixel.iter_mut().zip(color) {
                *value = (f64::from(*value) * (1.0 - cover) + f64::from(color) * cover).round() as u8;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn joints_and_bones_are_where_the_camera_sees_them() {
        let camera = Camera::look_at(DVec3::new(0.0, 0.0, 1.0), DVec3::ZERO, DVec3::Y, 0.5, 100, 100);
        let mut picture = RgbImage::from_pixel(100, 100, Rgb([255; 3]));
        let joints = [DVec3::ZERO, DVec3::new(0.1, 0.0, 0.0)];
        draw_skeleton(&mut picture, &camera, &[None, Some(0)], &joints, TEMPLATE);
        let [a, b] = joints.map(|joint| camera.project(joint).0);
        for place in [a, b, 0.5 * (a + b)] {
            assert_eq!(picture.get_pixel(place.x as u32, place.y as u32).0, TEMPLATE.color);
        }
        assert_eq!(picture.get_pixel(50, 10).0, [255; 3]);
        // What is outside the picture, or nowhere, is not drawn.
        draw_skeleton(&mut picture, &camera, &[None], &[DVec3::new(9.0, 0.0, 0.0)], TEMPLATE);
        draw_skeleton(&mut picture, &camera, &[None], &[DVec3::NAN], TEMPLATE);
    }
}
