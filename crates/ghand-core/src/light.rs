//! Light apart from skin: how bright a surface is under light, in linear light.
//!
//! Light comes from [`DIRECTION_COUNT`] directions, each with a radiance; a transfer says how much of each arrives at a
//! point: `irradiance_p = sum_k transfer_pk radiance_k`. Under radiance 1 from everywhere an open point has irradiance 1.
//! The cheap variant replaces directions by the nine spherical harmonics of degree at most 2 of the normal.
//!
//! A display value is the power [`DISPLAY_EXPONENT`] of linear light, so that the colour of lit skin is the product of
//! the skin's colour under irradiance 1 and the point's shade, `irradiance^DISPLAY_EXPONENT`. What the skin's surface
//! mirrors, its gloss, is added in linear light: `gloss_p = strength_p sum_k transfer_pk radiance_k mirrored_pk`.

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

/// Reflectance of skin that is looked at head-on.
const HEAD_ON_REFLECTANCE: f64 = 0.028;

/// The part of the light from direction `d` that a rough surface with normal `n` mirrors towards `v`, as a factor on what
/// white skin would show of it (unit vectors; `roughness` above 0, at most 1). 0 if either is behind the surface.
///
/// The GGX distribution of facets with correlated masking and Schlick's Fresnel term, whose value at grazing angles is
/// 1 - roughness, times pi.
pub fn mirrored(n: DVec3, d: DVec3, v: DVec3, roughness: f64) -> f64 {
    let (to_light, to_eye) = (n.dot(d), n.dot(v));
    if !(to_light > 0.0 && to_eye > 0.0) {
        return 0.0;
    }
    let half = (d + v).normalize_or_zero();
    let squared = roughness.powi(4);
    let peak = n.dot(half).powi(2) * (squared - 1.0) + 1.0;
    let masked = |a: f64, b: f64| a * (b * b * (1.0 - squared) + squared).sqrt();
    let masking = 0.5 / (masked(to_light, to_eye) + masked(to_eye, to_light));
    // Rough skin is no mirror at grazing angles either.
    let grazing = (1.0 - roughness).max(HEAD_ON_REFLECTANCE);
    let fresnel = HEAD_ON_REFLECTANCE + (grazing - HEAD_ON_REFLECTANCE) * (1.0 - v.dot(half)).clamp(0.0, 1.0).powi(5);
    squared / (peak * peak) * masking * fresnel
}

/// A display value with gloss (linear light) added. Skin is not darker than black.
pub fn with_gloss(display: f64, gloss: f64) -> f64 {
    if gloss > 0.0 { (linear(display) + gloss).powf(DISPLAY_EXPONENT) } else { display }
}

/// The derivative of [`with_gloss`] to the display value.
pub fn with_gloss_vjp(display: f64, gloss: f64) -> f64 {
    if gloss > 0.0 {
        let power = 1.0 / DISPLAY_EXPONENT - 1.0;
        (display.max(0.0) / with_gloss(display, gloss)).powf(power)
    } else {
        1.0
    }
}

/// What falls on the vertices of a mesh, on which Gaussians lie: values are interpolated from a triangle's corners.
#[derive(Debug, Clone, Copy)]
pub struct SurfaceLight<'a> {
    /// The triangle of each Gaussian.
    pub corners: &'a [[u32; 3]],
    /// Its place there.
    pub barycentric: &'a [[f64; 3]],
    /// One RGB per vertex.
    pub shades: &'a [[f64; 3]],
    /// Linear RGB per vertex; empty without gloss.
    pub gloss: &'a [[f64; 3]],
}

impl SurfaceLight<'_> {
    /// Shade and gloss of number `i` of the colours, `[3][N]`.
    fn at(&self, i: usize) -> [f64; 2] {
        let channel = i / self.corners.len();
        let p = i % self.corners.len();
        let at = |values: &[[f64; 3]]| -> f64 {
            let corners = self.corners[p].iter().zip(self.barycentric[p]);
            corners.map(|(v, weight)| weight * values.get(*v as usize).map_or(0.0, |rgb| rgb[channel])).sum()
        };
        [at(self.shades), at(self.gloss)]
    }
}

/// Lit colours from unlit ones, both `[3][N]`.
pub fn lit(colors: &[f64], surface: &SurfaceLight<'_>) -> Vec<f64> {
    let lit = |(i, color): (usize, &f64)| {
        let [shade, gloss] = surface.at(i);
        with_gloss(color * shade, gloss)
    };
    colors.iter().enumerate().map(lit).collect()
}

