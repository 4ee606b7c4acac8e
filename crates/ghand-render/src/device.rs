//! The GPU: opening a device, its failures, and recovery after its loss.

mod adapter;
mod failure;
mod recovery;

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

pub use adapter::AdapterChoice;
pub use failure::{DeviceError, RenderError};

use failure::Failure;

use crate::Tier;

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
    /// Name, type and driver of the adapter.
    pub info: wgpu::AdapterInfo,
    /// The set of device features that is used.
    pub tier: Tier,
    /// Its number among the devices that this process has opened. The handles above are equal for the first devices of
    /// two instances.
    pub number: u64,
    failure: Arc<Failure>,
}

/// Devices that this process has opened.
static OPENED: AtomicU64 = AtomicU64::new(0);

impl Gpu {
    /// Opens a device without a window, of the tier in [`Tier::VARIABLE`], else of the best tier for the adapter.
    ///
    /// # Errors
    /// [`DeviceError`] if no adapter fits or the adapter does not give a device.
    pub fn new(choice: &AdapterChoice) -> Result<Gpu, DeviceError> {
        Gpu::with_instance(instance(), choice)
    }

    /// Opens a device of a tier without a window.
    ///
    /// # Errors
    /// As [`Gpu::new`], and if the adapter lacks what the tier needs.
    pub fn with_tier(choice: &AdapterChoice, tier: Tier) -> Result<Gpu, DeviceError> {
        let instance = instance();
        let adapter = adapter::choose(&instance, choice)?;
        Gpu::open(instance, adapter, Some(tier))
    }

    /// Opens a device of the caller's instance (one with a display handle, for a window).
    ///
    /// # Errors
    /// As [`Gpu::new`].
    pub fn with_instance(instance: wgpu::Instance, choice: &AdapterChoice) -> Result<Gpu, DeviceError> {
        let adapter = adapter::choose(&instance, choice)?;
        Gpu::open(instance, adapter, Tier::from_env()?)
    }

    /// Opens a device of an adapter, of the given or the best tier.
    fn open(instance: wgpu::Instance, adapter: wgpu::Adapter, tier: Option<Tier>) -> Result<Gpu, DeviceError> {
        let info = adapter.get_info();
        let tier = match tier {
            Some(tier) if tier.is_offered_by(&adapter) => tier,
            Some(tier) => return Err(DeviceError::NoTier { adapter: info.name, tier: tier.name() }),
            None => Tier::best_for(&adapter),
        };
        let descriptor = tier.descriptor(&adapter);
        let (device, queue) = pollster::block_on(adapter.request_device(&descriptor))
            .map_err(|e| DeviceError::NoDevice { adapter: info.name.clone(), reason: e.to_string() })?;
        let failure = Arc::new(Failure::default());
        let reports = failure.clone();
        device.on_uncaptured_error(Arc::new(move |error| reports.record_error(&error)));
        let reports = failure.clone();
        device.set_device_lost_callback(move |reason, message| reports.record_loss(reason, &message));
        let number = OPENED.fetch_add(1, Ordering::Relaxed);
        Ok(Gpu { instance, adapter, device, queue, info, tier, number, failure })
    }

    /// Whether the adapter is a software rasteriser.
    pub fn is_cpu(&self) -> bool {
        self.info.device_type == wgpu::DeviceType::Cpu
    }
}

/// An instance without a window.
fn instance() -> wgpu::Instance {
    wgpu::Instance::new(wgpu::InstanceDescriptor {
        backends: wgpu::Backends::PRIMARY,
        ..wgpu::InstanceDescriptor::new_without_display_handle()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_missing_adapter_is_one_clear_sentence() {
        let error = Gpu::new(&AdapterChoice::Named("no such adapter".into())).unwrap_err().to_string();
        let there = Gpu::new(&AdapterChoice::from_env()).unwrap_or_else(|e| panic!("{e}")).info.name;
        assert!(error.contains("no such adapter") && error.contains(&there), "{error}");
    }
}
