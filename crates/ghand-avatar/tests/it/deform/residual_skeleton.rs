//! `residual_skeleton.wgsl` and `residual_skeleton_backward.wgsl` against `ghand_core::residual_skeleton`.

use ghand_core::residual_skeleton::{residual_joints, residual_joints_vjp};
use ghand_core::skeleton::{Affine, pose_skeleton_vjp};
use ghand_core::skinning::ResidualWeights;
use glam::DVec3;

use crate::deform::hand::{JOINTS, PARENTS, Run, assert_near, assert_same, norm};

/// The residual bones as input of skinning: without their mean, or without the root's translation.
fn effective(run: &Run, bones: &[Affine]) -> Vec<Affine> {
    match run.kind.weights {
        ResidualWeights::ZeroSum => {
            let mean = bones.iter().fold(Affine::ZERO, |sum, b| sum.add_scaled(1.0 / JOINTS as f64, b));
            bones.iter().map(|b| b.add_scaled(-1.0, &mean)).collect()
        }
        ResidualWeights::Paper => {
            let root = bones[0].translation;
            bones.iter().map(|b| Affine { translation: b.translation - root, ..*b }).collect()
        }
    }
}

/// dL/dB^ from the device's moments: the adjoint of [`effective`].
pub fn d_residual_bones(run: &Run) -> Vec<Affine> {
    let d = run.d_bones(&run.residual_weights);
    match run.kind.weights {
        ResidualWeights::ZeroSum => effective(run, &d),
        ResidualWeights::Paper => {
            let sum: DVec3 = d.iter().map(|b| b.translation).sum();
            let mut d = d;
            d[0].translation -= sum;
            d
        }
    }
}

#[test]
fn residual_joints_and_bones_equal_those_of_their_twins() {
    Run::each(|run| {
        let twin = residual_joints(&run.regressor, &run.offsets, &run.joints, run.kind.skeleton);
        assert_same(run.kind, "residual joints", &run.residual_joints[..], &twin);
        let bones = effective(run, &run.exact_residual_chain().posed_from_rest);
        // The differences from identities are small.
        assert_near(run.kind, "residual bones", &run.residual_bones[..], &bones, 1.0);
    });
}

#[test]
fn gradients_of_regressor_and_offsets_equal_those_of_their_twins() {
    Run::each(|run| {
        let chain = run.exact_residual_chain();
        let d_bones = d_residual_bones(run);
        let d = pose_skeleton_vjp(&PARENTS, &run.residual_joints, &chain, &d_bones);
        let (d_regressor, mut d_offsets) = residual_joints_vjp(&run.regressor, &run.offsets, &d.joints);
        d_offsets.iter_mut().zip(&run.d_points).for_each(|(sum, d)| *sum += *d);
        let scale = norm(&d_bones[..]);
        assert_near(run.kind, "d regressor", &run.d_regressor[..], &d_regressor, scale * norm(&run.offsets[..]));
        assert_near(run.kind, "d offsets", &run.d_offsets[..], &d_offsets, scale * 0.05);
    });
}
