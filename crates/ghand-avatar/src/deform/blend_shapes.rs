//! Host part of `blend_shapes.wgsl`: Hand Gaussian Blend Shapes (paper eq. 7 and 8).

use super::{BackwardBuffers, ForwardBuffers};
use ghand_render::Gpu;
use ghand_render::pipeline::{Bound, Module};

/// From bases and coefficients to offsets.
pub struct BlendShapes {
    blend: Bound,
    count: u32,
}

fn stage(gpu: &Gpu, b: &ForwardBuffers, entry: &'static str) -> ghand_render::pipeline::Stage {
    let rows = b.properties.sizes.coefficients.rows();
    Module::new(gpu, "blend_shapes").stage(gpu, entry, &[("COEFFICIENT_ROWS", rows as f64)])
}

impl BlendShapes {
    pub fn new(gpu: &Gpu, b: &ForwardBuffers) -> BlendShapes {
        let blend = stage(gpu, b, "blend_shapes").bind(gpu, &b.named());
        BlendShapes { blend, count: b.properties.sizes.gaussians as u32 }
    }

    pub fn encode(&self, pass: &mut wgpu::ComputePass<'_>) {
        self.blend.dispatch_invocations(pass, self.count);
    }
}

/// From the gradient of the offsets to the gradients of bases and coefficients.
pub struct BlendShapesBackward {
    blend: Bound,
    count: u32,
}

impl BlendShapesBackward {
    pub fn new(gpu: &Gpu, b: &ForwardBuffers, d: &BackwardBuffers) -> BlendShapesBackward {
        let all = [&b.named()[..], &d.named()[..]].concat();
        let blend = stage(gpu, b, "blend_shapes_backward").bind(gpu, &all);
        BlendShapesBackward { blend, count: b.properties.sizes.gaussians as u32 }
    }

    pub fn encode(&self, pass: &mut wgpu::ComputePass<'_>) {
        self.blend.dispatch_invocations(pass, self.count);
    }
}
