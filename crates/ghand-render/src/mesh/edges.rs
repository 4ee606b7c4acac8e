//! The edges of a mesh as screen-space lines, in f64.

use ghand_core::Camera;
use glam::{DVec2, DVec3};

use super::NEAR_PLANE;

/// Largest distance, in samples, between a point on a line and the sample whose face depth it is compared with: the
/// nearest of the four samples around a point is at most half a sample's diagonal away.
const REACH: f64 = std::f64::consts::FRAC_1_SQRT_2;
/// Error bound of f32 arithmetic and the device's interpolation, relative to the larger inverse depth of a line's ends:
/// 80 units of rounding.
const ROUNDING: f64 = 1e-5;

/// An edge on the screen, clipped to the visible region.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Segment {
    /// Ends, samples from the corner of the target.
    pub ends: [DVec2; 2],
    /// Inverse depth at the ends, 1/m; linear in between.
    pub inverse_depths: [f64; 2],
    /// A line lies on a face if its inverse depth is at most this much less than the face's, 1/m.
    pub tolerance: f64,
}

/// An edge and the depth tolerance from its faces.
struct Edge {
    vertices: [u32; 2],
    tolerance: f64,
}

/// The visible edges of a mesh, each once, on a target of `camera.width * k` x `camera.height * k` samples. Parts
/// farther than `radius` samples outside the target are clipped.
pub fn segments(
    positions: &[DVec3],
    triangles: &[[u32; 3]],
    camera: &Camera,
    supersample: u32,
    radius: f64,
) -> Vec<Segment> {
    let k = f64::from(supersample);
    let points: Vec<DVec3> = positions.iter().map(|p| camera.camera_from_world(*p)).collect();
    let size = DVec2::new(f64::from(camera.width), f64::from(camera.height)) * k;
    let [focal, principal] = [camera.focal * k, camera.principal * k];
    let cut = |edge: &Edge| {
        let [a, b] = clip_near(edge.vertices.map(|i| points[i as usize]))?;
        let ends = [a, b].map(|p| p.truncate() / p.z * focal + principal);
        let inverse_depths = [1.0 / a.z, 1.0 / b.z];
        let tolerance = edge.tolerance + ROUNDING * inverse_depths[0].max(inverse_depths[1]);
        clip_to_target(Segment { ends, inverse_depths, tolerance }, size, radius)
    };
    edges(&points, triangles, focal).iter().filter_map(cut).collect()
}

/// Each edge once, regardless of how many triangles share it.
fn edges(points: &[DVec3], triangles: &[[u32; 3]], focal: DVec2) -> Vec<Edge> {
    let mut sides: Vec<([u32; 2], f64)> = Vec::with_capacity(3 * triangles.len());
    for triangle in triangles {
        let tolerance = tolerance(triangle.map(|i| points[i as usize]), focal);
        for (a, b) in [(0, 1), (1, 2), (2, 0)] {
            let (a, b) = (triangle[a], triangle[b]);
            sides.push(([a.min(b), a.max(b)], tolerance));
        }
    }
    sides.sort_unstable_by_key(|(vertices, _)| *vertices);
    sides
        .chunk_by(|a, b| a.0 == b.0)
        .map(|same| Edge { vertices: same[0].0, tolerance: same.iter().fold(0.0, |most, side| most.max(side.1)) })
        .collect()
}

/// Change of a face's inverse depth (camera axes) within [`REACH`] samples. The inverse depth is linear on the screen:
/// for the plane n . x = d it is n . (ray of the sample) / d.
fn tolerance(corners: [DVec3; 3], focal: DVec2) -> f64 {
    let [a, b, c] = corners;
    let normal = (b - a).cross(c - a);
    let slope = (normal.truncate() / focal / normal.dot(a)).length();
    let inverse = corners.map(|p| 1.0 / p.z.max(NEAR_PLANE));
    let range = inverse.iter().fold(0.0, |m: f64, s| m.max(*s)) - inverse.iter().fold(f64::INFINITY, |m, s| m.min(*s));
    // For a face seen edge-on, or without area, the slope is not meaningful, but no sample is beyond the corners. `min`
    // ignores NaN.
    range.min(slope * REACH)
}

/// The part of an edge (camera axes) in front of the near plane.
fn clip_near([a, b]: [DVec3; 2]) -> Option<[DVec3; 2]> {
    let (da, db) = (a.z - NEAR_PLANE, b.z - NEAR_PLANE);
    // Exactly on the plane, despite rounding of the interpolation.
    let crossing = || a.lerp(b, da / (da - db)).with_z(NEAR_PLANE);
    match (da >= 0.0, db >= 0.0) {
        (true, true) => Some([a, b]),
        (true, false) => Some([a, crossing()]),
        (false, true) => Some([crossing(), b]),
        (false, false) => None,
    }
}

