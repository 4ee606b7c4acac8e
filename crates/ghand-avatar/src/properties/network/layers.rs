//! Layers of the networks. Maps are `[1][channels][side][side]`, tables of points `[points][channels]`.
//!
//! Convolutions are matrix products here, of the weights and the map as the columns of a kernel see it.
//! Burn's own are slower by a factor of several on a processor: for the gradient of the weights, flex 0.22.1 takes a batch
//! of one for a map of one channel, and a path that is meant for edge filters.

use burn_tensor::module::{batch_norm, batch_norm_train, linear};
use burn_tensor::ops::PadMode;
use burn_tensor::{Tensor, activation};

use super::parameters::{ParameterList, Part, Slot, Start};
use super::sizes::Activation;

/// Added to variances before their root is taken.
pub(crate) const NORM_EPSILON: f64 = 1e-5;

/// One evaluation of the networks.
pub(super) struct Pass<'a> {
    /// All parameters, flat.
    pub parameters: &'a [Tensor<1>],
    /// Mean and variance by which each normalisation goes; `None`: those of the map.
    pub fixed_norms: Option<&'a [[Tensor<1>; 2]]>,
    /// Mean and variance of the maps, by normalisation.
    pub seen_norms: Vec<(usize, [Tensor<1>; 2])>,
}

impl<'a> Pass<'a> {
    /// With these parameters; `fixed_norms` replace the maps' own mean and variance.
    pub fn new(parameters: &'a [Tensor<1>], fixed_norms: Option<&'a [[Tensor<1>; 2]]>) -> Pass<'a> {
        Pass { parameters, fixed_norms, seen_norms: Vec::new() }
    }
}

/// A layer of all inputs to all outputs.
#[derive(Debug)]
struct Linear {
    weight: Slot<2>,
    bias: Slot<1>,
}

impl Linear {
    fn forward(&self, pass: &Pass, x: Tensor<2>) -> Tensor<2> {
        linear(x, self.weight.of(pass.parameters), Some(self.bias.of(pass.parameters)))
    }
}

/// Layers one after the other, with activations between.
#[derive(Debug)]
pub(super) struct Mlp {
    layers: Vec<Linear>,
    activation: Activation,
}

impl Mlp {
    /// Layers of these widths, inputs first. `last` are the start values of the last layer's bias if it starts without
    /// an effect of its input; without, it starts like the others.
    pub fn new(
        list: &mut ParameterList,
        (name, part): (&str, Part),
        widths: &[usize],
        activation: Activation,
        last: Option<Start>,
    ) -> Mlp {
        let count = widths.len() - 1;
        let layers = widths.windows(2).enumerate().map(|(k, pair)| {
            let [inputs, outputs] = [pair[0], pair[1]];
            let usual = Start::of_inputs(inputs);
            let (weight, bias) = match last {
                Some(bias) if k + 1 == count => (Start::Zero, bias),
                _ => (usual, usual),
            };
            Linear {
                weight: list.add(format!("{name}.{k}.weight"), part, [inputs, outputs], weight),
                bias: list.add(format!("{name}.{k}.bias"), part, [outputs], bias),
            }
        });
        Mlp { layers: layers.collect(), activation }
    }

    /// `[points][inputs]` to `[points][outputs]`, without an activation behind the last layer.
    pub fn forward(&self, pass: &Pass, x: Tensor<2>) -> Tensor<2> {
        self.layers.iter().enumerate().fold(x, |x, (k, layer)| {
            let x = if k == 0 { x } else { self.activate(x) };
            layer.forward(pass, x)
        })
    }

    /// The activation.
    pub fn activate(&self, x: Tensor<2>) -> Tensor<2> {
        match self.activation {
            Activation::Relu => activation::relu(x),
            // Without the exponential's overflow.
            Activation::Softplus => activation::log_sigmoid(x.neg()).neg(),
        }
    }

    /// The last layer's parameters.
    pub fn last(&self) -> Option<(Slot<2>, Slot<1>)> {
        self.layers.last().map(|layer| (layer.weight, layer.bias))
    }
}

/// A convolution that keeps or halves the side of its map.
#[derive(Debug)]
pub(super) struct Conv {
    weight: Slot<4>,
    stride: usize,
}

impl Conv {
    /// Over `kernel` x `kernel` texels, without bias.
    pub fn new(
        list: &mut ParameterList,
        (name, part): (String, Part),
        channels: [usize; 2],
        kernel: usize,
        stride: usize,
    ) -> Conv {
        let [inputs, outputs] = channels;
        let start = Start::of_inputs(inputs * kernel * kernel);
        Conv { weight: list.add(name, part, [outputs, inputs, kernel, kernel], start), stride }
    }

    /// The map's side, or half of it with a stride of 2.
    pub fn forward(&self, pass: &Pass, x: Tensor<4>) -> Tensor<4> {
        let weight = self.weight.of(pass.parameters);
        let [outputs, inputs, kernel, _] = weight.dims();
        let padding = (kernel - 1) / 2;
        let x = padded(x, [padding; 4]);
        if self.stride == 1 {
            return convolved(weight.permute([0, 2, 3, 1]), x);
        }
        // With every 2 x 2 texels as channels of one, it is a 2 x 2 convolution with a stride of 1.
        let weight = weight.reshape([outputs, inputs, 2, 2, 2, 2]).permute([0, 2, 4, 3, 5, 1]);
        convolved(weight.reshape([outputs, 2, 2, 4 * inputs]), space_to_channels(x))
    }
}

