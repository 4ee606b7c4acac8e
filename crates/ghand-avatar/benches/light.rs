//! The shades of a pose: what light apart from skin costs whenever a hand moves.
//! `cargo bench --workspace --profile dev --bench light`
#![allow(
    clippy::unwrap_used,
    missing_docs,
    reason = "a benchmark fails by panicking; criterion's macros make functions"
)]

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use ghand_avatar::{Light, LightKind};
use ghand_core::Side;
use ghand_hand_model::builtin::builtin_hand;
use ghand_hand_model::named_poses::named_pose;

fn benchmark(c: &mut Criterion) {
    let model = builtin_hand(Side::Right).unwrap().without_blend_shapes();
    let pose = named_pose("relaxed", &model).unwrap();
    let sh = Light { kind: LightKind::Sh, turn: glam::DQuat::IDENTITY, coefficients: vec![[0.3; 3]; 9], trust: None };
    // A fitted light has some dark directions.
    let mut fitted = Light::studio();
    fitted.coefficients.iter_mut().step_by(2).for_each(|radiance| *radiance = [0.0; 3]);
    for (name, light) in [("64 directions", Light::studio()), ("32 directions", fitted), ("harmonics", sh)] {
        c.bench_function(&format!("light/{name}, {} vertices", model.vertices.len()), |bencher| {
            bencher.iter(|| black_box(light.vertex_shades(black_box(&model), &pose).unwrap()));
        });
    }
}

criterion_group! {
    name = benches;
    config = Criterion::default().sample_size(30);
    targets = benchmark
}
criterion_main!(benches);
