//! The GPU: choosing an adapter, opening a device, and saying clearly when that fails.

use std::sync::{Arc, Mutex};

use crate::tier::Tier;

/// Which adapter to use.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub enum AdapterChoice {
    /// The best that there is: discrete before integrated before virtual before software.
    #[default]
    Best,
    /// A software rasteriser.
    Cpu,
    /// Real hardware only.
    Gpu,
    /// The first adapter whose name contains this text, whatever the case.
    Named(String),
}

impl AdapterChoice {
    /// Environment variable that chooses the adapter where the caller does not.
    pub const VARIABLE: &'static str = "GHAND_ADAPTER";

    /// `cpu`, `gpu`, empty (best) or a part of an adapter's name.
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
        std::env::var(Self::VARIABLE).map(|v| Self::parse(&v)).unwrap_or_default()
    }
}

/// Why there is no device.
#[derive(Debug, thiserror::Error)]
pub enum DeviceError {
    /// No adapter fits the choice.
    #[error(
        "no graphics adapter {wanted}; install a Vulkan driver (Debian or Ubuntu without a GPU: `apt-get install \
         mesa-vulkan-drivers`, or `scripts/setup.sh`). Adapters found: {found}"
    )]
    NoAdapter {
        /// What was asked for.
        wanted: String,
        /// What there is.
        found: String,
    },
    /// The adapter lacks what a tier needs.
    #[error("the graphics adapter {adapter} lacks what the tier `{tier}` needs; use {}=baseline", Tier::VARIABLE)]
    NoTier {
        /// The adapter.
        adapter: String,
        /// The tier.
        tier: &'static str,
    },
    /// [`Tier::VARIABLE`] names no tier.
    #[error("{}={text} is no tier; it may be `baseline` or `fast`", Tier::VARIABLE)]
    UnknownTier {
        /// What it holds.
        text: String,
    },
    /// The adapter refused a device.
    #[error(
        "the graphics adapter {adapter} gave no device: {reason}; update its driver or choose another adapter with {}",
        AdapterChoice::VARIABLE
    )]
    NoDevice {
        /// The adapter.
        adapter: String,
        /// What the driver said.
        reason: String,
    },
}

/// Why rendering failed.
#[derive(Debug, thiserror::Error)]
pub enum RenderError {
    /// The device is gone or reported an error.
    #[error("the graphics device failed: {0}")]
    Device(String),
    /// The request cannot be met.
    #[error("{0}")]
    Invalid(String),
}

/// An open device with its queue.
#[derive(Debug, Clone)]
pub struct Gpu {
    /// The instance, for making surfaces.
    pub instance: wgpu::Instance,
    /// The adapter, for surface capabilities.
    pub adapter: wgpu::Adapter,
    /// The device.
    pub device: wgpu::Device,
    /// Its queue.
    pub queue: wgpu::Queue,
    /// What the adapter is.
    pub info: wgpu::AdapterInfo,
    /// How much of it is used.
    pub tier: Tier,
    failure: Arc<Mutex<Option<String>>>,
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

impl Gpu {
    /// Opens a device without a window, of the tier in [`Tier::VARIABLE`], else of the one that suits the adapter best.
    ///
    /// # Errors
    /// [`DeviceError`] when no adapter fits or the adapter gives no device.
    pub fn new(choice: &AdapterChoice) -> Result<Gpu, DeviceError> {
        Gpu::open(Self::instance(), choice, Self::tier_from_env()?)
    }

    /// Opens a device of a tier without a window.
    ///
    /// # Errors
    /// As [`Gpu::new`], and when the adapter lacks what the tier needs.
    pub fn with_tier(choice: &AdapterChoice, tier: Tier) -> Result<Gpu, DeviceError> {
        Gpu::open(Self::instance(), choice, Some(tier))
    }

    fn instance() -> wgpu::Instance {
        let descriptor = wgpu::InstanceDescriptor {
            backends: wgpu::Backends::PRIMARY,
            ..wgpu::InstanceDescriptor::new_without_display_handle()
        };
        wgpu::Instance::new(descriptor)
    }

    fn tier_from_env() -> Result<Option<Tier>, DeviceError> {
        match std::env::var(Tier::VARIABLE) {
            Ok(text) if !text.is_empty() => Tier::parse(&text).map(Some).ok_or(DeviceError::UnknownTier { text }),
            _ => Ok(None),
        }
    }

