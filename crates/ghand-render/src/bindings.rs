//! Bind groups from the structs in [`crate::stages`], which have a field for each binding of the WGSL.

use std::marker::PhantomData;

use crate::shader_sources::Shader;

/// What the bindings of an entry point or a shader are bound to.
pub trait Bindings {
    /// All of them, in `@group(0)`.
    fn entries(&self) -> Vec<wgpu::BindGroupEntry<'_>>;
}

/// A compute entry point.
pub trait ComputeEntry {
    /// Its name in the WGSL.
    const NAME: &'static str;
    /// What it binds. Variants for other tiers may use fewer of them.
    type Bindings<'a>: Bindings;
}

/// The vertex and fragment entry points of a shader.
pub trait RenderShader {
    /// The shader's name, see [`Shader::name`].
    const NAME: &'static str;
    /// What they bind, all together.
    type Bindings<'a>: Bindings;
}

/// The bind group of those bindings whose numbers a pipeline uses.
pub(crate) fn bind_group(
    device: &wgpu::Device,
    label: &str,
    layout: &wgpu::BindGroupLayout,
    used: &[u32],
    bindings: &impl Bindings,
) -> wgpu::BindGroup {
    let mut entries = bindings.entries();
    entries.retain(|entry| used.contains(&entry.binding));
    device.create_bind_group(&wgpu::BindGroupDescriptor { label: Some(label), layout, entries: &entries })
}

/// Makes the bind groups of render pipelines with the same entry points.
#[derive(Debug, Clone)]
pub struct RenderBindings<S> {
    used: Vec<u32>,
    shader: PhantomData<S>,
}

impl<S: RenderShader> RenderBindings<S> {
    /// Of pipelines with these entry points.
    ///
    /// # Panics
    /// Panics if the shader has no such entry point, which is a bug in the program.
    pub fn new(entry_points: &[&str]) -> RenderBindings<S> {
        let shader = Shader::named(S::NAME);
        let used = entry_points.iter().flat_map(|name| shader.entry(name).bindings).copied().collect();
        RenderBindings { used, shader: PhantomData }
    }

    /// The bind group of those bindings that the entry points use.
    pub fn group(
        &self,
        device: &wgpu::Device,
        pipeline: &wgpu::RenderPipeline,
        bindings: &S::Bindings<'_>,
    ) -> wgpu::BindGroup {
        bind_group(device, S::NAME, &pipeline.get_bind_group_layout(0), &self.used, bindings)
    }
}
