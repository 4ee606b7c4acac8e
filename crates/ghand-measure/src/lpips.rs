//! LPIPS (Zhang et al. 2018), version 0.1: how different two pictures look, from the features of AlexNet, which was
//! trained to recognise objects. The weights come with the program, or from a file of `scripts/lpips_weights.py`.
//!
//! Both pictures go through AlexNet. Behind each convolution the features of each pixel are made unit vectors over the
//! channels; their squared differences, times a weight for each channel, are averaged over the pixels and summed over
//! the convolutions.

mod alexnet;
mod convolution;
mod head;
mod network;
mod pair;
mod pool;
#[cfg(test)]
mod tests;
mod weights;

use std::path::Path;

pub use pair::{BACKBONE, LpipsError, Pair, SMALLEST_SIDE};
pub use weights::LpipsFileError;

use head::Comparison;
use network::{Features, Network};
use weights::Weights;

/// AlexNet with its linear layers.
#[derive(Debug)]
pub struct Lpips {
    network: Network,
    /// A weight per channel of each compared layer.
    linear: Vec<Vec<f32>>,
}

impl Lpips {
    /// With the published weights, which come with the program. The convolutions' are half floats, which changes
    /// distances by less than a thousandth.
    ///
    /// # Errors
    /// [`LpipsFileError`] if the program is damaged.
    pub fn built_in() -> Result<Lpips, LpipsFileError> {
        Weights::built_in().map(Lpips::new)
    }

    /// Reads a safetensors file with AlexNet's convolutions under torchvision's names (`features.0.weight`,
    /// `[outputs][inputs][kernel][kernel]`; `features.0.bias`; ...) and a linear layer for each (`linear.0`,
    /// `[channels]`; ...), F32 or F16. If its metadata has `lpips_backbone`, it must be [`BACKBONE`].
    ///
    /// # Errors
    /// [`LpipsFileError`] names the file, the tensor and what is wrong with it.
    pub fn load(path: &Path) -> Result<Lpips, LpipsFileError> {
        Weights::load(path).map(Lpips::new)
    }

    fn new(weights: Weights) -> Lpips {
        Lpips { network: Network::new(&weights), linear: weights.linear }
    }

    /// Whether images of this size are large enough.
    ///
    /// # Errors
    /// [`LpipsError::TooSmall`] if they are not.
    pub fn check_size(&self, [width, height]: [u32; 2]) -> Result<(), LpipsError> {
        match width.min(height) < SMALLEST_SIDE {
            true => Err(LpipsError::TooSmall { width, height }),
            false => Ok(()),
        }
    }

    /// The distances of several pictures from one truth, 0 if they are equal. That costs less than one after the other.
    ///
    /// # Errors
    /// [`LpipsError`] if the pictures are too small or not of their size.
    pub fn distances<const N: usize>(
        &self,
        size: [u32; 2],
        pictures: [&[[f32; 3]]; N],
        truth: &[[f32; 3]],
    ) -> Result<[f64; N], LpipsError> {
        let truth = self.features(size, truth)?;
        let mut distances = [0.0; N];
        for (distance, picture) in distances.iter_mut().zip(pictures) {
            let features = self.features(size, picture)?;
            *distance = self.comparisons(&features, &truth).map(|comparison| comparison.distance()).sum();
        }
        Ok(distances)
    }

    /// The distance of two pictures, and its gradient with respect to the display values of the first.
    ///
    /// # Errors
    /// As [`Lpips::distances`].
    pub fn distance_and_gradient(&self, pair: &Pair) -> Result<(f64, Vec<[f32; 3]>), LpipsError> {
        let &Pair { size, picture, truth } = pair;
        let (features, truth) = rayon::join(|| self.features(size, picture), || self.features(size, truth));
        let (features, truth) = (features?, truth?);
        let distance = self.comparisons(&features, &truth).map(|comparison| comparison.distance()).sum();
        let gradients = self.comparisons(&features, &truth).map(|comparison| comparison.gradient()).collect();
        Ok((distance, self.network.gradient(&features, gradients)))
    }

    /// What the layers compare.
    fn comparisons<'a>(&'a self, features: &'a Features, truth: &'a Features) -> impl Iterator<Item = Comparison<'a>> {
        let pairs = features.compared().zip(truth.compared()).zip(&self.linear);
        pairs.map(|((features, truth), weights)| Comparison { features, truth, weights })
    }

    fn features(&self, size: [u32; 2], picture: &[[f32; 3]]) -> Result<Features, LpipsError> {
        self.check_size(size)?;
        let [width, height] = size.map(|side| side as usize);
        if picture.len() != width * height {
            return Err(LpipsError::Size { width, height, pixels: picture.len() });
        }
        Ok(self.network.features([width, height], picture))
    }
}
