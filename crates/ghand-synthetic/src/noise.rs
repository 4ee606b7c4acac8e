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
    let base = q.floor();
    let f = q - base;
    let f = f * f * (DVec3::splat(3.0) - 2.0 * f);
    let [x, y, z] = base.to_array().map(|v| v as i64);
    let mut sum = 0.0;
    for corner in 0..8 {
        let (dx, dy, dz) = (corner & 1, corner >> 1 & 1, corner >> 2 & 1);
        let part = |d: i64, t: f64| if d == 1 { t } else { 1.0 - t };
        sum += part(dx, f.x) * part(dy, f.y) * part(dz, f.z) * lattice(x + dx, y + dy, z + dz, seed);
    }
    2.0 * sum - 1.0
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
