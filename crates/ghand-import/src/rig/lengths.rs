//! Lengths between landmarks that no movement changes.

use ghand_core::{HandModel, Pose};
use ghand_motion::ik::{self, HandIk};
use ghand_motion::image_landmarks::in_skeleton;
use ghand_motion::{PoseError, RestSkeleton};
use glam::DVec3;

use super::LANDMARKS;

/// Pairs of knuckles: the palm hardly bends.
const PALM: [(usize, usize); 4] = [(5, 9), (9, 13), (13, 17), (5, 17)];

/// Pairs of landmarks whose distance is the same in all poses: the bones, from the wrist on, and knuckles of the palm.
pub const BONES: [(usize, usize); ik::BONES.len() + PALM.len()] = {
    let mut pairs = [(0, 0); ik::BONES.len() + PALM.len()];
    let mut k = 0;
    while k < pairs.len() {
        pairs[k] = if k < ik::BONES.len() { ik::BONES[k] } else { PALM[k - ik::BONES.len()] };
        k += 1;
    }
    pairs
};

/// The lengths of [`BONES`] of a model's hand in its mean shape, as a tracker sees them whose landmarks of fingertips lie
/// `tip_inset` before the ends of the fingers, metres, and those of the palm `beside` its joints
/// ([`FitOptions`](ghand_motion::image_landmarks::FitOptions)).
///
/// # Errors
/// If the names of the model's joints do not identify their parts.
pub fn lengths_of(
    model: &HandModel,
    tip_inset: f64,
    beside: &[(usize, DVec3)],
) -> Result<[f64; BONES.len()], PoseError> {
    let rig = RestSkeleton::of(model)?;
    let hand = HandIk::new(&rig);
    let rest = Pose { rotations: vec![DVec3::ZERO; model.joint_count()], translation: DVec3::ZERO };
    let mut points = hand.landmarks(&rest);
    for tip in (4..LANDMARKS).step_by(4) {
        points[tip] -= (points[tip] - points[tip - 1]).normalize_or_zero() * tip_inset;
    }
    let palm = points[9].distance(points[0]);
    in_skeleton(beside, &rig).into_iter().for_each(|(landmark, at)| points[landmark] += at * palm);
    Ok(BONES.map(|(from, to)| points[from].distance(points[to])))
}

/// From the wrist to the tip of the middle finger as the tracker sees it, along the bones of `lengths`.
pub fn hand_length(lengths: &[f64; BONES.len()]) -> f64 {
    lengths[8..12].iter().sum()
}
