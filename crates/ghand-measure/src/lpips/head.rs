//! The comparison of features: unit vectors over the channels, weighted squared differences, mean over the pixels. Maps
//! are `[pixels][channels]`.

use rayon::prelude::*;

/// Added to the length of a feature vector before dividing by it.
const EPSILON: f32 = 1e-10;
/// Pixels per task. Sums are in a fixed order, so that results do not depend on the number of threads.
const TASK_PIXELS: usize = 256;

/// One compared layer: features, the truth's features, and the linear layer's weights.
pub(super) struct Comparison<'a> {
    pub features: &'a [f32],
    pub truth: &'a [f32],
    pub weights: &'a [f32],
}

/// One over the length of a feature vector.
fn inverse_length(features: &[f32]) -> f32 {
    1.0 / (features.iter().map(|f| f * f).sum::<f32>().sqrt() + EPSILON)
}

impl Comparison<'_> {
    fn channels(&self) -> usize {
        self.weights.len().max(1)
    }

    fn pixel_count(&self) -> usize {
        self.features.len() / self.channels()
    }

    /// The mean over the pixels of the weighted squared differences.
    pub fn distance(&self) -> f64 {
        let channels = self.channels();
        let tasks = self.features.par_chunks(TASK_PIXELS * channels).zip(self.truth.par_chunks(TASK_PIXELS * channels));
        let sums: Vec<f64> = tasks
            .map(|(features, truth)| {
                let pixels = features.chunks_exact(channels).zip(truth.chunks_exact(channels));
                pixels.map(|(f, t)| f64::from(self.pixel(f, t).0)).sum()
            })
            .collect();
        sums.iter().sum::<f64>() / self.pixel_count().max(1) as f64
    }

    /// The distance of a pixel, and the sum over the channels of weighted difference times feature.
    fn pixel(&self, features: &[f32], truth: &[f32]) -> (f32, f32) {
        let [inverse, truth_inverse] = [features, truth].map(inverse_length);
        let channels = features.iter().zip(truth).zip(self.weights);
        channels.fold((0.0, 0.0), |(distance, along), ((f, t), weight)| {
            let difference = f * inverse - t * truth_inverse;
            (distance + weight * difference * difference, along + weight * difference * f)
        })
    }

    /// The gradient of the distance with respect to the features.
    pub fn gradient(&self) -> Vec<f32> {
        let channels = self.channels();
        let scale = 2.0 / self.pixel_count().max(1) as f32;
        let mut gradient = vec![0.0; self.features.len()];
        let pixels = self.features.par_chunks_exact(channels).zip(self.truth.par_chunks_exact(channels));
        gradient.par_chunks_exact_mut(channels).zip(pixels).for_each(|(gradient, (features, truth))| {
            let [inverse, truth_inverse] = [features, truth].map(inverse_length);
            let (_, along) = self.pixel(features, truth);
            // Features that are all zero have no direction; the ReLU behind them passes no gradient either.
            let length = features.iter().map(|f| f * f).sum::<f32>().sqrt();
            // In this order no factor is infinite, however small the features are.
            let cosine = if length > 0.0 { along / length } else { 0.0 };
            let along = scale * cosine * inverse * inverse;
            for ((gradient, (f, t)), weight) in gradient.iter_mut().zip(features.iter().zip(truth)).zip(self.weights) {
                let difference = f * inverse - t * truth_inverse;
                *gradient = scale * weight * difference * inverse - f * along;
            }
        });
        gradient
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gradients_of_tiny_features_are_finite() {
        let truth = [1.0, 0.25, 0.5, 2.0];
        let weights = [1.0, 0.5];
        for exponent in -44..1 {
            let features: Vec<f32> = [1.0f64, 2.0, 3.0, 0.0].map(|f| (f * 10f64.powi(exponent)) as f32).to_vec();
            let comparison = Comparison { features: &features, truth: &truth, weights: &weights };
            let gradient = comparison.gradient();
            assert!(
                comparison.distance().is_finite() && gradient.iter().all(|g| g.is_finite()),
                "1e{exponent}: {gradient:?}"
            );
        }
    }
}
