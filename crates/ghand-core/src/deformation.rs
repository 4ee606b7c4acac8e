//! From an avatar's properties and a pose to its posed points (paper eq. 7 to 11), and the derivative: blend shapes,
//! residual skeleton, both kinematic chains, corrected skinning.

use glam::{DMat3, DVec3};
use rayon::prelude::*;

use crate::Pose;
use crate::blend_shapes::{blend_shapes, blend_shapes_vjp};
use crate::parallel::CHUNK;
use crate::residual_skeleton::{ResidualSkeleton, residual_joints, residual_joints_vjp};
use crate::skeleton::{Chain, pose_skeleton, pose_skeleton_vjp, rotations_vjp};
use crate::skinning::{ResidualWeights, Skinning, skin, skin_vjp};

/// The properties of N Gaussians on a hand of `n_b` joints, with `n` shape bases.
#[derive(Debug, Clone, Copy)]
pub struct DeformationInputs<'a> {
    /// Parent of each joint, which precedes it.
    pub parents: &'a [Option<usize>],
    /// Rest joints J, metres, `n_b`.
    pub joints: &'a [DVec3],
    /// Canonical Gaussians x_c, metres, N.
    pub canonical: &'a [DVec3],
    /// Skinning weights W, `[n_b][N]`.
    pub weights: &'a [f64],
    /// Shape bases S, `[n][N]`, metres.
    pub shape_basis: &'a [DVec3],
    /// Blend coefficients C in this pose, `[n][N]`, no unit.
    pub blend_coefficients: &'a [DVec3],
    /// Skeleton regressor R in this pose, `[n_b][N]`, no unit.
    pub skeleton_regressor: &'a [f64],
    /// Residual skinning weights W^, `[n_b][N]`.
    pub residual_weights: &'a [f64],
    /// Meaning of the residual weights.
    pub residual_weights_mode: ResidualWeights,
    /// Position of the residual joints.
    pub residual_skeleton_mode: ResidualSkeleton,
}

/// The results of [`deform`], intermediate ones included, all in the order of the inputs.
#[derive(Debug, Clone, PartialEq)]
pub struct Deformed {
    /// Offsets Delta, metres, N.
    pub offsets: Vec<DVec3>,
    /// Offset Gaussians x^_c, metres, N.
    pub rest: Vec<DVec3>,
    /// The posed skeleton.
    pub chain: Chain,
    /// Residual joints J^, metres, `n_b`.
    pub residual_joints: Vec<DVec3>,
    /// The posed residual skeleton.
    pub residual_chain: Chain,
    /// Posed Gaussians x_p, metres, N.
    pub posed: Vec<DVec3>,
}

/// Gradients of [`deform`]. If the coefficients or the regressor depend on the pose, the caller adds that part of the
/// gradient to `local` before [`rotations_vjp`].
#[derive(Debug, Clone, PartialEq)]
pub struct DeformationGradients {
    /// dL/dx_c, N.
    pub canonical: Vec<DVec3>,
    /// dL/dJ, `n_b`.
    pub joints: Vec<DVec3>,
    /// dL/dS, `[n][N]`.
    pub shape_basis: Vec<DVec3>,
    /// dL/dC, `[n][N]`.
    pub blend_coefficients: Vec<DVec3>,
    /// dL/dR, `[n_b][N]`.
    pub skeleton_regressor: Vec<f64>,
    /// dL/dW^, `[n_b][N]`.
    pub residual_weights: Vec<f64>,
    /// dL/dR_k of the joints' rotation matrices, `n_b`.
    pub local: Vec<DMat3>,
    /// dL/d(translation).
    pub translation: DVec3,
}

impl DeformationGradients {
    /// dL/d(axis-angle) of every joint.
    pub fn rotations(&self, pose: &Pose) -> Vec<DVec3> {
        rotations_vjp(&pose.rotations, &self.local)
    }
}

impl<'a> DeformationInputs<'a> {
    fn skinning<'b>(&self, rest: &'b [DVec3], chain: &'b Chain, residual_chain: &'b Chain, pose: &Pose) -> Skinning<'b>
    where
        'a: 'b,
    {
        Skinning {
            rest,
            weights: self.weights,
            residual_weights: self.residual_weights,
            bones: &chain.posed_from_rest,
            residual_bones: &residual_chain.posed_from_rest,
            translation: pose.translation,
            mode: self.residual_weights_mode,
        }
    }
}

/// Posed Gaussians `x_p = (sum_k W_k B_k + W^_k B^_k) (x_c + Delta) + t` with `Delta = sum_i C_i (.) S_i` and the
/// residual chain B^ of the joints `R Delta` (or `J + R Delta`).
///
/// The lengths must agree as documented. Runs in parallel over the Gaussians; the result is bit-identical for any
/// number of threads.
pub fn deform(d: &DeformationInputs, pose: &Pose) -> Deformed {
    let offsets = blend_shapes(d.shape_basis, d.blend_coefficients, d.canonical.len());
    let rest: Vec<DVec3> =
        d.canonical.par_iter().zip(&offsets).with_min_len(CHUNK).map(|(x, offset)| *x + *offset).collect();
    let residual_joints = residual_joints(d.skeleton_regressor, &offsets, d.joints, d.residual_skeleton_mode);
    let chain = pose_skeleton(d.parents, d.joints, &pose.rotations);
    let residual_chain = pose_skeleton(d.parents, &residual_joints, &pose.rotations);
    let posed = skin(&d.skinning(&rest, &chain, &residual_chain, pose));
    Deformed { offsets, rest, chain, residual_joints, residual_chain, posed }
}

/// Gradients of all inputs from dL/dx_p (N) and from a loss on the offsets themselves (dL/dDelta, N; empty if there is
/// none); `forward` is [`deform`]'s result for the same inputs.
pub fn deform_vjp(
    d: &DeformationInputs,
    pose: &Pose,
    forward: &Deformed,
    d_posed: &[DVec3],
    d_loss_offsets: &[DVec3],
) -> DeformationGradients {
    let skin = d.skinning(&forward.rest, &forward.chain, &forward.residual_chain, pose);
    let d_skin = skin_vjp(&skin, d_posed);
    let mut d_chain = pose_skeleton_vjp(d.parents, d.joints, &forward.chain, &d_skin.bones);
    let d_residual_chain =
        pose_skeleton_vjp(d.parents, &forward.residual_joints, &forward.residual_chain, &d_skin.residual_bones);
    d_chain.local.iter_mut().zip(&d_residual_chain.local).for_each(|(sum, d)| *sum += *d);
    if d.residual_skeleton_mode == ResidualSkeleton::Anchored {
        d_chain.joints.iter_mut().zip(&d_residual_chain.joints).for_each(|(sum, d)| *sum += *d);
    }
    let (skeleton_regressor, mut d_offsets) =
        residual_joints_vjp(d.skeleton_regressor, &forward.offsets, &d_residual_chain.joints);
    for part in [&d_skin.rest[..], d_loss_offsets] {
        d_offsets.par_iter_mut().zip(part).with_min_len(CHUNK).for_each(|(sum, d)| *sum += *d);
    }
    let (shape_basis, blend_coefficients) = blend_shapes_vjp(d.shape_basis, d.blend_coefficients, &d_offsets);
    DeformationGradients {
        canonical: d_skin.rest,
        joints: d_chain.joints,
        shape_basis,
        blend_coefficients,
        skeleton_regressor,
        residual_weights: d_skin.residual_weights,
        local: d_chain.local,
        translation: d_skin.translation,
    }
}
