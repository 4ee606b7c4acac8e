//! Host part of `skeleton.wgsl` and `skeleton_backward.wgsl`: the joint chain of a pose, and the gradients of pose and
//! joints.

use super::joint_sums::JointSums;
use super::{BackwardBuffers, ForwardBuffers, MOMENT_ROWS, ROW_MOMENT};
use ghand_render::Gpu;
use ghand_render::pipeline::{Bound, Module};
use ghand_render::stages::{
    self, RotationBackward, RotationBackwardBindings, SkeletonBackwardBindings, SkeletonBindings,
};

/// From pose to joint chain.
pub struct Skeleton {
    skeleton: Bound,
}

impl Skeleton {
    /// Reads poses, parents and joints; fills the chain.
    pub fn new(gpu: &Gpu, b: &ForwardBuffers) -> Skeleton {
        let ForwardBuffers { pose, poses, parents, joints, chain, .. } = b;
        let bindings = SkeletonBindings { pose, poses, parents, joints, chain };
        Skeleton { skeleton: Module::new(gpu, "skeleton").stage::<stages::Skeleton>(gpu, &[]).bind(gpu, &bindings) }
    }

    pub fn encode(&self, pass: &mut wgpu::ComputePass<'_>) {
        self.skeleton.dispatch(pass, 1);
    }
}

/// From the gradient of the bones to the gradients of joints and pose.
pub struct SkeletonBackward {
    bone_sums: JointSums,
    skeleton: Bound,
    rotations: Bound,
    joints: u32,
}

impl SkeletonBackward {
    pub fn new(gpu: &Gpu, b: &ForwardBuffers, d: &BackwardBuffers) -> SkeletonBackward {
        let sizes = b.properties.sizes;
        let bone_sums =
            JointSums::of_weights(gpu, &b.weights, sizes.joints, &d.d_skin, ROW_MOMENT, MOMENT_ROWS, sizes.gaussians);
        let module = Module::new(gpu, "skeleton_backward");
        let ForwardBuffers { pose, poses, parents, joints, chain, .. } = b;
        let BackwardBuffers { d_residual_joints, d_joints, d_local, d_pose, mobility, .. } = d;
        SkeletonBackward {
            skeleton: module.stage::<stages::SkeletonBackward>(gpu, &[]).bind(
                gpu,
                &SkeletonBackwardBindings {
                    pose,
                    parents,
                    joints,
                    chain,
                    d_bones: &bone_sums.total,
                    d_local,
                    d_joints,
                    d_pose,
                    d_residual_joints,
                },
            ),
            rotations: module
                .stage::<RotationBackward>(gpu, &[])
                .bind(gpu, &RotationBackwardBindings { pose, poses, d_local, d_pose, mobility }),
            bone_sums,
            joints: sizes.joints as u32,
        }
    }

    /// Adds to the local rotations' gradient, and fills the gradients of joints and pose.
    pub fn encode(&self, pass: &mut wgpu::ComputePass<'_>) {
        self.bone_sums.encode(pass);
        self.skeleton.dispatch(pass, 1);
        self.rotations.dispatch_invocations(pass, self.joints);
    }
}
