//! What poses change of the hand beyond plain skinning, as a few morph targets.
//!
//! An avatar's Gaussians keep the volume of bent joints; skinning alone flattens them. In each pose the Gaussians near a
//! vertex say where it lies before skinning. The displacements of all poses are put down to the few directions that they
//! share most: their principal components, without a mean, so that rest stays rest.

use ghand_core::Pose;
use ghand_core::skeleton::{Affine, pose_skeleton};
use glam::DVec3;
use rayon::prelude::*;

use crate::avatar::Avatar;
use crate::reference::{PosedGaussians, TwinError, pose_unlit};

/// Most morph targets.
const MOST: usize = 8;
/// A direction that moves vertices less than this, as a root mean square over poses and vertices, is not written, metres.
const LEAST: f64 = 0.05e-3;
/// Gaussians that say where a vertex lies.
const NEAR: usize = 8;
/// Least determinant of a skinning map that is inverted: below it the surface is collapsed, and a Gaussian says nothing.
const LEAST_DETERMINANT: f64 = 0.2;
/// Rounds of the power iteration; neighbouring components need not be told apart exactly.
const ROUNDS: usize = 100;

/// Displacements of a hand's vertices before skinning, and how much of each is in some poses.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Correctives {
    /// The displacements `[K][V]`, metres; each is the largest that a pose has of it.
    pub targets: Vec<DVec3>,
    /// The weights of each pose, K, from -1 to 1.
    pub weights: Vec<Vec<f64>>,
}

impl Correctives {
    /// What these poses change of an avatar's hand.
    ///
    /// # Errors
    /// [`TwinError`] if a pose does not fit the avatar.
    pub fn of(avatar: &Avatar, poses: &[Pose]) -> Result<Correctives, TwinError> {
        let rest = pose_unlit(avatar, &Pose::rest(avatar.model.joint_count()))?;
        let near = nearest(avatar, &rest);
        let displacements: Result<Vec<Vec<DVec3>>, TwinError> = (poses.par_iter())
            .map(|pose| Ok(displacements(avatar, pose, &pose_unlit(avatar, pose)?, &rest, &near)))
            .collect();
        Ok(principal(&displacements?))
    }
}

/// The numbers of the Gaussians nearest to each vertex at rest.
fn nearest(avatar: &Avatar, rest: &PosedGaussians) -> Vec<Vec<usize>> {
    let of = |vertex: &DVec3| {
        let mut near: Vec<usize> = (0..rest.means.len()).collect();
        let squared = |p: &usize| rest.means[*p].distance_squared(*vertex);
        let count = NEAR.min(near.len());
        if count < near.len() {
            near.select_nth_unstable_by(count, |a, b| squared(a).total_cmp(&squared(b)));
        }
        near.truncate(count);
        near
    };
    avatar.model.vertices.par_iter().map(of).collect()
}

/// How far each vertex is displaced before skinning.
fn displacements(
    avatar: &Avatar,
    pose: &Pose,
    posed: &PosedGaussians,
    rest: &PosedGaussians,
    near: &[Vec<usize>],
) -> Vec<DVec3> {
    let template = &avatar.template;
    let count = template.len();
    let chain = pose_skeleton(&template.parents, &template.joints, &pose.rotations);
    let moved: Vec<Option<DVec3>> = (0..count)
        .map(|p| {
            let map =
                chain.posed_from_rest.iter().enumerate().fold(Affine::ZERO, |sum, (k, bone)| {
                    sum.add_scaled(f64::from(template.weights[k * count + p]), bone)
                });
            let unposed = || map.linear.inverse() * (posed.means[p] - pose.translation - map.translation);
            (map.linear.determinant() > LEAST_DETERMINANT).then(|| unposed() - rest.means[p])
        })
        .collect();
    let mean = |near: &Vec<usize>| {
        let known: Vec<DVec3> = near.iter().filter_map(|p| moved[*p]).collect();
        known.iter().sum::<DVec3>() / known.len().max(1) as f64
    };
    near.iter().map(mean).collect()
}

