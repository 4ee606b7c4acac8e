//! A camera that moves around a point.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use ghand_core::{Camera, HandModel, Pose, Side};
use glam::{DQuat, DVec2, DVec3};
use serde::{Deserialize, Serialize};

use crate::framing::{Upright, middle};
use crate::view_side::ViewSide;

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
/// A kept view is not believed to be farther from the origin than this, metres.
const FARTHEST_TARGET: f64 = 1e4;

/// Distance of the camera of an orthographic view, metres. Its picture is that of a pinhole camera: over the 10 cm of a hand
/// before and behind the target sizes differ by 0.05 %, half a pixel at the edge of a picture of 2,000 pixels. Farther away
/// the f32 depths by which Gaussians are sorted become too coarse; here their step is 15 micrometres.
const ORTHOGRAPHIC_DISTANCE: f64 = 200.0;

/// How depth changes sizes.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Projection {
    /// What is near is larger, as an eye sees it.
    #[default]
    Perspective,
    /// Sizes are the same at all depths, as in a drawing; in fact a pinhole camera so far away that the difference cannot be
    /// seen, because the splatter has no other.
    Orthographic,
}

/// A view without what the subject determines, to be kept and taken again.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ViewPoint {
    /// The point in the middle of the picture, metres, world.
    pub target: DVec3,
    /// Distance from it, metres.
    pub distance: f64,
    /// Angle about `up`, from `back`, radians.
    pub yaw: f64,
    /// Elevation, radians.
    pub pitch: f64,
    /// Upwards in the picture at an elevation of 0, unit vector, world.
    pub up: DVec3,
    /// From the target to the camera at angles of 0, unit vector, world.
    pub back: DVec3,
    /// Along the shorter edge of the picture, radians.
    pub field_of_view: f64,
    /// How depth changes sizes.
    #[serde(default)]
    pub projection: Projection,
}

impl ViewPoint {
    /// Whether a picture can be taken from here: numbers from a file may be anything.
    pub fn is_usable(&self) -> bool {
        let most = FRAC_PI_2 - POLE_MARGIN + 1e-9;
        let is_unit = |axis: DVec3| (axis.length() - 1.0).abs() < 1e-3;
        self.target.length() <= FARTHEST_TARGET
            && (0.0..FARTHEST_TARGET).contains(&self.distance)
            && self.yaw.is_finite()
            && (-most..=most).contains(&self.pitch)
            && is_unit(self.up)
            && is_unit(self.back)
            && self.up.dot(self.back).abs() < 1e-3
            && (0.01..3.0).contains(&self.field_of_view)
    }
}

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
    /// Along the shorter edge of the picture, radians.
    field_of_view: f64,
    projection: Projection,
    /// A calibrated camera, whose view is shown until the view moves.
    calibrated: Option<Camera>,
}

