//! Adam on Burn's tensors, as `adam.wgsl` does it on tables of the device.

use burn_tensor::Tensor;
use ghand_render::optimizer::{AdamUniforms, BETAS, EPSILON};

/// Adam's state: the moments of each parameter that has had a gradient.
#[derive(Debug, Default)]
pub(super) struct NetworkAdam {
    moments: Vec<Option<[Tensor<1>; 2]>>,
}

impl NetworkAdam {
    /// For `count` parameters.
    pub fn new(count: usize) -> NetworkAdam {
        NetworkAdam { moments: vec![None; count] }
    }

    /// Both moments of a parameter, none before its first gradient.
    pub fn moments(&self, index: usize) -> impl Iterator<Item = &Tensor<1>> {
        self.moments.get(index).into_iter().flatten().flatten()
    }

    /// Goes on from other moments of a parameter.
    pub fn set_moments(&mut self, index: usize, moments: Option<[Tensor<1>; 2]>) {
        if let Some(slot) = self.moments.get_mut(index) {
            *slot = moments;
        }
    }

    /// A parameter after step number `step`, from 1.
    pub fn updated(
        &mut self,
        index: usize,
        parameter: Tensor<1>,
        gradient: Tensor<1>,
        rate: f64,
        step: u64,
    ) -> Tensor<1> {
        let AdamUniforms { correction_1, correction_2, .. } = AdamUniforms::new(0..0, 0, rate, step);
        let [beta_1, beta_2] = BETAS;
        let [first, second] =
            self.moments[index].take().unwrap_or_else(|| [gradient.zeros_like(), gradient.zeros_like()]);
        let first = first * beta_1 + gradient.clone() * (1.0 - beta_1);
        let second = second * beta_2 + gradient.square() * (1.0 - beta_2);
        let spread = (second.clone() * correction_2).sqrt() + EPSILON;
        let parameter = parameter - first.clone() * (rate * f64::from(correction_1)) / spread;
        self.moments[index] = Some([first, second]);
        parameter
    }
}
