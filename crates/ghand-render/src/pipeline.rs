//! Compute pipelines from WGSL, with buffers bound by their names in the shader.

use crate::Gpu;
use crate::bindings::Bindings;
use crate::shader_sources::Shader;

/// The buffers of a stage, by name in the WGSL.
pub type Buffers<'a> = [(&'a str, &'a wgpu::Buffer)];

/// One entry point of one shader, ready to be bound and dispatched.
#[derive(Debug)]
pub struct Stage {
    label: &'static str,
    pipeline: wgpu::ComputePipeline,
    bindings: Bindings,
    /// Invocations of a workgroup, at least 1.
    workgroup: u32,
}

/// A [`Stage`] with its buffers.
#[derive(Debug)]
pub struct Bound {
    label: &'static str,
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
    /// Panics if the shader has no entry point of this name, which is a bug in the program.
    pub fn stage(&self, gpu: &Gpu, entry: &'static str, constants: &[(&str, f64)]) -> Stage {
        let pipeline = gpu.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some(entry),
            layout: None,
            module: &self.module,
            entry_point: Some(entry),
            compilation_options: wgpu::PipelineCompilationOptions {
                constants,
                zero_initialize_workgroup_memory: false,
            },
            cache: None,
        });
        let workgroup = self.shader.entry(entry).workgroup.iter().product::<u32>().max(1);
        Stage { label: entry, pipeline, bindings: Bindings::new(self.shader.name, &[entry]), workgroup }
    }
}

impl Stage {
    /// Binds buffers by their names in the WGSL. Buffers that the entry point does not use are ignored, so that all
    /// stages of a shader can be given the same list.
    ///
    /// # Panics
    /// Panics if a buffer that the entry point uses is missing, which is a bug in the program.
    pub fn bind(&self, gpu: &Gpu, buffers: &Buffers) -> Bound {
        let resources: Vec<_> = buffers.iter().map(|(name, buffer)| (*name, buffer.as_entire_binding())).collect();
        let layout = self.pipeline.get_bind_group_layout(0);
        let group = self.bindings.group(&gpu.device, self.label, &layout, &resources);
        Bound { label: self.label, pipeline: self.pipeline.clone(), group, workgroup: self.workgroup }
    }

    /// Workgroups that `invocations` fill.
    pub fn groups(&self, invocations: u32) -> u32 {
        invocations.div_ceil(self.workgroup)
    }
}

/// Maximum number of workgroups per dimension that every WebGPU device supports.
const MAX_GROUPS: u32 = 65_535;

impl Bound {
    /// Name of the entry point.
    pub fn label(&self) -> &'static str {
        self.label
    }

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
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &self.group, &[]);
        pass.dispatch_workgroups(groups.div_ceil(rows), rows, 1);
    }
}

/// Begins a compute pass.
pub fn compute_pass<'a>(encoder: &'a mut wgpu::CommandEncoder, label: &str) -> wgpu::ComputePass<'a> {
    encoder.begin_compute_pass(&wgpu::ComputePassDescriptor { label: Some(label), ..Default::default() })
}
