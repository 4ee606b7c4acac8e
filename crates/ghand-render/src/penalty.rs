//! Host part of `penalty.wgsl`: a quadratic penalty on a table of values.

use bytemuck::{Pod, Zeroable};

use crate::pipeline::{Bound, Module, compute_pass};
use crate::stages::{AddPenalty, AddPenaltyBindings};
use crate::{Gpu, buffers};

/// See `shaders/penalty.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct PenaltyUniforms {
    /// Number of values.
    pub count: u32,
    /// The gradient as a multiple of the value.
    pub weight: f32,
    /// Unused.
    pub padding: [u32; 2],
}

/// Adds the gradient of `weight / 2 * |values|^2` to a gradient.
pub struct Penalty {
    uniforms: wgpu::Buffer,
    stage: Bound,
    count: u32,
    weight: f32,
}

impl Penalty {
    /// A penalty on the first `count` numbers of `values`, added to the first of `gradients`. Its initial weight is 0.
    pub fn new(gpu: &Gpu, values: &wgpu::Buffer, gradients: &wgpu::Buffer, count: usize) -> Penalty {
        let uniforms = buffers::uniform(gpu, "penalty", &PenaltyUniforms::zeroed());
        let bindings = AddPenaltyBindings { penalty: &uniforms, values, gradients };
        let stage = Module::new(gpu, "penalty").stage::<AddPenalty>(gpu, &[]).bind(gpu, &bindings);
        Penalty { uniforms, stage, count: count as u32, weight: 0.0 }
    }

    /// Sets the weight of later submissions.
    pub fn set_weight(&mut self, gpu: &Gpu, weight: f32) {
        self.weight = weight;
        let uniforms = PenaltyUniforms { count: self.count, weight, padding: [0; 2] };
        gpu.queue.write_buffer(&self.uniforms, 0, bytemuck::bytes_of(&uniforms));
    }

    /// Encodes the penalty, unless its weight is 0.
    pub fn encode(&self, encoder: &mut wgpu::CommandEncoder) {
        if self.weight != 0.0 {
            self.stage.dispatch_invocations(&mut compute_pass(encoder, "penalty"), self.count);
        }
    }
}
