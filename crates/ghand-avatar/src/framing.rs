//! Places cameras so that a hand fills the picture.

use std::f64::consts::TAU;

use ghand_core::posing::pose_hand;
use ghand_core::rotation::rotation_from_axis_angle;
use ghand_core::{Camera, HandModel, Pose, Side};
use ghand_hand_model::joints::hand_directions::hand_directions;
use glam::{DMat3, DQuat, DVec2, DVec3};

/// Distance of a turntable's cameras from the middle of the hand, metres.
pub const TURNTABLE_DISTANCE: f64 = 0.6;
/// Fraction of the picture, from edge to edge, that the hand may fill.
const FILL: f64 = 0.9;
/// Field of view of a portrait's height, radians: about that of a portrait lens.
const PORTRAIT_FIELD: f64 = 0.4;
/// Turn of a portrait's camera towards the thumb and above the horizon, radians: enough to see depth.
const PORTRAIT_TURN: DVec2 = DVec2::new(0.4, 0.1);

/// Orientation of a hand; unit vectors, world axes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Upright {
    /// Direction of the fingers.
    pub up: DVec3,
    /// Direction that the back of the hand faces.
    pub back: DVec3,
}

impl Upright {
    /// For a model at rest. Hands with unknown joint names are assumed to be oriented like the built-in one.
    pub fn at_rest(model: &HandModel) -> Upright {
        let built_in = if model.side == Side::Right { DVec3::X } else { DVec3::NEG_X };
        hand_directions(model)
            .map_or(Upright { up: DVec3::NEG_Y, back: built_in }, |d| Upright { up: d.forward, back: d.back })
    }

    /// For a model in a pose, following its root's rotation.
    pub fn posed(model: &HandModel, pose: &Pose) -> Upright {
        let turn = pose.rotations.first().map_or(DMat3::IDENTITY, |root| rotation_from_axis_angle(*root));
        let Upright { up, back } = Upright::at_rest(model);
        Upright { up: turn * up, back: turn * back }
    }
}

/// The model's vertices in a pose, world, metres. For a pose that does not fit the model they are those at rest: code
/// that poses the hand reports it.
pub fn posed_vertices(model: &HandModel, pose: &Pose) -> Vec<DVec3> {
    pose_hand(model, &[], pose).map_or_else(|_| model.vertices.clone(), |posed| posed.vertices)
}

/// Middle of the box around points.
pub fn middle(points: &[DVec3]) -> DVec3 {
    let first = points.first().copied().unwrap_or_default();
    let (low, high) = points.iter().fold((first, first), |(low, high), p| (low.min(*p), high.max(*p)));
    (low + high) * 0.5
}

/// Cameras around a hand, `[pose][view]`, starting at the back of the hand, fingers up as in the first pose. The whole
/// ring follows the hand's translation and keeps one field of view that fits every pose.
pub fn turntable(model: &HandModel, poses: &[&Pose], views: usize, size: [u32; 2]) -> Vec<Vec<Camera>> {
    let angles: Vec<f64> = (0..views).map(|view| TAU * view as f64 / views as f64).collect();
    rings(model, poses, |_| angles.clone(), size)
}

/// A camera for each pose, going around the hand `turns` times and starting at its back: as in a turntable, the camera
/// after the last pose would be at the start again.
pub fn orbit(model: &HandModel, poses: &[&Pose], turns: f64, size: [u32; 2]) -> Vec<Camera> {
    let angle = |pose: usize| vec![TAU * turns * pose as f64 / poses.len() as f64];
    rings(model, poses, angle, size).into_iter().flatten().collect()
}

