//! `skin.wgsl` and `skin_backward.wgsl` against `ghand_core::skinning`, and the hand's place in the splatter's table.

use ghand_core::skeleton::Affine;
use ghand_core::skinning::{ResidualWeights, Skinning, skin, skin_vjp};
use glam::DVec3;

use crate::deform::hand::{COUNT, JOINTS, PLACE, Run, assert_same, planes};

/// Skinning by the device's bones: the mean or translation is already subtracted from the residual ones, and
/// subtracting it again changes nothing.
pub fn skinning(run: &Run) -> Skinning<'_> {
    Skinning {
        rest: &run.points,
        weights: &run.weights,
        residual_weights: &run.residual_weights,
        bones: &run.chain.posed_from_rest,
        residual_bones: &run.residual_bones,
        translation: run.pose.translation,
        mode: run.kind.weights,
    }
}

pub fn of_hand(table: &[f64], row: usize) -> &[f64] {
    &table[row * PLACE.columns + PLACE.first..][..COUNT]
}

/// As the device has them.
pub fn posed_means(run: &Run) -> Vec<DVec3> {
    planes(&[0, 1, 2].map(|row| of_hand(&run.table, row)).concat(), COUNT)
}

#[test]
fn posed_means_equal_those_of_the_twin_and_are_in_the_hands_columns() {
    Run::each(|run| {
        let t = &run.table;
        assert_same(run.kind, "posed means", &posed_means(run)[..], &skin(&skinning(run)));
        assert_eq!([of_hand(t, 4), of_hand(t, 5), of_hand(t, 6)].concat(), run.color);
        for row in t.chunks_exact(PLACE.columns) {
            let outside = row[..PLACE.first].iter().chain(&row[PLACE.first + COUNT..]);
            assert!(outside.clone().count() == PLACE.columns - COUNT);
            assert!(outside.copied().all(|v| v == 0.0), "another hand's part of the table was changed");
        }
    });
}

#[test]
fn gradients_of_points_weights_and_colors_equal_those_of_the_twin() {
    Run::each(|run| {
        let d = skin_vjp(&skinning(run), &run.d_posed);
        assert_same(run.kind, "d points", &run.d_points[..], &d.rest);
        assert_same(run.kind, "d residual weights", &run.d_residual_weights[..], &d.residual_weights);
        assert_same(run.kind, "d bones", &run.d_bones(&run.weights)[..], &d.bones);
        assert_eq!(run.d_color, [4, 5, 6].map(|row| of_hand(&run.d_table, row)).concat());
    });
}

#[test]
fn subtracting_twice_from_residual_bones_changes_nothing() {
    Run::each(|run| {
        let bones = &run.residual_bones;
        let left = match run.kind.weights {
            ResidualWeights::ZeroSum => bones.iter().fold(Affine::ZERO, |sum, b| sum.add_scaled(1.0, b)).translation,
            ResidualWeights::Paper => bones[0].translation,
        };
        assert!(left.abs().cmple(DVec3::splat(1e-6)).all() && bones.len() == JOINTS, "{left}");
    });
}
