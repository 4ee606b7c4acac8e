//! The encoders: five convolutions down and five up, with what went down joined on the way up.

use burn_tensor::{Tensor, activation};

use super::layers::{Conv, ConvTransposed, Norm, Pass};
use super::parameters::{ParameterList, Part};
use super::sizes::LEVELS;

/// Slope of the activation on the way down, for negative values.
pub(super) const LEAK: f64 = 0.2;

/// A U-Net from a position map to features. All kernels are 4 x 4; the first and the deepest map are not normalised.
#[derive(Debug)]
pub(super) struct UNet {
    down: Vec<(Conv, Option<Norm>)>,
    up: Vec<(ConvTransposed, Option<Norm>)>,
}

/// Channels of the maps on the way down, the input first.
pub(super) fn channels_down(base: usize) -> [usize; LEVELS + 1] {
    [3, base, 2 * base, 4 * base, 8 * base, 8 * base]
}

/// Input and output channels of each layer on the way up.
pub(super) fn channels_up(base: usize, features: usize) -> [[usize; 2]; LEVELS] {
    // Inputs are what comes from below and what was there on the way down.
    [[8, 8], [16, 4], [8, 2], [4, 1], [2, 0]].map(|[inputs, outputs]| {
        let outputs = if outputs == 0 { features } else { outputs * base };
        [inputs * base, outputs]
    })
}

impl UNet {
    /// From 3 channels to `features`.
    pub fn new(list: &mut ParameterList, (name, part): (&str, Part), base: usize, features: usize) -> UNet {
        let channels = channels_down(base);
        let down = (0..LEVELS).map(|k| {
            let conv = Conv::new(list, (format!("{name}.down.{k}"), part), [channels[k], channels[k + 1]], 4, 2);
            let norm = (k > 0 && k + 1 < LEVELS).then(|| Norm::new(list, channels[k + 1]));
            (conv, norm)
        });
        let down = down.collect();
        let up = channels_up(base, features).into_iter().enumerate().map(|(k, [inputs, outputs])| {
            let last = k + 1 == LEVELS;
            let conv = ConvTransposed::new(list, (format!("{name}.up.{k}"), part), [inputs, outputs], last);
            let norm = (!last).then(|| Norm::new(list, outputs));
            (conv, norm)
        });
        UNet { down, up: up.collect() }
    }

    /// `[1][3][side][side]` to `[1][features][side][side]`.
    pub fn forward(&self, pass: &mut Pass, map: Tensor<4>) -> Tensor<4> {
        let mut x = map;
        let mut skipped = Vec::new();
        for (k, (conv, norm)) in self.down.iter().enumerate() {
            if k > 0 {
                skipped.push(x.clone());
                x = activation::leaky_relu(x, LEAK);
            }
            x = conv.forward(pass, x);
            if let Some(norm) = norm {
                x = norm.forward(pass, x);
            }
        }
        for (k, (conv, norm)) in self.up.iter().enumerate() {
            if k > 0
                && let Some(skip) = skipped.pop()
            {
                x = Tensor::cat(vec![x, skip], 1);
            }
            x = conv.forward(pass, activation::relu(x));
            if let Some(norm) = norm {
                x = norm.forward(pass, x);
            }
        }
        x
    }
}
