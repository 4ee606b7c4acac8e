//! Named poses for hands whose joint names identify the fingers.

use ghand_core::{HandModel, Pose, Side};
use glam::DVec3;

use super::joint_names::{Finger, finger_joints};

/// Names that [`named_pose`] knows.
pub const POSE_NAMES: [&str; 12] =
    ["rest", "open", "relaxed", "spread", "fist", "pinch", "point", "victory", "three", "four", "thumbs-up", "ok"];

/// Joint angles in radians, independent of the rig.
struct Gesture {
    /// Index, middle, ring, little finger: three flexions, starting at the knuckle, and the rotation towards the little
    /// finger.
    fingers: [[f64; 4]; 4],
    /// Towards the palm and across it at the thumb's base, then the flexions of its two other joints.
    thumb: [f64; 4],
}

const CURLED: [f64; 4] = [1.42, 1.72, 1.05, 0.0];
const STRAIGHT: [f64; 4] = [0.0; 4];

fn gesture(name: &str) -> Option<Gesture> {
    // Curled fingers point at the same spot of the palm, which turns the outer ones inwards.
    let [index, middle, ring, little] = [0.10, 0.02, -0.10, -0.24].map(|side| [CURLED[0], CURLED[1], CURLED[2], side]);
    // Next to a straight finger the web limits how far a knuckle bends.
    let bent_alone = [1.25, CURLED[1], CURLED[2], -0.10];
    let folded_thumb = [0.16, 0.12, 0.88, 1.09];
    Some(match name {
        "rest" => Gesture { fingers: [STRAIGHT; 4], thumb: [0.0; 4] },
        "relaxed" => Gesture {
            fingers: [
                [0.25, 0.35, 0.2, 0.03],
                [0.32, 0.4, 0.22, 0.0],
                [0.38, 0.42, 0.24, -0.04],
                [0.42, 0.42, 0.26, -0.1],
            ],
            thumb: [0.2, 0.15, 0.15, 0.2],
        },
        "open" => Gesture {
            fingers: [
                [-0.03, 0.02, 0.02, -0.05],
                [-0.03, 0.02, 0.02, 0.0],
                [-0.03, 0.02, 0.02, 0.05],
                [-0.03, 0.04, 0.02, 0.1],
            ],
            thumb: [-0.03, -0.12, -0.05, -0.05],
        },
        "spread" => Gesture {
            fingers: [[0.0, 0.0, 0.0, -0.12], STRAIGHT, [0.0, 0.0, 0.0, 0.12], [0.0, 0.0, 0.0, 0.22]],
            thumb: [-0.05, -0.25, -0.05, -0.1],
        },
        "fist" => Gesture { fingers: [index, middle, ring, little], thumb: folded_thumb },
        "pinch" => Gesture {
            fingers: [[1.0, 0.7, 0.5, 0.04], [0.40, 0.45, 0.25, 0.0], [0.30, 0.35, 0.2, 0.0], [0.22, 0.3, 0.2, 0.0]],
            thumb: [0.12, 0.16, 0.54, 0.54],
        },
        "point" => Gesture { fingers: [STRAIGHT, middle, ring, little], thumb: folded_thumb },
        "victory" => Gesture {
            fingers: [[0.0, 0.0, 0.0, -0.14], [0.0, 0.0, 0.0, 0.12], bent_alone, little],
            thumb: [-0.08, 0.69, 0.60, 0.87],
        },
        "three" => Gesture {
            fingers: [[0.0, 0.0, 0.0, -0.12], STRAIGHT, [0.0, 0.0, 0.0, 0.1], little],
            thumb: [-0.02, 0.69, 0.60, 0.87],
        },
        "four" => Gesture {
            fingers: [[0.0, 0.0, 0.0, -0.1], STRAIGHT, [0.0, 0.0, 0.0, 0.08], [0.0, 0.0, 0.0, 0.18]],
            thumb: [0.05, 0.69, 0.60, 0.75],
        },
        "ok" => Gesture {
            fingers: [[1.0, 0.7, 0.5, 0.04], [0.18, 0.22, 0.12, 0.0], [0.05, 0.1, 0.06, 0.06], [0.0, 0.04, 0.04, 0.14]],
            thumb: [0.12, 0.16, 0.54, 0.54],
        },
        "thumbs-up" => Gesture { fingers: [index, middle, ring, little], thumb: [-0.15, -0.35, -0.1, -0.15] },
        _ => return None,
    })
}

