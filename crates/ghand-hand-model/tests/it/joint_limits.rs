//! The axes of joints and how far they move, on the built-in hand and on rigs with WebXR's joints.

use ghand_core::rotation::rotation_from_axis_angle;
use ghand_core::{HandModel, Pose, Side};
use ghand_hand_model::files::gltf::read_gltf;
use ghand_hand_model::joints::axes::{JointAxes, fingertips};
use ghand_hand_model::joints::limits::{COUPLED_RATIO, COUPLED_SPREAD, JointLimits, random_pose};
use ghand_hand_model::joints::names::{Finger, JointRole};
use ghand_hand_model::named_poses::{POSE_NAMES, named_pose};
use ghand_test_support::procedural_hand::ProceduralHand;
use ghand_test_support::shared;
use glam::{DMat3, DVec3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Reflects points from one hand to the other.
const MIRROR: DVec3 = DVec3::new(-1.0, 1.0, 1.0);

/// Pairs of a right and a left hand. All of them have the fingers along -Y and the little finger towards +Z; the back
/// of the right ones faces +X.
fn pairs() -> Vec<[HandModel; 2]> {
    let procedural = |left| ProceduralHand { left, detail: 1, ..Default::default() }.build().unwrap();
    let read = |folder: &str, side: &str| {
        let path = shared(&format!("assets/{folder}/{side}.glb"))?;
        Some(read_gltf(&path, None).unwrap().model)
    };
    let files = ["generic-hand", "human-hand"]
        .into_iter()
        .filter_map(|folder| Some([read(folder, "right")?, read(folder, "left")?]));
    [[procedural(false), procedural(true)]].into_iter().chain(files).collect()
}

fn hands() -> Vec<HandModel> {
    pairs().into_iter().flatten().collect()
}

/// From the back of the hand through the palm.
fn palmwards(model: &HandModel) -> DVec3 {
    if model.side == Side::Right { DVec3::NEG_X } else { DVec3::X }
}

/// Role, index and axes of the joints with a role.
fn joints(model: &HandModel) -> Vec<(JointRole, usize, JointAxes)> {
    let roles = JointRole::of_joints(&model.joint_names);
    let axes = JointAxes::of_joints(model).unwrap();
    roles.iter().enumerate().filter_map(|(k, role)| Some(((*role)?, k, axes[k]))).collect()
}

/// How a finger's tip moves if a joint rotates by a tenth of a radian about an axis.
fn tip_moves(model: &HandModel, finger: Finger, joint: usize, axis: DVec3) -> DVec3 {
    let tip = fingertips(model, &JointRole::of_joints(&model.joint_names))[finger as usize];
    let from = model.joints[joint];
    from + rotation_from_axis_angle(0.1 * axis) * (tip - from) - tip
}

#[test]
fn positive_angles_flex_abduct_and_pronate_every_joint_of_every_finger() {
    for model in hands() {
        let palm = palmwards(&model);
        for (role, k, axes) in joints(&model) {
            let (JointRole::Bend(finger, _) | JointRole::Metacarpal(finger)) = role else { continue };
            let moves = |axis| tip_moves(&model, finger, k, axis).normalize();
            let what = format!("{} {}", model.name, model.joint_names[k]);
            let (inwards, outwards, turned) = match finger {
                Finger::Thumb => (DVec3::Z, palm, axes.twist.cross(DVec3::Z).dot(-palm)),
                Finger::Index | Finger::Middle => (palm, DVec3::NEG_Z, axes.twist.cross(-palm).dot(DVec3::NEG_Z)),
                Finger::Ring | Finger::Little => (palm, DVec3::Z, axes.twist.cross(-palm).dot(DVec3::NEG_Z)),
            };
            // A thumb's axes are between those of the palm.
            let least = if finger == Finger::Thumb { 0.4 } else { 0.85 };
            assert!(moves(axes.flexion).dot(inwards) > least, "{what} stretches: {}", moves(axes.flexion));
            assert!(moves(axes.abduction).dot(outwards) > least, "{what} adducts: {}", moves(axes.abduction));
            assert!(turned > least, "{what} supinates: {turned}");
        }
    }
}

#[test]
fn the_left_hand_with_the_same_angles_is_the_mirror_image() {
    for [right, left] in pairs() {
        // The files of the generic hand are mirrors only to their precision.
        let exact = right.joints.iter().zip(&left.joints).map(|(r, l)| (MIRROR * *r).distance(*l)).fold(0.0, f64::max);
        for ((role, _, r), (_, _, l)) in joints(&right).into_iter().zip(joints(&left)) {
            for (r, l) in [(r.flexion, l.flexion), (r.abduction, l.abduction), (r.twist, l.twist)] {
                // An axis is a pseudovector.
                assert!((-MIRROR * r).distance(l) <= 1e-12 + 300.0 * exact, "{} {role:?}: {r} {l}", right.name);
            }
        }
    }
}

#[test]
fn axes_are_orthonormal_and_angles_are_components_along_them() {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    for model in hands() {
        for (_, _, axes) in joints(&model) {
            let angles = DVec3::from_array(std::array::from_fn(|_| rng.random_range(-2.0..2.0)));
            let rotation = angles.x * axes.flexion + angles.y * axes.abduction + angles.z * axes.twist;
            assert!(axes.rotation(angles).distance(rotation) < 1e-14);
            assert!(axes.angles(rotation).distance(angles) < 1e-14);
        }
    }
}

/// MANO's right hand has its fingers along -X, its left hand along +X; the back of both faces +Y.
#[test]
fn in_manos_axes_fingers_flex_about_z() {
    for (left, sign) in [(false, 1.0), (true, -1.0)] {
        let turn = DMat3::from_cols(sign * DVec3::Y, sign * DVec3::X, DVec3::NEG_Z);
        let mut model = ProceduralHand { left, detail: 1, ..Default::default() }.build().unwrap();
        let before = joints(&model);
        for point in model.vertices.iter_mut().chain(&mut model.joints) {
            *point = turn * *point;
        }
        for ((role, _, before), (_, k, axes)) in before.into_iter().zip(joints(&model)) {
            assert!(axes.flexion.distance(turn * before.flexion) < 1e-12);
            if let JointRole::Bend(finger, _) = role
                && finger != Finger::Thumb
            {
                assert!(axes.flexion.dot(sign * DVec3::Z) > 0.9, "{} {}", model.joint_names[k], axes.flexion);
            }
        }
    }
}

#[test]
fn rest_is_within_every_range() {
    for (role, _, _) in hands().iter().flat_map(joints) {
        for range in JointLimits::of(role).ranges() {
            assert!(range.low <= 0.0 && range.high >= 0.0, "{role:?} {range:?}");
        }
    }
}

/// Flexion, abduction and twist of each joint beyond its range, radians.
fn excess(model: &HandModel, pose: &Pose) -> Vec<(usize, [f64; 3])> {
    let beyond = |(role, k, axes): (JointRole, usize, JointAxes)| {
        let angles = axes.angles(pose.rotations[k]).to_array();
        let ranges = JointLimits::of(role).ranges();
        (k, std::array::from_fn(|i| angles[i] - ranges[i].clamp(angles[i])))
    };
    joints(model).into_iter().map(beyond).collect()
}

fn largest(excess: &[(usize, [f64; 3])]) -> f64 {
    excess.iter().flat_map(|(_, e)| e).fold(0.0, |most, e| if most >= e.abs() { most } else { e.abs() })
}

#[test]
fn random_poses_fill_their_ranges_and_stay_within() {
    for model in hands() {
        let mut rng = ChaCha8Rng::seed_from_u64(2);
        let poses: Vec<Pose> = (0..400).map(|_| random_pose(&model, &mut rng).unwrap()).collect();
        for pose in &poses {
            assert!(largest(&excess(&model, pose)) < 1e-12);
            assert_eq!(pose.translation, DVec3::ZERO);
        }
        let joints = joints(&model);
        let flexion = |pose: &Pose, role| {
            let (_, k, axes) = joints.iter().find(|(known, _, _)| *known == role).unwrap();
            axes.angles(pose.rotations[*k]).x
        };
        for (role, k, axes) in &joints {
            for (i, range) in JointLimits::of(*role).ranges().iter().enumerate() {
                let angles = poses.iter().map(|pose| axes.angles(pose.rotations[*k])[i]);
                let (low, high) = angles.fold((f64::MAX, f64::MIN), |(low, high), a| (low.min(a), high.max(a)));
                assert!(high - low >= 0.75 * (range.high - range.low), "{} {role:?} {i}", model.name);
            }
        }
        for finger in [Finger::Index, Finger::Middle, Finger::Ring, Finger::Little] {
            for pose in &poses {
                let [middle, last] = [2, 3].map(|k| flexion(pose, JointRole::Bend(finger, k)));
                assert!((last - COUPLED_RATIO * middle).abs() < COUPLED_SPREAD + 1e-12);
            }
        }
    }
}

#[test]
fn named_poses_are_within_the_limits() {
    for model in hands() {
        for name in POSE_NAMES {
            let pose = named_pose(name, &model).unwrap();
            for (k, beyond) in excess(&model, &pose).into_iter().skip(1) {
                let beyond = DVec3::from_array(beyond).length().to_degrees();
                assert!(beyond < 0.1, "{}: {name}, {}: {beyond}", model.name, model.joint_names[k]);
            }
        }
    }
}

#[test]
fn a_rig_with_other_names_has_neither_axes_nor_limits() {
    let mut model = ProceduralHand { detail: 1, ..Default::default() }.build().unwrap();
    model.joint_names[2] = "bone".into();
    assert!(JointAxes::of_joints(&model).is_none());
    assert!(random_pose(&model, &mut ChaCha8Rng::seed_from_u64(4)).is_none());
}

#[test]
fn an_additional_joint_of_unknown_name_keeps_the_models_axes() {
    let mut model = ProceduralHand { detail: 1, ..Default::default() }.build().unwrap();
    let axes = JointAxes::of_joints(&model).unwrap();
    model.joint_names.push("elbow".into());
    model.joints.push(DVec3::Y);
    model.parents.push(Some(0));
    let with_elbow = JointAxes::of_joints(&HandModel { vertices: vec![], ..model.clone() });
    // Without skin there are no fingertips.
    assert!(with_elbow.is_none());
    for (finger, tip) in ["thumb", "index", "middle", "ring", "pinky"].into_iter().zip(fingertips_of_default()) {
        model.joint_names.push(format!("{finger}-tip"));
        model.joints.push(tip);
        model.parents.push(Some(0));
    }
    let with_elbow = JointAxes::of_joints(&model).unwrap();
    assert_eq!(with_elbow[..16], axes[..]);
    assert_eq!(with_elbow[16], JointAxes::OF_MODEL);
}

fn fingertips_of_default() -> [DVec3; 5] {
    let model = ProceduralHand { detail: 1, ..Default::default() }.build().unwrap();
    fingertips(&model, &JointRole::of_joints(&model.joint_names))
}
