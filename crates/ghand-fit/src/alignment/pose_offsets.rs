//! The constant offsets between two ways to describe the same poses, from frames of which both are known: an avatar that
//! was trained on refined poses may have other rest axes of its joints, and another rest position, than the true hand, and
//! the tracker that gave the first poses may be off in all frames alike.

use ghand_core::Pose;
use ghand_core::pose_offsets::{PoseOffsets, TrackerOffsets};
use ghand_core::rotation::{axis_angle_from_rotation, rotation_from_axis_angle};
use ghand_core::statistics::median;
use glam::{DMat3, DVec3};
use nalgebra::{DMatrix, DVector, Matrix3};

/// Singular values below this fraction of the largest count as 0: the root's rotations are then too much alike to tell
/// a and b apart, and the shortest pair is taken.
const LEAST_SINGULAR_VALUE: f64 = 1e-9;
/// Fewer frames do not tell what is constant in a tracker's errors from what is not.
const LEAST_FRAMES: usize = 8;
/// Times that the frames' weights are found anew.
const REWEIGHTINGS: usize = 8;
/// A frame this many times as far off as the typical one has half its weight (Cauchy's).
const HALF_WEIGHT: f64 = 2.0;
/// Median length of a vector of three normal numbers with variance 1.
const MEDIAN_LENGTH: f64 = 1.538;
/// Differences below this are rounding, radians and metres.
const ROUNDING: f64 = 1e-9;

/// The offsets between true and refined poses of the same frames. `parents` are those of the joints, each before its
/// children. From root to leaves, C_k is the chordal mean of (C_parent^T R_k)^T R'_k over the frames; a and b are
/// found by least squares. Without frames there are no offsets.
pub fn offsets_between(truth: &[Pose], refined: &[Pose], parents: &[Option<usize>]) -> PoseOffsets {
    fit(truth, refined, parents, 0).offsets
}

/// How the tracker that gave these poses is constantly off, where `refined` are better poses of the same frames; `None` if
/// there are too few. Frames that are far off count little.
pub fn tracker_offsets(given: &[Pose], refined: &[Pose], parents: &[Option<usize>]) -> Option<TrackerOffsets> {
    let frames = given.len().min(refined.len());
    (frames >= LEAST_FRAMES && given != refined).then(|| fit(given, refined, parents, REWEIGHTINGS))
}

/// Offsets from weighted frames; the weights, all 1 at first, are found anew some times.
fn fit(from: &[Pose], to: &[Pose], parents: &[Option<usize>], reweightings: usize) -> TrackerOffsets {
    let rotation =
        |pose: &Pose, joint: usize| rotation_from_axis_angle(pose.rotations.get(joint).copied().unwrap_or(DVec3::ZERO));
    let mut found = PoseOffsets { turns: vec![], shift: DVec3::ZERO, root_shift: DVec3::ZERO };
    let mut errors = vec![];
    for (joint, parent) in parents.iter().enumerate() {
        let of_parent = found.turn(*parent);
        let differences: Vec<DMat3> = (from.iter().zip(to))
            .map(|(from, to)| (of_parent.transpose() * rotation(from, joint)).transpose() * rotation(to, joint))
            .collect();
        let mut weights = vec![1.0; differences.len()];
        let mut turn = chordal_mean(&differences, &weights);
        let lengths = |turn: &DMat3| -> Vec<f64> {
            let off = |difference: &DMat3| axis_angle_from_rotation(&(turn.transpose() * *difference)).length();
            differences.iter().map(off).collect()
        };
        for _ in 0..reweightings {
            weights = weights_of(&lengths(&turn));
            turn = chordal_mean(&differences, &weights);
        }
        found.turns.push(turn);
        errors.push(standard_error(&lengths(&turn), &weights));
    }
    let frames: Vec<(DMat3, DVec3)> =
        (from.iter().zip(to)).map(|(from, to)| (rotation(from, 0), to.translation - from.translation)).collect();
    let mut weights = vec![1.0; frames.len()];
    [found.shift, found.root_shift] = translations(&frames, &weights);
    for _ in 0..reweightings {
        let off = |(root, difference): &(DMat3, DVec3)| (found.shift + *root * found.root_shift - *difference).length();
        weights = weights_of(&frames.iter().map(off).collect::<Vec<_>>());
        [found.shift, found.root_shift] = translations(&frames, &weights);
    }
    TrackerOffsets { offsets: found, errors, frames: frames.len() as u32 }
}

/// Cauchy's weights of frames that are this far off, from 0 to 1.
fn weights_of(lengths: &[f64]) -> Vec<f64> {
    let typical = median(lengths.iter().copied()) + ROUNDING;
    lengths.iter().map(|length| 1.0 / (1.0 + (length / (HALF_WEIGHT * typical)).powi(2))).collect()
}

/// Standard error about one axis of a mean of frames that are this far off.
fn standard_error(lengths: &[f64], weights: &[f64]) -> f64 {
    let deviation = median(lengths.iter().copied()) / MEDIAN_LENGTH;
    let squares: f64 = weights.iter().map(|weight| weight * weight).sum();
    deviation * squares.sqrt() / weights.iter().sum::<f64>().max(f64::MIN_POSITIVE)
}

