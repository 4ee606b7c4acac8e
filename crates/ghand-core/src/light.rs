//! Light apart from skin: how bright a surface is under distant light, in linear light.
//!
//! Light comes from [`DIRECTION_COUNT`] directions, each with a radiance; a transfer says how much of each arrives at a
//! point: `irradiance_p = sum_k transfer_pk radiance_k`. Under radiance 1 from everywhere an open point has irradiance 1.
//! The cheap variant replaces directions by the nine spherical harmonics of degree at most 2 of the normal.
//!
//! A display value is the power [`DISPLAY_EXPONENT`] of linear light, so that the colour of lit skin is the product of
//! the skin's colour under irradiance 1 and the point's shade, `irradiance^DISPLAY_EXPONENT`.

use glam::DVec3;

use crate::sphere::spiral_direction;

/// Number of light directions, K.
pub const DIRECTION_COUNT: usize = 64;
/// Number of spherical harmonics of degree at most 2.
pub const HARMONIC_COUNT: usize = 9;
/// A display value is linear light to this power.
pub const DISPLAY_EXPONENT: f64 = 1.0 / 2.2;
/// The least irradiance that has a shade of its own: below it display values would be steep, and a least-squares fit
/// with harmonics can be negative.
pub const LEAST_IRRADIANCE: f64 = 1e-3;

/// The directions towards the light, unit length: evenly on the sphere, along a Fibonacci spiral.
pub fn directions() -> [DVec3; DIRECTION_COUNT] {
    std::array::from_fn(|k| spiral_direction(k, DIRECTION_COUNT))
}

/// The part of the light from direction `d` that an unshadowed surface with normal `n` gets (unit vectors).
pub fn cosine_transfer(n: DVec3, d: DVec3) -> f64 {
    // The mean of max(0, n . d) over the sphere is 1/4.
    n.dot(d).max(0.0) * 4.0 / DIRECTION_COUNT as f64
}

/// The spherical harmonics of a unit normal, without their constant factors: 1; x, y, z; xy, yz, zx, x^2 - y^2, 3 z^2 - 1.
pub fn harmonics(n: DVec3) -> [f64; HARMONIC_COUNT] {
    let DVec3 { x, y, z } = n;
    [1.0, x, y, z, x * y, y * z, z * x, x * x - y * y, 3.0 * z * z - 1.0]
}

/// The shade of a point: the factor between its skin's colour under irradiance 1 and its display value.
pub fn shade(irradiance: f64) -> f64 {
    irradiance.max(LEAST_IRRADIANCE).powf(DISPLAY_EXPONENT)
}

/// Linear light of a display value.
pub fn linear(display: f64) -> f64 {
    display.max(0.0).powf(1.0 / DISPLAY_EXPONENT)
}

/// Lit colours, and with them the gradient of the unlit ones: a Gaussian's shade is interpolated from its triangle's
/// corners.
///
/// `shades` holds one RGB per vertex, `corners` the triangle of each Gaussian and `barycentric` its place there; `colors`
/// and the result are `[3][N]`. Since the product is linear in the colour, lighting the gradients of the lit colours gives
/// those of the unlit ones.
pub fn lit(colors: &[f64], corners: &[[u32; 3]], barycentric: &[[f64; 3]], shades: &[[f64; 3]]) -> Vec<f64> {
    let count = corners.len();
    let shade = |channel: usize, p: usize| -> f64 {
        corners[p].iter().zip(barycentric[p]).map(|(v, weight)| weight * shades[*v as usize][channel]).sum()
    };
    colors.iter().enumerate().map(|(i, color)| color * shade(i / count, i % count)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn even_light_gives_every_normal_the_irradiance_1() {
        let all = directions();
        for n in all.iter().chain(&[DVec3::X, DVec3::NEG_Z, DVec3::ONE.normalize()]) {
            let sum: f64 = all.iter().map(|d| cosine_transfer(*n, *d)).sum();
            assert!((sum - 1.0).abs() < 0.01, "{n}: {sum}");
        }
        let mean = all.iter().sum::<DVec3>() / DIRECTION_COUNT as f64;
        assert!(mean.length() < 0.005 && all.iter().all(|d| (d.length() - 1.0).abs() < 1e-12), "{mean}");
    }

    #[test]
    fn harmonics_are_orthogonal_over_the_sphere() {
        let all = directions();
        for a in 0..HARMONIC_COUNT {
            for b in 0..a {
                let product: f64 = all.iter().map(|d| harmonics(*d)[a] * harmonics(*d)[b]).sum();
                assert!(product.abs() / (DIRECTION_COUNT as f64) < 0.02, "{a}, {b}: {product}");
            }
        }
    }

    #[test]
    fn shade_and_linear_light_are_inverse() {
        for value in [0.05, 0.3, 1.0, 1.7] {
            assert!((shade(linear(value)) - value).abs() < 1e-12, "{value}");
        }
        assert!(shade(-1.0) > 0.0 && shade(-1.0) < 0.05);
    }

    #[test]
    fn a_lit_colour_is_the_interpolated_shade_times_the_colour() {
        let shades = [[1.0, 0.5, 0.0], [2.0, 0.5, 1.0], [0.0, 0.5, 2.0]];
        let (corners, barycentric) = ([[0, 1, 2], [2, 1, 0]], [[0.5, 0.25, 0.25], [1.0, 0.0, 0.0]]);
        let lit = lit(&[0.5, 1.0, 0.2, 0.4, 1.0, 0.5], &corners, &barycentric, &shades);
        let wanted = [0.5, 0.0, 0.1, 0.2, 0.75, 1.0];
        assert!(lit.iter().zip(wanted).all(|(a, b)| (a - b).abs() < 1e-12), "{lit:?}");
    }
}
