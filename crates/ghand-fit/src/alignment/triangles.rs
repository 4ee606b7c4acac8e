//! Triangles in an image, for what faces of a mesh an image shows.

use glam::{DVec2, DVec3};

use ghand_core::Camera;

/// Geometry nearer to the camera than this is ignored, metres.
const NEAR: f64 = 0.01;

/// Calls `mark` with the face, the index of the sample (row-major) and camera z (metres) of each sample at which a mesh shows
/// the front of a face, hidden or not. A sample stands for a square of `cell` x `cell` pixels.
pub fn cover_faces(
    camera: &Camera,
    [columns, rows]: [usize; 2],
    cell: f64,
    positions: &[DVec3],
    faces: &[[u32; 3]],
    mut mark: impl FnMut(usize, usize, f64),
) {
    let projected: Vec<(DVec2, f64)> = positions.iter().map(|position| camera.project(*position)).collect();
    for (number, face) in faces.iter().enumerate() {
        let corners = face.map(|corner| projected[corner as usize]);
        if corners.iter().any(|(_, z)| *z < NEAR) {
            continue;
        }
        let [a, b, c] = corners.map(|(pixel, _)| pixel / cell - 0.5);
        let area = (b - a).perp_dot(c - a);
        // Counter-clockwise from outside is clockwise where y points down. Backs are behind fronts.
        if area >= 0.0 {
            continue;
        }
        let (low, high) = (a.min(b).min(c), a.max(b).max(c));
        let range = |low: f64, high: f64, size: usize| {
            low.ceil().max(0.0) as usize..(high.floor() + 1.0).clamp(0.0, size as f64) as usize
        };
        for y in range(low.y, high.y, rows) {
            for x in range(low.x, high.x, columns) {
                let p = DVec2::new(x as f64, y as f64);
                let weights =
                    [(c - b).perp_dot(p - b), (a - c).perp_dot(p - c), (b - a).perp_dot(p - a)].map(|w| w / area);
                if weights.iter().all(|weight| *weight >= 0.0) {
                    let over_z: f64 = weights.iter().zip(&corners).map(|(weight, (_, z))| weight / z).sum();
                    mark(number, y * columns + x, over_z.recip());
                }
            }
        }
    }
}