/// The part of a segment within `radius` samples of the target (Liang and Barsky 1984), so that its coordinates are
/// precise in f32.
fn clip_to_target(segment: Segment, size: DVec2, radius: f64) -> Option<Segment> {
    let [a, b] = segment.ends;
    let along = b - a;
    let (mut first, mut last) = (0.0f64, 1.0f64);
    for axis in 0..2 {
        let (low, high) = (-radius - a[axis], size[axis] + radius - a[axis]);
        if along[axis] == 0.0 {
            if low > 0.0 || high < 0.0 {
                return None;
            }
            continue;
        }
        let (s, t) = (low / along[axis], high / along[axis]);
        first = first.max(s.min(t));
        last = last.min(s.max(t));
    }
    let [sa, sb] = segment.inverse_depths;
    let at = |t: f64| (a + along * t, sa + (sb - sa) * t);
    let (start, s) = at(first);
    let (end, t) = at(last);
    (first <= last).then_some(Segment { ends: [start, end], inverse_depths: [s, t], ..segment })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn camera() -> Camera {
        let camera = Camera::look_at(DVec3::new(0.0, 0.0, -1.0), DVec3::ZERO, DVec3::NEG_Y, 0.8, 60, 40);
        Camera { focal: DVec2::new(80.0, 90.0), ..camera }
    }

    /// A point at camera coordinates.
    fn world(x: f64, y: f64, z: f64) -> DVec3 {
        let camera = camera();
        camera.rotation.transpose() * (DVec3::new(x, y, z) - camera.translation)
    }

    fn all(positions: &[DVec3], triangles: &[[u32; 3]]) -> Vec<Segment> {
        segments(positions, triangles, &camera(), 2, 5.0)
    }

    #[test]
    fn an_edge_shared_by_triangles_is_listed_once() {
        let square = [world(-0.1, 0.0, 1.0), world(0.1, 0.0, 1.0), world(0.1, 0.1, 1.0), world(-0.1, 0.1, 1.0)];
        let listed = all(&square, &[[0, 1, 2], [0, 2, 3], [2, 1, 0], [2, 2, 1]]);
        // Four sides, one diagonal, and the zero-length side of the degenerate triangle.
        assert_eq!(listed.len(), 6);
        assert_eq!(listed.iter().filter(|s| s.ends[0] == s.ends[1]).count(), 1);
        assert!(all(&square, &[]).is_empty());
    }

    #[test]
    fn ends_are_at_the_projected_vertices() {
        let triangle = [world(-0.1, 0.02, 1.0), world(0.1, 0.05, 1.25), world(0.0, -0.1, 2.0)];
        let listed = all(&triangle, &[[0, 1, 2]]);
        for (segment, [i, j]) in listed.iter().zip([[0, 1], [0, 2], [1, 2]]) {
            for (end, inverse, vertex) in
                [(0, segment.inverse_depths[0], triangle[i]), (1, segment.inverse_depths[1], triangle[j])]
            {
                let (pixel, z) = camera().project(vertex);
                assert!((segment.ends[end] - pixel * 2.0).length() < 1e-10 && (inverse - 1.0 / z).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn lines_are_clipped_at_the_near_plane_and_around_the_target() {
        let crossing = [world(0.0, 0.0, 0.5), world(0.001, 0.0, -0.5), world(0.0, 0.001, -0.5)];
        let listed = all(&crossing, &[[0, 1, 2]]);
        assert_eq!(listed.len(), 2, "the side behind the camera is gone");
        assert!(listed.iter().all(|s| (s.inverse_depths[1] - 1.0 / NEAR_PLANE).abs() < 1e-9));

        // From the middle far out to the right: clipped five samples beyond 120, with the line's depth there.
        let wide = [world(0.0, 0.0, 1.0), world(900.0, 0.0, 1.0), world(900.0, 900.0, 2.0)];
        let segment = all(&wide, &[[0, 1, 2]])[0];
        assert!((segment.ends[1] - DVec2::new(125.0, 40.0)).length() < 1e-9, "{segment:?}");
        assert!((segment.inverse_depths[1] - 1.0).abs() < 1e-9);
        assert!(all(&wide.map(|p| p + DVec3::Y * 5.0), &[[0, 1, 2]]).len() < 3, "edges far outside are skipped");
        assert!(all(&crossing.map(|p| p - DVec3::Z * 5.0), &[[0, 1, 2]]).is_empty(), "those behind are skipped");
    }

    #[test]
    fn the_tolerance_is_the_change_of_inverse_depth_within_reach_of_a_sample() {
        let facing = [DVec3::new(0.0, 0.0, 1.0), DVec3::new(0.1, 0.0, 1.0), DVec3::new(0.0, 0.1, 1.0)];
        let focal = DVec2::new(160.0, 180.0);
        assert_eq!(tolerance(facing, focal), 0.0);
        // Differences of 1/z between two samples of a slanted face.
        let slanted = facing.map(|p| p + DVec3::Z * (0.7 * p.x));
        let inverse_at = |u: f64| (1.0 - 0.7 * u / focal.x) / 1.0;
        let change = (inverse_at(1.0) - inverse_at(0.0)).abs() * REACH;
        assert!((tolerance(slanted, focal) - change).abs() < 1e-12);
        // Seen edge-on, or without area: bounded by the corners.
        let edge_on = [DVec3::new(0.0, 0.0, 1.0), DVec3::new(0.0, 0.0, 2.0), DVec3::new(0.0, 0.1, 1.0)];
        assert_eq!(tolerance(edge_on, focal), 0.5);
        assert_eq!(tolerance([DVec3::Z; 3], focal), 0.0);
    }
}