    /// Opens a device of an instance that the caller made (one with a display handle, for a window).
    ///
    /// # Errors
    /// As [`Gpu::new`].
    pub fn with_instance(instance: wgpu::Instance, choice: &AdapterChoice) -> Result<Gpu, DeviceError> {
        Gpu::open(instance, choice, Self::tier_from_env()?)
    }

    fn open(instance: wgpu::Instance, choice: &AdapterChoice, tier: Option<Tier>) -> Result<Gpu, DeviceError> {
        let mut adapters = pollster::block_on(instance.enumerate_adapters(wgpu::Backends::PRIMARY));
        adapters.sort_by_key(|a| rank(a.get_info().device_type));
        let found: Vec<String> = adapters.iter().map(|a| a.get_info().name).collect();
        let fits = |a: &wgpu::Adapter| {
            let info = a.get_info();
            match choice {
                AdapterChoice::Best => true,
                AdapterChoice::Cpu => info.device_type == wgpu::DeviceType::Cpu,
                AdapterChoice::Gpu => info.device_type != wgpu::DeviceType::Cpu,
                AdapterChoice::Named(name) => info.name.to_lowercase().contains(&name.to_lowercase()),
            }
        };
        let Some(adapter) = adapters.into_iter().find(fits) else {
            let wanted = match choice {
                AdapterChoice::Best => "was found".to_owned(),
                AdapterChoice::Cpu => "of kind `cpu` was found".to_owned(),
                AdapterChoice::Gpu => "of kind `gpu` was found".to_owned(),
                AdapterChoice::Named(name) => format!("with `{name}` in its name was found"),
            };
            let found = if found.is_empty() { "none".to_owned() } else { found.join(", ") };
            return Err(DeviceError::NoAdapter { wanted, found });
        };
        let info = adapter.get_info();
        let tier = match tier {
            Some(tier) if tier.is_offered_by(&adapter) => tier,
            Some(tier) => return Err(DeviceError::NoTier { adapter: info.name, tier: tier.name() }),
            None => Tier::best_for(&adapter),
        };
        let descriptor = tier.descriptor(&adapter);
        let (device, queue) = pollster::block_on(adapter.request_device(&descriptor))
            .map_err(|e| DeviceError::NoDevice { adapter: info.name.clone(), reason: e.to_string() })?;
        let failure = Arc::new(Mutex::new(None));
        let record = |slot: &Arc<Mutex<Option<String>>>, message: String| {
            log::error!("{message}");
            if let Ok(mut slot) = slot.lock() {
                slot.get_or_insert(message);
            }
        };
        let slot = failure.clone();
        device.on_uncaptured_error(Arc::new(move |e: wgpu::Error| record(&slot, e.to_string())));
        let slot = failure.clone();
        device.set_device_lost_callback(move |reason, message| {
            if reason != wgpu::DeviceLostReason::Destroyed {
                record(&slot, format!("the device was lost: {message}"));
            }
        });
        Ok(Gpu { instance, adapter, device, queue, info, tier, failure })
    }

    /// Whether the adapter is a software rasteriser.
    pub fn is_cpu(&self) -> bool {
        self.info.device_type == wgpu::DeviceType::Cpu
    }

    /// Fails if the device has reported an error or was lost.
    ///
    /// # Errors
    /// [`RenderError::Device`] with the first message.
    pub fn check(&self) -> Result<(), RenderError> {
        match self.failure.lock() {
            Ok(slot) => slot.clone().map_or(Ok(()), |m| Err(RenderError::Device(m))),
            Err(_) => Err(RenderError::Device("its error handler panicked".into())),
        }
    }

    /// Waits until everything submitted has run.
    ///
    /// # Errors
    /// [`RenderError::Device`] if the device failed.
    pub fn wait(&self) -> Result<(), RenderError> {
        self.device.poll(wgpu::PollType::wait_indefinitely()).map_err(|e| RenderError::Device(e.to_string()))?;
        self.check()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_adapter_that_is_not_there_is_one_clear_sentence() {
        let error = Gpu::new(&AdapterChoice::Named("no such adapter".into())).unwrap_err().to_string();
        assert!(error.contains("no such adapter") && error.contains("mesa-vulkan-drivers"), "{error}");
    }

    #[test]
    fn choices_are_read_from_text() {
        assert_eq!(AdapterChoice::parse(" CPU "), AdapterChoice::Cpu);
        assert_eq!(AdapterChoice::parse("gpu"), AdapterChoice::Gpu);
        assert_eq!(AdapterChoice::parse(""), AdapterChoice::Best);
        assert_eq!(AdapterChoice::parse("GeForce"), AdapterChoice::Named("geforce".into()));
    }
}
