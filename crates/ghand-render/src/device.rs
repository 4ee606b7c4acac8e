//! The GPU: opening a device, its failures, and recovery after its loss.

mod adapter;
mod failure;
#[cfg(not(target_arch = "wasm32"))]
mod recovery;

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

pub use adapter::AdapterChoice;
pub use failure::{DeviceError, RenderError};

use failure::Failure;

use crate::pipeline::{Module, compute_pass};
use crate::stages::{SubgroupSize, SubgroupSizeBindings};
use crate::{Tier, buffers};

/// An open device with its queue.
#[derive(Debug, Clone)]
pub struct Gpu {
    /// The instance, for making surfaces; `None` if the device is the caller's.
    pub instance: Option<wgpu::Instance>,
    /// The adapter, for surface capabilities.
    pub adapter: wgpu::Adapter,
    /// The device.
    pub device: wgpu::Device,
    /// Its queue.
    pub queue: wgpu::Queue,
    /// Name, type and driver of the adapter.
    pub info: wgpu::AdapterInfo,
    /// The combination of kernels that runs.
    pub tier: Tier,
    /// Its number among the devices of this process. The handles above are equal for the first devices of two instances.
    pub number: u64,
    failure: Arc<Failure>,
}

/// Devices that this process has used.
static OPENED: AtomicU64 = AtomicU64::new(0);

impl Gpu {
    /// Opens a device without a window, of the tier in [`Tier::VARIABLE`], else of the best tier for the adapter.
    ///
    /// # Errors
    /// [`DeviceError`] if no adapter fits or the adapter does not give a device.
    #[cfg(not(target_arch = "wasm32"))]
    pub fn new(choice: &AdapterChoice) -> Result<Gpu, DeviceError> {
        pollster::block_on(Gpu::request(instance(), choice, Tier::from_env()?))
    }

    /// Opens a device of a tier without a window.
    ///
    /// # Errors
    /// As [`Gpu::new`], and if the adapter lacks what the tier needs.
    #[cfg(not(target_arch = "wasm32"))]
    pub fn with_tier(choice: &AdapterChoice, tier: Tier) -> Result<Gpu, DeviceError> {
        pollster::block_on(Gpu::request(instance(), choice, Some(tier)))
    }

    /// Opens a device of an instance, of the given or the best tier, without blocking the thread: the way in browsers.
    ///
    /// # Errors
    /// As [`Gpu::with_tier`].
    pub async fn request(
        instance: wgpu::Instance,
        choice: &AdapterChoice,
        tier: Option<Tier>,
    ) -> Result<Gpu, DeviceError> {
        let adapter = adapter::choose(&instance, choice).await?;
        Gpu::open(instance, adapter, tier).await
    }

    /// Uses the device of another program: a game, a window's. It must have been requested with
    /// [`wgpu::Limits::default`] or more; with [`wgpu::Features::SUBGROUP`] and 32 KiB of workgroup memory it is faster.
    /// Callbacks of the device are left alone, so that its errors and its loss are its owner's to notice; only the errors
    /// of the calls that make something here are caught.
    ///
    /// # Errors
    /// [`DeviceError::SmallLimits`] if the device allows less than every WebGPU device.
    pub fn from_parts(adapter: wgpu::Adapter, device: wgpu::Device, queue: wgpu::Queue) -> Result<Gpu, DeviceError> {
        let info = adapter.get_info();
        let mut missing = None;
        wgpu::Limits::default().check_limits_with_fail_fn(&device.limits(), true, |limit, needed, allowed| {
            missing = Some(DeviceError::SmallLimits { limit, needed, allowed });
        });
        if let Some(error) = missing {
            return Err(error);
        }
        let mut gpu = Gpu {
            instance: None,
            tier: Tier::of(is_cpu(&info), false),
            adapter,
            device,
            queue,
            info,
            number: OPENED.fetch_add(1, Ordering::Relaxed),
            failure: Arc::default(),
        };
        if Tier::subgroups_fit(gpu.device.features(), &gpu.device.limits()) {
            let large = match large_subgroups(&gpu.info) {
                Some(large) => large,
                // A browser does not let this thread wait for a measurement.
                None if cfg!(target_arch = "wasm32") => false,
                None => gpu.has_measured_large(buffers::read(&gpu, &gpu.subgroup_size(), 1))?,
            };
            gpu.tier = Tier::of(gpu.is_cpu(), large);
        }
        Ok(gpu)
    }

