//! The comparison of features: unit vectors over the channels, weighted squared differences, mean over the pixels. Maps
//! are `[channels][pixels]`.

use rayon::prelude::*;

/// Added to the length of a feature vector before dividing by it.
const EPSILON: f32 = 1e-10;
/// Pixels per task. Sums are in a fixed order, so that results do not depend on the number of threads.
const TASK_PIXELS: usize = 1024;

/// What a pixel's derivative needs besides its features.
#[derive(Clone, Copy, Default)]
struct Pixel {
    /// One over the length of the features.
    inverse: f32,
    /// One over the length of the truth's features.
    truth_inverse: f32,
    /// What to subtract of the features: the derivative of their length.
    along: f32,
}

/// One compared layer: features, the truth's features, and the linear layer's weights.
pub(super) struct Comparison<'a> {
    pub features: &'a [f32],
    pub truth: &'a [f32],
    pub weights: &'a [f32],
}

impl Comparison<'_> {
    fn pixel_count(&self) -> usize {
        self.features.len() / self.weights.len().max(1)
    }

    /// The mean over the pixels of the weighted squared differences.
    pub fn distance(&self) -> f64 {
        self.pixels().0
    }

    /// The distance and its gradient with respect to the features.
    pub fn distance_and_gradient(&self) -> (f64, Vec<f32>) {
        let (distance, pixels) = self.pixels();
        let count = self.pixel_count();
        let mut gradient = vec![0.0; self.features.len()];
        let rows = self.features.par_chunks(count.max(1)).zip(self.truth.par_chunks(count.max(1)));
        gradient.par_chunks_mut(count.max(1)).zip(rows).zip(self.weights).for_each(|((gradient, (f, t)), weight)| {
            let scale = 2.0 * weight / count as f32;
            for ((gradient, pixel), (f, t)) in gradient.iter_mut().zip(&pixels).zip(f.iter().zip(t)) {
                let difference = f * pixel.inverse - t * pixel.truth_inverse;
                *gradient = scale * difference * pixel.inverse - f * pixel.along;
            }
        });
        (distance, gradient)
    }

    fn pixels(&self) -> (f64, Vec<Pixel>) {
        let count = self.pixel_count();
        let mut pixels = vec![Pixel::default(); count];
        let sums: Vec<f64> = pixels
            .par_chunks_mut(TASK_PIXELS)
            .enumerate()
            .map(|(task, pixels)| self.task(task * TASK_PIXELS, count, pixels))
            .collect();
        (sums.iter().sum::<f64>() / count.max(1) as f64, pixels)
    }

    /// The sum over some pixels, from number `first` on.
    fn task(&self, first: usize, count: usize, pixels: &mut [Pixel]) -> f64 {
        let length = pixels.len();
        let part = |map: &[f32], channel: usize| {
            let start = (channel * count + first).min(map.len());
            start..(start + length).min(map.len())
        };
        let mut squares = vec![[0.0f32; 2]; length];
        for channel in 0..self.weights.len() {
            let range = part(self.features, channel);
            let values = self.features[range.clone()].iter().zip(&self.truth[range]);
            for ([f_sum, t_sum], (f, t)) in squares.iter_mut().zip(values) {
                *f_sum += f * f;
                *t_sum += t * t;
            }
        }
        for (pixel, squares) in pixels.iter_mut().zip(&squares) {
            let [inverse, truth_inverse] = squares.map(|square| 1.0 / (square.sqrt() + EPSILON));
            *pixel = Pixel { inverse, truth_inverse, along: 0.0 };
        }
        let mut sums = vec![0.0f32; length];
        for (channel, weight) in self.weights.iter().enumerate() {
            let range = part(self.features, channel);
            let values = self.features[range.clone()].iter().zip(&self.truth[range]);
            for ((pixel, sum), (f, t)) in pixels.iter_mut().zip(&mut sums).zip(values) {
                let difference = f * pixel.inverse - t * pixel.truth_inverse;
                *sum += weight * difference * difference;
                pixel.along += weight * difference * f;
            }
        }
        for (pixel, [square, _]) in pixels.iter_mut().zip(&squares) {
            // Features that are all zero have no direction; the ReLU behind them passes no gradient either.
            let length = square.sqrt();
            // In this order no factor is infinite, however small the features are.
            let cosine = if length > 0.0 { pixel.along / length } else { 0.0 };
            pixel.along = 2.0 / count as f32 * cosine * pixel.inverse * pixel.inverse;
        }
        sums.iter().map(|sum| f64::from(*sum)).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gradients_of_tiny_features_are_finite() {
        let truth = [1.0, 0.5, 0.25, 2.0];
        let weights = [1.0, 0.5];
        for exponent in -44..1 {
            let features: Vec<f32> = [1.0f64, 3.0, 2.0, 0.0].map(|f| (f * 10f64.powi(exponent)) as f32).to_vec();
            let (distance, gradient) =
                Comparison { features: &features, truth: &truth, weights: &weights }.distance_and_gradient();
            assert!(distance.is_finite() && gradient.iter().all(|g| g.is_finite()), "1e{exponent}: {gradient:?}");
        }
    }
}
