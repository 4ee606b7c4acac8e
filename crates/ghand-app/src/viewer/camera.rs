//! A camera that moves around a point.

use std::f64::consts::FRAC_PI_2;

use ghand_core::{Camera, HandModel, Pose, Side};
use glam::{DQuat, DVec2, DVec3};

use crate::framing::{Upright, middle, posed_vertices};

/// Field of view along the shorter edge of the picture, radians: about that of a portrait lens.
const FIELD_OF_VIEW: f64 = 0.4;
/// Fraction of the shorter edge that the hand fills at first.
const FILL: f64 = 0.9;
/// Bounds of the distance from a hand, metres: the near plane cuts nearer hands, and farther ones are dots.
const HAND_DISTANCES: [f64; 2] = [0.06, 4.0];
/// The same for a scene, in multiples of its radius. The camera may be inside the scene.
const SCENE_DISTANCES: [f64; 2] = [0.02, 100.0];
/// Rotation for a drag of one point, radians: a drag across a window is about one turn.
const TURN_PER_POINT: f64 = 0.008;
/// Initial angle from the back of a right hand, and elevation above the horizon, radians: enough to see depth.
const FIRST_TURN: DVec2 = DVec2::new(-0.5, 0.15);
/// The camera stays this far from the poles, radians, where "up" is undefined.
const POLE_MARGIN: f64 = 0.01;

/// The viewpoint.
#[derive(Debug, Clone, PartialEq)]
pub struct OrbitCamera {
    target: DVec3,
    distance: f64,
    /// Angle about the direction of the fingers, radians, from the back of the hand.
    yaw: f64,
    /// Elevation above the horizon, radians.
    pitch: f64,
    upright: Upright,
    /// Bounds of the distance.
    distances: [f64; 2],
}

impl OrbitCamera {
    /// Sees the whole hand, its back and a little of the thumb's side, fingers up.
    pub fn facing(model: &HandModel, pose: &Pose) -> OrbitCamera {
        let points = posed_vertices(model, pose);
        let target = middle(&points);
        let upright = Upright::posed(model, pose);
        // The thumb of a left hand is on the other side.
        let yaw = if model.side == Side::Right { FIRST_TURN.x } else { -FIRST_TURN.x };
        let (pitch, distances) = (FIRST_TURN.y, HAND_DISTANCES);
        let mut orbit = OrbitCamera { target, distance: 1.0, yaw, pitch, upright, distances };
        let direction = orbit.direction();
        // Every point must be inside the cone whose image is the largest circle in the picture.
        let slope = (0.5 * FIELD_OF_VIEW).tan() * FILL;
        let needed = points.iter().map(|p| {
            let offset = *p - target;
            let depth = offset.dot(direction);
            (offset - depth * direction).length() / slope + depth
        });
        orbit.distance = needed.fold(distances[0], f64::max).min(distances[1]);
        orbit
    }

    /// Sees the whole unit sphere about the origin, oriented like cameras of captures: y points down, and the camera
    /// looks along z.
    pub fn around_unit_sphere() -> OrbitCamera {
        let upright = Upright { up: DVec3::NEG_Y, back: DVec3::NEG_Z };
        let distance = 1.0 / ((0.5 * FIELD_OF_VIEW).tan() * FILL).atan().sin();
        OrbitCamera {
            target: DVec3::ZERO,
            distance,
            yaw: 0.0,
            pitch: FIRST_TURN.y,
            upright,
            distances: SCENE_DISTANCES,
        }
    }

    /// The vector from the target to the camera.
    fn direction(&self) -> DVec3 {
        let Upright { up, back } = self.upright;
        DQuat::from_axis_angle(up, self.yaw) * DQuat::from_axis_angle(up.cross(back), -self.pitch) * back
    }

    /// Rotates by a drag in points.
    pub fn orbit(&mut self, drag: DVec2) {
        self.yaw = (self.yaw - drag.x * TURN_PER_POINT).rem_euclid(std::f64::consts::TAU);
        let most = FRAC_PI_2 - POLE_MARGIN;
        self.pitch = (self.pitch + drag.y * TURN_PER_POINT).clamp(-most, most);
    }

