//! Named poses for hands whose joint names identify the fingers.
//!
//! A pose is a set of anatomical angles ([`JointAxes`]), the same on every rig and within the limits of
//! [`crate::joints::limits`]. They are tuned on the built-in hand: fingertips that touch do so there, and no part of it
//! is more than 2 mm inside another.

use ghand_core::{HandModel, Pose};
use glam::DVec3;

use crate::joints::axes::JointAxes;
use crate::joints::names::{Finger, JointRole};

/// Names that [`named_pose`] knows.
pub const POSE_NAMES: [&str; 12] =
    ["rest", "open", "relaxed", "spread", "fist", "pinch", "point", "victory", "three", "four", "thumbs-up", "ok"];

/// Angles in degrees.
struct Gesture {
    /// Index, middle, ring, little finger: flexions of the knuckle and the two hinges, and the knuckle's abduction.
    fingers: [[f64; 4]; 4],
    /// Flexion, abduction and twist of the thumb's base, and flexions of its knuckle and its hinge.
    thumb: [f64; 5],
}

const STRAIGHT: [f64; 4] = [0.0; 4];
// Of a fist. Flexed farther, the tips would be inside the palm, and the skin of two bones inside each other.
const INDEX: [f64; 4] = [71.0, 91.0, 60.0, -2.0];
const MIDDLE: [f64; 4] = [76.0, 91.0, 56.0, 0.0];
const RING: [f64; 4] = [77.0, 93.0, 54.0, 1.0];
const LITTLE: [f64; 4] = [77.0, 89.0, 47.0, -3.0];

// Pad on pad.
const INDEX_TO_THUMB: [f64; 4] = [58.0, 42.0, 23.0, 0.0];
const THUMB_TO_INDEX: [f64; 5] = [16.0, 15.0, 0.0, 19.0, 24.0];

/// A straight finger that moves sideways.
const fn sideways(abduction: f64) -> [f64; 4] {
    [0.0, 0.0, 0.0, abduction]
}

fn gesture(name: &str) -> Option<Gesture> {
    let (fingers, thumb) = match name {
        "rest" => ([STRAIGHT; 4], [0.0; 5]),
        "open" => (
            [[-2.0, 1.0, 1.0, 3.0], [-2.0, 1.0, 1.0, 0.0], [-2.0, 1.0, 1.0, 3.0], [-2.0, 2.0, 1.0, 6.0]],
            [-8.0, -2.0, 0.0, 0.0, -2.0],
        ),
        "relaxed" => (
            [[14.0, 20.0, 11.0, 0.0], [18.0, 23.0, 13.0, 0.0], [21.0, 24.0, 14.0, -2.0], [23.0, 24.0, 15.0, -4.0]],
            [16.0, 7.0, 3.0, 8.0, 10.0],
        ),
        "spread" => ([sideways(8.0), STRAIGHT, sideways(7.0), sideways(13.0)], [-14.0, -3.0, 0.0, 0.0, -4.0]),
        "fist" => ([INDEX, MIDDLE, RING, LITTLE], [23.0, 28.0, 8.0, 35.0, 43.0]),
        "pinch" => (
            [INDEX_TO_THUMB, [34.0, 32.0, 18.0, 0.0], [27.0, 28.0, 16.0, 0.0], [22.0, 25.0, 15.0, 0.0]],
            THUMB_TO_INDEX,
        ),
        "point" => ([STRAIGHT, MIDDLE, RING, LITTLE], [34.0, 28.0, 6.0, 34.0, 47.0]),
        "victory" => ([sideways(9.0), sideways(-8.0), RING, LITTLE], [38.0, 20.0, 2.0, 38.0, 47.0]),
        "three" => ([sideways(7.0), STRAIGHT, sideways(6.0), [79.0, 68.0, 37.0, -5.0]], [38.0, 7.0, 2.0, 38.0, 59.0]),
        "four" => ([sideways(6.0), STRAIGHT, sideways(5.0), sideways(10.0)], [10.0, -7.0, 10.0, 40.0, 51.0]),
        "thumbs-up" => ([INDEX, MIDDLE, RING, LITTLE], [-14.0, -7.0, 0.0, 0.0, -6.0]),
        "ok" => ([INDEX_TO_THUMB, [10.0, 13.0, 7.0, 0.0], [3.0, 6.0, 3.0, 3.0], [0.0, 2.0, 2.0, 8.0]], THUMB_TO_INDEX),
        _ => return None,
    };
    Some(Gesture { fingers, thumb })
}

impl Gesture {
    /// Flexion, abduction and twist of the joint that moves a part of the hand, degrees.
    fn angles(&self, role: JointRole) -> DVec3 {
        let [flexion, abduction, twist, knuckle, hinge] = self.thumb;
        match role {
            JointRole::Bend(Finger::Thumb, 1) => DVec3::new(flexion, abduction, twist),
            JointRole::Bend(Finger::Thumb, 2) => DVec3::X * knuckle,
            JointRole::Bend(Finger::Thumb, _) => DVec3::X * hinge,
            JointRole::Bend(finger, k) => {
                let [knuckle, middle, last, abduction] = self.fingers[finger as usize - Finger::Index as usize];
                match k {
                    1 => DVec3::new(knuckle, abduction, 0.0),
                    2 => DVec3::X * middle,
                    _ => DVec3::X * last,
                }
            }
            JointRole::Wrist | JointRole::Palm | JointRole::Metacarpal(_) | JointRole::Tip(_) => DVec3::ZERO,
        }
    }
}

