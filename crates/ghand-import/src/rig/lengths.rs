//! Lengths between landmarks that no movement changes.

use ghand_core::{HandModel, Pose};
use ghand_motion::ik::HandIk;
use ghand_motion::{PoseError, RestSkeleton};
use glam::DVec3;

use super::LANDMARKS;

/// Pairs of landmarks whose distance is the same in all poses: the bones, and knuckles of the palm.
pub const BONES: [(usize, usize); 24] = [
    (0, 1),
    (1, 2),
    (2, 3),
    (3, 4),
    (0, 5),
    (5, 6),
    (6, 7),
    (7, 8),
    (0, 9),
    (9, 10),
    (10, 11),
    (11, 12),
    (0, 13),
    (13, 14),
    (14, 15),
    (15, 16),
    (0, 17),
    (17, 18),
    (18, 19),
    (19, 20),
    (5, 9),
    (9, 13),
    (13, 17),
    (5, 17),
];

/// MediaPipe's landmarks of the tips lie this far before the end of the finger, metres.
pub const TIP_INSET: f64 = 0.006;

/// The lengths of [`BONES`] of a model's hand in its mean shape, as the tracker sees them, metres.
///
/// # Errors
/// If the names of the model's joints do not identify their parts.
pub fn lengths_of(model: &HandModel) -> Result<[f64; BONES.len()], PoseError> {
    let hand = HandIk::new(&RestSkeleton::of(model)?);
    let rest = Pose { rotations: vec![DVec3::ZERO; model.joint_count()], translation: DVec3::ZERO };
    let mut points = hand.landmarks(&rest);
    for tip in (4..LANDMARKS).step_by(4) {
        points[tip] -= (points[tip] - points[tip - 1]).normalize_or_zero() * TIP_INSET;
    }
    Ok(BONES.map(|(from, to)| points[from].distance(points[to])))
}

/// From the wrist to the tip of the middle finger as the tracker sees it, along the bones of `lengths`.
pub fn hand_length(lengths: &[f64; BONES.len()]) -> f64 {
    lengths[8..12].iter().sum()
}
