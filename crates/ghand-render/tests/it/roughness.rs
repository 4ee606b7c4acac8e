//! `roughness.wgsl` against `ghand_render::reference::roughness`, and that against differences of the penalty.

use ghand_render::buffers;
use ghand_render::reference::roughness::{add_roughness, roughness};
use ghand_render::roughness::Roughness;

use crate::common::{assert_same, gpu, random, widen};

const COUNT: usize = 100;
const ROWS: usize = 3;
const WEIGHT: f32 = 0.7;
const WIDTH: f32 = 0.3;

/// A ring with a gap: each has its neighbours to the left and right, and a missing one.
fn ring() -> Vec<u32> {
    let n = COUNT as u32;
    let left = (0..n).map(|p| if p == 0 { p } else { p - 1 });
    let right = (0..n).map(|p| if p + 1 == n { p } else { p + 1 });
    left.chain(right).chain(0..n).collect()
}

#[test]
fn the_gradient_is_added_to_what_is_there() {
    let gpu = gpu();
    let values = random(1, ROWS * COUNT, 1.0);
    let gradients = random(2, ROWS * COUNT, 1.0);
    let [on_values, on_gradients] = [&values, &gradients].map(|v| buffers::filled(&gpu, "test", v));
    let mut penalty = Roughness::new(&gpu, &on_values, &on_gradients, ROWS, &ring(), COUNT);
    let run = |penalty: &Roughness| {
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        penalty.encode(&mut encoder);
        gpu.queue.submit([encoder.finish()]);
        buffers::read::<f32>(&gpu, &on_gradients, ROWS * COUNT).unwrap()
    };
    assert_eq!(run(&penalty), gradients, "a weight of 0 adds nothing");
    penalty.set_weight(&gpu, WEIGHT, WIDTH);
    let got = widen(&run(&penalty));
    let mut twin = widen(&gradients);
    add_roughness(&widen(&values), &mut twin, &ring(), COUNT, WEIGHT.into(), WIDTH.into());
    assert_same("roughness", &got[..], &twin);
}

#[test]
fn the_twins_gradient_is_that_of_its_penalty() {
    let values = widen(&random(3, ROWS * COUNT, 1.0));
    let mut gradients = vec![0.0; ROWS * COUNT];
    let weight = WEIGHT.into();
    let width = WIDTH.into();
    add_roughness(&values, &mut gradients, &ring(), COUNT, weight, width);
    let at = |i: usize, step: f64| {
        let mut moved = values.clone();
        moved[i] += step;
        roughness(&moved, &ring(), COUNT, weight, width)
    };
    for i in (0..ROWS * COUNT).step_by(7) {
        let slope = (at(i, 1e-5) - at(i, -1e-5)) / 2e-5;
        assert!((slope - gradients[i]).abs() < 1e-8, "{i}: {slope}, {}", gradients[i]);
    }
    let even = vec![0.4; ROWS * COUNT];
    assert_eq!(roughness(&even, &ring(), COUNT, weight, width), 0.0);
}
