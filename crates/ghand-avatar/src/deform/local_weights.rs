//! Host part of `local_weights.wgsl`: keeps residual weights to the joints that move a Gaussian.

use bytemuck::{Pod, Zeroable};

use ghand_render::pipeline::{Bound, Module};
use ghand_render::{Gpu, buffers};

/// See `shaders/local_weights.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct LocalWeightsUniforms {
    /// N.
    pub count: u32,
    /// `n_b`.
    pub joints: u32,
    /// Unused.
    pub padding_a: u32,
    /// Unused.
    pub padding_b: u32,
}

/// Makes a table of residual weights, or their gradient, local.
pub struct LocalWeights {
    stage: Bound,
    count: u32,
}

impl LocalWeights {
    /// For `values` in place and skinning weights, both `[joints][N]`.
    pub fn new(gpu: &Gpu, weights: &wgpu::Buffer, values: &wgpu::Buffer, joints: usize, count: usize) -> LocalWeights {
        let sizes =
            LocalWeightsUniforms { count: count as u32, joints: joints as u32, ..LocalWeightsUniforms::zeroed() };
        let uniforms = buffers::uniform(gpu, "local weights", &sizes);
        let buffers = [("local_weights_size", &uniforms), ("weights", weights), ("values", values)];
        let stage = Module::new(gpu, "local_weights").stage(gpu, "local_weights", &[]).bind(gpu, &buffers);
        LocalWeights { stage, count: count as u32 }
    }

    /// Encodes it.
    pub fn encode(&self, pass: &mut wgpu::ComputePass<'_>) {
        self.stage.dispatch_invocations(pass, self.count);
    }
}
