//! Host part of `skin.wgsl` and `skin_backward.wgsl`: corrected linear blend skinning (paper eq. 10 and 11).

use super::{BackwardBuffers, ForwardBuffers, invocations_of_four};
use ghand_render::Gpu;
use ghand_render::pipeline::{Bound, Module};

/// From points and bones to posed means in the splatter's table.
pub struct Skin {
    skin: Bound,
    invocations: u32,
}

impl Skin {
    pub fn new(gpu: &Gpu, b: &ForwardBuffers) -> Skin {
        let skin = Module::new(gpu, "skin").stage(gpu, "skin", &b.properties.sizes.skinning()).bind(gpu, &b.named());
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
        let all = [&b.named()[..], &d.named()[..]].concat();
        let skin = Module::new(gpu, "skin_backward")
            .stage(gpu, "skin_backward", &b.properties.sizes.skinning())
            .bind(gpu, &all);
        SkinBackward { skin, invocations: invocations_of_four(b.properties.sizes.gaussians) }
    }

    pub fn encode(&self, pass: &mut wgpu::ComputePass<'_>) {
        self.skin.dispatch_invocations(pass, self.invocations);
    }
}
