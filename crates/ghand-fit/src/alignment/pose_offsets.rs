//! The constant offsets between two ways to describe the same poses: an avatar that was trained on refined poses may have
//! other rest axes of its joints, and another rest position, than the true hand.
//!
//! An offset C_k per joint, a and b describe all poses: R'_k = C_parent^T R_k C_k and t' = t + a + R_0 b.

use ghand_core::Pose;
use ghand_core::rotation::{axis_angle_from_rotation, rotation_from_axis_angle};
use glam::{DMat3, DVec3};
use nalgebra::{DMatrix, DVector, Matrix3};

/// Singular values below this fraction of the largest count as 0: the root's rotations are then too much alike to tell
/// a and b apart, and the shortest pair is taken.
const LEAST_SINGULAR_VALUE: f64 = 1e-9;

/// What maps true poses to those that an avatar was trained on.
#[derive(Debug, Clone, PartialEq)]
pub struct PoseOffsets {
    parents: Vec<Option<usize>>,
    /// C_k.
    turns: Vec<DMat3>,
    /// a and b, metres.
    shift: DVec3,
    root_shift: DVec3,
}

impl PoseOffsets {
    /// The offsets between true and refined poses of the same frames. `parents` are those of the joints, each before its
    /// children. From root to leaves, C_k is the chordal mean of (C_parent^T R_k)^T R'_k over the frames; a and b are
    /// found by least squares. Without frames there are no offsets.
    pub fn between(truth: &[Pose], refined: &[Pose], parents: &[Option<usize>]) -> PoseOffsets {
        let rotation = |pose: &Pose, joint: usize| {
            rotation_from_axis_angle(pose.rotations.get(joint).copied().unwrap_or(DVec3::ZERO))
        };
        let mut turns: Vec<DMat3> = vec![];
        for (joint, parent) in parents.iter().enumerate() {
            let of_parent = turn_of(&turns, *parent);
            let differences = truth.iter().zip(refined).map(|(truth, refined)| {
                (of_parent.transpose() * rotation(truth, joint)).transpose() * rotation(refined, joint)
            });
            turns.push(chordal_mean(differences));
        }
        let frames: Vec<(DMat3, DVec3)> = (truth.iter().zip(refined))
            .map(|(truth, refined)| (rotation(truth, 0), refined.translation - truth.translation))
            .collect();
        let [shift, root_shift] = translations(&frames);
        PoseOffsets { parents: parents.to_vec(), turns, shift, root_shift }
    }

    /// A pose of the true hand as one of the avatar.
    pub fn apply(&self, pose: &Pose) -> Pose {
        let turned = |(joint, rotation): (usize, &DVec3)| {
            let rotation = rotation_from_axis_angle(*rotation);
            let parent = self.parents.get(joint).copied().flatten();
            let own = turn_of(&self.turns, Some(joint));
            axis_angle_from_rotation(&(turn_of(&self.turns, parent).transpose() * rotation * own))
        };
        let root = rotation_from_axis_angle(pose.rotations.first().copied().unwrap_or(DVec3::ZERO));
        Pose {
            rotations: pose.rotations.iter().enumerate().map(turned).collect(),
            translation: pose.translation + self.shift + root * self.root_shift,
        }
    }

    /// Mean angle of the joints' offsets, degrees.
    pub fn mean_degrees(&self) -> f64 {
        let angles = self.turns.iter().map(|turn| axis_angle_from_rotation(turn).length().to_degrees());
        angles.sum::<f64>() / self.turns.len().max(1) as f64
    }
}

fn turn_of(turns: &[DMat3], joint: Option<usize>) -> DMat3 {
    joint.and_then(|joint| turns.get(joint)).copied().unwrap_or(DMat3::IDENTITY)
}

/// The rotation with the least sum of squared differences of its entries from these.
fn chordal_mean(rotations: impl Iterator<Item = DMat3>) -> DMat3 {
    let sum = rotations.fold(DMat3::ZERO, |sum, rotation| sum + rotation);
    let svd = Matrix3::from_column_slice(&sum.to_cols_array()).svd(true, true);
    let (Some(u), Some(v_transposed)) = (svd.u, svd.v_t) else { return DMat3::IDENTITY };
    let sign = (u * v_transposed).determinant().signum();
    // nalgebra sorts singular values in descending order: the last direction is the one that matters least.
    let mean = u * Matrix3::from_diagonal(&nalgebra::Vector3::new(1.0, 1.0, sign)) * v_transposed;
    DMat3::from_cols_slice(mean.as_slice())
}

