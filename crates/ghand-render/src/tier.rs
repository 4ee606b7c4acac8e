//! Two tiers of device features; every stage runs on both.

use crate::DeviceError;

/// A set of device features that the stages use.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Tier {
    /// The features of every WebGPU device.
    Baseline,
    /// Subgroups of eight invocations or more, and 32 KiB of workgroup memory.
    Fast,
}

impl Tier {
    /// Environment variable that selects the tier: `baseline` or `fast`.
    pub const VARIABLE: &'static str = "GHAND_TIER";

    /// Workgroup memory of the fast tier, bytes: a block of pairs in `fast/sort.wgsl`.
    const WORKGROUP_BYTES: u32 = 32_768;

    /// Minimum subgroup size on the fast tier: in the rasteriser, eight invocations share what they load.
    const SUBGROUP_SIZE: u32 = 8;

    /// Reads `baseline` or `fast`, ignoring case.
    pub fn parse(text: &str) -> Option<Tier> {
        match text.trim().to_lowercase().as_str() {
            "baseline" => Some(Tier::Baseline),
            "fast" => Some(Tier::Fast),
            _ => None,
        }
    }

    /// The tier in [`Tier::VARIABLE`], if it is set.
    ///
    /// # Errors
    /// [`DeviceError::UnknownTier`] if it has another value.
    pub(crate) fn from_env() -> Result<Option<Tier>, DeviceError> {
        match std::env::var_os(Tier::VARIABLE).map(|text| text.to_string_lossy().into_owned()) {
            Some(text) if !text.is_empty() => Tier::parse(&text).map(Some).ok_or(DeviceError::UnknownTier { text }),
            _ => Ok(None),
        }
    }

    /// Selects the value for this tier.
    pub(crate) fn choose<T>(self, baseline: T, fast: T) -> T {
        match self {
            Tier::Baseline => baseline,
            Tier::Fast => fast,
        }
    }

    /// The tier's name, as in [`Tier::parse`].
    pub fn name(self) -> &'static str {
        match self {
            Tier::Baseline => "baseline",
            Tier::Fast => "fast",
        }
    }

    /// Whether the adapter has what the tier needs.
    pub fn is_offered_by(self, adapter: &wgpu::Adapter) -> bool {
        match self {
            Tier::Baseline => true,
            Tier::Fast => {
                adapter.features().contains(wgpu::Features::SUBGROUP)
                    && adapter.get_info().subgroup_min_size >= Self::SUBGROUP_SIZE
                    && adapter.limits().max_compute_workgroup_storage_size >= Self::WORKGROUP_BYTES
            }
        }
    }

    /// The best tier that an adapter supports.
    pub fn best_for(adapter: &wgpu::Adapter) -> Tier {
        if Tier::Fast.is_offered_by(adapter) { Tier::Fast } else { Tier::Baseline }
    }

    /// The device to request from an adapter. Both tiers request timestamps if offered, and the adapter's largest
    /// buffers and images; no stage depends on these.
    pub(crate) fn descriptor(self, adapter: &wgpu::Adapter) -> wgpu::DeviceDescriptor<'static> {
        let offered = adapter.limits();
        let default = wgpu::Limits::default();
        let (features, workgroup_bytes) = match self {
            Tier::Baseline => (wgpu::Features::empty(), default.max_compute_workgroup_storage_size),
            Tier::Fast => (wgpu::Features::SUBGROUP, Self::WORKGROUP_BYTES),
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
    fn tiers_are_read_from_text() {
        assert_eq!(Tier::parse(" FAST "), Some(Tier::Fast));
        assert_eq!(Tier::parse(Tier::Baseline.name()), Some(Tier::Baseline));
        assert_eq!(Tier::parse("quick"), None);
    }
}
