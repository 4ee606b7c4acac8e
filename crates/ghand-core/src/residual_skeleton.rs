//! The Neural Residual Skeleton (paper eq. 9): joints regressed from the blend-shape offsets.

use glam::DVec3;

/// Where the residual skeleton stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ResidualSkeleton {
    /// `J^ = R Delta`, as in the paper: millimetres from the model's origin.
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
    joints
        .iter()
        .enumerate()
        .map(|(k, joint)| {
            let row = &skeleton_regressor[k * count..(k + 1) * count];
            let moved: DVec3 = row.iter().zip(offsets).map(|(r, d)| *d * *r).sum();
            match mode {
                ResidualSkeleton::Paper => moved,
                ResidualSkeleton::Anchored => *joint + moved,
            }
        })
        .collect()
}

/// dL/dR (`[n_b][N]`) and dL/dDelta (N) from dL/dJ^. In the anchored mode dL/dJ equals dL/dJ^.
pub fn residual_joints_vjp(
    skeleton_regressor: &[f64],
    offsets: &[DVec3],
    d_residual_joints: &[DVec3],
) -> (Vec<f64>, Vec<DVec3>) {
    let count = offsets.len();
    let mut d_regressor = Vec::with_capacity(skeleton_regressor.len());
    let mut d_offsets = vec![DVec3::ZERO; count];
    for (k, d_joint) in d_residual_joints.iter().enumerate() {
        let row = &skeleton_regressor[k * count..(k + 1) * count];
        for ((r, offset), d_offset) in row.iter().zip(offsets).zip(&mut d_offsets) {
            d_regressor.push(d_joint.dot(*offset));
            *d_offset += *d_joint * *r;
        }
    }
    (d_regressor, d_offsets)
}