    /// Opens a device of an adapter, of the given or the best tier.
    async fn open(instance: wgpu::Instance, adapter: wgpu::Adapter, tier: Option<Tier>) -> Result<Gpu, DeviceError> {
        let info = adapter.get_info();
        let lacks = |tier: Tier| DeviceError::NoTier { adapter: info.name.clone(), tier: tier.name() };
        let offered = Tier::subgroups_fit(adapter.features(), &adapter.limits());
        if let Some(tier) = tier.filter(|tier| tier.has_subgroups() && !offered) {
            return Err(lacks(tier));
        }
        let subgroups = tier.map_or(offered, Tier::has_subgroups);
        let (device, queue) = adapter
            .request_device(&Tier::descriptor(&adapter, subgroups))
            .await
            .map_err(|e| DeviceError::NoDevice { adapter: info.name.clone(), reason: e.to_string() })?;
        let failure = Arc::new(Failure::default());
        let reports = failure.clone();
        device.on_uncaptured_error(Arc::new(move |error| reports.record_error(&error)));
        let reports = failure.clone();
        device.set_device_lost_callback(move |reason, message| reports.record_loss(reason, &message));
        let number = OPENED.fetch_add(1, Ordering::Relaxed);
        let best = tier.unwrap_or(Tier::of(is_cpu(&info), subgroups));
        let instance = Some(instance);
        let mut gpu = Gpu { instance, adapter, device, queue, info: info.clone(), tier: best, number, failure };
        if gpu.tier.has_subgroups() {
            let large = match large_subgroups(&info) {
                Some(large) => large,
                None if cfg!(target_arch = "wasm32") => {
                    gpu.has_measured_large(buffers::read_async(&gpu, &gpu.subgroup_size(), 1).await)?
                }
                None => gpu.has_measured_large(buffers::read(&gpu, &gpu.subgroup_size(), 1))?,
            };
            match (large, tier) {
                (true, _) => {}
                (false, Some(tier)) => return Err(lacks(tier)),
                (false, None) => gpu.tier = Tier::of(gpu.is_cpu(), false),
            }
        }
        Ok(gpu)
    }

    /// Submits the measurement of the size of subgroups, and returns the buffer with its only word.
    fn subgroup_size(&self) -> wgpu::Buffer {
        let size = buffers::zeroed(self, "subgroup size", 1);
        let stage = Module::new(self, "subgroups/subgroup_size").stage::<SubgroupSize>(self, &[]);
        let bound = stage.bind(self, &SubgroupSizeBindings { size: &size });
        let mut encoder = self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        bound.dispatch(&mut compute_pass(&mut encoder, "subgroup size"), 1);
        self.queue.submit([encoder.finish()]);
        size
    }

    /// Whether the measured size is enough.
    fn has_measured_large(&self, read: Result<Vec<u32>, RenderError>) -> Result<bool, DeviceError> {
        let adapter = self.info.name.clone();
        let size = read.map_err(|e| DeviceError::NoDevice { adapter, reason: e.to_string() })?;
        Ok(size.first().is_some_and(|size| *size >= Tier::SUBGROUP_SIZE))
    }

    /// Whether the adapter is a software rasteriser.
    pub fn is_cpu(&self) -> bool {
        is_cpu(&self.info)
    }
}

fn is_cpu(info: &wgpu::AdapterInfo) -> bool {
    info.device_type == wgpu::DeviceType::Cpu
}

/// Whether subgroups are large enough, if the adapter says so: on Metal it gives a range from 4 on for all.
fn large_subgroups(info: &wgpu::AdapterInfo) -> Option<bool> {
    if info.subgroup_min_size >= Tier::SUBGROUP_SIZE {
        return Some(true);
    }
    (info.subgroup_max_size < Tier::SUBGROUP_SIZE).then_some(false)
}

/// An instance without a window, with the backends that the shaders run on.
pub fn instance() -> wgpu::Instance {
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

    #[test]
    fn the_measured_size_of_subgroups_is_one_that_the_adapter_gives() {
        let choice = AdapterChoice::from_env();
        let gpu = match Gpu::with_tier(&choice, Tier::CpuSubgroups) {
            Ok(gpu) => gpu,
            Err(e @ DeviceError::NoTier { .. }) => return println!("skipped: {e}"),
            Err(e) => panic!("{e}"),
        };
        let sizes: Vec<u32> = buffers::read(&gpu, &gpu.subgroup_size(), 1).unwrap_or_else(|e| panic!("{e}"));
        let given = gpu.info.subgroup_min_size..=gpu.info.subgroup_max_size;
        assert!(given.contains(&sizes[0]), "{sizes:?}, {given:?}");
        assert!(matches!(gpu.has_measured_large(Ok(vec![4])), Ok(false)));
    }
}