/// Directions of a flat hand, unit vectors in model axes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HandDirections {
    /// From the wrist to the middle finger's knuckle.
    pub forward: DVec3,
    /// From the index finger's knuckle to the little finger's.
    pub across: DVec3,
    /// The direction that the back of the hand faces.
    pub back: DVec3,
}

/// Directions of a model at rest; `None` if the names of its joints do not identify the three joints of each finger.
pub fn hand_directions(model: &HandModel) -> Option<HandDirections> {
    let knuckle = |finger| Some(model.joints[finger_joints(finger, model)?[0]]);
    let across = (knuckle(Finger::Little)? - knuckle(Finger::Index)?).normalize_or_zero();
    let forward = (knuckle(Finger::Middle)? - model.joints[0]).normalize_or_zero();
    let back = across.cross(forward).normalize_or_zero() * if model.side == Side::Right { 1.0 } else { -1.0 };
    Some(HandDirections { forward, across, back })
}

/// The pose of that name for a model. `None` if the name is not in [`POSE_NAMES`] or the names of the model's joints
/// do not identify the three joints of each finger (see [`super::joint_names`]).
///
/// Axes come from the rest pose, which must be roughly flat: a finger flexes in the plane through its first bone and
/// the palm's normal. The root stays where it is.
pub fn named_pose(name: &str, model: &HandModel) -> Option<Pose> {
    let gesture = gesture(name)?;
    let at = |joint: usize| model.joints[joint];
    let fingers = Finger::ALL.map(|finger| finger_joints(finger, model));
    let [Some(thumb), Some(index), Some(middle), Some(ring), Some(pinky)] = fingers else { return None };
    let HandDirections { across, back, .. } = hand_directions(model)?;
    let mut pose = Pose::rest(model.joint_count());
    for (joints, [first, second, third, side]) in [index, middle, ring, pinky].into_iter().zip(gesture.fingers) {
        let along = (at(joints[1]) - at(joints[0])).normalize_or_zero();
        let flexion = turning(along, -back);
        pose.rotations[joints[0]] = first * flexion + side * turning(along, across);
        pose.rotations[joints[1]] = second * flexion;
        pose.rotations[joints[2]] = third * flexion;
    }
    let along = (at(thumb[1]) - at(thumb[0])).normalize_or_zero();
    let [to_palm, to_little, second, third] = gesture.thumb;
    // The thumb's own joints bend mostly across the palm.
    let flexion = turning(along, across - 0.45 * back);
    pose.rotations[thumb[0]] = to_palm * turning(along, -back) + to_little * turning(along, across);
    pose.rotations[thumb[1]] = second * flexion;
    pose.rotations[thumb[2]] = third * flexion;
    Some(pose)
}

/// The axis about which a small rotation moves `from` towards `to`.
fn turning(from: DVec3, to: DVec3) -> DVec3 {
    from.cross(to).normalize_or_zero()
}

#[cfg(test)]
mod tests {
    use glam::{DMat3, DQuat};

    use super::*;
    use crate::gltf::read_gltf;
    use crate::procedural::ProceduralHand;
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
        // The tips' farthest points: the pads are closer.
        assert!(pinch[0].distance(pinch[4]) < 0.016);
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
            check(&read_gltf(&path).unwrap());
        }
    }

    #[test]
    fn a_rig_with_other_names_has_no_named_poses() {
        let mut model = ProceduralHand { detail: 1, ..Default::default() }.build().unwrap();
        model.joint_names[2] = "bone".into();
        assert!(named_pose("fist", &model).is_none());
    }
}
