//! Host part of `residual_skeleton.wgsl` and `residual_skeleton_backward.wgsl`: the Neural Residual Skeleton
//! (paper eq. 9).

use super::joint_sums::JointSums;
use super::{BackwardBuffers, ForwardBuffers, MOMENT_ROWS, ROW_MOMENT, invocations_of_four};
use ghand_render::Gpu;
use ghand_render::pipeline::{Bound, Module};

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
        let own = [
            ("regressed", &regress.total),
            ("rest_joints", &b.joints),
            ("joints", &b.residual_joints),
            ("chain", &b.residual_chain),
        ];
        let all = [&own[..], &b.named()[..]].concat();
        ResidualSkeleton {
            place: module.stage(gpu, "place_residual_joints", &[]).bind(gpu, &all),
            chain: module.stage(gpu, "residual_skeleton", &[]).bind(gpu, &all),
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
        let own = [
            ("d_bones", &bone_sums.total),
            ("joints", &b.residual_joints),
            ("chain", &b.residual_chain),
            ("d_joints", &d.d_residual_joints),
        ];
        let all = [&own[..], &b.named()[..], &d.named()[..]].concat();
        ResidualSkeletonBackward {
            chain: module.stage(gpu, "residual_skeleton_backward", &[]).bind(gpu, &all),
            joints: module.stage(gpu, "residual_joints_backward", &[]).bind(gpu, &all),
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