/// The pose of that name for a model. `None` if the name is not in [`POSE_NAMES`] or the names of the model's joints
/// do not identify the three joints of each finger (see [`crate::joints::names`]).
///
/// Angles are measured from the rest pose, which must be roughly flat with the thumb spread. The root stays where it is.
pub fn named_pose(name: &str, model: &HandModel) -> Option<Pose> {
    let gesture = gesture(name)?;
    let roles = JointRole::of_joints(&model.joint_names);
    let axes = JointAxes::of_joints(model)?;
    let rotation = |(axes, role): (&JointAxes, Option<JointRole>)| {
        role.map_or(DVec3::ZERO, |role| axes.rotation(gesture.angles(role).map(f64::to_radians)))
    };
    Some(Pose { rotations: axes.iter().zip(roles).map(rotation).collect(), ..Pose::rest(model.joint_count()) })
}

#[cfg(test)]
mod tests {
    use ghand_core::Side;
    use glam::{DMat3, DQuat};

    use super::*;
    use crate::files::gltf::read_gltf;
    use crate::joints::names::finger_joints;
    use ghand_test_support::procedural_hand::ProceduralHand;
    use ghand_test_support::shared;

    /// New positions of points fixed to each joint at rest, from an independent, simple walk along the chain.
    fn posed(model: &HandModel, pose: &Pose, points: &[(usize, DVec3)]) -> Vec<DVec3> {
        let mut turns: Vec<DMat3> = Vec::new();
        let mut places: Vec<DVec3> = Vec::new();
        for (k, parent) in model.parents.iter().enumerate() {
            let own = DMat3::from_quat(DQuat::from_scaled_axis(pose.rotations[k]));
            let (turn, place) = match *parent {
                None => (own, model.joints[k]),
                Some(p) => (turns[p] * own, places[p] + turns[p] * (model.joints[k] - model.joints[p])),
            };
            turns.push(turn);
            places.push(place);
        }
        points.iter().map(|&(k, p)| places[k] + turns[k] * (p - model.joints[k])).collect()
    }

    /// The vertex farthest from the wrist among those that move with a joint.
    fn tip(model: &HandModel, finger: Finger) -> (usize, DVec3) {
        let last = finger_joints(finger, model).unwrap()[2];
        let tip_joint = model.parents.iter().position(|p| *p == Some(last)).unwrap_or(last);
        let bound = (0..model.vertices.len()).filter(|&i| {
            let row = model.vertex_weights(i);
            row[last] + if tip_joint == last { 0.0 } else { row[tip_joint] } > 0.9
        });
        let away = |i: &usize| model.vertices[*i].distance(model.joints[last]);
        (last, model.vertices[bound.max_by(|a, b| away(a).total_cmp(&away(b))).unwrap()])
    }

    fn check(model: &HandModel) {
        let towards_palm = if model.side == Side::Right { -1.0 } else { 1.0 };
        let fingers = [Finger::Index, Finger::Middle, Finger::Ring, Finger::Little, Finger::Thumb];
        let tips = fingers.map(|finger| tip(model, finger));
        let rest = posed(model, &named_pose("rest", model).unwrap(), &tips);
        for ((_, at_rest), posed) in tips.iter().zip(&rest) {
            assert!(at_rest.distance(*posed) < 1e-12);
        }
        let relaxed = posed(model, &named_pose("relaxed", model).unwrap(), &tips);
        for (finger, (before, after)) in rest.iter().zip(&relaxed).enumerate() {
            assert!((after.x - before.x) * towards_palm > 0.0, "{:?} curls backwards", fingers[finger]);
        }
        let fist = posed(model, &named_pose("fist", model).unwrap(), &tips);
        for finger in 0..4 {
            let reach = |p: DVec3| p.distance(model.joints[0]);
            assert!(reach(fist[finger]) < 0.72 * reach(rest[finger]), "{:?} stays out of the fist", fingers[finger]);
        }
        let point = posed(model, &named_pose("point", model).unwrap(), &tips);
        assert!(point[0].distance(rest[0]) < 1e-12 && point[1].distance(rest[1]) > 0.05);
        let pinch = posed(model, &named_pose("pinch", model).unwrap(), &tips);
        println!("{}: pinch gap {:.1} mm", model.name, pinch[0].distance(pinch[4]) * 1e3);
        // The tips' farthest points: the pads are closer. On a hand of other proportions and another thumb at rest, the
        // angles that close the built-in hand's fingertips leave a gap: 25.4 mm on the generic hand, whose thumb begins
        // 15 mm nearer to the tips.
        assert!(pinch[0].distance(pinch[4]) < 0.028);
        let spread = posed(model, &named_pose("spread", model).unwrap(), &tips);
        assert!(spread[0].distance(spread[3]) > rest[0].distance(rest[3]) + 0.01);
        for name in POSE_NAMES {
            assert!(named_pose(name, model).unwrap().rotations.iter().all(|r| r.is_finite()));
        }
        assert!(named_pose("salute", model).is_none());
    }

    #[test]
    fn poses_bend_procedural_fingers_towards_the_palm() {
        check(&ProceduralHand::default().build().unwrap());
        check(&ProceduralHand { left: true, ..Default::default() }.build().unwrap());
    }

    #[test]
    fn poses_bend_webxr_fingers_towards_the_palm() {
        for file in ["right.glb", "left.glb"] {
            let Some(path) = shared(&format!("assets/generic-hand/{file}")) else { return };
            check(&read_gltf(&path, None).unwrap().model);
        }
    }

    #[test]
    fn a_rig_with_other_names_has_no_named_poses() {
        let mut model = ProceduralHand { detail: 1, ..Default::default() }.build().unwrap();
        model.joint_names[2] = "bone".into();
        assert!(named_pose("fist", &model).is_none());
    }
}