/// The rotation with the least sum of weighted squared differences of its entries from these.
fn chordal_mean(rotations: &[DMat3], weights: &[f64]) -> DMat3 {
    let sum = rotations.iter().zip(weights).fold(DMat3::ZERO, |sum, (rotation, weight)| sum + *rotation * *weight);
    let svd = Matrix3::from_column_slice(&sum.to_cols_array()).svd(true, true);
    let (Some(u), Some(v_transposed)) = (svd.u, svd.v_t) else { return DMat3::IDENTITY };
    let sign = (u * v_transposed).determinant().signum();
    // nalgebra sorts singular values in descending order: the last direction is the one that matters least.
    let mean = u * Matrix3::from_diagonal(&nalgebra::Vector3::new(1.0, 1.0, sign)) * v_transposed;
    DMat3::from_cols_slice(mean.as_slice())
}

/// a and b with the least weighted sum of squares of a + R_0 b - difference over the frames.
fn translations(frames: &[(DMat3, DVec3)], weights: &[f64]) -> [DVec3; 2] {
    let mut matrix = DMatrix::zeros(3 * frames.len(), 6);
    let mut wanted = DVector::zeros(3 * frames.len());
    for (frame, ((root, difference), weight)) in frames.iter().zip(weights).enumerate() {
        let weight = weight.sqrt();
        for row in 0..3 {
            matrix[(3 * frame + row, row)] = weight;
            (0..3).for_each(|column| matrix[(3 * frame + row, 3 + column)] = weight * root.col(column)[row]);
            wanted[3 * frame + row] = weight * difference[row];
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
        offsets_between(truth, refined, &PARENTS)
    }

    #[test]
    fn known_offsets_are_recovered() {
        let truth: Vec<Pose> = (0..6).map(pose).collect();
        let refined: Vec<Pose> = truth.iter().map(|pose| offsets().apply(pose, &PARENTS)).collect();
        let found = between(&truth, &refined);
        for (joint, (found, expected)) in found.turns.iter().zip(&offsets().turns).enumerate() {
            assert!(found.abs_diff_eq(*expected, 1e-9), "joint {joint}: {found}, not {expected}");
        }
        assert!(found.shift.abs_diff_eq(offsets().shift, 1e-9), "{}", found.shift);
        assert!(found.root_shift.abs_diff_eq(offsets().root_shift, 1e-9), "{}", found.root_shift);
        // They hold for poses that were not among the frames.
        let new = pose(77);
        assert!(difference(&found.apply(&new, &PARENTS), &offsets().apply(&new, &PARENTS)) < 1e-9);
        assert!(difference(&found.apply(&new, &PARENTS), &new) > 0.1, "no offset at all");
    }

    #[test]
    fn equal_poses_have_no_offsets() {
        let truth: Vec<Pose> = (0..4).map(pose).collect();
        let found = between(&truth, &truth);
        assert!(found.mean_degrees() < 1e-9);
        assert!(difference(&found.apply(&pose(77), &PARENTS), &pose(77)) < 1e-9);
        let none = between(&[], &[]);
        assert!(difference(&none.apply(&pose(77), &PARENTS), &pose(77)) < 1e-12);
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

    #[test]
    fn a_trackers_offsets_are_found_among_noise_and_lost_frames_with_their_errors() {
        let given: Vec<Pose> = (0..40).map(pose).collect();
        let mut refined: Vec<Pose> = given.iter().map(|pose| offsets().apply(pose, &PARENTS)).collect();
        for (k, pose) in refined.iter_mut().enumerate() {
            // A fifth of the frames were lost by the tracker.
            let size = if k % 5 == 4 { 1.5 } else { 0.05 };
            for (joint, rotation) in pose.rotations.iter_mut().enumerate() {
                let noise = rotation_from_axis_angle(size * vector(9000 + 100 * k + joint));
                *rotation = axis_angle_from_rotation(&(rotation_from_axis_angle(*rotation) * noise));
            }
            pose.translation += 0.1 * size * vector(20_000 + k);
        }
        let TrackerOffsets { offsets: found, errors, frames } = tracker_offsets(&given, &refined, &PARENTS).unwrap();
        let plain = offsets_between(&given, &refined, &PARENTS);
        let off = |found: &PoseOffsets| -> Vec<f64> {
            let turns = found.turns.iter().zip(offsets().turns);
            turns.map(|(a, b)| axis_angle_from_rotation(&(a.transpose() * b)).length()).collect()
        };
        assert_eq!(frames, 40);
        for (joint, (off, error)) in off(&found).iter().zip(&errors).enumerate() {
            assert!(*off < 0.03 && *off < 6.0 * error && *error < 0.02, "joint {joint}: {off}, error {error}");
        }
        assert!(off(&found).iter().sum::<f64>() < 0.5 * off(&plain).iter().sum::<f64>(), "lost frames count");
        assert!((found.shift - offsets().shift).length() < 0.004 && (plain.shift - offsets().shift).length() > 0.004);
        // Too few frames, or poses that were not refined, tell nothing.
        assert_eq!(tracker_offsets(&given[..7], &refined[..7], &PARENTS), None);
        assert_eq!(tracker_offsets(&given, &given, &PARENTS), None);
    }
}
