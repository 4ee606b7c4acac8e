//! Random numbers with a normal distribution.

use glam::DVec3;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

/// A number of mean 0 and standard deviation 1.
pub(super) fn normal(rng: &mut ChaCha8Rng) -> f64 {
    // Box-Muller.
    let (u, v) = (1.0 - rng.random::<f64>(), rng.random::<f64>());
    (-2.0 * u.ln()).sqrt() * (std::f64::consts::TAU * v).cos()
}

/// Numbers of [`truncated_normal`] beyond this many standard deviations are drawn again.
pub(super) const MOST_DEVIATIONS: f64 = 2.0;

/// A number of mean 0, normally distributed with standard deviation 1 within two of them.
pub(super) fn truncated_normal(rng: &mut ChaCha8Rng) -> f64 {
    loop {
        let number = normal(rng);
        if number.abs() <= MOST_DEVIATIONS {
            return number;
        }
    }
}

/// A vector whose components have the standard deviation `sigma`.
pub(super) fn normal_vector(rng: &mut ChaCha8Rng, sigma: f64) -> DVec3 {
    DVec3::new(normal(rng), normal(rng), normal(rng)) * sigma
}
