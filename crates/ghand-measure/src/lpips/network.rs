//! AlexNet's convolutions on the host: the features of a picture, and the gradient of the picture.

use super::alexnet::CONVOLUTIONS;
use super::convolution::Convolution;
use super::pool::Maxima;
use super::weights::Weights;

/// Subtracted from values in `[-1, 1]`, by channel, before they are divided by [`SCALE`].
const SHIFT: [f32; 3] = [-0.030, -0.088, -0.188];
const SCALE: [f32; 3] = [0.458, 0.448, 0.450];

/// AlexNet with its weights.
#[derive(Debug)]
pub(super) struct Network {
    /// In the order of [`CONVOLUTIONS`].
    convolutions: Vec<Convolution>,
}

/// What a picture makes of the network.
#[derive(Debug)]
pub(super) struct Features {
    /// Width and height of the picture.
    size: [usize; 2],
    /// In the order of [`CONVOLUTIONS`].
    layers: Vec<Layer>,
}

/// A convolution's part of [`Features`].
#[derive(Debug)]
struct Layer {
    /// The maxima that it takes in place of the features before it.
    maxima: Option<Maxima>,
    /// Width and height of its input.
    input_size: [usize; 2],
    /// What it gives, which is compared: `[pixels][channels]`, row-major.
    features: Vec<f32>,
}

impl Features {
    /// What is compared: the features behind each convolution, `[pixels][channels]`.
    pub fn compared(&self) -> impl Iterator<Item = &[f32]> {
        self.layers.iter().map(|layer| layer.features.as_slice())
    }
}

impl Network {
    pub fn new(weights: &Weights) -> Network {
        let all = CONVOLUTIONS.into_iter().zip(&weights.convolutions);
        Network { convolutions: all.map(|(conv, [weight, bias])| Convolution::new(conv, weight, bias)).collect() }
    }

    /// The features of a picture of display values, row-major, of `size` (width, height).
    pub fn features(&self, size: [usize; 2], picture: &[[f32; 3]]) -> Features {
        let value = |channel: usize, value: f32| (2.0 * value - 1.0 - SHIFT[channel]) / SCALE[channel];
        let input: Vec<f32> = picture.iter().flat_map(|pixel| [0, 1, 2].map(|c| value(c, pixel[c]))).collect();
        let mut layers: Vec<Layer> = Vec::with_capacity(CONVOLUTIONS.len());
        let mut map_size = size;
        for (conv, convolution) in CONVOLUTIONS.iter().zip(&self.convolutions) {
            let before = layers.last().map_or(&input, |layer| &layer.features);
            let maxima = conv.is_pooled.then(|| Maxima::of(map_size, before, conv.inputs));
            let (input_size, input) =
                maxima.as_ref().map_or((map_size, before), |maxima| (maxima.size, &maxima.values));
            let features = convolution.forward(input_size, input);
            map_size = convolution.output_size(input_size);
            layers.push(Layer { maxima, input_size, features });
        }
        Features { size, layers }
    }

    /// The gradient with respect to display values, from those with respect to the compared features.
    pub fn gradient(&self, features: &Features, mut gradients: Vec<Vec<f32>>) -> Vec<[f32; 3]> {
        let mut of_picture = vec![0.0; 3 * features.size[0] * features.size[1]];
        for (convolution, layer) in self.convolutions.iter().zip(&features.layers).rev() {
            let Some(mut gradient) = gradients.pop() else { break };
            // The ReLU passes nothing where it gave nothing.
            gradient.iter_mut().zip(&layer.features).filter(|(_, value)| **value <= 0.0).for_each(|(g, _)| *g = 0.0);
            let of_input = convolution.backward(layer.input_size, &gradient);
            let before = gradients.last_mut().unwrap_or(&mut of_picture);
            match &layer.maxima {
                Some(maxima) => maxima.add_gradient(&of_input, before),
                None => before.iter_mut().zip(&of_input).for_each(|(sum, value)| *sum += value),
            }
        }
        let pixels = of_picture.as_chunks::<3>().0.iter();
        pixels.map(|pixel| [0, 1, 2].map(|c| 2.0 / SCALE[c] * pixel[c])).collect()
    }
}
