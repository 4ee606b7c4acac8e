//! Bind groups by the names of the bindings in the WGSL.

use crate::shader_sources::{Entry, Shader};

/// The entry points of a shader that share a bind group.
#[derive(Debug, Clone)]
pub struct Bindings {
    entries: Vec<&'static Entry>,
}

impl Bindings {
    /// The bindings that any of these entry points of a shader uses.
    ///
    /// # Panics
    /// Panics if the shader or an entry point does not exist, which is a bug in the program.
    pub fn new(shader: &str, entry_points: &[&str]) -> Bindings {
        let shader = Shader::named(shader);
        Bindings { entries: entry_points.iter().map(|name| shader.entry(name)).collect() }
    }

    /// The bind group of the used `resources`. Others are ignored, so that all stages of a shader can be given the same
    /// list.
    ///
    /// # Panics
    /// Panics if a used resource is missing, which is a bug in the program.
    pub fn group(
        &self,
        device: &wgpu::Device,
        label: &str,
        layout: &wgpu::BindGroupLayout,
        resources: &[(&str, wgpu::BindingResource<'_>)],
    ) -> wgpu::BindGroup {
        let mut used: Vec<(&str, u32)> = self.entries.iter().flat_map(|entry| entry.bindings).copied().collect();
        used.sort_by_key(|(_, number)| *number);
        used.dedup();
        let resource = |name: &str| {
            let found = resources.iter().find(|(given, _)| *given == name);
            found.unwrap_or_else(|| panic!("{label}: nothing is bound to `{name}`")).1.clone()
        };
        let entry = |&(name, binding): &(&str, u32)| wgpu::BindGroupEntry { binding, resource: resource(name) };
        let entries: Vec<_> = used.iter().map(entry).collect();
        device.create_bind_group(&wgpu::BindGroupDescriptor { label: Some(label), layout, entries: &entries })
    }
}
