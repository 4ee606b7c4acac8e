//! Where the networks run, and how their tensors come from the splatter's buffers and go there.

use burn_tensor::{Device, Tensor, TensorData};
use ghand_render::{Gpu, RenderError, buffers};

/// Where networks can run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum NetworkPlacement {
    /// On the processor; properties and their gradients are copied.
    Host,
    /// On the splatter's own device; nothing leaves it.
    #[cfg(feature = "gpu-networks")]
    Gpu,
}

impl NetworkPlacement {
    /// Environment variable that says where: `host` or `gpu`.
    const VARIABLE: &'static str = "GHAND_NETWORKS";

    /// The place in [`NetworkPlacement::VARIABLE`], else the faster one: a software rasteriser runs networks slower
    /// than the processor itself does.
    ///
    /// # Errors
    /// [`RenderError::Invalid`] if the variable has another value, or this program has no networks for the GPU.
    pub fn from_env(gpu: &Gpu) -> Result<NetworkPlacement, RenderError> {
        let text = std::env::var_os(Self::VARIABLE).unwrap_or_default().to_string_lossy().to_lowercase();
        match text.as_str() {
            "" => Ok(if gpu.is_cpu() { NetworkPlacement::Host } else { NetworkPlacement::BEST_FOR_GPU }),
            "host" => Ok(NetworkPlacement::Host),
            #[cfg(feature = "gpu-networks")]
            "gpu" => Ok(NetworkPlacement::Gpu),
            #[cfg(not(feature = "gpu-networks"))]
            "gpu" => Err(RenderError::Invalid(format!(
                "{}=gpu: this program was built without networks for the GPU; build it with `--features gpu-networks`",
                Self::VARIABLE
            ))),
            _ => Err(RenderError::Invalid(format!("{}={text} is not a place; use `host` or `gpu`", Self::VARIABLE))),
        }
    }

    #[cfg(feature = "gpu-networks")]
    const BEST_FOR_GPU: NetworkPlacement = NetworkPlacement::Gpu;
    #[cfg(not(feature = "gpu-networks"))]
    const BEST_FOR_GPU: NetworkPlacement = NetworkPlacement::Host;
}

/// A device of Burn.
#[derive(Debug, Clone)]
pub(super) struct NetworkDevice {
    place: NetworkPlacement,
    /// Where tensors are.
    pub device: Device,
}

impl NetworkDevice {
    /// The networks' device beside a splatter's.
    ///
    /// # Errors
    /// [`RenderError::Device`] if Burn cannot use the splatter's device.
    pub fn new(gpu: &Gpu, place: NetworkPlacement) -> Result<NetworkDevice, RenderError> {
        let _ = gpu;
        let device = match place {
            NetworkPlacement::Host => Device::flex(),
            #[cfg(feature = "gpu-networks")]
            NetworkPlacement::Gpu => on_gpu::registered(gpu)?,
        };
        Ok(NetworkDevice { place, device })
    }

    /// Copies a table to the start of a buffer, row-major.
    ///
    /// # Errors
    /// [`RenderError::Device`] if the tensor cannot be read.
    pub fn write(&self, gpu: &Gpu, table: Tensor<2>, buffer: &wgpu::Buffer) -> Result<(), RenderError> {
        match self.place {
            NetworkPlacement::Host => gpu.queue.write_buffer(buffer, 0, bytemuck::cast_slice(&values(table)?)),
            #[cfg(feature = "gpu-networks")]
            NetworkPlacement::Gpu => on_gpu::write(gpu, table, buffer)?,
        }
        Ok(())
    }

    /// A table from the start of a buffer, row-major.
    ///
    /// # Errors
    /// [`RenderError`] if the device has failed.
    pub fn read(&self, gpu: &Gpu, buffer: &wgpu::Buffer, shape: [usize; 2]) -> Result<Tensor<2>, RenderError> {
        match self.place {
            NetworkPlacement::Host => {
                let values: Vec<f32> = buffers::read(gpu, buffer, shape[0] * shape[1])?;
                Ok(Tensor::from_data(TensorData::new(values, shape), &self.device))
            }
            #[cfg(feature = "gpu-networks")]
            NetworkPlacement::Gpu => on_gpu::read(gpu, buffer, shape, &self.device),
        }
    }
}

