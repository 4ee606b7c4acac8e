//! The splatter skips contributions below its thresholds.

use crate::common::*;
use ghand_render::reference::project::Gaussian;
use ghand_render::splat::{SplatModel, Thresholds};
use glam::DVec3;

#[test]
fn coarser_alpha_thresholds_agree_with_the_twin() {
    let camera = camera(90, 53);
    check_with_alpha_cut(SplatModel::HAND, 8, &random_scene(1, 2000, 0.001..0.01), &camera, 1.0);
    let scene = general_scene(21, 400, 0.005..0.03, 4);
    check_with_alpha_cut(SplatModel { antialias: true, ..SplatModel::trained(1) }, 4, &scene, &camera, 1.0);
}

#[test]
fn gaussians_at_the_same_depth_but_for_the_dropped_bits_keep_their_order() {
    let camera = camera(24, 16);
    // The first is red and farther away by a part of its distance.
    let red_first = |farther: f64, depth_bits: u32| {
        let [red, green] = [DVec3::X, DVec3::Y];
        let at = |depth: f64| camera.rotation.transpose() * (DVec3::Z * depth - camera.translation);
        let scene =
            [(1.0 + farther, red), (1.0, green)].map(|(part, color)| Gaussian::round(at(part * 0.8), 0.05, 1.0, color));
        let thresholds = Thresholds { depth_bits, ..Thresholds::default() };
        let model = SplatModel::HAND;
        let weights = vec![[0.0; 4]; 24 * 16];
        let image = render_with(&gpu(), model, thresholds, &table(&scene, &model), &camera, 0.9, &weights).image;
        let [r, g, ..] = image.into_iter().max_by(|a, b| (a[0] + a[1]).total_cmp(&(b[0] + b[1]))).unwrap();
        r > g
    };
    assert_eq!([1e-5, 1e-3, 0.3].map(|farther| red_first(farther, 30)), [false; 3]);
    assert_eq!([1e-5, 1e-3, 0.3].map(|farther| red_first(farther, 20)), [true, false, false]);
    assert_eq!([1e-5, 1e-3, 0.3].map(|farther| red_first(farther, 10)), [true, true, false]);
}
