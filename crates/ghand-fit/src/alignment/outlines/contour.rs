//! The outer contour of a posed template in an image, against that of the mask.

use std::collections::BTreeMap;

use ghand_capture::mask::{open_pixels, projected};
use ghand_core::{Camera, HandModel};
use ghand_hand_model::surface::arm_end::{ArmEnd, ArmEndInImage};
use glam::{DVec2, DVec3};

use super::distance_field::DistanceField;

/// A contour point counts only if this point outside of it, in pixels along its normal, is free.
const OUTSIDE: f64 = 2.5;
/// Points farther than this from the mask's outline do not belong to it, pixels.
const FARTHEST: f64 = 40.0;
/// Least length of an edge's image, and the length beyond which it counts no more, pixels.
const LENGTHS: [f64; 2] = [0.2, 20.0];
/// Least cosine between the contour's normal and the direction away from the mask.
const LEAST_AGREEMENT: f64 = 0.5;
/// Geometry nearer to the camera than this is ignored, metres.
const NEAR: f64 = 0.01;

/// The edges of a template that two triangles share.
pub struct Edges {
    triangles: Vec<[u32; 3]>,
    /// Where it ends at the wrist.
    arm_end: Option<ArmEnd>,
    /// Two vertices and two triangles each.
    edges: Vec<([u32; 2], [u32; 2])>,
}

/// A point of the template's outer contour in an image.
#[derive(Debug, Clone, Copy)]
pub struct ContourPoint {
    /// The point is in the middle of the edge between these vertices.
    pub edge: [u32; 2],
    /// Signed distance to the mask's outline, pixels.
    pub residual: f64,
    /// Its derivative by the point's position, pixels per metre, world axes.
    pub gradient: DVec3,
    /// Its derivative by the pixel at which the point is seen.
    pub slope: DVec2,
    /// The point's position in the camera's axes, metres.
    pub in_camera: DVec3,
    /// Length of the contour that it stands for, pixels.
    pub length: f64,
}

impl Edges {
    pub fn of(template: &HandModel) -> Edges {
        let triangles = &template.faces;
        let mut sides: BTreeMap<[u32; 2], Vec<u32>> = BTreeMap::new();
        for (triangle, [a, b, c]) in (0..).zip(triangles) {
            for [p, q] in [[a, b], [b, c], [c, a]] {
                sides.entry([*p.min(q), *p.max(q)]).or_default().push(triangle);
            }
        }
        let edges = sides.into_iter().filter_map(|(edge, sides)| Some((edge, <[u32; 2]>::try_from(sides).ok()?)));
        Edges { triangles: triangles.clone(), arm_end: ArmEnd::of(template), edges: edges.collect() }
    }

    /// The same; the template's end at the wrist is an outline as any other.
    pub fn with_arm_end(self) -> Edges {
        Edges { arm_end: None, ..self }
    }

    /// Whether a vertex is at the template's end, and that is no outline.
    pub fn is_arm_end(&self, vertex: u32) -> bool {
        self.arm_end.as_ref().is_some_and(|end| end.contains(vertex))
    }

    /// The end of the template at `positions` in an image.
    pub fn arm_end(&self, positions: &[DVec3], camera: &Camera) -> Option<ArmEndInImage> {
        self.arm_end.as_ref()?.seen(positions, camera)
    }

    /// The outer contour of the mesh at `positions` (metres, world; `normals` are those of the vertices) as far as it may
    /// correspond to the mask's outline: not its end at the wrist, nor what may lie over the arm, if the mask has one.
    pub fn contour(
        &self,
        positions: &[DVec3],
        normals: &[DVec3],
        camera: &Camera,
        field: &DistanceField,
    ) -> Vec<ContourPoint> {
        let center = camera.center();
        let corner = |i: u32| positions[i as usize];
        let pixels = projected(camera, positions);
        let is_front = |&[a, b, c]: &[u32; 3]| match [a, b, c].map(|v| pixels[v as usize]) {
            // Counter-clockwise from outside is clockwise where y points down.
            [Some(a), Some(b), Some(c)] => (b - a).perp_dot(c - a) < 0.0,
            _ => (corner(b) - corner(a)).cross(corner(c) - corner(a)).dot(center - corner(a)) > 0.0,
        };
        let is_front: Vec<bool> = self.triangles.iter().map(is_front).collect();
        let front: Vec<[u32; 3]> =
            self.triangles.iter().zip(&is_front).filter(|(_, front)| **front).map(|(t, _)| *t).collect();
        let arm = self.arm_end(positions, camera);
        // Each with the pixel that must be free.
        let point = |&([a, b], [first, second]): &([u32; 2], [u32; 2])| {
            if is_front[first as usize] == is_front[second as usize] || self.is_arm_end(a) || self.is_arm_end(b) {
                return None;
            }
            let [(p, p_depth), (q, q_depth)] = [a, b].map(|v| camera.project(corner(v)));
            if p_depth < NEAR || q_depth < NEAR {
                return None;
            }
            let length = p.distance(q);
            let outwards = camera.rotation * (normals[a as usize] + normals[b as usize]);
            let across = (q - p).perp() / length;
            let normal = if across.dot(outwards.truncate()) < 0.0 { -across } else { across };
            let middle = 0.5 * (p + q);
            let outside = middle + OUTSIDE * normal;
            if length < LENGTHS[0] || arm.is_some_and(|arm| arm.may_be_arm(outside)) {
                return None;
            }
            let (residual, slope) = field.at(middle)?;
            let agrees = slope.length() > LEAST_AGREEMENT && slope.normalize().dot(normal) > LEAST_AGREEMENT;
            if !agrees || residual.abs() > FARTHEST {
                return None;
            }
            let at = camera.camera_from_world(0.5 * (corner(a) + corner(b)));
            let [x, y] = (slope * camera.focal / at.z).to_array();
            let gradient = camera.rotation.transpose() * DVec3::new(x, y, -(x * at.x + y * at.y) / at.z);
            let length = length.min(LENGTHS[1]);
            let point = ContourPoint { edge: [a, b], residual, gradient, slope, in_camera: at, length };
            Some((pixel_at(outside, camera), point))
        };
        let points: Vec<(usize, ContourPoint)> = self.edges.iter().filter_map(point).collect();
        let size = [camera.width, camera.height].map(|pixels| pixels as usize);
        let open = open_pixels(size, &pixels, &front, points.iter().map(|(pixel, _)| *pixel));
        points.into_iter().filter(|(pixel, _)| open[*pixel]).map(|(_, point)| point).collect()
    }
}

/// Number of the pixel at a point of an image, or of the nearest one.
fn pixel_at(point: DVec2, camera: &Camera) -> usize {
    let clamp = |v: f64, size: u32| v.clamp(0.0, f64::from(size - 1)) as usize;
    clamp(point.y, camera.height) * camera.width as usize + clamp(point.x, camera.width)
}
