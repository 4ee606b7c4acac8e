//! A hand with WebXR's joints, made from the built-in one.

use ghand_core::posing::pose_hand;
use ghand_core::skeleton::pose_skeleton;
use ghand_hand_model::joints::names::{Finger, JointRole};
use ghand_hand_model::named_poses::named_pose;

use super::super::*;
use crate::test_hands::procedural;

/// A hand of 25 joints with WebXR's names whose rest pose is the built-in hand's relaxed one, in rotated axes: a
/// skeleton as different from the built-in hand's as real ones are.
pub(super) fn webxr(side: Side) -> HandModel {
    let hand = procedural(side);
    let rig = RestSkeleton::of(hand).unwrap();
    let pose = named_pose("relaxed", hand).unwrap();
    let chain = pose_skeleton(&rig.parents, &rig.joints, &pose.rotations);
    let turn = rotation_from_axis_angle(DVec3::new(0.4, -0.9, 0.3));
    let turn = if side == Side::Right { turn } else { mirror(turn) };
    let place = |joint: usize, point: DVec3| {
        turn * (chain.world[joint].linear * (point - rig.joints[joint]) + chain.world[joint].translation)
    };
    let names = RestSkeleton::webxr(side).clone();
    let at = |role: JointRole| {
        let joint = rig.joint(role).unwrap();
        place(joint, rig.joints[joint])
    };
    let joint = |role: &Option<JointRole>| match role.unwrap() {
        JointRole::Metacarpal(finger) => at(JointRole::Wrist).lerp(at(JointRole::Bend(finger, 1)), 0.3),
        JointRole::Tip(finger) => place(rig.joint(JointRole::Bend(finger, 3)).unwrap(), *rig.tip(finger).unwrap()),
        role => at(role),
    };
    let joints: Vec<DVec3> = names.roles.iter().map(joint).collect();
    let posed = pose_hand(hand, &[], &pose).unwrap().vertices;
    let vertices: Vec<DVec3> = posed.iter().map(|point| turn * *point).collect();
    // Weights of the built-in hand's joints go to the joints with the same roles.
    let mut weights = vec![0.0; vertices.len() * joints.len()];
    for (vertex, row) in weights.chunks_exact_mut(joints.len()).enumerate() {
        for (role, weight) in rig.roles.iter().zip(hand.vertex_weights(vertex)) {
            row[names.joint(role.unwrap()).unwrap()] = *weight;
        }
    }
    let model = HandModel {
        name: "WebXR hand".into(),
        joint_names: names.joint_names,
        parents: names.parents,
        joints,
        vertices,
        weights,
        ..hand.without_blend_shapes()
    };
    model.validate().unwrap();
    model
}

fn mirror(turn: DMat3) -> DMat3 {
    let flip = DMat3::from_diagonal(DVec3::new(-1.0, 1.0, 1.0));
    flip * turn * flip
}

/// Directions of all bones of the fingers in a pose, thumb to little finger, from the palm to the tip.
pub(super) fn directions(model: &HandModel, pose: &Pose) -> Vec<DVec3> {
    let rig = RestSkeleton::of(model).unwrap();
    let chain = pose_skeleton(&rig.parents, &rig.joints, &pose.rotations);
    let bone = |finger: Finger, k: u8| {
        let joint = rig.joint(JointRole::Bend(finger, k)).unwrap();
        let end =
            if k < 3 { rig.joint_position(JointRole::Bend(finger, k + 1)).unwrap() } else { *rig.tip(finger).unwrap() };
        (chain.world[joint].linear * (end - rig.joints[joint])).normalize()
    };
    Finger::ALL.into_iter().flat_map(|finger| (1..=3).map(move |k| (finger, k))).map(|(f, k)| bone(f, k)).collect()
}
