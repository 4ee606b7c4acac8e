//! Compute pipelines from WGSL pieces.

use crate::Gpu;

/// One entry point of one shader, ready to be bound and dispatched.
#[derive(Debug)]
pub struct Stage {
    label: &'static str,
    pipeline: wgpu::ComputePipeline,
}

/// A [`Stage`] with its buffers.
#[derive(Debug)]
pub struct Bound {
    label: &'static str,
    pipeline: wgpu::ComputePipeline,
    group: wgpu::BindGroup,
}

/// Joins WGSL pieces into one source: shared pieces first, then the stage. What every stage needs to be dispatched comes
/// with it.
pub fn compose(pieces: &[&str]) -> String {
    let dispatch = include_str!("../../../shaders/shared/dispatch.wgsl");
    format!("{dispatch}\n{}", pieces.join("\n"))
}

/// A compiled WGSL source from which stages are made.
#[derive(Debug)]
pub struct Module {
    module: wgpu::ShaderModule,
}

impl Module {
    /// Compiles a source. One that does not compile is an error of the [`Gpu::scoped`] around this call, else one of
    /// [`Gpu::check`]; so are stages that the device refuses.
    pub fn new(gpu: &Gpu, label: &str, source: &str) -> Module {
        Module {
            module: gpu.device.create_shader_module(wgpu::ShaderModuleDescriptor {
                label: Some(label),
                source: wgpu::ShaderSource::Wgsl(source.into()),
            }),
        }
    }

    /// The stage with that entry point. `constants` are the source's `override` values.
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
        Stage { label: entry, pipeline }
    }
}

impl Stage {
    /// Binds buffers to `@group(0)`; the numbers are the `@binding`s that the entry point uses, no others.
    pub fn bind(&self, gpu: &Gpu, buffers: &[(u32, &wgpu::Buffer)]) -> Bound {
        let entries: Vec<_> = buffers
            .iter()
            .map(|(binding, buffer)| wgpu::BindGroupEntry { binding: *binding, resource: buffer.as_entire_binding() })
            .collect();
        let group = gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some(self.label),
            layout: &self.pipeline.get_bind_group_layout(0),
            entries: &entries,
        });
        Bound { label: self.label, pipeline: self.pipeline.clone(), group }
    }
}

/// Most workgroups in one dimension that every WebGPU device takes.
const MAX_GROUPS: u32 = 65_535;

impl Bound {
    /// Name of the entry point.
    pub fn label(&self) -> &'static str {
        self.label
    }

    /// Dispatches at least `groups` workgroups, folded into two dimensions where they are many: shaders count them as
    /// `workgroup_id.x + workgroup_id.y * num_workgroups.x` and ignore those beyond their work.
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
