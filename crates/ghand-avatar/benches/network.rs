//! The networks on the host: what they cost whenever a hand moves, and in a training step with one view.
//! `cargo bench --workspace --features networks --profile dev --bench network`
#![allow(
    clippy::unwrap_used,
    missing_docs,
    reason = "a benchmark fails by panicking; criterion's macros make functions"
)]

use std::cell::Cell;

use criterion::{Criterion, criterion_group, criterion_main};
use ghand_avatar::{Avatar, AvatarConfig, NetworkSizes, PropertyRates, Scene};
use ghand_core::{Pose, Side};
use ghand_hand_model::builtin::builtin_hand;
use ghand_render::splat::Purpose;
use ghand_render::{AdapterChoice, Gpu};
use glam::DVec3;

/// Poses that take turns, so that nothing is reused.
const POSES: usize = 2;

fn scene(gpu: &Gpu, uv_resolution: u32, purpose: Purpose) -> Scene {
    let model = builtin_hand(Side::Right).unwrap();
    let config = AvatarConfig { uv_resolution, network: Some(NetworkSizes::quick()), ..Default::default() };
    let avatar = Avatar::untrained(&model, &config, [0.5; 3], 0).unwrap();
    let mut scene = Scene::new(gpu, &[&avatar], purpose, POSES, [16, 16]).unwrap();
    for frame in 0..POSES {
        let mut pose = Pose::rest(avatar.template.joint_count());
        pose.rotations[1] = DVec3::X * frame as f64;
        scene.set_pose(gpu, 0, frame, &pose).unwrap();
    }
    scene
}

fn rates(step: u64) -> PropertyRates {
    PropertyRates {
        step,
        shape_basis: 1.0,
        residual_weights: 1.0,
        regressor: 1.0,
        scale: 1.0,
        color: 1.0,
        color_components: 1.0,
        response: 1.0,
        networks: 1e-3,
        feature_tensor: 1e-3,
    }
}

fn benchmark(c: &mut Criterion) {
    let gpu = Gpu::new(&AdapterChoice::from_env()).unwrap();
    for uv_resolution in [102, 160] {
        let mut playing = scene(&gpu, uv_resolution, Purpose::Images);
        let count = playing.splatter().count();
        let turn = Cell::new(0);
        let forward = |scene: &mut Scene| {
            turn.set(turn.get() + 1);
            scene.set_frame(&gpu, turn.get() % POSES);
            let mut encoder = gpu.device.create_command_encoder(&Default::default());
            let avatar = &mut scene.avatars_mut()[0];
            avatar.model.forward(&gpu, &mut encoder, &avatar.deformation).unwrap();
            gpu.queue.submit([encoder.finish()]);
        };
        c.bench_function(&format!("network/play, {count} Gaussians"), |bencher| {
            bencher.iter(|| forward(&mut playing));
        });
        let mut training = scene(&gpu, uv_resolution, Purpose::Gradients);
        let (splatter, avatars) = training.splatter_and_avatars_mut();
        let joints = avatars[0].deformation.properties().sizes.joints;
        let _backward = avatars[0].prepare_training(&gpu, splatter.d_gaussians(), &vec![1.0; joints]).unwrap();
        c.bench_function(&format!("network/training forward, {count} Gaussians"), |bencher| {
            bencher.iter(|| forward(&mut training));
        });
        c.bench_function(&format!("network/training step, {count} Gaussians"), |bencher| {
            bencher.iter(|| {
                forward(&mut training);
                let mut encoder = gpu.device.create_command_encoder(&Default::default());
                let model = &mut training.avatars_mut()[0].model;
                model.trainable_mut().unwrap().backward(&gpu, &mut encoder).unwrap();
                model.trainable_mut().unwrap().update(&gpu, &mut encoder, &rates(turn.get() as u64)).unwrap();
            });
        });
    }
}

criterion_group! {
    name = benches;
    config = Criterion::default().sample_size(10);
    targets = benchmark
}
criterion_main!(benches);