/// Cameras around a hand, `[pose][view]`, from the angles for each pose.
fn rings(
    model: &HandModel,
    poses: &[&Pose],
    angles: impl Fn(usize) -> Vec<f64>,
    [width, height]: [u32; 2],
) -> Vec<Vec<Camera>> {
    let Some(first) = poses.first() else { return Vec::new() };
    let center = middle(&posed_vertices(model, first));
    let Upright { up, back } = Upright::posed(model, first);
    let ring = |pose: usize, target: DVec3, fov_y: f64| -> Vec<Camera> {
        let camera = |angle: f64| {
            let direction = DQuat::from_axis_angle(up, angle) * back;
            Camera::look_at(target + direction * TURNTABLE_DISTANCE, target, up, fov_y, width, height)
        };
        angles(pose).into_iter().map(camera).collect()
    };
    let targets: Vec<DVec3> = poses.iter().map(|p| center + p.translation - first.translation).collect();
    // Slopes, as multiples of the picture's height, of the outermost point in any picture.
    let aspect = f64::from(width) / f64::from(height);
    let mut slope = 0.0f64;
    for (number, (pose, target)) in poses.iter().zip(&targets).enumerate() {
        let points = posed_vertices(model, pose);
        for camera in ring(number, *target, 1.0) {
            for p in points.iter().map(|p| camera.camera_from_world(*p)).filter(|p| p.z > 0.1 * TURNTABLE_DISTANCE) {
                slope = slope.max(p.y.abs() / p.z).max(p.x.abs() / p.z / aspect);
            }
        }
    }
    let fov_y = 2.0 * (slope.clamp(1e-3, 10.0) / FILL).atan();
    targets.iter().enumerate().map(|(number, target)| ring(number, *target, fov_y)).collect()
}

/// A camera that sees the back of the hand and a little of the thumb's side, fingers up, for any rotation of the hand;
/// `points` (world, metres) fill the picture.
pub fn portrait(model: &HandModel, pose: &Pose, points: &[DVec3], [width, height]: [u32; 2]) -> Camera {
    let Upright { up, back } = Upright::posed(model, pose);
    let to_thumb = if model.side == Side::Right { -PORTRAIT_TURN.x } else { PORTRAIT_TURN.x };
    let raised = DQuat::from_axis_angle(up.cross(back).normalize_or(DVec3::X), -PORTRAIT_TURN.y) * back;
    let direction = DQuat::from_axis_angle(up, to_thumb) * raised;
    let target = middle(points);
    let far = Camera::look_at(target + direction, target, up, PORTRAIT_FIELD, width, height);
    // Slopes of the picture's edges, and the least distance at which every point is inside.
    let slopes = DVec2::new(f64::from(width), f64::from(height)) / (2.0 * far.focal) * FILL;
    let needed = points.iter().map(|p| {
        let offset = far.rotation * (*p - target);
        (offset.truncate().abs() / slopes).max_element() - offset.z
    });
    let distance = needed.fold(0.0, f64::max).max(f64::MIN_POSITIVE);
    Camera::look_at(target + direction * distance, target, up, PORTRAIT_FIELD, width, height)
}

#[cfg(test)]
mod tests {
    use ghand_hand_model::named_poses::named_pose;
    use ghand_test_support::procedural_hand::ProceduralHand;

    use ghand_core::skeleton::pose_skeleton;

    use super::*;

    #[test]
    fn a_hand_that_is_horizontal_in_its_model_is_shown_upright() {
        let model = ProceduralHand { detail: 1, ..Default::default() }.build().unwrap();
        // A quarter turn, as in MANO's hands: the box around the hand turns with it.
        let turn = DMat3::from_rotation_z(-std::f64::consts::FRAC_PI_2);
        let mut lying = model.clone();
        lying.vertices.iter_mut().chain(&mut lying.joints).for_each(|p| *p = turn * *p);
        let (a, b) = (Upright::at_rest(&model), Upright::at_rest(&lying));
        assert!((turn * a.up).distance(b.up) < 1e-12 && (turn * a.back).distance(b.back) < 1e-12);
        assert!(a.up.dot(DVec3::NEG_Y) > 0.98 && a.back.dot(DVec3::X) > 0.98 && b.up.dot(a.up) < 0.5);
        let pose = Pose::rest(model.joint_count());
        let seen = |model: &HandModel| {
            let camera = &turntable(model, &[&pose], 5, [300, 300])[0][2];
            model.vertices.iter().map(|v| camera.project(*v).0).collect::<Vec<DVec2>>()
        };
        let moved = seen(&model).iter().zip(seen(&lying)).map(|(a, b)| a.distance(b)).collect::<Vec<f64>>();
        assert!(moved.iter().all(|d| *d < 1e-6), "the pictures are the same");
    }

