//! AlexNet in Burn, on the host.

use burn_tensor::activation::relu;
use burn_tensor::module::{conv2d, max_pool2d};
use burn_tensor::ops::{ConvOptions, MaxPoolOptions};
use burn_tensor::{Device, Tensor, TensorData};

use super::LpipsError;
use super::alexnet::{CONVOLUTIONS, Conv, POOL_KERNEL, POOL_STRIDE};
use super::weights::Weights;

/// Subtracted from values in `[-1, 1]`, by channel, before they are divided by [`SCALE`].
const SHIFT: [f32; 3] = [-0.030, -0.088, -0.188];
const SCALE: [f32; 3] = [0.458, 0.448, 0.450];

/// A convolution's tensors.
#[derive(Debug)]
struct Parameters {
    weight: Tensor<4>,
    bias: Tensor<1>,
}

/// AlexNet with its weights.
#[derive(Debug)]
pub(super) struct Network {
    /// In the order of [`CONVOLUTIONS`].
    parameters: Vec<Parameters>,
    device: Device,
}

/// The value that the network takes in place of a display value in `[0, 1]`.
fn network_value(channel: usize, value: f32) -> f32 {
    (2.0 * value - 1.0 - SHIFT[channel]) / SCALE[channel]
}

pub(super) fn values<const D: usize>(tensor: Tensor<D>) -> Result<Vec<f32>, LpipsError> {
    tensor.try_into_vec_as::<f32>().map_err(|e| LpipsError::Tensor(format!("{e:?}")))
}

impl Network {
    pub fn new(weights: &Weights) -> Network {
        let device = Device::flex();
        let parameters = CONVOLUTIONS.into_iter().zip(&weights.convolutions).map(|(conv, [weight, bias])| {
            let Conv { inputs, outputs, kernel, .. } = conv;
            let weight = TensorData::new(weight.clone(), [outputs, inputs, kernel, kernel]);
            let bias = TensorData::new(bias.clone(), [outputs]);
            Parameters { weight: Tensor::from_data(weight, &device), bias: Tensor::from_data(bias, &device) }
        });
        Network { parameters: parameters.collect(), device }
    }

    /// A picture of display values as the network's input, `[1][3][height][width]`.
    pub fn input(&self, [width, height]: [usize; 2], picture: &[[f32; 3]]) -> Tensor<4> {
        let planes = (0..3).flat_map(|c| picture.iter().map(move |pixel| network_value(c, pixel[c])));
        Tensor::from_data(TensorData::new(planes.collect::<Vec<f32>>(), [1, 3, height, width]), &self.device)
    }

    /// The features that are compared, `[1][channels][rows][columns]` each.
    pub fn features(&self, mut x: Tensor<4>) -> Vec<Tensor<4>> {
        let mut taps = Vec::new();
        for (conv, own) in CONVOLUTIONS.iter().zip(&self.parameters) {
            if conv.is_pooled {
                x = max_pool2d(x, MaxPoolOptions::new([POOL_KERNEL; 2]).with_stride([POOL_STRIDE; 2]));
            }
            let options = ConvOptions::new([conv.stride; 2], [conv.padding; 2], [1; 2], 1);
            x = relu(conv2d(x, own.weight.clone(), Some(own.bias.clone()), options));
            taps.push(x.clone());
        }
        taps
    }

    /// The gradient with respect to display values of a sum of features times `weights`.
    pub fn gradient(
        &self,
        input: &Tensor<4>,
        taps: Vec<Tensor<4>>,
        weights: Vec<Vec<f32>>,
    ) -> Result<Vec<[f32; 3]>, LpipsError> {
        let products = taps.into_iter().zip(weights).map(|(tap, weights)| {
            let shape = tap.dims();
            (tap * Tensor::from_data(TensorData::new(weights, shape), &self.device)).sum()
        });
        let [_, _, rows, columns] = input.dims();
        let pixels = rows * columns;
        let mut gradient = vec![[0.0; 3]; pixels];
        let Some(sum) = products.reduce(|a, b| a + b) else { return Ok(gradient) };
        let mut all = sum.backward();
        if let Some(planes) = input.grad_remove(&mut all) {
            let planes = values(planes)?;
            for (channel, plane) in planes.chunks_exact(pixels.max(1)).enumerate().take(3) {
                let scale = 2.0 / SCALE[channel];
                gradient.iter_mut().zip(plane).for_each(|(pixel, value)| pixel[channel] = scale * value);
            }
        }
        Ok(gradient)
    }
}
