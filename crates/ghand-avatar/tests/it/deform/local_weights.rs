//! `local_weights.wgsl` against `ghand_core::skinning::make_local`.

use ghand_avatar::deform::LocalWeights;
use ghand_core::skinning::make_local;
use ghand_render::buffers;
use ghand_render::pipeline::compute_pass;

use crate::deform::hand::{assert_same, gpu, kinds, random, widen};

const COUNT: usize = 130;
const JOINTS: usize = 5;

#[test]
fn residual_weights_are_those_of_the_joints_that_move_a_gaussian_and_sum_to_zero() {
    let gpu = gpu();
    let values = random(1, JOINTS * COUNT, 1.0);
    // About half of the joints move a Gaussian; the last one is moved by none, the one before by one.
    let mut weights: Vec<f32> = random(2, JOINTS * COUNT, 1.0).into_iter().map(|weight| weight.max(0.0)).collect();
    for k in 0..JOINTS {
        weights[k * COUNT + COUNT - 1] = 0.0;
        weights[k * COUNT + COUNT - 2] = if k == 3 { 1.0 } else { 0.0 };
    }
    let [on_values, on_weights] = [&values, &weights].map(|v| buffers::filled(&gpu, "test", v));
    let stage = LocalWeights::new(&gpu, &on_weights, &on_values, JOINTS, COUNT);
    let run = || {
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        stage.encode(&mut compute_pass(&mut encoder, "test"));
        gpu.queue.submit([encoder.finish()]);
        widen(&buffers::read::<f32>(&gpu, &on_values, JOINTS * COUNT).unwrap())
    };
    let got = run();
    let mut twin = widen(&values);
    make_local(&widen(&weights), &mut twin, COUNT);
    assert_same(kinds()[0], "local weights", &got[..], &twin);
    for p in 0..COUNT {
        let of_point = || (0..JOINTS).map(|k| k * COUNT + p);
        assert!(of_point().map(|i| got[i]).sum::<f64>().abs() < 1e-6);
        assert!(of_point().all(|i| weights[i] > 0.0 || got[i] == 0.0));
        assert!(p < COUNT - 2 || of_point().all(|i| got[i] == 0.0));
    }
    // A projection.
    let again = run();
    assert!(again.iter().zip(&got).all(|(a, b)| (a - b).abs() < 1e-6));
}
