//! Angles between poses.

use glam::{DQuat, DVec3};

use crate::pose::Pose;
use crate::rotation::rotation_from_axis_angle;

/// Which joints move. A joint whose rotation is exactly 0 in every pose is fixed in this capture, and refinement does
/// not change it.
pub fn moving_joints(poses: &[Pose]) -> Vec<bool> {
    let joints = poses.first().map_or(0, |p| p.rotations.len());
    (0..joints).map(|k| poses.iter().any(|p| p.rotations.get(k).is_some_and(|r| *r != DVec3::ZERO))).collect()
}

/// Mean angle between the local rotations of two sequences of poses, degrees, over all frames and the joints for which
/// `counts` is true.
pub fn pose_error_degrees(poses: &[Pose], truth: &[Pose], counts: &[bool]) -> f64 {
    let mut sum = 0.0;
    let mut n = 0usize;
    for (a, b) in poses.iter().zip(truth) {
        for ((a, b), counts) in a.rotations.iter().zip(&b.rotations).zip(counts) {
            if *counts {
                let between = rotation_from_axis_angle(*a).transpose() * rotation_from_axis_angle(*b);
                sum += DQuat::from_mat3(&between).normalize().angle_between(DQuat::IDENTITY).to_degrees();
                n += 1;
            }
        }
    }
    sum / n.max(1) as f64
}
