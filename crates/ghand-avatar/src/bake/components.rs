//! The components of each joint: the combinations of its regressors that change the hand most.

use crate::deform::baked::{Component, VALUES};
use ghand_core::skeleton::Chain;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::EQUAL_ERRORS;
use super::sums::{GroupSums, OF_JOINT, Regressors, solve};

/// Regressors that vary by less than this part of the one that varies most say nothing: squares.
const SMALLEST_VARIANCE: f64 = 1e-5;
/// Components that change the hand by less than this part of the first: squares.
const SMALLEST_CHANGE: f64 = 1e-6;
/// How far beyond its range over the poses a component may go, as a part of that range.
const MARGIN: f64 = 0.2;

/// Components by joint. Over the poses each has a variance of 1.
pub struct JointComponents {
    /// Gains of the regressors, [`OF_JOINT`] rows and a column for each component.
    gains: Vec<DMatrix<f64>>,
    /// Limits of each component of each joint.
    limits: Vec<Vec<[f64; 2]>>,
}

impl JointComponents {
    /// Up to `rank` components of each joint, from the sums of all groups over poses.
    pub fn find(regressors: &Regressors, groups: &[GroupSums], rank: usize, chains: &[Chain]) -> JointComponents {
        let rows: Vec<Vec<[f64; OF_JOINT]>> = chains.iter().map(|chain| regressors.of(chain)).collect();
        let joints = regressors.joints();
        // Factors of the covariances: what is left of the regressors once they vary independently.
        let factors: Vec<[DMatrix<f64>; 2]> =
            (0..joints).map(|k| whitening(&rows.iter().map(|row| row[k]).collect::<Vec<_>>())).collect();
        let changes = groups
            .par_iter()
            .map(|group| {
                let solution = solve(&group.gram, &group.right);
                let mut sums: Vec<Option<DMatrix<f64>>> = vec![None; joints];
                for (i, (k, _)) in group.joints.iter().enumerate() {
                    let mut block = &factors[*k][0] * solution.rows(1 + i * OF_JOINT, OF_JOINT);
                    for (c, mut column) in block.column_iter_mut().enumerate() {
                        column /= EQUAL_ERRORS[c % VALUES];
                    }
                    sums[*k] = Some(&block * block.transpose());
                }
                sums
            })
            .collect::<Vec<_>>();
        let mut all = JointComponents { gains: vec![], limits: vec![] };
        for (k, [_, back]) in factors.iter().enumerate() {
            let independent = back.ncols();
            let mut sum = DMatrix::zeros(independent, independent);
            // In the order of the groups, so that the result does not depend on the number of threads.
            changes.iter().filter_map(|of| of[k].as_ref()).for_each(|change| sum += change);
            let gains = back * largest_directions(&sum, rank);
            let limits = gains.column_iter().map(|gain| limits_over(&gain.into_owned(), rows.iter().map(|row| row[k])));
            all.limits.push(limits.collect());
            all.gains.push(gains);
        }
        all
    }

    /// Number of a joint's components.
    pub fn of_joint(&self, joint: usize) -> usize {
        self.gains[joint].ncols()
    }

    /// A component of a joint.
    pub fn component(&self, regressors: &Regressors, joint: usize, index: usize) -> Component {
        let gain = self.gains[joint].column(index);
        Component {
            joint: joint as f32,
            other: regressors.other(joint) as f32,
            limits: self.limits[joint][index].map(|limit| limit as f32),
            product: if regressors.other(joint) == joint { 0.0 } else { gain[OF_JOINT - 1] as f32 },
            gains: std::array::from_fn(|i| gain[i] as f32),
        }
    }

    /// The sums of a group with the components as regressors.
    pub fn reduce(&self, group: &GroupSums) -> GroupSums {
        let joints: Vec<(usize, usize)> = group.joints.iter().map(|(k, _)| (*k, self.of_joint(*k))).collect();
        let size = 1 + joints.iter().map(|(_, count)| count).sum::<usize>();
        let mut map = DMatrix::zeros(group.gram.nrows(), size);
        map[(0, 0)] = 1.0;
        let mut column = 1;
        for (i, (k, count)) in joints.iter().enumerate() {
            map.view_mut((1 + i * OF_JOINT, column), (OF_JOINT, *count)).copy_from(&self.gains[*k]);
            column += count;
        }
        let back = map.transpose();
        GroupSums::reduced(joints, &back * &group.gram * &map, &back * &group.right)
    }
}

/// From coefficients of regressors to those of independent ones of variance 1, and from gains of the latter to gains of
/// the former.
fn whitening(rows: &[[f64; OF_JOINT]]) -> [DMatrix<f64>; 2] {
    let count = rows.len().max(1) as f64;
    let mean: [f64; OF_JOINT] = std::array::from_fn(|i| rows.iter().map(|row| row[i]).sum::<f64>() / count);
    let covariance = DMatrix::from_fn(OF_JOINT, OF_JOINT, |i, j| {
        rows.iter().map(|row| (row[i] - mean[i]) * (row[j] - mean[j])).sum::<f64>() / count
    });
    let eigen = covariance.symmetric_eigen();
    let largest = eigen.eigenvalues.max();
    let kept: Vec<usize> =
        (0..OF_JOINT).filter(|i| largest > 1e-10 && eigen.eigenvalues[*i] > SMALLEST_VARIANCE * largest).collect();
    let scaled = |power: f64| {
        DMatrix::from_fn(OF_JOINT, kept.len(), |row, i| {
            eigen.eigenvectors[(row, kept[i])] * eigen.eigenvalues[kept[i]].powf(power)
        })
    };
    [scaled(0.5).transpose(), scaled(-0.5)]
}

/// The directions of a sum of squares in which it is largest, a column each.
fn largest_directions(sum: &DMatrix<f64>, rank: usize) -> DMatrix<f64> {
    if sum.is_empty() {
        return DMatrix::zeros(0, 0);
    }
    let eigen = sum.clone().symmetric_eigen();
    let mut order: Vec<usize> = (0..sum.nrows()).collect();
    order.sort_by(|a, b| eigen.eigenvalues[*b].total_cmp(&eigen.eigenvalues[*a]));
    let largest = order.first().map_or(0.0, |i| eigen.eigenvalues[*i]);
    order.truncate(rank);
    order.retain(|i| largest > 0.0 && eigen.eigenvalues[*i] > SMALLEST_CHANGE * largest);
    let columns: Vec<DVector<f64>> = order.iter().map(|i| eigen.eigenvectors.column(*i).into_owned()).collect();
    if columns.is_empty() { DMatrix::zeros(sum.nrows(), 0) } else { DMatrix::from_columns(&columns) }
}

/// The range of a component over poses, with its margin.
fn limits_over(gain: &DVector<f64>, rows: impl Iterator<Item = [f64; OF_JOINT]>) -> [f64; 2] {
    let values = rows.map(|row| gain.iter().zip(row).map(|(g, f)| g * f).sum::<f64>());
    let [low, high] =
        values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], value| [low.min(value), high.max(value)]);
    [low - MARGIN * (high - low), high + MARGIN * (high - low)]
}