/// A tensor's values, row-major.
///
/// # Errors
/// [`RenderError::Device`] if it cannot be read.
pub(super) fn values<const D: usize>(tensor: Tensor<D>) -> Result<Vec<f32>, RenderError> {
    tensor.try_into_vec_as::<f32>().map_err(|e| RenderError::Device(format!("a tensor could not be read: {e:?}")))
}

/// Burn's wgpu backend and the splatter share device and queue. Burn collects its work; what it has collected is
/// submitted before a copy, so that the queue runs both in order.
#[cfg(feature = "gpu-networks")]
mod on_gpu {
    use std::sync::{Mutex, PoisonError};

    use burn_cubecl::cubecl::wgpu::{AutoCompiler, WgpuResource, WgpuServer};
    use burn_cubecl::kernel::into_contiguous;
    use burn_dispatch::backends::Cube;
    use burn_tensor::wgpu::WgpuSetup;
    use burn_tensor::{Device, Tensor};
    use ghand_render::{Gpu, RenderError};

    /// Devices that Burn knows, by [`Gpu::number`]: it would not recognise one of them again.
    static REGISTERED: Mutex<Vec<(u64, Device)>> = Mutex::new(Vec::new());

    /// Burn's name for a splatter's device.
    pub fn registered(gpu: &Gpu) -> Result<Device, RenderError> {
        let mut known = REGISTERED.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, device)) = known.iter().find(|(number, _)| *number == gpu.number) {
            return Ok(device.clone());
        }
        let Some(instance) = gpu.instance.clone() else {
            let why = "networks run on a device of another program only on the processor; set GHAND_NETWORKS=host";
            return Err(RenderError::Invalid(why.into()));
        };
        let setup = WgpuSetup {
            instance,
            adapter: gpu.adapter.clone(),
            device: gpu.device.clone(),
            queue: gpu.queue.clone(),
            backend: gpu.info.backend,
        };
        let device = Device::wgpu_options().setup(setup).init();
        let device = device.map_err(|e| RenderError::Device(format!("networks cannot run on it: {e:?}")))?;
        known.push((gpu.number, device.clone()));
        Ok(device)
    }

    /// Runs `copy` on the buffer of a table, between all work of Burn so far and all that follows.
    fn with_buffer(table: Tensor<2>, copy: impl FnOnce(&WgpuResource)) -> Result<(), RenderError> {
        let failed =
            |what: &dyn std::fmt::Debug| RenderError::Device(format!("a tensor could not be copied: {what:?}"));
        let tensor = into_contiguous(table.try_into_primitive::<Cube>().map_err(|e| failed(&e))?);
        let resource = tensor.client.get_resource::<WgpuServer<AutoCompiler>>(tensor.handle.clone());
        let resource = resource.map_err(|e| failed(&e))?;
        tensor.client.flush().map_err(|e| failed(&e))?;
        copy(resource.resource());
        Ok(())
    }

    /// The bytes of a table.
    fn bytes([rows, columns]: [usize; 2]) -> u64 {
        (rows * columns * size_of::<f32>()) as u64
    }

    pub fn write(gpu: &Gpu, table: Tensor<2>, buffer: &wgpu::Buffer) -> Result<(), RenderError> {
        let bytes = bytes(table.dims());
        with_buffer(table, |from| {
            let mut encoder = gpu.device.create_command_encoder(&Default::default());
            encoder.copy_buffer_to_buffer(&from.buffer, from.offset, buffer, 0, bytes);
            gpu.queue.submit([encoder.finish()]);
        })
    }

    pub fn read(
        gpu: &Gpu,
        buffer: &wgpu::Buffer,
        shape: [usize; 2],
        device: &Device,
    ) -> Result<Tensor<2>, RenderError> {
        let table = Tensor::empty(shape, device);
        with_buffer(table.clone(), |to| {
            let mut encoder = gpu.device.create_command_encoder(&Default::default());
            encoder.copy_buffer_to_buffer(buffer, 0, &to.buffer, to.offset, bytes(shape));
            gpu.queue.submit([encoder.finish()]);
        })?;
        Ok(table)
    }
}
