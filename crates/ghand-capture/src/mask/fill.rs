//! The filled outline of a mesh.

use ghand_core::Camera;
use glam::{DVec2, DVec3};

/// Triangles with a corner nearer than this are skipped, metres: points at or behind the camera have no image.
const NEAR: f64 = 1e-3;

/// Whether each pixel's centre, row-major, is inside the image of a triangle, edges included. `faces` are indices into
/// `points` (world, metres); a triangle with an index beyond them is skipped.
pub fn covered_pixels(camera: &Camera, points: &[DVec3], faces: &[[u32; 3]]) -> Vec<bool> {
    let (width, height) = (camera.width as usize, camera.height as usize);
    let mut inside = vec![false; width * height];
    let projected: Vec<Option<DVec2>> = points
        .iter()
        .map(|p| {
            let (pixel, depth) = camera.project(*p);
            (depth > NEAR && pixel.is_finite()).then_some(pixel)
        })
        .collect();
    let corner = |i: u32| projected.get(i as usize).copied().flatten();
    for [a, b, c] in faces {
        let (Some(a), Some(b), Some(c)) = (corner(*a), corner(*b), corner(*c)) else { continue };
        let area = (b - a).perp_dot(c - a);
        if area == 0.0 {
            // Its neighbours share its edges.
            continue;
        }
        let (low, high) = (a.min(b).min(c), a.max(b).max(c));
        // Pixels whose centres, at half-integers, are between.
        let range = |low: f64, high: f64, size: usize| {
            let bound = |v: f64| v.clamp(0.0, size as f64) as usize;
            bound((low - 0.5).ceil())..bound((high - 0.5).floor() + 1.0)
        };
        for y in range(low.y, high.y, height) {
            for x in range(low.x, high.x, width) {
                let p = DVec2::new(x as f64 + 0.5, y as f64 + 0.5);
                let side = |from: DVec2, to: DVec2| (to - from).perp_dot(p - from) * area >= 0.0;
                if side(a, b)
                    && side(b, c)
                    && side(c, a)
                    && let Some(pixel) = inside.get_mut(y * width + x)
                {
                    *pixel = true;
                }
            }
        }
    }
    inside
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A camera that maps (x, y, 1) to pixel (x, y).
    fn camera(width: u32, height: u32) -> Camera {
        let camera = Camera::look_at(DVec3::ZERO, DVec3::Z, DVec3::NEG_Y, 1.0, width, height);
        Camera { focal: DVec2::ONE, principal: DVec2::ZERO, ..camera }
    }

    fn filled(points: &[[f64; 3]], faces: &[[u32; 3]]) -> Vec<String> {
        let points: Vec<DVec3> = points.iter().map(|p| DVec3::from(*p)).collect();
        let mask = covered_pixels(&camera(6, 4), &points, faces);
        mask.chunks(6).map(|row| row.iter().map(|i| if *i { '#' } else { '.' }).collect()).collect()
    }

    #[test]
    fn centres_on_an_edge_are_inside_and_either_orientation_is_filled() {
        let square = [[1.5, 0.5, 1.0], [4.5, 0.5, 1.0], [4.5, 2.5, 1.0], [1.5, 2.5, 1.0]];
        let expected = [".####.", ".####.", ".####.", "......"];
        assert_eq!(filled(&square, &[[0, 1, 2], [0, 2, 3]]), expected);
        assert_eq!(filled(&square, &[[0, 1, 2], [0, 3, 2]]), expected);
    }

    #[test]
    fn triangles_without_an_image_are_skipped_and_others_clipped() {
        let far = [[-1e9, -1e3, 1.0], [1e9, -1e3, 1.0], [2.0, 2.0, 1.0], [0.0, 0.0, -1.0], [f64::NAN, 0.0, 1.0]];
        assert_eq!(filled(&far, &[[0, 1, 2]]), ["######", "######", "......", "......"]);
        for broken in [[0, 1, 3], [0, 1, 4], [0, 1, 99], [0, 1, 1]] {
            assert!(filled(&far, &[broken]).iter().all(|row| row == "......"), "{broken:?}");
        }
    }
}
