//! Tiers: the named combinations of kernels. What a device can do, and whether it is a processor, choose one.

#[cfg(not(target_arch = "wasm32"))]
use crate::DeviceError;

/// A combination of kernels.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Tier {
    /// For software rasterisers with the features of every WebGPU device: sorts by strands, one invocation each.
    Cpu,
    /// As [`Tier::Cpu`], but eight invocations of a subgroup share what they load to rasterise.
    CpuSubgroups,
    /// For graphics processors with the features of every WebGPU device: sorts by blocks, one workgroup each.
    Gpu,
    /// As [`Tier::Gpu`], but subgroups share what they load to rasterise, and add up the counts of the sort.
    GpuSubgroups,
}

impl Tier {
    /// All tiers.
    pub const ALL: [Tier; 4] = [Tier::Cpu, Tier::CpuSubgroups, Tier::Gpu, Tier::GpuSubgroups];

    /// Environment variable that selects the tier by its name.
    pub const VARIABLE: &'static str = "GHAND_TIER";

    /// Workgroup memory with subgroups, bytes: a block of pairs in `sort_by_blocks.wgsl`.
    const WORKGROUP_BYTES: u32 = 32_768;

    /// Minimum subgroup size: in the rasteriser, eight invocations share what they load.
    pub(crate) const SUBGROUP_SIZE: u32 = 8;

    /// The tier's name: `cpu`, `cpu-subgroups`, `gpu` or `gpu-subgroups`.
    pub fn name(self) -> &'static str {
        match self {
            Tier::Cpu => "cpu",
            Tier::CpuSubgroups => "cpu-subgroups",
            Tier::Gpu => "gpu",
            Tier::GpuSubgroups => "gpu-subgroups",
        }
    }

    /// Reads a tier's name, ignoring case.
    pub fn parse(text: &str) -> Option<Tier> {
        let name = text.trim().to_lowercase();
        Tier::ALL.into_iter().find(|tier| tier.name() == name)
    }

    /// The tier in [`Tier::VARIABLE`], if it is set.
    ///
    /// # Errors
    /// [`DeviceError::UnknownTier`] if it has another value.
    #[cfg(not(target_arch = "wasm32"))]
    pub(crate) fn from_env() -> Result<Option<Tier>, DeviceError> {
        match std::env::var_os(Tier::VARIABLE).map(|text| text.to_string_lossy().into_owned()) {
            Some(text) if !text.is_empty() => Tier::parse(&text).map(Some).ok_or(DeviceError::UnknownTier { text }),
            _ => Ok(None),
        }
    }

    /// The tier for a device of this kind, with or without subgroups.
    pub(crate) fn of(is_cpu: bool, subgroups: bool) -> Tier {
        match (is_cpu, subgroups) {
            (true, false) => Tier::Cpu,
            (true, true) => Tier::CpuSubgroups,
            (false, false) => Tier::Gpu,
            (false, true) => Tier::GpuSubgroups,
        }
    }

    /// Whether it uses subgroups.
    pub fn has_subgroups(self) -> bool {
        matches!(self, Tier::CpuSubgroups | Tier::GpuSubgroups)
    }

    /// Whether it sorts by strands.
    pub(crate) fn has_strands(self) -> bool {
        matches!(self, Tier::Cpu | Tier::CpuSubgroups)
    }

    /// Selects the value for this tier.
    pub(crate) fn choose<T>(self, portable: T, subgroups: T) -> T {
        if self.has_subgroups() { subgroups } else { portable }
    }

    /// Whether features and limits suffice for subgroups. Their size is another matter.
    pub(crate) fn subgroups_fit(features: wgpu::Features, limits: &wgpu::Limits) -> bool {
        features.contains(wgpu::Features::SUBGROUP)
            && limits.max_compute_workgroup_storage_size >= Self::WORKGROUP_BYTES
    }

    /// The device to request from an adapter, with or without subgroups: timestamps if offered, and the adapter's largest
    /// buffers and images; no stage depends on these.
    pub(crate) fn descriptor(adapter: &wgpu::Adapter, subgroups: bool) -> wgpu::DeviceDescriptor<'static> {
        let offered = adapter.limits();
        let default = wgpu::Limits::default();
        let (features, workgroup_bytes) = match subgroups {
            false => (wgpu::Features::empty(), default.max_compute_workgroup_storage_size),
            true => (wgpu::Features::SUBGROUP, Self::WORKGROUP_BYTES),
        };
        let limits = wgpu::Limits {
            max_storage_buffer_binding_size: offered.max_storage_buffer_binding_size,
            max_buffer_size: offered.max_buffer_size,
            max_texture_dimension_2d: offered.max_texture_dimension_2d,
            max_compute_workgroup_storage_size: workgroup_bytes,
            ..default
        };
        let mut descriptor = wgpu::DeviceDescriptor {
            label: Some("ghand"),
            required_features: features | (adapter.features() & wgpu::Features::TIMESTAMP_QUERY),
            required_limits: limits,
            ..Default::default()
        };
        if cfg!(feature = "gpu-networks") {
            share(&mut descriptor, adapter);
        }
        descriptor
    }
}

/// Requests what Burn's kernels use wherever an adapter offers it: they ask the adapter, not the device.
fn share(descriptor: &mut wgpu::DeviceDescriptor<'_>, adapter: &wgpu::Adapter) {
    use wgpu::Features;
    let kernels = Features::SUBGROUP
        | Features::SHADER_F16
        | Features::SHADER_F64
        | Features::SHADER_INT64
        | Features::SHADER_FLOAT32_ATOMIC;
    descriptor.required_features |= adapter.features() & kernels;
    let offered = adapter.limits();
    descriptor.required_limits = wgpu::Limits {
        max_compute_invocations_per_workgroup: offered.max_compute_invocations_per_workgroup,
        max_compute_workgroup_size_x: offered.max_compute_workgroup_size_x,
        max_compute_workgroup_size_y: offered.max_compute_workgroup_size_y,
        max_compute_workgroup_size_z: offered.max_compute_workgroup_size_z,
        max_compute_workgroup_storage_size: offered.max_compute_workgroup_storage_size,
        max_compute_workgroups_per_dimension: offered.max_compute_workgroups_per_dimension,
        max_storage_buffers_per_shader_stage: offered.max_storage_buffers_per_shader_stage,
        ..descriptor.required_limits.clone()
    };
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tiers_are_read_from_their_names() {
        Tier::ALL.iter().for_each(|tier| assert_eq!(Tier::parse(tier.name()), Some(*tier)));
        assert_eq!(Tier::parse(" GPU-Subgroups "), Some(Tier::GpuSubgroups));
        assert_eq!(Tier::parse("fast"), None);
    }
}