impl OrbitCamera {
    /// Sees all of these points (metres, world) of a hand in a pose, its back and a little of the thumb's side, fingers
    /// up.
    pub fn facing(model: &HandModel, pose: &Pose, points: &[DVec3]) -> OrbitCamera {
        // The thumb of a left hand is on the other side.
        let yaw = if model.side == Side::Right { FIRST_TURN.x } else { -FIRST_TURN.x };
        let mut orbit = OrbitCamera {
            target: DVec3::ZERO,
            distance: 1.0,
            yaw,
            pitch: FIRST_TURN.y,
            upright: Upright::posed(model, pose),
            distances: HAND_DISTANCES,
            field_of_view: FIELD_OF_VIEW,
            projection: Projection::default(),
            calibrated: None,
        };
        orbit.frame(points);
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
            field_of_view: FIELD_OF_VIEW,
            projection: Projection::default(),
            calibrated: None,
        }
    }

    /// The vector from the target to the camera.
    fn direction(&self) -> DVec3 {
        let Upright { up, back } = self.upright;
        DQuat::from_axis_angle(up, self.yaw) * DQuat::from_axis_angle(up.cross(back), -self.pitch) * back
    }

    /// Moves, without turning, so that these points (metres, world) fill the picture.
    pub fn frame(&mut self, points: &[DVec3]) {
        self.calibrated = None;
        let axes = self.camera([1, 1]).rotation;
        // The box around the points in the camera's axes: a fist is then in the middle of the picture.
        let turned: Vec<DVec3> = points.iter().map(|point| axes * *point).collect();
        self.target = axes.transpose() * middle(&turned);
        let direction = self.direction();
        // Every point must be inside the cone whose image is the largest circle in the picture.
        let slope = (0.5 * self.field_of_view).tan() * FILL;
        let needed = points.iter().map(|p| {
            let offset = *p - self.target;
            let depth = offset.dot(direction);
            let nearer = if self.projection == Projection::Perspective { depth } else { 0.0 };
            (offset - depth * direction).length() / slope + nearer
        });
        self.distance = needed.fold(self.distances[0], f64::max).min(self.distances[1]);
    }

    /// Turns to a side of a hand in a pose.
    pub fn look_from(&mut self, side: ViewSide, model: &HandModel, pose: &Pose) {
        let to_thumb = if model.side == Side::Right { -FRAC_PI_2 } else { FRAC_PI_2 };
        (self.yaw, self.pitch) = match side {
            ViewSide::Back => (0.0, 0.0),
            ViewSide::Palm => (PI, 0.0),
            ViewSide::ThumbSide => (to_thumb, 0.0),
            ViewSide::LittleFingerSide => (-to_thumb, 0.0),
            ViewSide::Fingertips => (0.0, FRAC_PI_2 - POLE_MARGIN),
        };
        self.upright = Upright::posed(model, pose);
        self.calibrated = None;
    }

    /// Looks along z with y down, as the camera of a tracker does.
    pub fn look_along_world(&mut self) {
        (self.yaw, self.pitch) = (0.0, 0.0);
        self.upright = Upright { up: DVec3::NEG_Y, back: DVec3::NEG_Z };
        self.calibrated = None;
    }

    /// Shows the view of a calibrated camera. The first movement leaves it for an orbit about the point at `depth` on its
    /// axis, metres.
    pub fn show_calibrated(&mut self, camera: &Camera, depth: f64) {
        let [down, forward] = [1, 2].map(|row| camera.rotation.row(row));
        self.distance = depth.max(self.distances[0]);
        self.target = camera.center() + forward * self.distance;
        self.upright = Upright { up: -down, back: -forward };
        (self.yaw, self.pitch) = (0.0, 0.0);
        let edge = f64::from(camera.width.min(camera.height));
        self.field_of_view = 2.0 * (0.5 * edge / camera.focal.max_element()).atan();
        self.projection = Projection::Perspective;
        self.calibrated = Some(camera.clone());
    }

    /// Whether the view is that of a calibrated camera.
    pub fn is_calibrated(&self) -> bool {
        self.calibrated.is_some()
    }

    /// How depth changes sizes.
    pub fn projection(&self) -> Projection {
        self.projection
    }

    /// Switches between perspective and orthographic views; what is at the target's depth keeps its size.
    pub fn switch_projection(&mut self) {
        self.calibrated = None;
        self.projection = match self.projection {
            Projection::Perspective => Projection::Orthographic,
            Projection::Orthographic => Projection::Perspective,
        };
    }

    /// What to keep of the view.
    pub fn view_point(&self) -> ViewPoint {
        ViewPoint {
            target: self.target,
            distance: self.distance,
            yaw: self.yaw,
            pitch: self.pitch,
            up: self.upright.up,
            back: self.upright.back,
            field_of_view: self.field_of_view,
            projection: self.projection,
        }
    }

    /// Takes a view that was kept; it should be usable.
    pub fn take(&mut self, view: &ViewPoint) {
        self.target = view.target;
        self.distance = view.distance.clamp(self.distances[0], self.distances[1]);
        (self.yaw, self.pitch) = (view.yaw, view.pitch);
        self.upright = Upright { up: view.up, back: view.back };
        self.field_of_view = view.field_of_view;
        self.projection = view.projection;
        self.calibrated = None;
    }

    /// Depth of the plane from which a viewer would say that things are so far away, metres: 0, but an orthographic camera
    /// is farther away than it seems.
    pub fn apparent_depth(&self) -> f64 {
        match (self.projection, &self.calibrated) {
            (Projection::Orthographic, None) => ORTHOGRAPHIC_DISTANCE - self.distance,
            _ => 0.0,
        }
    }

    /// Rotates by a drag in points.
    pub fn orbit(&mut self, drag: DVec2) {
        self.turn(-drag.x * TURN_PER_POINT);
        let most = FRAC_PI_2 - POLE_MARGIN;
        self.pitch = (self.pitch + drag.y * TURN_PER_POINT).clamp(-most, most);
    }

    /// Moves around the target, radians.
    pub fn turn(&mut self, angle: f64) {
        self.calibrated = None;
        self.yaw = (self.yaw + angle).rem_euclid(TAU);
    }

    /// Moves by a drag in points, so that a surface at the target's depth follows the pointer; `edge` is the picture's
    /// shorter edge in points.
    pub fn pan(&mut self, drag: DVec2, edge: f64) {
        self.calibrated = None;
        let scale = 2.0 * self.distance * (0.5 * self.field_of_view).tan() / edge.max(1.0);
        let camera = self.camera([1, 1]);
        self.target -= (camera.rotation.row(0) * drag.x + camera.rotation.row(1) * drag.y) * scale;
    }

    /// Moves `factor` times nearer.
    pub fn zoom(&mut self, factor: f64) {
        self.calibrated = None;
        self.distance = (self.distance / factor).clamp(self.distances[0], self.distances[1]);
    }

    /// Moves `factor` times nearer, so that what is at `pointer` at the target's depth stays there: points from the
    /// picture's middle, whose shorter edge is `edge`.
    pub fn zoom_at(&mut self, factor: f64, pointer: DVec2, edge: f64) {
        let before = self.distance;
        self.zoom(factor);
        // At the new distance, what was under the pointer is farther from the middle.
        self.pan(pointer * (1.0 - before / self.distance), edge);
    }

    /// Along the shorter edge of the picture, radians.
    pub fn field_of_view(&self) -> f64 {
        self.field_of_view
    }

    /// Changes the field of view, and the distance with it, so that the target keeps its size.
    pub fn set_field_of_view(&mut self, angle: f64) {
        let before = (0.5 * self.field_of_view).tan();
        self.field_of_view = angle;
        self.zoom((0.5 * angle).tan() / before);
    }

    /// The camera for a picture of this size, pixels.
    pub fn camera(&self, [width, height]: [u32; 2]) -> Camera {
        if let Some(camera) = &self.calibrated {
            return camera.resized(width, height);
        }
        let mut slope = (0.5 * self.field_of_view).tan() * f64::from(height) / f64::from(width.min(height));
        let mut distance = self.distance;
        if self.projection == Projection::Orthographic {
            slope *= self.distance / ORTHOGRAPHIC_DISTANCE;
            distance = ORTHOGRAPHIC_DISTANCE;
        }
        let eye = self.target + self.direction() * distance;
        Camera::look_at(eye, self.target, self.upright.up, 2.0 * slope.atan(), width, height)
    }
}

