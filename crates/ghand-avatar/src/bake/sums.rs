//! The normal equations of each group.

use crate::deform::baked::{GROUP, VALUES};
use ghand_core::pose_response::rotation_features;
use ghand_core::skeleton::Chain;
use nalgebra::DMatrix;
use rayon::prelude::*;

/// Regressors of a joint: the entries of `vec(R - I)`, then the product of its bend and its parent's.
pub const OF_JOINT: usize = 10;
/// Values of a group.
pub const COLUMNS: usize = GROUP * VALUES;

/// The regressors of all joints in a pose.
pub struct Regressors {
    /// Parent of each joint, unless that is the root or none.
    parents: Vec<Option<usize>>,
    /// Which way each joint bends over the poses: weights of the entries of `vec(R - I)`, of unit length, or 0.
    pub bends: Vec<[f64; 9]>,
}

impl Regressors {
    /// With the bends over these poses.
    pub fn new(parents: &[Option<usize>], chains: &[Chain]) -> Regressors {
        let bends = (0..parents.len()).map(|k| main_direction(chains.iter().map(|c| rotation_features(&c.local[k]))));
        let bends = bends.enumerate().map(|(k, bend)| if k == 0 { [0.0; 9] } else { bend }).collect();
        Regressors { parents: parents.iter().map(|parent| parent.filter(|k| *k > 0)).collect(), bends }
    }

    /// Number of joints.
    pub fn joints(&self) -> usize {
        self.parents.len()
    }

    /// The joint whose bend the product of a joint has: its parent, or itself if there is no product.
    pub fn other(&self, joint: usize) -> usize {
        self.parents[joint].unwrap_or(joint)
    }

    /// The regressors of each joint; 0 for the root, which turns the whole hand.
    pub fn of(&self, chain: &Chain) -> Vec<[f64; OF_JOINT]> {
        let features: Vec<[f64; 9]> = chain.local.iter().map(rotation_features).collect();
        let bend = |k: usize| -> f64 { self.bends[k].iter().zip(&features[k]).map(|(u, f)| u * f).sum() };
        let one = |k: usize| {
            if k == 0 {
                return [0.0; OF_JOINT];
            }
            let product = self.parents[k].map_or(0.0, |parent| bend(k) * bend(parent));
            std::array::from_fn(|i| if i < 9 { features[k][i] } else { product })
        };
        (0..self.parents.len()).map(one).collect()
    }
}

/// The direction in which vectors vary most about their mean; 0 if they do not.
fn main_direction(vectors: impl Iterator<Item = [f64; 9]>) -> [f64; 9] {
    let vectors: Vec<_> = vectors.collect();
    let mean: [f64; 9] = std::array::from_fn(|i| vectors.iter().map(|v| v[i]).sum::<f64>() / vectors.len() as f64);
    let covariance = DMatrix::from_fn(9, 9, |i, j| vectors.iter().map(|v| (v[i] - mean[i]) * (v[j] - mean[j])).sum());
    let eigen = covariance.symmetric_eigen();
    let largest = eigen.eigenvalues.imax();
    if eigen.eigenvalues[largest] < 1e-12 {
        return [0.0; 9];
    }
    std::array::from_fn(|i| eigen.eigenvectors[(i, largest)])
}

/// The sums of a group. The first regressor is 1.
pub struct GroupSums {
    /// Joints whose regressors it has, and for each how many.
    pub joints: Vec<(usize, usize)>,
    /// Mean of the regressors' products.
    pub gram: DMatrix<f64>,
    /// Mean of the products of regressors and values, [`COLUMNS`] columns: a Gaussian's values are neighbours.
    pub right: DMatrix<f64>,
    /// Poses so far.
    poses: f64,
}

impl GroupSums {
    /// Of a group that these joints move. Their parents count too, for what moves beside a joint.
    pub fn new(moving: &[usize], parents: &[Option<usize>]) -> GroupSums {
        let mut joints: Vec<usize> = moving.iter().flat_map(|k| [Some(*k), parents[*k]]).flatten().collect();
        joints.sort_unstable();
        joints.dedup();
        let joints: Vec<(usize, usize)> = joints.into_iter().filter(|k| *k > 0).map(|k| (k, OF_JOINT)).collect();
        let size = 1 + joints.len() * OF_JOINT;
        GroupSums { joints, gram: DMatrix::zeros(size, size), right: DMatrix::zeros(size, COLUMNS), poses: 0.0 }
    }

    /// Sums with fewer regressors.
    pub fn reduced(joints: Vec<(usize, usize)>, gram: DMatrix<f64>, right: DMatrix<f64>) -> GroupSums {
        GroupSums { joints, gram, right, poses: 1.0 }
    }

    fn add(&mut self, regressors: &[[f64; OF_JOINT]], values: &[[f32; VALUES]]) {
        let row: Vec<f64> = std::iter::once(1.0).chain(self.joints.iter().flat_map(|(k, _)| regressors[*k])).collect();
        self.poses += 1.0;
        // Running means: all poses weigh the same.
        let part = 1.0 / self.poses;
        for (i, a) in row.iter().enumerate() {
            for (j, b) in row.iter().enumerate() {
                self.gram[(i, j)] += part * (a * b - self.gram[(i, j)]);
            }
        }
        for (column, value) in values.as_flattened().iter().enumerate() {
            for (sum, a) in self.right.column_mut(column).iter_mut().zip(&row) {
                *sum += part * (a * f64::from(*value) - *sum);
            }
        }
    }
}

/// Adds a pose to the sums of all groups.
pub fn add(groups: &mut [GroupSums], regressors: &[[f64; OF_JOINT]], values: &[[f32; VALUES]]) {
    groups.par_iter_mut().zip(values.par_chunks(GROUP)).for_each(|(group, values)| group.add(regressors, values));
}

/// What of the regressors' products counts as rounding.
const RIDGE: f64 = 1e-7;

/// The coefficients of the regressors, one row each, with the least squares.
pub fn solve(gram: &DMatrix<f64>, right: &DMatrix<f64>) -> DMatrix<f64> {
    let ridge = RIDGE * gram.diagonal().max().max(f64::MIN_POSITIVE);
    let mut damped = gram.clone();
    // The first, the constant, is not damped.
    (1..gram.nrows()).for_each(|i| damped[(i, i)] += ridge);
    match damped.cholesky() {
        Some(factors) => factors.solve(right),
        None => DMatrix::zeros(right.nrows(), right.ncols()),
    }
}
