#![allow(clippy::neg_cmp_op_on_partial_ord, reason = "`!(error <= bound)` rejects NaN too")]

use ghand_core::Side;
use ghand_core::posing::pose_hand;
use ghand_core::skeleton::pose_skeleton;
use ghand_hand_model::named_poses::{POSE_NAMES, named_pose};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::*;
use crate::test_hands::{generic, hands, larger, natural_pose, procedural};

/// Rotations of the joints in space.
fn in_space(rig: &RestSkeleton, pose: &Pose) -> Vec<DMat3> {
    pose_skeleton(&rig.parents, &rig.joints, &pose.rotations).world.iter().map(|g| g.linear).collect()
}

/// Largest entry of the differences; NaN if one is NaN.
fn difference(a: &DMat3, b: &DMat3) -> f64 {
    (*a - *b).to_cols_array().iter().map(|e| e.abs()).fold(0.0, larger)
}

/// Whether two poses are the same to 1e-6 on all joints of a role that both skeletons have.
fn same(first: &RestSkeleton, second: &RestSkeleton, before: &Pose, after: &Pose) -> Result<(), String> {
    for (k, role) in first.roles.iter().enumerate() {
        if role.is_none_or(|role| second.joint(role).is_none()) {
            continue;
        }
        let [a, b] = [before, after].map(|pose| rotation_from_axis_angle(pose.rotations[k]));
        if !(difference(&a, &b) <= 1e-6) {
            return Err(format!("{} is off by {:.1e}", first.joint_names[k], difference(&a, &b)));
        }
    }
    let moved = before.translation.distance(after.translation);
    if moved <= 1e-6 { Ok(()) } else { Err(format!("the wrist is {moved} m off")) }
}

#[test]
fn a_round_trip_is_the_identity() {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let rigs: Vec<RestSkeleton> = hands().iter().map(|model| RestSkeleton::of(model).unwrap()).collect();
    let rigs: Vec<RestSkeleton> =
        rigs.into_iter().chain([Side::Right, Side::Left].map(|side| RestSkeleton::webxr(side).clone())).collect();
    for model in hands() {
        let first = RestSkeleton::of(&model).unwrap();
        for second in &rigs {
            let there = Retarget::new(&first, second);
            let back = Retarget::new(second, &first);
            for _ in 0..50 {
                let pose = natural_pose(&model, &mut rng);
                let again = back.pose(&there.pose(&pose));
                same(&first, second, &pose, &again)
                    .unwrap_or_else(|e| panic!("{} to {}: {e}", first.name, second.name));
            }
        }
    }
}

#[test]
fn the_round_trip_comparison_rejects_a_wrong_joint_and_numbers_that_are_not_finite() {
    let model = procedural(Side::Right);
    let rig = RestSkeleton::of(model).unwrap();
    let pose = named_pose("fist", model).unwrap();
    let changed = |joint: usize, by: DVec3| {
        let mut other = pose.clone();
        other.rotations[joint] += by;
        same(&rig, &rig, &pose, &other)
    };
    assert!(changed(5, DVec3::ZERO).is_ok());
    assert!(changed(5, DVec3::X * 1e-5).is_err() && changed(15, DVec3::NAN).is_err());
    let mut one = DMat3::IDENTITY;
    one.x_axis.y = f64::NAN;
    assert!(difference(&one, &DMat3::IDENTITY).is_nan());
    let moved = Pose { translation: DVec3::NAN, ..pose.clone() };
    assert!(same(&rig, &rig, &pose, &moved).is_err());
}

