//! Host part of `stretch.wgsl`: sizes of Gaussians follow the surface.

use super::{BackwardBuffers, ForwardBuffers};
use ghand_core::stretch::LIMITS;
use ghand_render::pipeline::{Bound, Module};
use ghand_render::stages::{StretchBackwardBindings, StretchBindings};
use ghand_render::{Gpu, buffers, stages};

/// From places before and after skinning to the standard deviations in the splatter's table.
pub struct Stretch {
    stretch: Bound,
    invocations: u32,
}

impl Stretch {
    /// `neighbors`: `[any number][N]`.
    pub fn new(gpu: &Gpu, b: &ForwardBuffers, neighbors: &[u32]) -> Stretch {
        let count = b.properties.sizes.gaussians;
        let constants =
            [("NEIGHBORS", (neighbors.len() / count.max(1)) as f64), ("SMALLEST", LIMITS[0]), ("LARGEST", LIMITS[1])];
        let stretch = Module::new(gpu, "stretch").stage::<stages::Stretch>(gpu, &constants).bind(
            gpu,
            &StretchBindings {
                pose: &b.pose,
                neighbors: &buffers::filled(gpu, "neighbours", neighbors),
                offsets: &b.offsets,
                skinned: &b.skinned,
                scale: &b.properties.scale,
                gaussians: &b.gaussians,
            },
        );
        Stretch { stretch, invocations: count as u32 }
    }

    pub fn encode(&self, pass: &mut wgpu::ComputePass<'_>) {
        self.stretch.dispatch_invocations(pass, self.invocations);
    }
}

/// From the gradient of those standard deviations to that of the ones before skinning.
pub struct StretchBackward {
    stretch: Bound,
    invocations: u32,
}

impl StretchBackward {
    pub fn new(gpu: &Gpu, b: &ForwardBuffers, d: &BackwardBuffers) -> StretchBackward {
        let stretch = Module::new(gpu, "stretch").stage::<stages::StretchBackward>(gpu, &[]).bind(
            gpu,
            &StretchBackwardBindings {
                pose: &b.pose,
                scale: &b.properties.scale,
                d_scale: &d.gradients.scale,
                gaussians: &b.gaussians,
                d_gaussians: &d.d_gaussians,
            },
        );
        StretchBackward { stretch, invocations: b.properties.sizes.gaussians as u32 }
    }

    pub fn encode(&self, pass: &mut wgpu::ComputePass<'_>) {
        self.stretch.dispatch_invocations(pass, self.invocations);
    }
}
