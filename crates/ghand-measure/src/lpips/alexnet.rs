//! The convolutions of AlexNet, as in torchvision. The features behind each are compared.

/// A convolution with bias, before a ReLU.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Conv {
    /// Its place among torchvision's `features`.
    index: usize,
    pub inputs: usize,
    pub outputs: usize,
    pub kernel: usize,
    pub stride: usize,
    pub padding: usize,
    /// Whether its input is the maximum over windows of [`POOL_KERNEL`] pixels, every [`POOL_STRIDE`] pixels.
    pub is_pooled: bool,
}

pub(super) const POOL_KERNEL: usize = 3;
pub(super) const POOL_STRIDE: usize = 2;

pub(super) const CONVOLUTIONS: [Conv; 5] = [
    Conv { index: 0, inputs: 3, outputs: 64, kernel: 11, stride: 4, padding: 2, is_pooled: false },
    Conv { index: 3, inputs: 64, outputs: 192, kernel: 5, stride: 1, padding: 2, is_pooled: true },
    Conv { index: 6, inputs: 192, outputs: 384, kernel: 3, stride: 1, padding: 1, is_pooled: true },
    Conv { index: 8, inputs: 384, outputs: 256, kernel: 3, stride: 1, padding: 1, is_pooled: false },
    Conv { index: 10, inputs: 256, outputs: 256, kernel: 3, stride: 1, padding: 1, is_pooled: false },
];

impl Conv {
    /// Name of its tensors without `.weight` and `.bias`.
    pub fn name(&self) -> String {
        format!("features.{}", self.index)
    }

    /// Shapes of weight and bias.
    pub fn shapes(&self) -> [Vec<usize>; 2] {
        [vec![self.outputs, self.inputs, self.kernel, self.kernel], vec![self.outputs]]
    }
}

#[cfg(test)]
mod tests {
    use super::super::SMALLEST_SIDE;
    use super::*;

    #[test]
    fn layers_fit_together_and_have_the_published_number_of_parameters() {
        assert!(CONVOLUTIONS.windows(2).all(|pair| pair[0].outputs == pair[1].inputs));
        // The sum over torchvision's feature layers.
        let count = |conv: &Conv| conv.shapes().map(|shape| shape.iter().product::<usize>()).iter().sum::<usize>();
        assert_eq!(CONVOLUTIONS.iter().map(count).sum::<usize>(), 2_469_696);
    }

    #[test]
    fn the_smallest_side_is_that_at_which_pytorch_stops_failing() {
        let output = |side: usize| {
            CONVOLUTIONS.iter().try_fold(side, |side, conv| {
                let side = if conv.is_pooled { side.checked_sub(POOL_KERNEL)? / POOL_STRIDE + 1 } else { side };
                Some((side + 2 * conv.padding).checked_sub(conv.kernel)? / conv.stride + 1)
            })
        };
        assert_eq!((1..).find(|side| output(*side).is_some()), Some(SMALLEST_SIDE as usize));
    }
}
