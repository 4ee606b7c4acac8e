//! Smooth noise in space, identical on every machine.

use glam::DVec3;

/// A number in `[0, 1)` for a cell of the integer lattice.
pub(super) fn lattice(x: i64, y: i64, z: i64, seed: u64) -> f64 {
    // SplitMix64's finaliser over a mix of the coordinates by large odd numbers.
    let mut h = seed
        ^ (x as u64).wrapping_mul(0x9E37_79B9_7F4A_7C15)
        ^ (y as u64).wrapping_mul(0xC2B2_AE3D_27D4_EB4F)
        ^ (z as u64).wrapping_mul(0x1656_67B1_9E37_79F9);
    h = (h ^ (h >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    h = (h ^ (h >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    ((h ^ (h >> 31)) >> 11) as f64 / (1u64 << 53) as f64
}

/// Value noise in `[-1, 1]` with features of about `size` (the unit of `p`).
pub(super) fn noise(p: DVec3, size: f64, seed: u64) -> f64 {
    let q = p / size;
    let base = q.to_array().map(floor);
    let f = q - DVec3::from(base.map(|v| v as f64));
    let f = f * f * (DVec3::splat(3.0) - 2.0 * f);
    let [x, y, z] = base;
    let parts = f.to_array().map(|t| [1.0 - t, t]);
    let mut sum = 0.0;
    for corner in 0..8 {
        let [dx, dy, dz] = [corner & 1, corner >> 1 & 1, corner >> 2 & 1];
        let part = parts[0][dx] * parts[1][dy] * parts[2][dz];
        sum += part * lattice(x + dx as i64, y + dy as i64, z + dz as i64, seed);
    }
    2.0 * sum - 1.0
}

/// The largest whole number that is not above `v`; faster than the one of the platform's library.
fn floor(v: f64) -> i64 {
    let near = v as i64;
    near - i64::from(near as f64 > v)
}

/// Three octaves of [`noise`], in `[-1, 1]`, the largest of `size`.
pub(super) fn fractal(p: DVec3, size: f64, seed: u64) -> f64 {
    (4.0 * noise(p, size, seed) + 2.0 * noise(p, size * 0.5, seed + 1) + noise(p, size * 0.25, seed + 2)) / 7.0
}

/// 0 below `low`, 1 above `high`, smooth between.
pub(super) fn smoothstep(low: f64, high: f64, x: f64) -> f64 {
    let t = ((x - low) / (high - low)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// 1 at 0, falling off over `width`.
pub(super) fn bump(x: f64, width: f64) -> f64 {
    (-(x / width).powi(2)).exp()
}
