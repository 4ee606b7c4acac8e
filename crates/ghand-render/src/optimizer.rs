//! Host part of `adam.wgsl`: Adam on ranges of parameter tables, without leaving the device.

use bytemuck::{Pod, Zeroable};

use crate::pipeline::{Bound, Module, Stage};
use crate::stages::{AdamStep, AdamStepBindings, AdamStepVectors, AdamStepVectorsBindings};
use crate::{Gpu, RenderError, buffers};

/// See `shaders/adam.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct AdamUniforms {
    /// Number of parameters.
    pub count: u32,
    /// Offset of the first parameter in the parameter table.
    pub parameter_offset: u32,
    /// Offset of the first gradient in the gradient table.
    pub gradient_offset: u32,
    /// Step size.
    pub learning_rate: f32,
    /// Decay of the first moment.
    pub beta_1: f32,
    /// Decay of the second moment.
    pub beta_2: f32,
    /// Added to the root of the second moment.
    pub epsilon: f32,
    /// 1 / (1 - beta_1^step).
    pub correction_1: f32,
    /// 1 / (1 - beta_2^step).
    pub correction_2: f32,
    /// Unused.
    pub padding_1: u32,
    /// Unused.
    pub padding_2: u32,
    /// Unused.
    pub padding_3: u32,
}

/// Decay of the first and second moment.
pub const BETAS: [f64; 2] = [0.9, 0.999];
/// Small enough for gradients of single Gaussians, which are about 1e-6.
pub const EPSILON: f32 = 1e-15;

impl AdamUniforms {
    /// The uniforms of step number `step` (from 1) on a range.
    pub fn new(range: std::ops::Range<usize>, gradient_offset: usize, learning_rate: f64, step: u64) -> AdamUniforms {
        let correction = |beta: f64| (1.0 / (1.0 - beta.powf(step as f64))) as f32;
        AdamUniforms {
            count: range.len() as u32,
            parameter_offset: range.start as u32,
            gradient_offset: gradient_offset as u32,
            learning_rate: learning_rate as f32,
            beta_1: BETAS[0] as f32,
            beta_2: BETAS[1] as f32,
            epsilon: EPSILON,
            correction_1: correction(BETAS[0]),
            correction_2: correction(BETAS[1]),
            padding_1: 0,
            padding_2: 0,
            padding_3: 0,
        }
    }
}

/// The compiled Adam stages.
pub struct Adam {
    scalars: Stage<AdamStep>,
    vectors: Stage<AdamStepVectors>,
}

/// Which parameters share a second moment.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Grouping {
    /// Every parameter has its own second moment.
    Scalars,
    /// Vectors of three parameters share one; ranges must be multiples of three.
    Vectors,
}

/// Adam bound to one parameter table; each range of the table with a separate learning rate is a slot.
pub struct AdamTable {
    /// Both moments of each parameter.
    pub moments: wgpu::Buffer,
    length: usize,
    slots: Vec<(wgpu::Buffer, Bound)>,
}

impl Adam {
    /// Compiles the stage.
    ///
    /// # Errors
    /// [`RenderError`] if the device rejects it or was lost.
    pub fn new(gpu: &Gpu) -> Result<Adam, RenderError> {
        gpu.scoped("the optimizer", || {
            let module = Module::new(gpu, "adam");
            Adam { scalars: module.stage(gpu, &[]), vectors: module.stage(gpu, &[]) }
        })
    }

    /// Binds a table of `length` parameters with `slots` ranges.
    ///
    /// # Errors
    /// [`RenderError`] if the device has too little memory for the moments or was lost.
    pub fn table(
        &self,
        gpu: &Gpu,
        parameters: &wgpu::Buffer,
        gradients: &wgpu::Buffer,
        length: usize,
        slots: usize,
        grouping: Grouping,
    ) -> Result<AdamTable, RenderError> {
        gpu.scoped(&format!("the moments of {length} parameters"), || {
            let moments = &buffers::zeroed(gpu, "moments", 2 * length);
            let slots = (0..slots)
                .map(|_| {
                    let uniforms = buffers::uniform(gpu, "adam", &AdamUniforms::zeroed());
                    let adam = &uniforms;
                    let bound = match grouping {
                        Grouping::Scalars => {
                            self.scalars.bind(gpu, &AdamStepBindings { adam, parameters, gradients, moments })
                        }
                        Grouping::Vectors => {
                            self.vectors.bind(gpu, &AdamStepVectorsBindings { adam, parameters, gradients, moments })
                        }
                    };
                    (uniforms, bound)
                })
                .collect();
            AdamTable { moments: moments.clone(), length, slots }
        })
    }
}

impl AdamTable {
    /// Reads both moments of each parameter.
    ///
    /// # Errors
    /// [`RenderError`] if the device failed or was lost.
    pub fn read_moments(&self, gpu: &Gpu) -> Result<Vec<f32>, RenderError> {
        buffers::read(gpu, &self.moments, 2 * self.length)
    }

    /// Encodes a step of one slot. A slot can be encoded only once per submission, since its uniforms are written
    /// immediately.
    pub fn encode(&self, gpu: &Gpu, pass: &mut wgpu::ComputePass<'_>, slot: usize, uniforms: &AdamUniforms) {
        if let Some((buffer, bound)) = self.slots.get(slot) {
            gpu.queue.write_buffer(buffer, 0, bytemuck::bytes_of(uniforms));
            bound.dispatch_invocations(pass, uniforms.count);
        }
    }
}