    #[test]
    fn a_turntable_holds_the_hand_fingers_up_and_fills_the_picture() {
        for left in [false, true] {
            let model = ProceduralHand { detail: 1, left, ..Default::default() }.build().unwrap();
            let mut fist = named_pose("fist", &model).unwrap();
            fist.translation = DVec3::new(0.3, 0.1, -0.2);
            let poses = [Pose::rest(model.joint_count()), fist];
            for size in [[320, 320], [200, 400], [400, 200]] {
                let cameras = turntable(&model, &poses.each_ref(), 7, size);
                let mut most = 0.0f64;
                for (pose, ring) in poses.iter().zip(&cameras) {
                    let points = posed_vertices(&model, pose);
                    let tip = posed_vertices(&model, pose).len() - 1;
                    assert_eq!((ring.len(), tip > 0), (7, true));
                    for camera in ring {
                        assert!((camera.center() - middle(&points)).length() < 0.75);
                        let wrist = camera.project(pose.translation + model.joints[0]).0;
                        let knuckle = camera.project(pose.translation + model.joints[4]).0;
                        assert!(knuckle.y < wrist.y, "the fingers point down");
                        for p in &points {
                            let (p, _) = camera.project(*p);
                            let edge = (p / DVec2::new(size[0].into(), size[1].into()) - 0.5).abs().max_element();
                            most = most.max(edge);
                        }
                    }
                }
                assert!((most - 0.5 * FILL).abs() < 1e-6, "{size:?}: {most}");
            }
        }
    }

    #[test]
    fn an_orbit_goes_around_while_the_hand_moves() {
        let model = ProceduralHand { detail: 1, ..Default::default() }.build().unwrap();
        let rest = Pose::rest(model.joint_count());
        let fist = named_pose("fist", &model).unwrap();
        let poses = [&rest, &fist, &rest, &fist];
        let still = turntable(&model, &[&rest], 4, [200, 200]);
        for (turns, views) in [(1.0, [0, 1, 2, 3]), (-1.0, [0, 3, 2, 1]), (2.0, [0, 2, 0, 2]), (-0.5, [0, 9, 3, 9])] {
            let cameras = orbit(&model, &poses, turns, [200, 200]);
            assert_eq!(cameras.len(), 4);
            for (camera, view) in cameras.iter().zip(views).filter(|(_, view)| *view < 4) {
                assert!(camera.center().distance(still[0][view].center()) < 1e-9, "{turns} turns, view {view}");
            }
            assert!(cameras.iter().all(|c| c.focal == cameras[0].focal), "the field of view changes");
        }
    }

    #[test]
    fn a_portrait_shows_the_back_of_the_hand_for_any_rotation() {
        for left in [false, true] {
            let model = ProceduralHand { detail: 1, left, ..Default::default() }.build().unwrap();
            let mut pose = named_pose("fist", &model).unwrap();
            for root in [DVec3::ZERO, DVec3::new(1.0, -2.0, 0.5)] {
                pose.rotations[0] = root;
                pose.translation = root;
                let points = posed_vertices(&model, &pose);
                for size in [[320, 320], [100, 400], [400, 100]] {
                    let camera = portrait(&model, &pose, &points, size);
                    let picture = DVec2::new(size[0].into(), size[1].into());
                    let edge = |p: &DVec3| (camera.project(*p).0 / picture - 0.5).abs().max_element();
                    let most = points.iter().map(edge).fold(0.0, f64::max);
                    assert!((most - 0.5 * FILL).abs() < 1e-9, "{most}");
                    let chain = pose_skeleton(&model.parents, &model.joints, &pose.rotations);
                    let seen =
                        |k: usize| camera.project(chain.posed_from_rest[k].apply(model.joints[k]) + pose.translation);
                    let at = |name: &str| seen(model.joint_index(name).unwrap());
                    assert!(at("middle1").0.y < seen(0).0.y, "the fingers point up");
                    assert!(at("middle3").1 > at("middle2").1, "a fist's fingertips are behind the hand's back");
                    let thumb_is_left = at("index1").0.x < at("pinky1").0.x;
                    assert_eq!(thumb_is_left, !left, "a right hand seen on its back has its thumb on the left");
                }
            }
        }
    }
}
