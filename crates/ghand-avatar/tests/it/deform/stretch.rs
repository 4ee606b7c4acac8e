//! `stretch.wgsl` against `ghand_core::stretch`.

use ghand_core::skinning::ResidualWeights;
use ghand_core::stretch::{LIMITS, stretch};

use crate::deform::hand::{NEIGHBORS, Run, assert_same};
use crate::deform::skin::{of_hand, posed_means};

fn factors(run: &Run) -> Vec<f64> {
    stretch(&NEIGHBORS, &run.points, &posed_means(run))
}

#[test]
fn standard_deviations_and_their_gradients_are_those_of_the_twin() {
    Run::each(|run| {
        let factors = factors(run);
        let times = |values: &[f64]| values.iter().zip(&factors).map(|(v, factor)| v * factor).collect::<Vec<_>>();
        assert_same(run.kind, "posed standard deviations", of_hand(&run.table, 3), &times(&run.scale)[..]);
        assert_same(run.kind, "d standard deviations", &run.d_scale[..], &times(of_hand(&run.d_table, 3))[..]);
    });
}

#[test]
fn some_gaussians_are_at_the_limits_and_some_between() {
    Run::each(|run| {
        let factors = factors(run);
        let has = |wanted: fn(f64) -> bool| factors.iter().any(|factor| wanted(*factor));
        if run.kind.angle > 1.0 {
            assert!(has(|f| f == LIMITS[0]) && has(|f| f == LIMITS[1]) && has(|f| f > LIMITS[0] && f < LIMITS[1]));
        } else if run.kind.weights == ResidualWeights::ZeroSum {
            assert!(factors.iter().all(|f| (f - 1.0).abs() < 1e-3), "nothing moves at rest");
        }
    });
}
