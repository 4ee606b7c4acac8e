//! What a camera makes of the light: exposure, white balance, noise, 8 bits.

use glam::Vec3;
use rayon::prelude::*;

use crate::errors::exposures::exposures;

/// Standard deviation of the cameras' exposures, of display values; each channel has a third of it in addition.
const EXPOSURE_NOISE: f64 = 0.10;
/// Exposure on average: a little below that at which light skin is white.
const EXPOSURE: f64 = 0.9;
/// Standard deviation of the noise of black, and of white beside that, in display values.
const DARK_NOISE: f32 = 0.008;
const SHOT_NOISE: f32 = 0.022;

/// The sensor of one camera.
#[derive(Debug, Clone)]
pub(crate) struct Sensor {
    gains: Vec3,
    seed: u64,
}

impl Sensor {
    /// The sensors of all cameras.
    pub(crate) fn all(count: usize, seed: u64) -> Vec<Sensor> {
        let gains = exposures(count, EXPOSURE_NOISE, seed ^ 0x5E2).into_iter();
        let sensor = |(gains, camera): ([f64; 3], u64)| Sensor {
            gains: Vec3::from_array(gains.map(|gain| (EXPOSURE * gain) as f32)),
            seed: seed ^ (camera << 32),
        };
        gains.zip(0..).map(sensor).collect()
    }

    /// Red, green and blue of a frame's pixels from their display colours.
    pub(crate) fn record(&self, light: &[Vec3], frame: usize) -> Vec<u8> {
        let frame_seed = mixed(self.seed ^ ((frame as u64) << 40));
        let pixel = |(i, color): (usize, &Vec3)| {
            let value = *color * self.gains;
            let noise = Vec3::from_array(std::array::from_fn(|channel| {
                normal(mixed(frame_seed.wrapping_add(4 * i as u64 + channel as u64)))
            }));
            let deviation = value.map(|v| (DARK_NOISE * DARK_NOISE + SHOT_NOISE * SHOT_NOISE * v.max(0.0)).sqrt());
            (value + deviation * noise).to_array().map(|v| (255.0 * v).round().clamp(0.0, 255.0) as u8)
        };
        let pixels: Vec<[u8; 3]> = light.par_iter().enumerate().map(pixel).collect();
        pixels.into_flattened()
    }
}

/// SplitMix64's finaliser: bits that look random.
fn mixed(seed: u64) -> u64 {
    let h = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15);
    let h = (h ^ (h >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    let h = (h ^ (h >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    h ^ (h >> 31)
}

/// A number of mean 0 and standard deviation 1 from random bits, nearly normal: the sum of four even ones.
fn normal(bits: u64) -> f32 {
    let sum: f32 = (0..4).map(|k| ((bits >> (16 * k)) & 0xFFFF) as f32 / 65_536.0).sum();
    // Each has a variance of 1/12.
    (sum - 2.0) * 3f32.sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sensors_differ_in_colour_and_have_noise_of_the_given_size() {
        let sensors = Sensor::all(3, 5);
        let grey = vec![Vec3::splat(0.5); 40_000];
        let means = |rgb: &[u8]| -> [f64; 3] {
            std::array::from_fn(|c| rgb.iter().skip(c).step_by(3).map(|v| f64::from(*v)).sum::<f64>() / 40_000.0)
        };
        let [a, b] = [0, 1].map(|k| means(&sensors[k].record(&grey, 0)));
        assert!((0..3).any(|c| (a[c] - b[c]).abs() > 3.0), "{a:?} {b:?}");
        let first = sensors[0].record(&grey, 0);
        assert!(first == sensors[0].record(&grey, 0) && first != sensors[0].record(&grey, 1));
        let squares = first.iter().step_by(3).map(|v| (f64::from(*v) - a[0]).powi(2)).sum::<f64>() / 40_000.0;
        let expected = 255.0 * f64::from(DARK_NOISE.powi(2) + SHOT_NOISE.powi(2) * (a[0] as f32 / 255.0)).sqrt();
        // Rounding adds 0.29.
        assert!((squares.sqrt() - expected).abs() < 0.1, "{} {expected}", squares.sqrt());
    }
}
