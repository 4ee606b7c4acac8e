//! The operators of a network.

use super::convolution::{Convolution, DepthwiseConvolution, Window};

/// What follows an operator, in place.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Activation {
    /// Nothing.
    None,
    /// From zero to six.
    Relu6,
}

impl Activation {
    /// Applies it to all numbers.
    pub fn apply(self, values: &mut [f32]) {
        match self {
            Activation::None => {}
            Activation::Relu6 => values.iter_mut().for_each(|v| *v = v.clamp(0.0, 6.0)),
        }
    }
}

/// One step of a network.
pub enum Operator {
    /// Mixes channels of a window.
    Convolution(Convolution),
    /// Convolves each channel by itself.
    DepthwiseConvolution(DepthwiseConvolution),
    /// Adds two tensors of one size.
    Add,
    /// Multiplies negative numbers by their channel's slope.
    Prelu {
        /// By channel.
        slopes: Vec<f32>,
    },
    /// Adds channels of zeros.
    PadChannels {
        /// Channels of the input.
        channels: usize,
        /// New channels after them.
        padding: usize,
    },
    /// The largest of each window.
    MaxPool {
        /// Where to look.
        window: Window,
        /// Of input and output.
        channels: usize,
    },
    /// Interpolates, with the middles of corner pixels half a pixel from the edge.
    ResizeBilinear {
        /// Rows and columns of the input.
        from: [usize; 2],
        /// Rows and columns of the output.
        to: [usize; 2],
        /// Of input and output.
        channels: usize,
    },
    /// The mean over rows and columns.
    Mean {
        /// Of input and output.
        channels: usize,
    },
    /// A product by a matrix.
    FullyConnected {
        /// By output and input.
        weights: Vec<f32>,
        /// By output.
        bias: Vec<f32>,
    },
    /// 1 / (1 + exp(-x)).
    Logistic,
    /// The same numbers, in another shape.
    Copy,
    /// Joins tensors.
    Concatenate {
        /// For each input, how many numbers stand together.
        runs: Vec<usize>,
    },
}

impl Operator {
    /// Computes the output.
    pub fn run(&self, inputs: &[&[f32]], output: &mut [f32]) {
        let input = inputs[0];
        match self {
            Operator::Convolution(convolution) => convolution.run(input, output),
            Operator::DepthwiseConvolution(convolution) => convolution.run(input, output),
            Operator::Add => {
                for ((sum, a), b) in output.iter_mut().zip(input).zip(inputs[1]) {
                    *sum = a + b;
                }
            }
            Operator::Prelu { slopes } => {
                for (output, input) in output.chunks_exact_mut(slopes.len()).zip(input.chunks_exact(slopes.len())) {
                    for ((output, &x), slope) in output.iter_mut().zip(input).zip(slopes) {
                        *output = if x < 0.0 { x * slope } else { x };
                    }
                }
            }
            Operator::PadChannels { channels, padding } => {
                output.fill(0.0);
                let pixels = output.chunks_exact_mut(channels + padding);
                for (output, input) in pixels.zip(input.chunks_exact(*channels)) {
                    output[..*channels].copy_from_slice(input);
                }
            }
            Operator::MaxPool { window, channels } => {
                for (pixel, output) in output.chunks_exact_mut(*channels).enumerate() {
                    output.fill(f32::NEG_INFINITY);
                    for (_, from) in window.places(pixel) {
                        for (largest, x) in output.iter_mut().zip(&input[from * channels..]) {
                            *largest = largest.max(*x);
                        }
                    }
                }
            }
            Operator::ResizeBilinear { from, to, channels } => resize_bilinear(input, *from, output, *to, *channels),
            Operator::Mean { channels } => {
                output.fill(0.0);
                for pixel in input.chunks_exact(*channels) {
                    output.iter_mut().zip(pixel).for_each(|(sum, x)| *sum += x);
                }
                let pixels = (input.len() / channels) as f32;
                output.iter_mut().for_each(|sum| *sum /= pixels);
            }
            Operator::FullyConnected { weights, bias } => {
                for ((output, weights), bias) in output.iter_mut().zip(weights.chunks_exact(input.len())).zip(bias) {
                    *output = weights.iter().zip(input).map(|(w, x)| w * x).sum::<f32>() + bias;
                }
            }
            Operator::Logistic => {
                output.iter_mut().zip(input).for_each(|(y, x)| *y = 1.0 / (1.0 + (-x).exp()));
            }
            Operator::Copy => output.copy_from_slice(input),
            Operator::Concatenate { runs } => {
                let mut start = 0;
                let whole: usize = runs.iter().sum();
                for (input, run) in inputs.iter().zip(runs) {
                    for (output, input) in output.chunks_exact_mut(whole).zip(input.chunks_exact(*run)) {
                        output[start..start + run].copy_from_slice(input);
                    }
                    start += run;
                }
            }
        }
    }
}

fn resize_bilinear(input: &[f32], from: [usize; 2], output: &mut [f32], to: [usize; 2], channels: usize) {
    // The two neighbours along one axis, and the weight of the second.
    let neighbours = |place: usize, axis: usize| {
        let position = (place as f32 + 0.5) * from[axis] as f32 / to[axis] as f32 - 0.5;
        let position = position.max(0.0);
        let last = from[axis] - 1;
        let first = (position as usize).min(last);
        ([first, (first + 1).min(last)], position - first as f32)
    };
    for (pixel, output) in output.chunks_exact_mut(channels).enumerate() {
        let (rows, down) = neighbours(pixel / to[1], 0);
        let (columns, right) = neighbours(pixel % to[1], 1);
        let at = |row: usize, column: usize, c: usize| input[(row * from[1] + column) * channels + c];
        for (c, output) in output.iter_mut().enumerate() {
            let [above, below] = rows.map(|row| {
                let [a, b] = columns.map(|column| at(row, column, c));
                a + (b - a) * right
            });
            *output = above + (below - above) * down;
        }
    }
}
