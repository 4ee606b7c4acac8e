//! Compute pipelines from WGSL, bound by the structs in [`crate::stages`].

use std::marker::PhantomData;

use crate::Gpu;
use crate::bindings::{ComputeEntry, bind_group};
use crate::shader_sources::{Entry, Shader};

/// One entry point of one shader, ready to be bound and dispatched.
#[derive(Debug)]
pub struct Stage<E> {
    pipeline: wgpu::ComputePipeline,
    entry: &'static Entry,
    program: PhantomData<E>,
}

/// A [`Stage`] with what it binds.
#[derive(Debug)]
pub struct Bound {
    pipeline: wgpu::ComputePipeline,
    group: wgpu::BindGroup,
    /// Invocations of a workgroup, at least 1.
    workgroup: u32,
}

/// A shader from which stages are made.
#[derive(Debug)]
pub struct Module {
    module: wgpu::ShaderModule,
    shader: &'static Shader,
}

impl Module {
    /// Compiles the shader of this name. Stages that the device rejects are reported by the [`Gpu::scoped`] around this
    /// call, else by [`Gpu::check`].
    ///
    /// # Panics
    /// Panics if no shader has this name.
    pub fn new(gpu: &Gpu, name: &str) -> Module {
        let shader = Shader::named(name);
        Module { module: shader.module(&gpu.device), shader }
    }

    /// The stage of an entry point. `constants` are the source's `override` values.
    ///
    /// # Panics
    /// Panics if another shader has this entry point, which is a bug in the program.
    pub fn stage<E: ComputeEntry>(&self, gpu: &Gpu, constants: &[(&str, f64)]) -> Stage<E> {
        let pipeline = gpu.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some(E::NAME),
            layout: None,
            module: &self.module,
            entry_point: Some(E::NAME),
            compilation_options: wgpu::PipelineCompilationOptions {
                constants,
                zero_initialize_workgroup_memory: false,
            },
            cache: None,
        });
        Stage { pipeline, entry: self.shader.entry(E::NAME), program: PhantomData }
    }
}

impl<E: ComputeEntry> Stage<E> {
    /// Binds everything that the entry point uses:
    ///
    /// ```
    /// use ghand_render::Gpu;
    /// use ghand_render::pipeline::{Bound, Stage};
    /// use ghand_render::stages::{AddPenalty, AddPenaltyBindings};
    ///
    /// fn bind(gpu: &Gpu, stage: &Stage<AddPenalty>, uniforms: &wgpu::Buffer, buffers: &[wgpu::Buffer; 2]) -> Bound {
    ///     let [values, gradients] = buffers;
    ///     stage.bind(gpu, &AddPenaltyBindings { penalty: uniforms, values, gradients })
    /// }
    /// ```
    ///
    /// A missing buffer does not compile:
    ///
    /// ```compile_fail,E0063
    /// use ghand_render::Gpu;
    /// use ghand_render::pipeline::{Bound, Stage};
    /// use ghand_render::stages::{AddPenalty, AddPenaltyBindings};
    ///
    /// fn bind(gpu: &Gpu, stage: &Stage<AddPenalty>, uniforms: &wgpu::Buffer, buffers: &[wgpu::Buffer; 2]) -> Bound {
    ///     let [values, gradients] = buffers;
    ///     stage.bind(gpu, &AddPenaltyBindings { penalty: uniforms, values })
    /// }
    /// ```
    pub fn bind(&self, gpu: &Gpu, bindings: &E::Bindings<'_>) -> Bound {
        let layout = self.pipeline.get_bind_group_layout(0);
        let group = bind_group(&gpu.device, E::NAME, &layout, self.entry.bindings, bindings);
        Bound { pipeline: self.pipeline.clone(), group, workgroup: self.workgroup() }
    }

    /// Invocations of a workgroup, at least 1.
    fn workgroup(&self) -> u32 {
        self.entry.workgroup.iter().product::<u32>().max(1)
    }

    /// Workgroups that `invocations` fill.
    pub fn groups(&self, invocations: u32) -> u32 {
        invocations.div_ceil(self.workgroup())
    }
}

/// Maximum number of workgroups per dimension that every WebGPU device supports.
const MAX_GROUPS: u32 = 65_535;

impl Bound {
    /// Dispatches the workgroups for `invocations` as [`Bound::dispatch`] does.
    pub fn dispatch_invocations(&self, pass: &mut wgpu::ComputePass<'_>, invocations: u32) {
        self.dispatch(pass, invocations.div_ceil(self.workgroup));
    }

    /// Dispatches at least `groups` workgroups, in two dimensions if there are many: shaders number them as
    /// `workgroup_id.x + workgroup_id.y * num_workgroups.x` and ignore the surplus.
    pub fn dispatch(&self, pass: &mut wgpu::ComputePass<'_>, groups: u32) {
        if groups == 0 {
            return;
        }
        let rows = groups.div_ceil(MAX_GROUPS);
        self.dispatch_grid(pass, [groups.div_ceil(rows), rows]);
    }

    /// Dispatches columns and rows of workgroups.
    pub fn dispatch_grid(&self, pass: &mut wgpu::ComputePass<'_>, [columns, rows]: [u32; 2]) {
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &self.group, &[]);
        pass.dispatch_workgroups(columns, rows, 1);
    }
}

/// Begins a compute pass.
pub fn compute_pass<'a>(encoder: &'a mut wgpu::CommandEncoder, label: &str) -> wgpu::ComputePass<'a> {
    encoder.begin_compute_pass(&wgpu::ComputePassDescriptor { label: Some(label), ..Default::default() })
}
