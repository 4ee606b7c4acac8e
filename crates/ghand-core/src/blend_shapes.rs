//! Hand Gaussian Blend Shapes (paper eq. 7 and 8): offsets as products of bases and coefficients.

use glam::DVec3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::parallel::CHUNK;

/// The number of components of a blend coefficient.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum CoefficientLayout {
    /// One per basis and Gaussian: `[n][N]`.
    #[default]
    PerBasis,
    /// One per component of a basis, as in the paper (eq. 7): `[n][3][N]`.
    PerComponent,
}

impl CoefficientLayout {
    /// Numbers of a coefficient: rows of the coefficients of one basis.
    pub fn rows(self) -> usize {
        match self {
            CoefficientLayout::PerBasis => 1,
            CoefficientLayout::PerComponent => 3,
        }
    }
}

/// Offsets `Delta = sum_i C_i (.) S_i` (metres) of N Gaussians.
///
/// `shape_basis` is `[n][N]` (metres), `blend_coefficients` `[n][N]` (no unit, one per component), both basis-major.
/// Their lengths must be equal and a multiple of `count` = N.
///
/// ```
/// use ghand_core::blend_shapes::blend_shapes;
/// use glam::DVec3;
///
/// // Two bases of one Gaussian.
/// let basis = [DVec3::X, DVec3::Y];
/// let coefficients = [DVec3::splat(2.0), DVec3::splat(3.0)];
/// assert_eq!(blend_shapes(&basis, &coefficients, 1), [DVec3::new(2.0, 3.0, 0.0)]);
/// ```
pub fn blend_shapes(shape_basis: &[DVec3], blend_coefficients: &[DVec3], count: usize) -> Vec<DVec3> {
    let mut offsets = vec![DVec3::ZERO; count];
    offsets.par_chunks_mut(CHUNK).enumerate().for_each(|(chunk, offsets)| {
        let products = shape_basis.chunks_exact(count).zip(blend_coefficients.chunks_exact(count));
        for (basis, coefficients) in products {
            let first = chunk * CHUNK;
            for ((offset, s), c) in offsets.iter_mut().zip(&basis[first..]).zip(&coefficients[first..]) {
                *offset += *c * *s;
            }
        }
    });
    offsets
}

/// dL/dS and dL/dC (in that order, shaped like the inputs) from dL/dDelta.
pub fn blend_shapes_vjp(
    shape_basis: &[DVec3],
    blend_coefficients: &[DVec3],
    d_offsets: &[DVec3],
) -> (Vec<DVec3>, Vec<DVec3>) {
    let count = d_offsets.len();
    let product = |values: &[DVec3]| {
        values.par_iter().enumerate().with_min_len(CHUNK).map(|(j, v)| *v * d_offsets[j % count]).collect()
    };
    (product(blend_coefficients), product(shape_basis))
}
