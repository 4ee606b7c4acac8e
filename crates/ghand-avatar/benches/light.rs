//! The shades of a pose: what light apart from skin costs whenever a hand moves.
//! `cargo bench --workspace --profile dev --bench light`
#![allow(
    clippy::unwrap_used,
    missing_docs,
    reason = "a benchmark fails by panicking; criterion's macros make functions"
)]

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use ghand_avatar::light::{Lamp, Lamps, LitMesh};
use ghand_avatar::{AvatarLight, Light, LightKind};
use ghand_core::Side;
use ghand_hand_model::builtin::builtin_hand;
use ghand_hand_model::named_poses::named_pose;
use ghand_hand_model::surface::sample_surface;
use glam::DVec3;

fn benchmark(c: &mut Criterion) {
    let model = builtin_hand(Side::Right).unwrap().without_blend_shapes();
    let pose = named_pose("relaxed", &model).unwrap();
    let sh =
        Light { kind: LightKind::Sh, turn: glam::DQuat::IDENTITY, coefficients: vec![[0.3; 3]; 9], ..Light::studio() };
    let lamp = |x: f64| Lamp { offset: DVec3::new(x, -0.3, 0.4), radius: 0.1, radiance: [20.0; 3] };
    let with_lamps = |lamps: Vec<Lamp>| {
        let lamps = Lamps { place: Lamps::middle(&model.vertices), reach: 0.1, lamps };
        Light { lamps: Some(lamps), ..Light::studio() }
    };
    let lights = [
        ("64 directions", Light::studio()),
        ("a lamp near the hand, too", with_lamps(vec![lamp(0.5)])),
        ("two lamps near the hand, too", with_lamps(vec![lamp(0.5), lamp(-0.5)])),
        ("harmonics", sh),
    ];
    let samples = sample_surface(&model, 16).unwrap();
    for (name, light) in lights {
        for divided in [false, true] {
            let lit = AvatarLight { divided, ..AvatarLight::new(light.clone(), None, &samples) };
            let mesh = LitMesh::new(&lit, &model);
            c.bench_function(&format!("light/{name}, {} vertices", mesh.vertex_count()), |bencher| {
                bencher.iter(|| {
                    let parts = mesh.parts(&light, black_box(&pose)).unwrap();
                    black_box(mesh.shades(&light, &parts, [0.5, 0.3, 0.1]))
                });
            });
        }
    }
}

criterion_group! {
    name = benches;
    config = Criterion::default().sample_size(30);
    targets = benchmark
}
criterion_main!(benches);
