//! Host part of `skin.wgsl` and `skin_backward.wgsl`: corrected linear blend skinning (paper eq. 10 and 11).

use super::{BackwardBuffers, ForwardBuffers, invocations_of_four};
use ghand_render::pipeline::{Bound, Module};
use ghand_render::stages::{SkinBackwardBindings, SkinBindings};
use ghand_render::{Gpu, stages};

/// From points and bones to posed means in the splatter's table.
pub struct Skin {
    skin: Bound,
    invocations: u32,
}

impl Skin {
    pub fn new(gpu: &Gpu, b: &ForwardBuffers) -> Skin {
        let skin = Module::new(gpu, "skin").stage::<stages::Skin>(gpu, &b.properties.sizes.skinning()).bind(
            gpu,
            &SkinBindings {
                pose: &b.pose,
                residual_weights: &b.properties.residual_weights,
                chain: &b.chain,
                residual_chain: &b.residual_chain,
                poses: &b.poses,
                gaussians: &b.gaussians,
                skinned: &b.skinned,
                offsets: &b.offsets,
                weights: &b.weights,
            },
        );
        Skin { skin, invocations: invocations_of_four(b.properties.sizes.gaussians) }
    }

    pub fn encode(&self, pass: &mut wgpu::ComputePass<'_>) {
        self.skin.dispatch_invocations(pass, self.invocations);
    }
}

/// From the gradient of the posed means to the gradients of points and residual weights, and to the moments from which
/// the bones' gradients are computed.
pub struct SkinBackward {
    skin: Bound,
    invocations: u32,
}

impl SkinBackward {
    pub fn new(gpu: &Gpu, b: &ForwardBuffers, d: &BackwardBuffers) -> SkinBackward {
        let module = Module::new(gpu, "skin_backward");
        let skin = module.stage::<stages::SkinBackward>(gpu, &b.properties.sizes.skinning()).bind(
            gpu,
            &SkinBackwardBindings {
                pose: &b.pose,
                residual_weights: &b.properties.residual_weights,
                chain: &b.chain,
                residual_chain: &b.residual_chain,
                d_gaussians: &d.d_gaussians,
                d_residual_weights: &d.gradients.residual_weights,
                offsets: &b.offsets,
                weights: &b.weights,
                d_skin: &d.d_skin,
            },
        );
        SkinBackward { skin, invocations: invocations_of_four(b.properties.sizes.gaussians) }
    }

    pub fn encode(&self, pass: &mut wgpu::ComputePass<'_>) {
        self.skin.dispatch_invocations(pass, self.invocations);
    }
}