/// The strongest directions of displacements `[F][V]`.
fn principal(displacements: &[Vec<DVec3>]) -> Correctives {
    let poses = displacements.len();
    let vertices = displacements.first().map_or(0, Vec::len);
    let product = |a: &[DVec3], b: &[DVec3]| -> f64 { a.iter().zip(b).map(|(a, b)| a.dot(*b)).sum() };
    let mut gram: Vec<Vec<f64>> =
        displacements.iter().map(|a| displacements.iter().map(|b| product(a, b)).collect()).collect();
    let mut found = Correctives { targets: vec![], weights: vec![vec![]; poses] };
    for _ in 0..MOST {
        let Some((strength, direction)) = largest_eigenvector(&gram) else { break };
        if (strength / (poses * vertices).max(1) as f64).sqrt() < LEAST {
            break;
        }
        // The direction is one of poses; the displacement of each vertex per unit of it:
        let root = strength.sqrt();
        let most = direction.iter().map(|v| v.abs()).fold(0.0, f64::max) * root;
        for v in 0..vertices {
            let sum: DVec3 = displacements.iter().zip(&direction).map(|(d, weight)| d[v] * *weight).sum();
            found.targets.push(sum * (most / root));
        }
        found.weights.iter_mut().zip(&direction).for_each(|(weights, v)| weights.push(v * root / most));
        for (row, a) in gram.iter_mut().zip(&direction) {
            row.iter_mut().zip(&direction).for_each(|(entry, b)| *entry -= strength * a * b);
        }
    }
    found
}

/// The largest eigenvalue of a symmetric matrix without negative ones, and its unit eigenvector, by power iteration; `None`
/// if the matrix is zero.
fn largest_eigenvector(matrix: &[Vec<f64>]) -> Option<(f64, Vec<f64>)> {
    // From the column with the largest diagonal entry, which cannot be orthogonal to the eigenvector unless it is zero.
    let start = (0..matrix.len()).max_by(|a, b| matrix[*a][*a].total_cmp(&matrix[*b][*b]))?;
    let mut vector = matrix[start].clone();
    let mut value = 0.0;
    for _ in 0..ROUNDS {
        let length = vector.iter().map(|v| v * v).sum::<f64>().sqrt();
        if length == 0.0 {
            return None;
        }
        vector.iter_mut().for_each(|v| *v /= length);
        let next: Vec<f64> = matrix.iter().map(|row| row.iter().zip(&vector).map(|(a, b)| a * b).sum()).collect();
        value = next.iter().zip(&vector).map(|(a, b)| a * b).sum();
        vector = next;
    }
    let length = vector.iter().map(|v| v * v).sum::<f64>().sqrt();
    (length > 0.0 && value > 0.0).then(|| (value, vector.into_iter().map(|v| v / length).collect()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn poses_that_share_two_directions_are_restored_from_them() {
        let wave = |k: usize| DVec3::new((k as f64).sin(), (1.7 * k as f64).cos(), 0.3) * 1e-3;
        let [a, b]: [Vec<DVec3>; 2] = [0, 50].map(|from| (from..from + 40).map(wave).collect());
        let mixes = [(1.0, 0.0), (0.2, 0.9), (-0.7, 0.4), (0.0, 0.0), (1.5, -1.0)];
        let poses: Vec<Vec<DVec3>> =
            mixes.iter().map(|(x, y)| a.iter().zip(&b).map(|(a, b)| *a * *x + *b * *y).collect()).collect();
        let found = principal(&poses);
        assert_eq!(found.targets.len(), 2 * 40);
        for (pose, weights) in poses.iter().zip(&found.weights) {
            assert!(weights.len() == 2 && weights.iter().all(|w| w.abs() <= 1.0 + 1e-12));
            for (v, expected) in pose.iter().enumerate() {
                let sum = found.targets[v] * weights[0] + found.targets[40 + v] * weights[1];
                assert!(sum.distance(*expected) < 1e-9);
            }
        }
        assert!((0..2).all(|k| found.weights.iter().any(|w| w[k].abs() > 1.0 - 1e-9)), "each target is the largest");
        // What cannot be seen is not written.
        let little: Vec<Vec<DVec3>> = poses.iter().map(|pose| pose.iter().map(|d| *d * 0.01).collect()).collect();
        assert!(principal(&little).targets.is_empty());
        assert_eq!(principal(&[]), Correctives::default());
    }
}
