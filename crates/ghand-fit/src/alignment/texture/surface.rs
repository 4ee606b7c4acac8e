//! Points on the template's surface, and which of them an image shows.

use ghand_core::{Camera, HandModel};
use glam::{DVec2, DVec3};

use crate::alignment::triangles::cover_faces;

/// Number of points on the whole hand.
const POINTS: f64 = 4000.0;
/// Only points that follow one bone at least to this part count: where bones blend, skin does not move as skinning says.
const LEAST_WEIGHT: f64 = 0.85;
/// Side of a patch at rest, metres.
const PATCH: f64 = 0.012;

/// Width and height of a cell in which depth is kept, pixels.
const CELL: f64 = 4.0;
/// A surface hides a point if it is nearer by more than this, metres: that much depth may vary over a cell and its
/// neighbours on a surface seen at an angle.
const HIDES: f64 = 0.008;

/// A point of a face, moving with it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SurfacePoint {
    /// The face's vertices, and the weights whose mean of them the point is.
    pub corners: [u32; 3],
    pub weights: [f64; 3],
    /// The patch of the surface that it belongs to.
    pub patch: [i32; 3],
}

impl SurfacePoint {
    /// The mean of the values at the face's vertices.
    pub fn mean_of(&self, values: &[DVec3]) -> DVec3 {
        self.corners.iter().zip(self.weights).map(|(corner, weight)| weight * values[*corner as usize]).sum()
    }
}

/// Points that stand for equal areas of the surface at rest.
pub fn surface_points(model: &HandModel) -> Vec<SurfacePoint> {
    let area = |face: &[u32; 3]| {
        let [a, b, c] = face.map(|corner| model.vertices[corner as usize]);
        0.5 * (b - a).cross(c - a).length()
    };
    let each = model.faces.iter().map(area).sum::<f64>() / POINTS;
    let bone_weight = |vertex: u32| model.vertex_weights(vertex as usize).iter().copied().fold(0.0, f64::max);
    let mut points = vec![];
    let mut due = 0.5;
    let mut number = 0.0_f64;
    for face in &model.faces {
        due += area(face) / each;
        while due >= 1.0 {
            due -= 1.0;
            number += 1.0;
            // Powers of the plastic ratio's inverse: a sequence that fills the unit square evenly; folded into the triangle.
            let [mut u, mut v] = [0.754_877_666_246_693, 0.569_840_290_998_053].map(|step| (number * step).fract());
            if u + v > 1.0 {
                (u, v) = (1.0 - u, 1.0 - v);
            }
            let mut point = SurfacePoint { corners: *face, weights: [1.0 - u - v, u, v], patch: [0; 3] };
            let on_bone: f64 =
                face.iter().zip(point.weights).map(|(corner, weight)| weight * bone_weight(*corner)).sum();
            if on_bone >= LEAST_WEIGHT {
                point.patch = (point.mean_of(&model.vertices) / PATCH).to_array().map(|v| v.floor() as i32);
                points.push(point);
            }
        }
    }
    points
}

/// How near the nearest surface is, in cells of an image.
pub struct NearestDepth {
    size: [usize; 2],
    /// Least camera z of each cell and its neighbours, metres.
    depth: Vec<f64>,
}

impl NearestDepth {
    /// Of a mesh at `positions` (metres, world axes).
    pub fn new(camera: &Camera, positions: &[DVec3], faces: &[[u32; 3]]) -> NearestDepth {
        let size = [camera.width, camera.height].map(|length| (f64::from(length) / CELL).ceil() as usize);
        let mut depth = vec![f64::INFINITY; size[0] * size[1]];
        cover_faces(camera, size, CELL, positions, faces, |_, at, z| depth[at] = depth[at].min(z));
        NearestDepth { size, depth: least_of_neighbours(&depth, size) }
    }

    /// Whether a point of the surface is seen: nothing is before it or before its surroundings.
    pub fn shows(&self, pixel: DVec2, depth: f64) -> bool {
        let cell = pixel / CELL;
        let [columns, rows] = self.size;
        let is_inside = cell.x >= 0.0 && cell.y >= 0.0 && cell.x < columns as f64 && cell.y < rows as f64;
        is_inside && depth - self.depth[cell.y as usize * columns + cell.x as usize] < HIDES
    }
}

fn least_of_neighbours(depth: &[f64], [columns, rows]: [usize; 2]) -> Vec<f64> {
    let around = |at: usize, size: usize| at.saturating_sub(1)..(at + 2).min(size);
    let least = |x: usize, y: usize| {
        let lines = around(y, rows).flat_map(|y| &depth[y * columns..][around(x, columns)]);
        lines.copied().fold(f64::INFINITY, f64::min)
    };
    (0..columns * rows).map(|i| least(i % columns, i / columns)).collect()
}

#[cfg(test)]
mod tests {
    use ghand_core::Side;
    use ghand_hand_model::builtin::builtin_hand;

    use super::*;

    #[test]
    fn points_spread_evenly_over_the_bones() {
        let model = builtin_hand(Side::Right).unwrap();
        let points = surface_points(&model);
        assert!((1500..=4000).contains(&points.len()), "{}", points.len());
        assert_eq!(points, surface_points(&model));
        for point in &points {
            assert!((point.weights.iter().sum::<f64>() - 1.0).abs() < 1e-12);
            assert!(point.weights.iter().all(|weight| *weight >= 0.0));
        }
        // A patch of 12 x 12 mm has some 20 to 30 points; few are cut off smaller.
        let patches: std::collections::BTreeSet<[i32; 3]> = points.iter().map(|point| point.patch).collect();
        assert!((5..40).contains(&(points.len() / patches.len())), "{} patches", patches.len());
    }

    #[test]
    fn points_behind_or_beside_other_parts_are_not_seen() {
        let camera = Camera::look_at(DVec3::new(0.0, 0.0, -0.5), DVec3::ZERO, DVec3::Y, 0.5, 160, 120);
        // A wall that faces the camera, and a small square before it.
        let square = |half: f64, z: f64| {
            [(-half, -half), (-half, half), (half, half), (half, -half)].map(|(x, y)| DVec3::new(x, y, z))
        };
        let positions: Vec<DVec3> = [square(0.1, 0.0), square(0.02, -0.05)].concat();
        let faces = [[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]];
        let front = |face: &[u32; 3]| {
            let [a, b, c] = face.map(|corner| positions[corner as usize]);
            (b - a).cross(c - a).z < 0.0
        };
        assert!(faces.iter().all(front), "the camera looks along z");
        let nearest = NearestDepth::new(&camera, &positions, &faces);
        let shows = |point: DVec3| {
            let (pixel, depth) = camera.project(point);
            nearest.shows(pixel, depth)
        };
        assert!(shows(DVec3::new(0.0, 0.0, -0.05)), "the square");
        assert!(!shows(DVec3::ZERO), "the wall behind the square");
        assert!(shows(DVec3::new(0.08, 0.05, 0.0)), "the wall");
        // The square's border is at 0.022 of the wall.
        assert!(!shows(DVec3::new(0.024, 0.0, 0.0)), "the wall just beside the square");
        assert!(!shows(DVec3::new(5.0, 0.0, 0.0)), "outside the image");
        // Seen from behind nothing hides.
        let turned: Vec<[u32; 3]> = faces.iter().map(|[a, b, c]| [*a, *c, *b]).collect();
        let (pixel, depth) = camera.project(DVec3::ZERO);
        assert!(NearestDepth::new(&camera, &positions, &turned).shows(pixel, depth));
    }
}
