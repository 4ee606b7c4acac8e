//! Networks on the splatter's device, beside the same on the processor.

use burn_tensor::{Tensor, TensorData};
use ghand_render::{AdapterChoice, Gpu, buffers};

use super::super::network_device::{NetworkDevice, NetworkPlacement, values};
use super::super::sizes::Activation;
use super::{Case, NAMES, random, tiny};

fn gpu() -> Gpu {
    Gpu::new(&AdapterChoice::from_env()).unwrap_or_else(|error| panic!("{error}"))
}

/// Largest difference between two lists, in multiples of the largest number.
fn difference(a: &[f32], b: &[f32]) -> f32 {
    assert_eq!(a.len(), b.len());
    let largest = b.iter().fold(1e-20f32, |largest, b| largest.max(b.abs()));
    a.iter().zip(b).fold(0.0f32, |worst, (a, b)| if a.is_nan() { f32::NAN } else { worst.max((a - b).abs()) }) / largest
}

#[test]
fn networks_and_their_gradients_are_those_of_the_processor() {
    let gpu = gpu();
    let on_gpu = NetworkDevice::new(&gpu, NetworkPlacement::Gpu).unwrap();
    for activation in [Activation::Relu, Activation::Softplus] {
        let host = Case::new(tiny(activation), 40);
        let here = Case { device: on_gpu.device.clone(), ..Case::new(tiny(activation), 40) };
        for ((name, a), b) in NAMES.iter().zip(here.values()).zip(host.values()) {
            let difference = difference(&a, &b);
            assert!(difference < 1e-4, "{name}: {difference}");
        }
        for ((parameter, a), b) in host.list.parameters.iter().zip(here.gradients()).zip(host.gradients()) {
            let difference = difference(&a, &b);
            assert!(difference < 1e-3, "{}: {difference}", parameter.name);
        }
    }
}

#[test]
fn tables_come_from_buffers_and_go_there_in_order() {
    let gpu = gpu();
    let on_gpu = NetworkDevice::new(&gpu, NetworkPlacement::Gpu).unwrap();
    let again = NetworkDevice::new(&gpu, NetworkPlacement::Gpu).unwrap();
    assert_eq!(on_gpu.device, again.device, "a device is registered once");
    let numbers = random(3, 7 * 13, 1.0);
    let from = buffers::zeroed(&gpu, "from", numbers.len());
    let to = buffers::zeroed(&gpu, "to", numbers.len());
    for round in 1..=20 {
        // What came before is still under way.
        let scaled: Vec<f32> = numbers.iter().map(|x| x * round as f32).collect();
        gpu.queue.write_buffer(&from, 0, bytemuck::cast_slice(&scaled));
        let table = on_gpu.read(&gpu, &from, [7, 13]).unwrap();
        // Transposed: not in the order of its memory.
        on_gpu.write(&gpu, (table * 2.0).transpose(), &to).unwrap();
        let found: Vec<f32> = buffers::read(&gpu, &to, numbers.len()).unwrap();
        let expected = Tensor::<2>::from_data(TensorData::new(scaled, [7, 13]), &burn_tensor::Device::flex());
        assert_eq!(found, values((expected * 2.0).transpose()).unwrap(), "round {round}");
    }
}
