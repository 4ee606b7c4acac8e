//! Constant offsets between two ways to describe the same poses: rest axes of joints, and a rest position, that differ.
//!
//! An offset C_k per joint, a and b describe all poses: R'_k = C_parent^T R_k C_k and t' = t + a + R_0 b.

use glam::{DMat3, DVec3};

use crate::Pose;
use crate::rotation::{axis_angle_from_rotation, rotation_from_axis_angle};

/// What maps poses of one way to those of another.
#[derive(Debug, Clone, PartialEq)]
pub struct PoseOffsets {
    /// C_k, `n_b`.
    pub turns: Vec<DMat3>,
    /// a, metres.
    pub shift: DVec3,
    /// b, metres.
    pub root_shift: DVec3,
}

impl PoseOffsets {
    /// A pose of the one way as one of the other. `parents` are those of the joints, each before its children.
    pub fn apply(&self, pose: &Pose, parents: &[Option<usize>]) -> Pose {
        let turned = |(joint, rotation): (usize, &DVec3)| {
            let rotation = rotation_from_axis_angle(*rotation);
            let parent = self.turn(parents.get(joint).copied().flatten());
            axis_angle_from_rotation(&(parent.transpose() * rotation * self.turn(Some(joint))))
        };
        let root = rotation_from_axis_angle(pose.rotations.first().copied().unwrap_or(DVec3::ZERO));
        Pose {
            rotations: pose.rotations.iter().enumerate().map(turned).collect(),
            translation: pose.translation + self.shift + root * self.root_shift,
        }
    }

    /// C_k; the identity of no joint.
    pub fn turn(&self, joint: Option<usize>) -> DMat3 {
        joint.and_then(|joint| self.turns.get(joint)).copied().unwrap_or(DMat3::IDENTITY)
    }

    /// Mean angle of the joints' offsets, degrees.
    pub fn mean_degrees(&self) -> f64 {
        let angles = self.turns.iter().map(|turn| axis_angle_from_rotation(turn).length().to_degrees());
        angles.sum::<f64>() / self.turns.len().max(1) as f64
    }
}

/// How a tracker's poses are constantly off, as known from frames of which both its poses and better ones exist.
#[derive(Debug, Clone, PartialEq)]
pub struct TrackerOffsets {
    /// What maps the tracker's poses to better ones.
    pub offsets: PoseOffsets,
    /// Standard error of each joint's turn about one axis, radians, `n_b`.
    pub errors: Vec<f64>,
    /// Number of frames that they come from.
    pub frames: u32,
}