#[test]
fn metacarpal_motion_is_lost_but_finger_directions_are_kept() {
    let Some(model) = generic(Side::Right) else { return };
    let (first, second) = (RestSkeleton::of(&model).unwrap(), RestSkeleton::of(procedural(Side::Right)).unwrap());
    let mut rng = ChaCha8Rng::seed_from_u64(2);
    let mut pose = natural_pose(&model, &mut rng);
    let metacarpal = model.joint_index("ring-finger-metacarpal").unwrap();
    pose.rotations[metacarpal] = DVec3::new(0.1, 0.2, -0.1);
    let again = Retarget::new(&second, &first).pose(&Retarget::new(&first, &second).pose(&pose));
    let (before, after) = (in_space(&first, &pose), in_space(&first, &again));
    for name in ["wrist", "ring-finger-phalanx-proximal", "ring-finger-phalanx-distal", "thumb-phalanx-distal"] {
        let k = model.joint_index(name).unwrap();
        assert!(difference(&before[k], &after[k]) < 1e-9, "{name}");
    }
    assert!(again.rotations[metacarpal].length() < 1e-9);
}

#[test]
fn bones_keep_their_directions_and_wrists_their_positions() {
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    for from in hands() {
        for to in hands().iter().filter(|to| to.side == from.side) {
            let (first, second) = (RestSkeleton::of(&from).unwrap(), RestSkeleton::of(to).unwrap());
            let pose = natural_pose(&from, &mut rng);
            let other = Retarget::new(&first, &second).pose(&pose);
            let (a, b) = (in_space(&first, &pose), in_space(&second, &other));
            for (j, role) in second.roles.iter().enumerate() {
                let Some(k) = role.and_then(|role| first.joint(role)) else { continue };
                assert!(difference(&(a[k] * first.frames[k]), &(b[j] * second.frames[j])) < 1e-9);
            }
            let wrist = |rig: &RestSkeleton, pose: &Pose| rig.joints[0] + pose.translation;
            assert!(wrist(&first, &pose).distance(wrist(&second, &other)) < 1e-12);
        }
    }
}

#[test]
fn a_mirrored_pose_is_the_mirror_image() {
    let (right, left) = (procedural(Side::Right), procedural(Side::Left));
    let mut rng = ChaCha8Rng::seed_from_u64(4);
    for _ in 0..10 {
        let pose = natural_pose(right, &mut rng);
        let seen = pose_hand(right, &[], &pose).unwrap().vertices;
        let image = pose_hand(left, &[], &pose.mirrored()).unwrap().vertices;
        let worst = seen.iter().zip(&image).map(|(a, b)| mirrored_point(*a).distance(*b)).fold(0.0, larger);
        assert!(worst < 1e-12, "{worst}");
        let way = Retarget::new(&RestSkeleton::of(right).unwrap(), &RestSkeleton::of(left).unwrap());
        let other = way.pose(&pose);
        for (a, b) in other.rotations.iter().zip(&pose.mirrored().rotations) {
            assert!(difference(&rotation_from_axis_angle(*a), &rotation_from_axis_angle(*b)) < 1e-9);
        }
    }
}

#[test]
fn named_poses_are_the_same_on_another_skeleton() {
    let Some(model) = generic(Side::Left) else { return };
    let (from, to) = (RestSkeleton::of(procedural(Side::Right)).unwrap(), RestSkeleton::of(&model).unwrap());
    let way = Retarget::new(&from, &to);
    for name in POSE_NAMES {
        let carried = way.pose(&named_pose(name, procedural(Side::Right)).unwrap());
        let own = named_pose(name, &model).unwrap();
        let [carried, own] = [carried, own].map(|pose| in_space(&to, &pose));
        for role in to.roles.iter().flatten() {
            let k = to.joint(*role).unwrap();
            let angle = axis_angle_from_rotation(&(carried[k].transpose() * own[k])).length().to_degrees();
            // The rest poses differ by this much.
            assert!(angle < 35.0, "{name}: {role:?} by {angle} degrees");
        }
    }
}

#[test]
fn skeletons_with_unknown_joint_names_are_rejected_with_the_names() {
    let mut model = procedural(Side::Right).clone();
    model.joint_names[3] = "bone".into();
    let error = RestSkeleton::of(&model).unwrap_err().to_string();
    assert!(error.contains("procedural hand") && error.contains("bone"), "{error}");
}
