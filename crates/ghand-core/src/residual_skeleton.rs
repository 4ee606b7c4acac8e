//! The Neural Residual Skeleton (paper eq. 9): joints regressed from the blend-shape offsets.

use glam::DVec3;
use rayon::prelude::*;

use crate::parallel::{CHUNK, sum_in_chunks};

/// Position of the residual joints.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ResidualSkeleton {
    /// `J^ = R Delta`, as in the paper: within millimetres of the model's origin.
    Paper,
    /// `J^ = J + R Delta`: the rest joints, corrected.
    #[default]
    Anchored,
}

/// Residual joints (metres): `skeleton_regressor` is `[n_b][N]`, `offsets` N offsets (metres), `joints` the `n_b` rest
/// joints (metres).
pub fn residual_joints(
    skeleton_regressor: &[f64],
    offsets: &[DVec3],
    joints: &[DVec3],
    mode: ResidualSkeleton,
) -> Vec<DVec3> {
    let count = offsets.len();
    let residual_joint = |(k, joint): (usize, &DVec3)| {
        let row = &skeleton_regressor[k * count..(k + 1) * count];
        let moved = sum_in_chunks(count, DVec3::ZERO, |sum, p| sum + offsets[p] * row[p], |a, b| a + b);
        match mode {
            ResidualSkeleton::Paper => moved,
            ResidualSkeleton::Anchored => *joint + moved,
        }
    };
    joints.par_iter().enumerate().map(residual_joint).collect()
}

/// dL/dR (`[n_b][N]`) and dL/dDelta (N) from dL/dJ^. In the anchored mode dL/dJ equals dL/dJ^.
pub fn residual_joints_vjp(
    skeleton_regressor: &[f64],
    offsets: &[DVec3],
    d_residual_joints: &[DVec3],
) -> (Vec<f64>, Vec<DVec3>) {
    let count = offsets.len();
    let mut d_regressor = vec![0.0; skeleton_regressor.len()];
    let rows = d_regressor.par_chunks_exact_mut(count.max(1)).zip(d_residual_joints);
    rows.for_each(|(row, d_joint)| row.iter_mut().zip(offsets).for_each(|(d, offset)| *d = d_joint.dot(*offset)));
    let d_offset = |p: usize| -> DVec3 {
        let rows = skeleton_regressor.chunks_exact(count).zip(d_residual_joints);
        rows.fold(DVec3::ZERO, |sum, (row, d_joint)| sum + *d_joint * row[p])
    };
    (d_regressor, (0..count).into_par_iter().with_min_len(CHUNK).map(d_offset).collect())
}
