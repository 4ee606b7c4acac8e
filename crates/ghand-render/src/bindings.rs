//! What the host reads from WGSL instead of repeating it: binding numbers by name, and workgroup sizes.

use std::collections::BTreeMap;

use naga::valid::{Capabilities, ValidationFlags, Validator};

use crate::shader_sources;

/// The binding numbers in `@group(0)` that some entry points use, by name in the WGSL, and the size of their workgroups.
#[derive(Debug, Clone, Default)]
pub struct Bindings {
    numbers: BTreeMap<String, u32>,
    workgroup_size: [u32; 3],
}

impl Bindings {
    /// The bindings that any of these entry points of a shader uses.
    ///
    /// # Panics
    /// Panics if no shader has this name.
    pub fn new(shader: &str, entry_points: &[&str]) -> Bindings {
        Bindings::in_source(shader_sources::source(shader), entry_points)
    }

    /// The bindings that any of these entry points of a WGSL source uses. Empty if the source is invalid, which the
    /// device reports.
    pub fn in_source(source: &str, entry_points: &[&str]) -> Bindings {
        let Ok(module) = naga::front::wgsl::parse_str(source) else { return Bindings::default() };
        let Ok(info) = Validator::new(ValidationFlags::empty(), Capabilities::all()).validate(&module) else {
            return Bindings::default();
        };
        let mut bindings = Bindings::default();
        for (index, _) in module.entry_points.iter().enumerate().filter(|(_, e)| entry_points.contains(&&*e.name)) {
            bindings.workgroup_size = module.entry_points[index].workgroup_size;
            let uses = info.get_entry_point(index);
            let used = module.global_variables.iter().filter(|(handle, _)| !uses[*handle].is_empty());
            bindings.numbers.extend(used.filter_map(|(_, v)| Some((v.name.clone()?, v.binding?.binding))));
        }
        bindings
    }

    /// The workgroup size of the last of the entry points; 0 for one that is not a compute stage.
    pub fn workgroup_size(&self) -> [u32; 3] {
        self.workgroup_size
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
        let resource = |name: &str| {
            let found = resources.iter().find(|(given, _)| *given == name);
            found.unwrap_or_else(|| panic!("{label}: nothing is bound to `{name}`")).1.clone()
        };
        let entry =
            |(name, number): (&String, &u32)| wgpu::BindGroupEntry { binding: *number, resource: resource(name) };
        let entries: Vec<_> = self.numbers.iter().map(entry).collect();
        device.create_bind_group(&wgpu::BindGroupDescriptor { label: Some(label), layout, entries: &entries })
    }
}