/// Zeros around a map: left, right, top, bottom.
fn padded(x: Tensor<4>, [left, right, top, bottom]: [usize; 4]) -> Tensor<4> {
    x.pad((left, right, top, bottom), PadMode::Constant(0.0))
}

/// `[1][c][2 h][2 w]` to `[1][4 c][h][w]`; channels by row, column, channel.
fn space_to_channels(x: Tensor<4>) -> Tensor<4> {
    let [_, channels, rows, columns] = x.dims();
    let [rows, columns] = [rows / 2, columns / 2];
    let x = x.reshape([channels, rows, 2, columns, 2]).permute([2, 4, 0, 1, 3]);
    x.reshape([1, 4 * channels, rows, columns])
}

/// The opposite of [`space_to_channels`].
fn channels_to_space(x: Tensor<4>) -> Tensor<4> {
    let [_, channels, rows, columns] = x.dims();
    let x = x.reshape([2, 2, channels / 4, rows, columns]).permute([2, 3, 0, 4, 1]);
    x.reshape([1, channels / 4, 2 * rows, 2 * columns])
}

/// A convolution with a stride of 1, of weights `[outputs][kernel][kernel][inputs]`, rows before columns.
///
/// Only what columns see is laid out beside each other for the product, `kernel` times the map; for each row of the
/// kernel a map comes out, and these are added, each a row further up.
fn convolved(weight: Tensor<4>, x: Tensor<4>) -> Tensor<4> {
    let [outputs, kernel, _, inputs] = weight.dims();
    let [_, _, rows, columns] = x.dims();
    let columns = columns + 1 - kernel;
    let beside = Tensor::cat((0..kernel).map(|z| x.clone().narrow(3, z, columns)).collect(), 1);
    let by_row = product(weight.reshape([outputs * kernel, kernel * inputs]), beside);
    // With one row more in each, what belongs together has the same number of its map.
    let rows_of_all = by_row.reshape([1, outputs, kernel * rows, columns]);
    let skewed = padded(rows_of_all, [0, 0, 0, kernel]).reshape([outputs, kernel, rows + 1, columns]);
    let rows = rows + 1 - kernel;
    skewed.narrow(2, 0, rows).sum_dim(1).reshape([1, outputs, rows, columns])
}

/// `[outputs][inputs]` times a map of that many channels.
fn product(weight: Tensor<2>, x: Tensor<4>) -> Tensor<4> {
    let [_, channels, rows, columns] = x.dims();
    let outputs = weight.dims()[0];
    weight.matmul(x.reshape([channels, rows * columns])).reshape([1, outputs, rows, columns])
}

/// A transposed 4 x 4 convolution, which doubles the side of its map.
#[derive(Debug)]
pub(super) struct ConvTransposed {
    weight: Slot<4>,
    bias: Option<Slot<1>>,
}

impl ConvTransposed {
    /// With bias or without.
    pub fn new(
        list: &mut ParameterList,
        (name, part): (String, Part),
        channels: [usize; 2],
        with_bias: bool,
    ) -> ConvTransposed {
        let [inputs, outputs] = channels;
        // Four of the sixteen weights reach a texel.
        let start = Start::of_inputs(4 * inputs);
        let weight = list.add(format!("{name}.weight"), part, [inputs, outputs, 4, 4], start);
        let bias = with_bias.then(|| list.add(format!("{name}.bias"), part, [outputs], start));
        ConvTransposed { weight, bias }
    }

    /// Twice the side.
    pub fn forward(&self, pass: &Pass, x: Tensor<4>) -> Tensor<4> {
        let weight = self.weight.of(pass.parameters);
        let [inputs, outputs, ..] = weight.dims();
        let [_, _, rows, columns] = x.dims();
        // What each texel gives to the 2 x 2 blocks of 2 x 2 texels that it reaches.
        let weight = weight.reshape([inputs, outputs, 2, 2, 2, 2]).permute([2, 4, 3, 5, 1, 0]);
        let given = product(weight.reshape([16 * outputs, inputs]), x);
        let block = |y: usize, z: usize| {
            let part = given.clone().narrow(1, (2 * y + z) * 4 * outputs, 4 * outputs);
            padded(part, [z, 1 - z, y, 1 - y])
        };
        let sum = block(0, 0) + block(0, 1) + block(1, 0) + block(1, 1);
        let x = channels_to_space(sum).narrow(2, 1, 2 * rows).narrow(3, 1, 2 * columns);
        match self.bias {
            Some(bias) => x + bias.of(pass.parameters).reshape([1, outputs, 1, 1]),
            None => x,
        }
    }
}

/// Normalises each channel to mean 0 and variance 1 over the map. Nothing of it is learned.
#[derive(Debug)]
pub(super) struct Norm {
    index: usize,
    channels: usize,
}

impl Norm {
    /// Of this many channels.
    pub fn new(list: &mut ParameterList, channels: usize) -> Norm {
        list.norms.push(channels);
        Norm { index: list.norms.len() - 1, channels }
    }

    /// The same shape.
    pub fn forward(&self, pass: &mut Pass, x: Tensor<4>) -> Tensor<4> {
        let one = Tensor::ones([self.channels], &x.device());
        let zero = one.zeros_like();
        if let Some(fixed) = pass.fixed_norms {
            let [mean, variance] = fixed[self.index].clone();
            return batch_norm(x, one, zero, mean, variance, NORM_EPSILON);
        }
        let normalized = batch_norm_train(x, one, zero, NORM_EPSILON);
        pass.seen_norms.push((self.index, [normalized.mean, normalized.variance]));
        normalized.output
    }
}
