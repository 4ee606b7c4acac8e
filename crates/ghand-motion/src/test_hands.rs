//! Hands and poses for tests.

use std::sync::LazyLock;

use ghand_core::rotation::{axis_angle_from_rotation, rotation_from_axis_angle};
use ghand_core::{HandModel, Pose, Side};
use ghand_hand_model::files::gltf::read_gltf;
use ghand_hand_model::named_poses::{POSE_NAMES, named_pose};
use ghand_synthetic::hand::trajectory::natural_motion as motion_of;
use ghand_test_support::procedural_hand::ProceduralHand;
use ghand_test_support::shared;
use glam::DVec3;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use crate::pose_sequence::between;

/// The built-in hand, small.
pub(crate) fn procedural(side: Side) -> &'static HandModel {
    static HANDS: LazyLock<[HandModel; 2]> = LazyLock::new(|| {
        [false, true].map(|left| ProceduralHand { left, detail: 1, ..Default::default() }.build().unwrap())
    });
    &HANDS[usize::from(side == Side::Left)]
}

/// The generic hand with WebXR's joints, if it is available.
pub(crate) fn generic(side: Side) -> Option<HandModel> {
    let file = if side == Side::Left { "left.glb" } else { "right.glb" };
    shared(&format!("assets/generic-hand/{file}")).map(|path| read_gltf(&path, None).unwrap().model)
}

/// All of them.
pub(crate) fn hands() -> Vec<HandModel> {
    let sides = [Side::Right, Side::Left];
    sides.iter().map(|side| procedural(*side).clone()).chain(sides.iter().filter_map(|side| generic(*side))).collect()
}

pub(crate) fn vector(rng: &mut ChaCha8Rng, size: f64) -> DVec3 {
    DVec3::from_array([0; 3].map(|_| rng.random_range(-size..size)))
}

/// A pose between two named ones with small changes to all joints, randomly rotated and moved.
pub(crate) fn natural_pose(model: &HandModel, rng: &mut ChaCha8Rng) -> Pose {
    let mut named = || named_pose(POSE_NAMES[rng.random_range(0..POSE_NAMES.len())], model).unwrap();
    let (a, b) = (named(), named());
    let mut pose = between(&a, &b, rng.random());
    for rotation in &mut pose.rotations {
        // Only joints that bend: metacarpals and tips stay.
        if *rotation != DVec3::ZERO {
            *rotation += vector(rng, 0.04);
        }
    }
    pose.rotations[0] = axis_angle_from_rotation(&rotation_from_axis_angle(vector(rng, 3.0)));
    pose.translation = vector(rng, 0.3);
    pose
}

/// The synthetic capture's natural motion, of the right built-in hand.
pub(crate) fn natural_motion(count: usize, seed: u64) -> Vec<Pose> {
    motion_of(procedural(Side::Right), count, seed)
}

/// The larger of two numbers, or NaN if either is NaN.
pub(crate) fn larger(a: f64, b: f64) -> f64 {
    if a.is_nan() || b.is_nan() { f64::NAN } else { a.max(b) }
}