/// The gradient of the unlit colours from that of the lit ones, both `[3][N]`.
pub fn lit_vjp(colors: &[f64], surface: &SurfaceLight<'_>, d_lit: &[f64]) -> Vec<f64> {
    let d_color = |(i, (color, d)): (usize, (&f64, &f64))| {
        let [shade, gloss] = surface.at(i);
        d * shade * with_gloss_vjp(color * shade, gloss)
    };
    colors.iter().zip(d_lit).enumerate().map(d_color).collect()
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
        let corners = [[0, 1, 2], [2, 1, 0]];
        let barycentric = [[0.5, 0.25, 0.25], [1.0, 0.0, 0.0]];
        let surface = SurfaceLight { corners: &corners, barycentric: &barycentric, shades: &shades, gloss: &[] };
        let lit = lit(&[0.5, 1.0, 0.2, 0.4, 1.0, 0.5], &surface);
        let wanted = [0.5, 0.0, 0.1, 0.2, 0.75, 1.0];
        assert!(lit.iter().zip(wanted).all(|(a, b)| (a - b).abs() < 1e-12), "{lit:?}");
    }

    #[test]
    fn the_derivative_of_lit_colours_is_that_of_finite_differences() {
        let shades = [[1.0, 0.5, 0.2], [1.5, 0.5, 1.0], [0.1, 0.5, 1.2]];
        let gloss = [[0.1, 0.2, 0.3], [0.0, 0.0, 0.0], [0.05, 0.0, 1.0]];
        let corners = [[0, 1, 2], [1, 1, 1]];
        let barycentric = [[0.5, 0.25, 0.25], [1.0, 0.0, 0.0]];
        let surface = SurfaceLight { corners: &corners, barycentric: &barycentric, shades: &shades, gloss: &gloss };
        let colors = [0.5, 0.9, 0.2, 0.4, 1.0, 0.03];
        let d_lit = [0.3, -1.0, 0.7, 0.2, -0.4, 1.1];
        let loss = |colors: &[f64]| -> f64 { lit(colors, &surface).iter().zip(d_lit).map(|(c, d)| c * d).sum() };
        for (i, d) in lit_vjp(&colors, &surface, &d_lit).into_iter().enumerate() {
            let moved = |by: f64| {
                let mut moved = colors;
                moved[i] += by;
                loss(&moved)
            };
            let difference = (moved(1e-6) - moved(-1e-6)) / 2e-6;
            assert!((d - difference).abs() < 1e-8, "{i}: {d}, {difference}");
        }
    }

    #[test]
    fn a_mirror_shows_a_lamp_where_it_is_and_takes_no_more_than_there_is() {
        let n = DVec3::Z;
        let at = |angle: f64| DVec3::new(angle.sin(), 0.0, angle.cos());
        for roughness in [0.45, 0.55, 0.7] {
            let seen = |angle: f64| mirrored(n, at(-0.5), at(angle), roughness);
            assert!(seen(0.5) > 1.2 * seen(0.1) && seen(0.5) > 1.2 * seen(-0.5), "{roughness}");
            assert_eq!(seen(1.7), 0.0);
            // Light goes both ways.
            let back = mirrored(n, at(0.3), at(-0.5), roughness);
            assert!((seen(0.3) - back).abs() < 1e-12);
            // White light from everywhere: no more than a few percent are mirrored, more at a grazing angle.
            let all = |v: DVec3| -> f64 {
                directions().iter().map(|d| cosine_transfer(n, *d) * mirrored(n, *d, v, roughness)).sum()
            };
            assert!((0.01..0.06).contains(&all(at(0.2))), "{roughness}: {}", all(at(0.2)));
            assert!((all(at(0.2))..0.4).contains(&all(at(1.3))), "{roughness}: {}", all(at(1.3)));
        }
    }

    #[test]
    fn gloss_is_added_in_linear_light() {
        assert!((with_gloss(shade(0.3), 0.2) - shade(0.5)).abs() < 1e-12);
        assert_eq!((with_gloss(0.4, 0.0), with_gloss_vjp(0.4, 0.0)), (0.4, 1.0));
        assert!((with_gloss(0.0, 0.1) - shade(0.1)).abs() < 1e-12 && with_gloss_vjp(0.0, 0.1) == 0.0);
    }
}
