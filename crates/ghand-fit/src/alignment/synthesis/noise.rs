//! How far drawn pixels are off where the pose is right, from how far they are off: by some value everywhere, and where the
//! image is steep by a fraction of a pixel, as the avatar's surface is not quite the hand's.

use ghand_core::statistics::median;

use super::samples::Sample;

/// Degrees of freedom of Student's distribution, which bounds the influence of outliers.
const FREEDOM: f64 = 5.0;
/// Before anything is measured: display values, and pixels.
const FIRST: [f64; 2] = [0.03, 0.5];
/// At least, for images of 8 bits and surfaces in millimetres.
const LEAST: [f64; 2] = [0.004, 0.01];
/// Rounds in which both and the weights of outliers settle.
const ROUNDS: usize = 6;

/// Variances of residuals.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Noise {
    /// Everywhere, squared display values.
    pub value: f64,
    /// By squared slope, squared pixels.
    pub place: f64,
}

impl Noise {
    /// The noise of some samples.
    pub fn of(samples: &[Sample]) -> Noise {
        let median = median(samples.iter().map(|sample| sample.squared_slope));
        let mut noise = Noise { value: FIRST[0].powi(2), place: FIRST[1].powi(2) };
        for _ in 0..ROUNDS {
            let [mut value, mut value_weights, mut place, mut place_weights] = [0.0; 4];
            for sample in samples {
                let variance = noise.variance(sample);
                let square = sample.residual.powi(2);
                let weight = noise.weight(sample) * variance;
                if sample.squared_slope <= median {
                    value += weight * (square - noise.place * sample.squared_slope);
                    value_weights += weight;
                } else {
                    // Weighted by what each is expected to say.
                    let weight = weight / variance.powi(2);
                    place += weight * (square - noise.value) * sample.squared_slope;
                    place_weights += weight * sample.squared_slope.powi(2);
                }
            }
            let part = |sum: f64, weights: f64| if weights > 0.0 { sum / weights } else { 0.0 };
            noise = Noise {
                value: part(value, value_weights).max(LEAST[0].powi(2)),
                place: part(place, place_weights).max(LEAST[1].powi(2)),
            };
        }
        noise
    }

    fn variance(&self, sample: &Sample) -> f64 {
        self.value + self.place * sample.squared_slope
    }

    /// One over the variance of a sample's residual, less for outliers.
    pub fn weight(&self, sample: &Sample) -> f64 {
        let variance = self.variance(sample);
        (FREEDOM + 1.0) / (FREEDOM + sample.residual.powi(2) / variance) / variance
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    #[test]
    fn both_parts_of_the_noise_are_found() {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let mut normal = || (0..12).map(|_| rng.random::<f64>() - 0.5).sum::<f64>();
        let samples: Vec<Sample> = (0..40_000)
            .map(|k| {
                // Most of an image is flat; outlines are steep.
                let slope = if k % 5 == 0 { 0.15 } else { 0.002 * f64::from(k % 7) };
                // Every hundredth has nothing to do with the hand.
                let outlier = if k % 100 == 0 { 0.5 } else { 0.0 };
                let residual = 0.01 * normal() + 0.6 * slope * normal() + outlier;
                Sample { face: 0, residual, gradient: DVec3::ZERO, squared_slope: slope * slope }
            })
            .collect();
        let noise = Noise::of(&samples);
        assert!((noise.value.sqrt() / 0.01 - 1.0).abs() < 0.15, "{noise:?}");
        assert!((noise.place.sqrt() / 0.6 - 1.0).abs() < 0.15, "{noise:?}");
        let outlier = Sample { residual: 0.5, ..samples[1] };
        let usual = Sample { residual: 0.0, ..samples[1] };
        assert!(noise.weight(&outlier) < 0.01 * noise.weight(&usual));
    }
}