    /// Moves by a drag in points, so that a surface at the target's depth follows the pointer; `edge` is the picture's
    /// shorter edge in points.
    pub fn pan(&mut self, drag: DVec2, edge: f64) {
        let scale = 2.0 * self.distance * (0.5 * FIELD_OF_VIEW).tan() / edge.max(1.0);
        let camera = self.camera([1, 1]);
        self.target -= (camera.rotation.row(0) * drag.x + camera.rotation.row(1) * drag.y) * scale;
    }

    /// Moves `factor` times nearer.
    pub fn zoom(&mut self, factor: f64) {
        self.distance = (self.distance / factor).clamp(self.distances[0], self.distances[1]);
    }

    /// The camera for a picture of this size, pixels.
    pub fn camera(&self, [width, height]: [u32; 2]) -> Camera {
        let slope = (0.5 * FIELD_OF_VIEW).tan() * f64::from(height) / f64::from(width.min(height));
        let eye = self.target + self.direction() * self.distance;
        Camera::look_at(eye, self.target, self.upright.up, 2.0 * slope.atan(), width, height)
    }
}

#[cfg(test)]
mod tests {
    use ghand_hand_model::procedural::ProceduralHand;

    use super::*;

    fn setup() -> (HandModel, OrbitCamera) {
        let model = ProceduralHand { detail: 1, ..Default::default() }.build().unwrap();
        let camera = OrbitCamera::facing(&model, &Pose::rest(model.joint_count()));
        (model, camera)
    }

    #[test]
    fn the_whole_hand_is_seen_in_any_window() {
        let (model, orbit) = setup();
        for size in [[400, 400], [900, 300], [300, 900]] {
            let camera = orbit.camera(size);
            let half = f64::from(size[0].min(size[1])) * 0.5;
            let reach = |p: &DVec3| (camera.project(*p).0 - camera.principal).length() / half;
            let most = model.vertices.iter().map(reach).fold(0.0, f64::max);
            assert!(most <= FILL + 1e-9 && most > 0.8 * FILL, "{size:?}: {most}");
        }
    }

    #[test]
    fn the_unit_sphere_fills_the_first_view_of_a_scene() {
        let camera = OrbitCamera::around_unit_sphere().camera([400, 300]);
        let direction = |i: u32| (f64::from(i) * 2.4, (f64::from(i) * 0.02 - 1.0).acos());
        let point = |(a, b): (f64, f64)| DVec3::new(b.sin() * a.cos(), b.sin() * a.sin(), b.cos());
        let reach = |i: u32| (camera.project(point(direction(i))).0 - camera.principal).length() / 150.0;
        let most = (0..100).map(reach).fold(0.0, f64::max);
        assert!(most <= FILL + 1e-9 && most > 0.95 * FILL, "{most}");
        assert!(camera.project(DVec3::NEG_Y).0.y < 100.0, "y points down");
    }

    #[test]
    fn panning_moves_the_hand_with_the_pointer() {
        let (_, mut orbit) = setup();
        orbit.orbit(DVec2::new(70.0, -30.0));
        let point = orbit.target;
        orbit.pan(DVec2::new(12.0, -7.0), 300.0);
        let camera = orbit.camera([400, 300]);
        let moved = camera.project(point).0 - camera.principal;
        assert!((moved - DVec2::new(12.0, -7.0)).length() < 1e-6, "{moved}");
    }

    #[test]
    fn dragging_rotates_the_near_side_with_the_pointer() {
        let (_, mut orbit) = setup();
        let near = orbit.target + orbit.direction() * 0.05;
        for drag in [DVec2::new(9.0, 0.0), DVec2::new(0.0, 9.0)] {
            let mut turned = orbit.clone();
            turned.orbit(drag);
            let camera = turned.camera([300, 300]);
            assert!((camera.project(near).0 - camera.principal).dot(drag) > 0.0, "{drag}");
        }
        orbit.orbit(DVec2::new(0.0, 1e6));
        assert!(orbit.camera([30, 30]).rotation.is_finite());
        orbit.zoom(1e9);
        assert_eq!(orbit.distance, HAND_DISTANCES[0]);
    }
}
