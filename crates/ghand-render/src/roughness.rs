//! Host part of `roughness.wgsl`: a penalty on differences between neighbours on a surface.

use bytemuck::{Pod, Zeroable};

use crate::pipeline::{Bound, Module, compute_pass};
use crate::stages::{AddRoughness, AddRoughnessBindings};
use crate::{Gpu, buffers};

/// See `shaders/roughness.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct RoughnessUniforms {
    /// N.
    pub count: u32,
    /// Number of rows of values.
    pub rows: u32,
    /// Number of neighbours of each Gaussian.
    pub neighbors: u32,
    /// Weight of a pair.
    pub weight: f32,
    /// 1 / width^2: differences below the width count quadratically, larger ones linearly.
    pub inverse_squared_width: f32,
    /// Unused.
    pub padding_a: u32,
    /// Unused.
    pub padding_b: u32,
    /// Unused.
    pub padding_c: u32,
}

/// Adds the gradient of the roughness of a table to a gradient.
pub struct Roughness {
    uniforms: wgpu::Buffer,
    stage: Bound,
    current: RoughnessUniforms,
}

impl Roughness {
    /// A penalty on the roughness of `values`, `[rows][N]`, added to `gradients`. `neighbors` is `[K][N]`; a missing
    /// neighbour is the Gaussian itself. Its initial weight is 0.
    pub fn new(
        gpu: &Gpu,
        values: &wgpu::Buffer,
        gradients: &wgpu::Buffer,
        rows: usize,
        neighbors: &[u32],
        count: usize,
    ) -> Roughness {
        let current = RoughnessUniforms {
            count: count as u32,
            rows: rows as u32,
            neighbors: (neighbors.len() / count.max(1)) as u32,
            ..RoughnessUniforms::zeroed()
        };
        let uniforms = buffers::uniform(gpu, "roughness", &current);
        let neighbors = &buffers::filled(gpu, "neighbors", neighbors);
        let bindings = AddRoughnessBindings { roughness: &uniforms, neighbors, values, gradients };
        let stage = Module::new(gpu, "roughness").stage::<AddRoughness>(gpu, &[]).bind(gpu, &bindings);
        Roughness { uniforms, stage, current }
    }

    /// Sets weight and width of later submissions; differences below the width count quadratically, larger ones linearly.
    pub fn set_weight(&mut self, gpu: &Gpu, weight: f32, width: f32) {
        self.current.weight = weight;
        self.current.inverse_squared_width = 1.0 / (width * width);
        gpu.queue.write_buffer(&self.uniforms, 0, bytemuck::bytes_of(&self.current));
    }

    /// Encodes the penalty, unless its weight is 0.
    pub fn encode(&self, encoder: &mut wgpu::CommandEncoder) {
        if self.current.weight != 0.0 {
            let invocations = self.current.count * self.current.rows;
            self.stage.dispatch_invocations(&mut compute_pass(encoder, "roughness"), invocations);
        }
    }
}
