//! A convolution and the gradient of its input, as products of matrices. Maps are `[pixels][channels]`, row-major.

use nalgebra::{DMatrixView, DMatrixViewMut};
use rayon::prelude::*;

use super::alexnet::Conv;

/// Output pixels that one task computes; fixed, so that the result does not depend on the number of threads.
const PIXELS: usize = 128;

/// A convolution with its weights. Windows are `[rows][columns][channels]`.
#[derive(Debug)]
pub(super) struct Convolution {
    conv: Conv,
    /// A column of `outputs` weights for each value of a window.
    by_window: Vec<f32>,
    /// The transpose: a column of a window's weights for each output.
    by_output: Vec<f32>,
    bias: Vec<f32>,
}

impl Convolution {
    /// `weight` is `[outputs][inputs][kernel][kernel]`.
    pub fn new(conv: Conv, weight: &[f32], bias: &[f32]) -> Convolution {
        let Conv { inputs, outputs, kernel, .. } = conv;
        let places = kernel * kernel;
        let mut by_output = Vec::with_capacity(weight.len());
        for filter in weight.chunks_exact(inputs * places) {
            by_output.extend((0..places).flat_map(|place| (0..inputs).map(move |c| filter[c * places + place])));
        }
        let depth = inputs * places;
        let by_window = (0..depth).flat_map(|at| by_output.iter().skip(at).step_by(depth).copied()).collect();
        debug_assert_eq!(by_output.len(), depth * outputs, "one weight for each value of a window and output");
        Convolution { conv, by_window, by_output, bias: bias.to_vec() }
    }

    /// Width and height of the output.
    pub fn output_size(&self, size: [usize; 2]) -> [usize; 2] {
        let Conv { kernel, stride, padding, .. } = self.conv;
        size.map(|side| (side + 2 * padding).saturating_sub(kernel) / stride + 1)
    }

    fn depth(&self) -> usize {
        self.conv.kernel * self.conv.kernel * self.conv.inputs
    }

    /// For an output pixel, the places of its window that lie in the input: place in the window, input pixel.
    fn places(&self, size: [usize; 2], pixel: usize) -> impl Iterator<Item = (usize, usize)> {
        let Conv { kernel, stride, padding, .. } = self.conv;
        let columns = self.output_size(size)[0];
        let [x, y] = [pixel % columns * stride, pixel / columns * stride];
        (0..kernel).flat_map(move |i| (0..kernel).map(move |j| [i, j])).filter_map(move |[i, j]| {
            let row = (y + i).checked_sub(padding).filter(|row| *row < size[1])?;
            let column = (x + j).checked_sub(padding).filter(|column| *column < size[0])?;
            Some((i * kernel + j, row * size[0] + column))
        })
    }

    /// The output behind a ReLU, of an input of `size` (width, height).
    pub fn forward(&self, size: [usize; 2], input: &[f32]) -> Vec<f32> {
        let Conv { inputs, outputs, .. } = self.conv;
        let depth = self.depth();
        let weights = DMatrixView::from_slice(&self.by_window, outputs, depth);
        let mut output = vec![0.0; self.output_size(size).iter().product::<usize>() * outputs];
        output.par_chunks_mut(PIXELS * outputs).enumerate().for_each(|(task, output)| {
            let pixels = output.len() / outputs;
            let mut windows = vec![0.0; pixels * depth];
            for (pixel, window) in windows.chunks_exact_mut(depth).enumerate() {
                for (place, from) in self.places(size, task * PIXELS + pixel) {
                    window[place * inputs..][..inputs].copy_from_slice(&input[from * inputs..][..inputs]);
                }
            }
            output.chunks_exact_mut(outputs).for_each(|pixel| pixel.copy_from_slice(&self.bias));
            let windows = DMatrixView::from_slice(&windows, depth, pixels);
            DMatrixViewMut::from_slice(output, outputs, pixels).gemm(1.0, &weights, &windows, 1.0);
            output.iter_mut().for_each(|value| *value = value.max(0.0));
        });
        output
    }

    /// The gradient of the input, from that of the output before its ReLU.
    pub fn backward(&self, size: [usize; 2], gradient: &[f32]) -> Vec<f32> {
        let Conv { inputs, outputs, .. } = self.conv;
        let depth = self.depth();
        let weights = DMatrixView::from_slice(&self.by_output, depth, outputs);
        let of_windows = |gradient: &[f32]| {
            let pixels = gradient.len() / outputs;
            let mut windows = vec![0.0; pixels * depth];
            let gradient = DMatrixView::from_slice(gradient, outputs, pixels);
            DMatrixViewMut::from_slice(&mut windows, depth, pixels).gemm(1.0, &weights, &gradient, 0.0);
            windows
        };
        let windows: Vec<Vec<f32>> = gradient.par_chunks(PIXELS * outputs).map(of_windows).collect();
        // Windows overlap: their sums are in a fixed order.
        let mut of_input = vec![0.0; size[0] * size[1] * inputs];
        for (pixel, window) in windows.iter().flat_map(|windows| windows.chunks_exact(depth)).enumerate() {
            for (place, to) in self.places(size, pixel) {
                let sums = &mut of_input[to * inputs..][..inputs];
                sums.iter_mut().zip(&window[place * inputs..]).for_each(|(sum, value)| *sum += value);
            }
        }
        of_input
    }
}
