//! Convolutions of pictures by rows, columns and channels.

use nalgebra::{DMatrixView, DMatrixViewMut};
use rayon::prelude::*;

use super::operators::Activation;

/// Output pixels that one task computes; fixed, so that the result does not depend on the number of threads.
const PIXELS: usize = 256;

/// Channels that the depthwise convolution sums in registers.
const LANES: usize = 8;

/// What both kinds have in common: sizes and strides.
#[derive(Debug, Clone, Copy)]
pub struct Window {
    /// Rows and columns of the input.
    pub input: [usize; 2],
    /// Rows and columns of the output.
    pub output: [usize; 2],
    /// Rows and columns of the window.
    pub size: [usize; 2],
    /// Rows and columns from one output to the next.
    pub stride: [usize; 2],
    /// Rows and columns before the input.
    pub padding: [usize; 2],
}

impl Window {
    /// A window whose output has as many rows and columns as the input has strides, begun or whole. Padding is half
    /// before the input, half after it, where it may be one more.
    pub fn padded(input: [usize; 2], size: [usize; 2], stride: [usize; 2]) -> Window {
        let output = [0, 1].map(|k| input[k].div_ceil(stride[k]));
        let padding = [0, 1].map(|k| ((output[k] - 1) * stride[k] + size[k]).saturating_sub(input[k]) / 2);
        Window { input, output, size, stride, padding }
    }

    /// For an output pixel, the places of the window inside the input: index in the window, index of the input's pixel.
    pub fn places(&self, pixel: usize) -> impl Iterator<Item = (usize, usize)> {
        let Window { input, output, size, stride, padding: [top, left] } = *self;
        let [y, x] = [pixel / output[1] * stride[0], pixel % output[1] * stride[1]];
        (0..size[0]).flat_map(move |i| (0..size[1]).map(move |j| [i, j])).filter_map(move |[i, j]| {
            let row = (y + i).checked_sub(top).filter(|&row| row < input[0])?;
            let column = (x + j).checked_sub(left).filter(|&column| column < input[1])?;
            Some((i * size[1] + j, row * input[1] + column))
        })
    }
}

/// A convolution that mixes channels.
pub struct Convolution {
    pub window: Window,
    pub channels: usize,
    pub filters: usize,
    /// By place in the window, input channel and filter.
    pub weights: Vec<f32>,
    /// By filter.
    pub bias: Vec<f32>,
    pub activation: Activation,
}

impl Convolution {
    /// A product of matrices: the weights by the input's windows, one column for each output pixel.
    pub fn run(&self, input: &[f32], output: &mut [f32]) {
        let depth = self.window.size[0] * self.window.size[1] * self.channels;
        let weights = DMatrixView::from_slice(&self.weights, self.filters, depth);
        output.par_chunks_mut(PIXELS * self.filters).enumerate().for_each(|(task, output)| {
            let pixels = output.len() / self.filters;
            let first = task * PIXELS;
            for pixel in output.chunks_exact_mut(self.filters) {
                pixel.copy_from_slice(&self.bias);
            }
            let gathered;
            let windows = if self.window.size == [1, 1] && self.window.stride == [1, 1] {
                &input[first * depth..][..pixels * depth]
            } else {
                gathered = self.gather(input, first, pixels, depth);
                &gathered
            };
            let windows = DMatrixView::from_slice(windows, depth, pixels);
            DMatrixViewMut::from_slice(output, self.filters, pixels).gemm(1.0, &weights, &windows, 1.0);
            self.activation.apply(output);
        });
    }

    /// The windows of some output pixels, one after the other; zero outside of the input.
    fn gather(&self, input: &[f32], first: usize, pixels: usize, depth: usize) -> Vec<f32> {
        let mut gathered = vec![0.0; pixels * depth];
        for (pixel, window) in gathered.chunks_exact_mut(depth).enumerate() {
            for (place, from) in self.window.places(first + pixel) {
                window[place * self.channels..][..self.channels]
                    .copy_from_slice(&input[from * self.channels..][..self.channels]);
            }
        }
        gathered
    }
}

/// A convolution of each channel by itself.
pub struct DepthwiseConvolution {
    pub window: Window,
    pub channels: usize,
    /// By place in the window and channel.
    pub weights: Vec<f32>,
    /// By channel.
    pub bias: Vec<f32>,
    pub activation: Activation,
}

impl DepthwiseConvolution {
    /// Sums each output pixel over its window, a few channels at a time.
    pub fn run(&self, input: &[f32], output: &mut [f32]) {
        let channels = self.channels;
        let row = self.window.output[1];
        output.par_chunks_mut(row * channels).enumerate().for_each(|(y, output)| {
            let mut places = Vec::with_capacity(self.window.size[0] * self.window.size[1]);
            for (x, pixel) in output.chunks_exact_mut(channels).enumerate() {
                places.clear();
                places.extend(self.window.places(y * row + x).map(|(place, from)| [place * channels, from * channels]));
                let (blocks, rest) = pixel.as_chunks_mut::<LANES>();
                for (block, output) in blocks.iter_mut().enumerate() {
                    let start = block * LANES;
                    let mut sum: [f32; LANES] = std::array::from_fn(|c| self.bias[start + c]);
                    for [weight, from] in &places {
                        let weights = self.weights[weight + start..].first_chunk::<LANES>();
                        let values = input[from + start..].first_chunk::<LANES>();
                        if let (Some(weights), Some(values)) = (weights, values) {
                            for c in 0..LANES {
                                sum[c] += weights[c] * values[c];
                            }
                        }
                    }
                    *output = sum;
                }
                let start = channels - rest.len();
                for (c, output) in rest.iter_mut().enumerate() {
                    let channel = start + c;
                    let terms =
                        places.iter().map(|[weight, from]| self.weights[weight + channel] * input[from + channel]);
                    *output = terms.fold(self.bias[channel], |sum, term| sum + term);
                }
            }
            self.activation.apply(output);
        });
    }
}
