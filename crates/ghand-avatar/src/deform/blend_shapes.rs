//! Host part of `blend_shapes.wgsl`: Hand Gaussian Blend Shapes (paper eq. 7 and 8).

use super::{BackwardBuffers, ForwardBuffers};
use ghand_render::bindings::ComputeEntry;
use ghand_render::pipeline::{Bound, Module, Stage};
use ghand_render::stages::{BlendShapesBackwardBindings, BlendShapesBindings};
use ghand_render::{Gpu, stages};

/// From bases and coefficients to offsets.
pub struct BlendShapes {
    blend: Bound,
    count: u32,
}

fn stage<E: ComputeEntry>(gpu: &Gpu, b: &ForwardBuffers) -> Stage<E> {
    let rows = b.properties.sizes.coefficients.rows();
    Module::new(gpu, "blend_shapes").stage(gpu, &[("COEFFICIENT_ROWS", rows as f64)])
}

impl BlendShapes {
    pub fn new(gpu: &Gpu, b: &ForwardBuffers) -> BlendShapes {
        let blend = stage::<stages::BlendShapes>(gpu, b).bind(
            gpu,
            &BlendShapesBindings {
                pose: &b.pose,
                rest: &b.rest,
                shape_basis: &b.properties.shape_basis,
                coefficients: &b.properties.coefficients,
                offsets: &b.offsets,
            },
        );
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
        let blend = stage::<stages::BlendShapesBackward>(gpu, b).bind(
            gpu,
            &BlendShapesBackwardBindings {
                pose: &b.pose,
                shape_basis: &b.properties.shape_basis,
                coefficients: &b.properties.coefficients,
                d_skin: &d.d_skin,
                d_shape_basis: &d.gradients.shape_basis,
                d_coefficients: &d.gradients.coefficients,
            },
        );
        BlendShapesBackward { blend, count: b.properties.sizes.gaussians as u32 }
    }

    pub fn encode(&self, pass: &mut wgpu::ComputePass<'_>) {
        self.blend.dispatch_invocations(pass, self.count);
    }
}
