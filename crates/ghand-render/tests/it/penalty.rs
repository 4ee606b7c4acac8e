//! `penalty.wgsl` against `ghand_render::reference::penalty`.

use ghand_render::penalty::Penalty;
use ghand_render::{buffers, reference};

use crate::common::{assert_same, gpu, random, widen};

#[test]
fn a_penalty_is_added_only_to_the_first_gradients() {
    let gpu = gpu();
    let values = random(1, 130, 1.0);
    let gradients = random(2, 130, 1.0);
    let [on_values, on_gradients] = [&values, &gradients].map(|v| buffers::filled(&gpu, "test", v));
    let mut penalty = Penalty::new(&gpu, &on_values, &on_gradients, 100);
    let run = |penalty: &Penalty| {
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        penalty.encode(&mut encoder);
        gpu.queue.submit([encoder.finish()]);
        buffers::read::<f32>(&gpu, &on_gradients, 130).unwrap()
    };
    assert_eq!(run(&penalty), gradients, "a weight of 0 adds nothing");
    penalty.set_weight(&gpu, 0.7);
    let got = run(&penalty);
    let mut twin = widen(&gradients);
    reference::penalty::add_penalty(&widen(&values[..100]), &mut twin[..100], f64::from(0.7f32));
    assert_same("penalty", &widen(&got)[..], &twin);
    assert_eq!(got[100..], gradients[100..]);
}