/// a and b with the least sum of squares of a + R_0 b - difference over the frames.
fn translations(frames: &[(DMat3, DVec3)]) -> [DVec3; 2] {
    let mut matrix = DMatrix::zeros(3 * frames.len(), 6);
    let mut wanted = DVector::zeros(3 * frames.len());
    for (frame, (root, difference)) in frames.iter().enumerate() {
        for row in 0..3 {
            matrix[(3 * frame + row, row)] = 1.0;
            (0..3).for_each(|column| matrix[(3 * frame + row, 3 + column)] = root.col(column)[row]);
            wanted[3 * frame + row] = difference[row];
        }
    }
    if frames.is_empty() {
        return [DVec3::ZERO; 2];
    }
    let svd = matrix.svd(true, true);
    let least = LEAST_SINGULAR_VALUE * svd.singular_values.max();
    match svd.solve(&wanted, least) {
        Ok(found) => [DVec3::new(found[0], found[1], found[2]), DVec3::new(found[3], found[4], found[5])],
        Err(_) => [DVec3::ZERO; 2],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PARENTS: [Option<usize>; 5] = [None, Some(0), Some(1), Some(0), Some(3)];

    /// Numbers from -1 to 1 that follow no simple pattern.
    fn number(seed: usize) -> f64 {
        let x = (seed as f64 * 12.9898).sin() * 43_758.545;
        2.0 * (x - x.floor()) - 1.0
    }

    fn vector(seed: usize) -> DVec3 {
        DVec3::new(number(3 * seed), number(3 * seed + 1), number(3 * seed + 2))
    }

    fn pose(seed: usize) -> Pose {
        let rotations = (0..PARENTS.len()).map(|joint| vector(100 * seed + joint)).collect();
        Pose { rotations, translation: vector(100 * seed + 50) }
    }

    fn offsets() -> PoseOffsets {
        PoseOffsets {
            parents: PARENTS.to_vec(),
            turns: (0..PARENTS.len()).map(|joint| rotation_from_axis_angle(0.3 * vector(joint + 7000))).collect(),
            shift: 0.01 * vector(8000),
            root_shift: 0.02 * vector(8001),
        }
    }

    /// Largest difference of two poses, of the rotations' matrices and of the translations.
    fn difference(a: &Pose, b: &Pose) -> f64 {
        assert_eq!(a.rotations.len(), b.rotations.len());
        let turns = a.rotations.iter().zip(&b.rotations).map(|(a, b)| {
            let between = rotation_from_axis_angle(*a) - rotation_from_axis_angle(*b);
            between.to_cols_array().into_iter().map(f64::abs).fold(0.0, f64::max)
        });
        turns.fold((a.translation - b.translation).abs().max_element(), f64::max)
    }

    fn between(truth: &[Pose], refined: &[Pose]) -> PoseOffsets {
        PoseOffsets::between(truth, refined, &PARENTS)
    }

    #[test]
    fn known_offsets_are_recovered() {
        let truth: Vec<Pose> = (0..6).map(pose).collect();
        let refined: Vec<Pose> = truth.iter().map(|pose| offsets().apply(pose)).collect();
        let found = between(&truth, &refined);
        for (joint, (found, expected)) in found.turns.iter().zip(&offsets().turns).enumerate() {
            assert!(found.abs_diff_eq(*expected, 1e-9), "joint {joint}: {found}, not {expected}");
        }
        assert!(found.shift.abs_diff_eq(offsets().shift, 1e-9), "{}", found.shift);
        assert!(found.root_shift.abs_diff_eq(offsets().root_shift, 1e-9), "{}", found.root_shift);
        // They hold for poses that were not among the frames.
        let new = pose(77);
        assert!(difference(&found.apply(&new), &offsets().apply(&new)) < 1e-9);
        assert!(difference(&found.apply(&new), &new) > 0.1, "no offset at all");
    }

    #[test]
    fn equal_poses_have_no_offsets() {
        let truth: Vec<Pose> = (0..4).map(pose).collect();
        let found = between(&truth, &truth);
        assert!(found.mean_degrees() < 1e-9);
        assert!(difference(&found.apply(&pose(77)), &pose(77)) < 1e-9);
        let none = between(&[], &[]);
        assert!(difference(&none.apply(&pose(77)), &pose(77)) < 1e-12);
    }

    #[test]
    fn noise_is_averaged_and_frames_with_one_root_rotation_are_enough() {
        let turn = DVec3::new(0.0, 0.0, 0.2);
        let mut frames = [[pose(1), pose(1)], [pose(2), pose(2)]];
        for (noise, [truth, refined]) in [0.05, -0.05].into_iter().zip(&mut frames) {
            truth.rotations = vec![DVec3::ZERO; PARENTS.len()];
            refined.rotations = vec![DVec3::ZERO; PARENTS.len()];
            refined.rotations[0] = turn * (1.0 + noise);
            refined.translation = truth.translation + DVec3::X * (0.3 + noise);
        }
        let [truth, refined] = [0, 1].map(|k| frames.iter().map(|pair| pair[k].clone()).collect::<Vec<_>>());
        let found = between(&truth, &refined);
        let root = axis_angle_from_rotation(&found.turns[0]);
        assert!(root.abs_diff_eq(turn, 1e-12), "{root}");
        // Nothing tells a and b apart, but their sum is known.
        assert!((found.shift + found.root_shift).abs_diff_eq(0.3 * DVec3::X, 1e-12));
    }
}