#[cfg(test)]
mod tests {
    use ghand_test_support::procedural_hand::ProceduralHand;

    use super::*;

    fn setup() -> (HandModel, OrbitCamera) {
        let model = ProceduralHand { detail: 1, ..Default::default() }.build().unwrap();
        let camera = OrbitCamera::facing(&model, &Pose::rest(model.joint_count()), &model.vertices);
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
    fn an_orthographic_view_keeps_sizes_at_the_target_and_gives_all_depths_the_same() {
        let (model, mut orbit) = setup();
        orbit.orbit(DVec2::new(30.0, 12.0));
        let before = orbit.camera([400, 300]);
        orbit.switch_projection();
        let after = orbit.camera([400, 300]);
        let apart = (before.rotation - after.rotation).to_cols_array();
        assert!(apart.iter().all(|v| v.abs() < 1e-12));
        let across = after.rotation.row(0) * 0.05;
        let shown = |camera: &Camera, depth: f64| {
            let at = orbit.target - after.rotation.row(2) * depth;
            camera.project(at + across).0.distance(camera.project(at).0)
        };
        assert!((shown(&after, 0.0) / shown(&before, 0.0) - 1.0).abs() < 1e-9);
        for depth in [-0.1, 0.1] {
            // The bound that `ORTHOGRAPHIC_DISTANCE` promises.
            assert!((shown(&after, depth) / shown(&after, 0.0) - 1.0).abs() < 5.1e-4);
            assert!((shown(&before, depth) / shown(&before, 0.0) - 1.0).abs() > 0.1);
        }
        assert!((after.camera_from_world(orbit.target).z - orbit.apparent_depth() - orbit.distance).abs() < 1e-9);
        orbit.frame(&model.vertices);
        let camera = orbit.camera([300, 300]);
        let reach = |p: &DVec3| (camera.project(*p).0 - camera.principal).length() / 150.0;
        let most = model.vertices.iter().map(reach).fold(0.0, f64::max);
        assert!(most <= FILL + 1e-3 && most > 0.8 * FILL, "{most}");
        // What is under the pointer stays there in this view, too.
        let pointer = DVec2::new(80.0, -45.0);
        let world = |orbit: &OrbitCamera| {
            let camera = orbit.camera([400, 300]);
            let slope = (pointer / camera.focal).extend(1.0);
            camera.center() + camera.rotation.transpose() * (slope * ORTHOGRAPHIC_DISTANCE)
        };
        let place = world(&orbit);
        orbit.zoom_at(1.7, pointer, 300.0);
        assert!(world(&orbit).distance(place) < 1e-9);
    }

    #[test]
    fn a_view_is_taken_again_as_it_was_kept_and_nonsense_is_noticed() {
        let (_, mut orbit) = setup();
        orbit.orbit(DVec2::new(70.0, -30.0));
        orbit.switch_projection();
        let kept = orbit.view_point();
        assert!(kept.is_usable());
        let text = serde_json::to_string(&kept).unwrap();
        let (_, mut other) = setup();
        other.take(&serde_json::from_str(&text).unwrap());
        assert_eq!(other.camera([400, 300]), orbit.camera([400, 300]));
        let wrong = [
            ViewPoint { distance: f64::NAN, ..kept.clone() },
            ViewPoint { target: DVec3::splat(1e9), ..kept.clone() },
            ViewPoint { pitch: 1.6, ..kept.clone() },
            ViewPoint { up: kept.back, ..kept.clone() },
            ViewPoint { back: DVec3::ZERO, ..kept.clone() },
            ViewPoint { field_of_view: 0.0, ..kept },
        ];
        assert!(wrong.iter().all(|view| !view.is_usable()));
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

    #[test]
    fn zooming_keeps_what_is_under_the_pointer() {
        let (_, orbit) = setup();
        let camera = orbit.camera([400, 300]);
        let pointer = DVec2::new(80.0, -45.0);
        // The point at the target's depth under the pointer.
        let slope = (pointer / camera.focal).extend(1.0);
        let point = camera.center() + camera.rotation.transpose() * (slope * orbit.distance);
        for factor in [0.5, 1.7, 1e9] {
            let mut zoomed = orbit.clone();
            zoomed.zoom_at(factor, pointer, 300.0);
            let camera = zoomed.camera([400, 300]);
            assert!((camera.project(point).0 - camera.principal - pointer).length() < 1e-6, "{factor}");
        }
    }

    #[test]
    fn a_fist_fills_the_picture_once_it_is_framed() {
        let (model, mut orbit) = setup();
        let pose = ghand_hand_model::named_poses::named_pose("fist", &model).unwrap();
        let points = crate::framing::posed_vertices(&model, &pose);
        let extent = |orbit: &OrbitCamera| {
            let camera = orbit.camera([300, 300]);
            let places: Vec<DVec2> = points.iter().map(|p| (camera.project(*p).0 - camera.principal) / 150.0).collect();
            let (low, high) =
                places.iter().fold((DVec2::INFINITY, DVec2::NEG_INFINITY), |(a, b), p| (a.min(*p), b.max(*p)));
            ((low + high).length(), (high - low).max_element(), places.iter().map(|p| p.length()).fold(0.0, f64::max))
        };
        let (_, before, _) = extent(&orbit);
        let direction = orbit.direction();
        orbit.frame(&points);
        let (off, after, most) = extent(&orbit);
        assert!(orbit.direction().distance(direction) < 1e-12);
        assert!(after > 1.2 * before && off < 0.2 && most <= FILL + 1e-9, "{before} {after} {off} {most}");
    }

    #[test]
    fn a_change_of_the_field_of_view_keeps_the_size() {
        let (_, mut orbit) = setup();
        let size = |orbit: &OrbitCamera| orbit.camera([300, 300]).focal.x / orbit.distance;
        let before = size(&orbit);
        orbit.set_field_of_view(1.2);
        assert!((size(&orbit) / before - 1.0).abs() < 1e-9 && orbit.field_of_view() == 1.2);
    }

    #[test]
    fn each_side_of_either_hand_is_seen() {
        let (right, mut orbit) = setup();
        let left = ProceduralHand { detail: 1, left: true, ..Default::default() }.build().unwrap();
        for model in [right, left] {
            let pose = Pose::rest(model.joint_count());
            let mut seen = |side| {
                orbit.look_from(side, &model, &pose);
                orbit.frame(&model.vertices);
                let camera = orbit.camera([300, 300]);
                let at = |name: &str| camera.camera_from_world(model.joints[model.joint_index(name).unwrap()]);
                (at("thumb3"), at("index1"), at("pinky1"), at("middle1"), at("wrist"))
            };
            let (thumb, _, pinky, middle, wrist) = seen(ViewSide::Back);
            let mirror = if model.side == Side::Right { 1.0 } else { -1.0 };
            // The thumb of the back of a right hand is on the left.
            assert!(mirror * (pinky.x - thumb.x) > 0.0 && middle.y < wrist.y);
            let (thumb, _, pinky, ..) = seen(ViewSide::Palm);
            assert!(mirror * (pinky.x - thumb.x) < 0.0);
            let (_, index, pinky, ..) = seen(ViewSide::ThumbSide);
            assert!(index.z < pinky.z);
            let (_, index, pinky, ..) = seen(ViewSide::LittleFingerSide);
            assert!(pinky.z < index.z);
            let (.., middle, wrist) = seen(ViewSide::Fingertips);
            assert!(middle.z < wrist.z);
        }
    }

    #[test]
    fn a_calibrated_camera_is_shown_exactly_and_left_without_a_jump() {
        let (_, mut orbit) = setup();
        let eye = DVec3::new(0.4, 0.5, -0.3);
        let mut camera = Camera::look_at(eye, DVec3::ZERO, DVec3::new(0.3, -1.0, 0.1).normalize(), 0.6, 400, 300);
        camera.principal += DVec2::new(13.0, -8.0);
        orbit.show_calibrated(&camera, eye.length());
        assert!(orbit.is_calibrated());
        assert_eq!(orbit.camera([400, 300]), camera);
        assert_eq!(orbit.camera([200, 150]), camera.resized(200, 150));
        orbit.zoom(1.0);
        let left = orbit.camera([400, 300]);
        assert!(left.center().distance(eye) < 1e-9 && (left.focal - camera.focal).length() < 1e-6);
        let turned = left.rotation - camera.rotation;
        assert!(turned.to_cols_array().iter().all(|v| v.abs() < 1e-9), "{turned}");
    }
}
