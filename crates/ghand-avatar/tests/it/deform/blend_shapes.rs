//! `blend_shapes.wgsl` against `ghand_core::blend_shapes`, with both layouts of the coefficients.

use ghand_avatar::deform::CoefficientLayout;
use ghand_core::blend_shapes::{blend_shapes, blend_shapes_vjp};

use crate::deform::hand::{COUNT, Run, assert_same, planes};

#[test]
fn offsets_and_points_equal_those_of_the_twin() {
    Run::each(|run| {
        let offsets = blend_shapes(&run.shape_basis, &run.coefficients, COUNT);
        assert_same(run.kind, "offsets", &run.offsets[..], &offsets);
        let points: Vec<_> = run.rest.iter().zip(&offsets).map(|(x, offset)| *x + *offset).collect();
        assert_same(run.kind, "points", &run.points[..], &points);
    });
}

#[test]
fn gradients_of_bases_and_coefficients_equal_those_of_the_twin() {
    Run::each(|run| {
        let (d_basis, d_coefficients) = blend_shapes_vjp(&run.shape_basis, &run.coefficients, &run.d_offsets);
        assert_same(run.kind, "d shape basis", &run.d_shape_basis[..], &d_basis);
        match run.kind.coefficients {
            CoefficientLayout::PerComponent => {
                assert_same(run.kind, "d coefficients", &planes(&run.d_coefficients, COUNT)[..], &d_coefficients);
            }
            // One number applies to all three components.
            CoefficientLayout::PerBasis => {
                let sums: Vec<f64> = d_coefficients.iter().map(|d| d.element_sum()).collect();
                assert_same(run.kind, "d coefficients", &run.d_coefficients[..], &sums);
            }
        }
    });
}
