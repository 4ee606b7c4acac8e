//! A pose: one rotation a joint and a global translation.

use glam::DVec3;

/// Joint rotations and global translation of a hand.
#[derive(Debug, Clone, PartialEq)]
pub struct Pose {
    /// Axis-angle rotation of each joint in the model's axes, radians, in the order of the model's joints. The root's
    /// rotation turns the hand about the root joint.
    pub rotations: Vec<DVec3>,
    /// Global translation, metres, added last.
    pub translation: DVec3,
}

impl Pose {
    /// The rest pose of a model of `joint_count` joints: no rotation, no translation.
    pub fn rest(joint_count: usize) -> Pose {
        Pose { rotations: vec![DVec3::ZERO; joint_count], translation: DVec3::ZERO }
    }
}
