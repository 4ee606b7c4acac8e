//! Host part of `residual_skeleton.wgsl` and `residual_skeleton_backward.wgsl`: the Neural Residual Skeleton
//! (paper eq. 9).

use super::joint_sums::JointSums;
use super::{BackwardBuffers, ForwardBuffers, MOMENT_ROWS, ROW_MOMENT, invocations_of_four};
use ghand_render::Gpu;
use ghand_render::pipeline::{Bound, Module};
use ghand_render::stages::{
    self, PlaceResidualJoints, PlaceResidualJointsBindings, ResidualJointsBackward, ResidualJointsBackwardBindings,
    ResidualSkeletonBackwardBindings, ResidualSkeletonBindings,
};

/// From offsets to residual joints and their chain.
pub struct ResidualSkeleton {
    regress: JointSums,
    place: Bound,
    chain: Bound,
    joints: u32,
}

impl ResidualSkeleton {
    pub fn new(gpu: &Gpu, b: &ForwardBuffers) -> ResidualSkeleton {
        let sizes = b.properties.sizes;
        let regress = JointSums::new(gpu, &b.properties.regressor, sizes.joints, &b.offsets, 0, 3, sizes.gaussians);
        let module = Module::new(gpu, "residual_skeleton");
        let ForwardBuffers { pose, poses, parents, joints, residual_joints, residual_chain, .. } = b;
        ResidualSkeleton {
            place: module.stage::<PlaceResidualJoints>(gpu, &[]).bind(
                gpu,
                &PlaceResidualJointsBindings { pose, rest_joints: joints, regressed: &regress.total, residual_joints },
            ),
            chain: module.stage::<stages::ResidualSkeleton>(gpu, &[]).bind(
                gpu,
                &ResidualSkeletonBindings { pose, poses, parents, joints: residual_joints, chain: residual_chain },
            ),
            regress,
            joints: sizes.joints as u32,
        }
    }

    pub fn encode(&self, pass: &mut wgpu::ComputePass<'_>) {
        self.regress.encode(pass);
        self.place.dispatch_invocations(pass, 3 * self.joints);
        self.chain.dispatch(pass, 1);
    }
}

/// From the gradient of the residual bones to the gradients of the regressor, the offsets and the local rotations.
pub struct ResidualSkeletonBackward {
    bone_sums: JointSums,
    chain: Bound,
    joints: Bound,
    invocations: u32,
}

impl ResidualSkeletonBackward {
    pub fn new(gpu: &Gpu, b: &ForwardBuffers, d: &BackwardBuffers) -> ResidualSkeletonBackward {
        let sizes = b.properties.sizes;
        let weights = &b.properties.residual_weights;
        let bone_sums = JointSums::new(gpu, weights, sizes.joints, &d.d_skin, ROW_MOMENT, MOMENT_ROWS, sizes.gaussians);
        let module = Module::new(gpu, "residual_skeleton_backward");
        ResidualSkeletonBackward {
            chain: module.stage::<stages::ResidualSkeletonBackward>(gpu, &[]).bind(
                gpu,
                &ResidualSkeletonBackwardBindings {
                    pose: &b.pose,
                    parents: &b.parents,
                    joints: &b.residual_joints,
                    chain: &b.residual_chain,
                    d_bones: &bone_sums.total,
                    d_local: &d.d_local,
                    d_joints: &d.d_residual_joints,
                },
            ),
            joints: module.stage::<ResidualJointsBackward>(gpu, &[]).bind(
                gpu,
                &ResidualJointsBackwardBindings {
                    pose: &b.pose,
                    regressor: &b.properties.regressor,
                    d_residual_joints: &d.d_residual_joints,
                    d_regressor: &d.gradients.regressor,
                    offsets: &b.offsets,
                    d_skin: &d.d_skin,
                },
            ),
            bone_sums,
            invocations: invocations_of_four(sizes.gaussians),
        }
    }

    /// Overwrites the local rotations' gradient, fills the regressor's, and turns the points' gradient into the
    /// offsets'.
    pub fn encode(&self, pass: &mut wgpu::ComputePass<'_>) {
        self.bone_sums.encode(pass);
        self.chain.dispatch(pass, 1);
        self.joints.dispatch_invocations(pass, self.invocations);
    }
}
