//! Exposure and white balance of the training cameras, which no two cameras have exactly alike.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use crate::normal::normal;

/// Factors on the display values of each camera: all 1 without noise.
pub(crate) fn exposures(cameras: usize, noise: f64, seed: u64) -> Vec<[f64; 3]> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed ^ 0xE4905);
    let mut of_camera = || {
        let exposure = normal(&mut rng) * noise;
        [0; 3].map(|_| (exposure + normal(&mut rng) * noise / 3.0).exp())
    };
    (0..cameras).map(|_| of_camera()).collect()
}
