//! The choice of the graphics adapter.

use crate::device::DeviceError;

/// Which adapter to use.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub enum AdapterChoice {
    /// The best available: discrete before integrated before virtual before software.
    #[default]
    Best,
    /// A software rasteriser.
    Cpu,
    /// Real hardware only.
    Gpu,
    /// The first adapter whose name contains this text, ignoring case.
    Named(String),
}

impl AdapterChoice {
    /// Environment variable that selects the adapter if the caller does not.
    pub const VARIABLE: &'static str = "GHAND_ADAPTER";

    /// Reads `cpu`, `gpu`, an empty text (best) or part of an adapter's name.
    pub fn parse(text: &str) -> AdapterChoice {
        match text.trim().to_lowercase().as_str() {
            "" | "best" => AdapterChoice::Best,
            "cpu" => AdapterChoice::Cpu,
            "gpu" => AdapterChoice::Gpu,
            name => AdapterChoice::Named(name.to_owned()),
        }
    }

    /// The choice in [`AdapterChoice::VARIABLE`], else the best adapter.
    pub fn from_env() -> AdapterChoice {
        std::env::var_os(Self::VARIABLE).map(|v| Self::parse(&v.to_string_lossy())).unwrap_or_default()
    }

    fn fits(&self, info: &wgpu::AdapterInfo) -> bool {
        match self {
            AdapterChoice::Best => true,
            AdapterChoice::Cpu => info.device_type == wgpu::DeviceType::Cpu,
            AdapterChoice::Gpu => info.device_type != wgpu::DeviceType::Cpu,
            AdapterChoice::Named(name) => info.name.to_lowercase().contains(&name.to_lowercase()),
        }
    }

    fn wanted(&self) -> String {
        match self {
            AdapterChoice::Best => "was found".to_owned(),
            AdapterChoice::Cpu => "of kind `cpu` was found".to_owned(),
            AdapterChoice::Gpu => "of kind `gpu` was found".to_owned(),
            AdapterChoice::Named(name) => format!("with `{name}` in its name was found"),
        }
    }
}

fn rank(kind: wgpu::DeviceType) -> u32 {
    match kind {
        wgpu::DeviceType::DiscreteGpu => 0,
        wgpu::DeviceType::IntegratedGpu => 1,
        wgpu::DeviceType::VirtualGpu => 2,
        wgpu::DeviceType::Other => 3,
        wgpu::DeviceType::Cpu => 4,
    }
}

/// The adapters of an instance, the best first.
async fn adapters(instance: &wgpu::Instance) -> Vec<wgpu::Adapter> {
    let mut adapters = instance.enumerate_adapters(wgpu::Backends::PRIMARY).await;
    adapters.sort_by_key(|a| rank(a.get_info().device_type));
    adapters
}

/// The best adapter that fits a choice.
pub(super) async fn choose(instance: &wgpu::Instance, choice: &AdapterChoice) -> Result<wgpu::Adapter, DeviceError> {
    let adapters = adapters(instance).await;
    // An adapter can be listed once per driver.
    let mut found: Vec<String> = adapters.iter().map(|a| a.get_info().name).collect();
    found.dedup();
    let chosen = adapters.into_iter().find(|a| choice.fits(&a.get_info()));
    chosen.ok_or_else(|| DeviceError::NoAdapter { wanted: choice.wanted(), found })
}

/// The adapter that was opened before, if it is available.
#[cfg(not(target_arch = "wasm32"))]
pub(super) async fn find_again(instance: &wgpu::Instance, before: &wgpu::AdapterInfo) -> Option<wgpu::Adapter> {
    // The driver's version is not compared: a driver update is one way to lose a device.
    let identity = |i: &wgpu::AdapterInfo| {
        (i.name.clone(), i.vendor, i.device, i.device_type, i.backend, i.device_pci_bus_id.clone())
    };
    adapters(instance).await.into_iter().find(|a| identity(&a.get_info()) == identity(before))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn choices_are_read_from_text() {
        assert_eq!(AdapterChoice::parse(" CPU "), AdapterChoice::Cpu);
        assert_eq!(AdapterChoice::parse("gpu"), AdapterChoice::Gpu);
        assert_eq!(AdapterChoice::parse(""), AdapterChoice::Best);
        assert_eq!(AdapterChoice::parse("GeForce"), AdapterChoice::Named("geforce".into()));
    }
}
