//! The corrected skinning of 87,779 Gaussians with 8 bases and 16 joints, forward and with its derivative, and the posing
//! of a hand model. `cargo bench -p ghand-hand-model --profile dev --bench deformation`
#![allow(
    clippy::unwrap_used,
    missing_docs,
    reason = "a benchmark fails by panicking; criterion's macros make functions"
)]

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use ghand_core::Pose;
use ghand_core::deformation::{DeformationInputs, deform, deform_vjp};
use ghand_core::posing::pose_hand;
use ghand_core::residual_skeleton::ResidualSkeleton;
use ghand_core::skinning::ResidualWeights;
use ghand_test_support::procedural_hand::ProceduralHand;
use glam::DVec3;
use rand::{RngExt, SeedableRng};

const POINTS: usize = 87_779;
const BASES: usize = 8;

fn numbers(rng: &mut rand_chacha::ChaCha8Rng, count: usize, size: f64) -> Vec<f64> {
    (0..count).map(|_| rng.random_range(-size..size)).collect()
}

fn vectors(rng: &mut rand_chacha::ChaCha8Rng, count: usize, size: f64) -> Vec<DVec3> {
    numbers(rng, 3 * count, size).chunks_exact(3).map(DVec3::from_slice).collect()
}

fn benchmark(c: &mut Criterion) {
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(1);
    let hand = ProceduralHand::default().build().unwrap();
    let joints = hand.joint_count();
    let canonical = vectors(&mut rng, POINTS, 0.1);
    let basis = vectors(&mut rng, BASES * POINTS, 0.01);
    let coefficients = vectors(&mut rng, BASES * POINTS, 1.0);
    let weights: Vec<f64> = numbers(&mut rng, joints * POINTS, 0.125).iter().map(|w| w.abs()).collect();
    let residual_weights = numbers(&mut rng, joints * POINTS, 0.1);
    let regressor = numbers(&mut rng, joints * POINTS, 0.01);
    let d_posed = vectors(&mut rng, POINTS, 1.0);
    let pose = Pose { rotations: vectors(&mut rng, joints, 1.0), translation: DVec3::new(0.0, 0.1, 0.5) };
    let deformation = DeformationInputs {
        parents: &hand.parents,
        joints: &hand.joints,
        canonical: &canonical,
        weights: &weights,
        shape_basis: &basis,
        blend_coefficients: &coefficients,
        skeleton_regressor: &regressor,
        residual_weights: &residual_weights,
        residual_weights_mode: ResidualWeights::ZeroSum,
        residual_skeleton_mode: ResidualSkeleton::Anchored,
    };
    c.bench_function("deform 87,779 Gaussians", |b| b.iter(|| black_box(deform(&deformation, &pose))));
    c.bench_function("deform + VJP 87,779 Gaussians", |b| {
        b.iter(|| {
            let forward = deform(&deformation, &pose);
            black_box(deform_vjp(&deformation, &pose, &forward, &d_posed, &[]))
        });
    });
    let shape = vec![0.5; hand.shape_count()];
    c.bench_function("pose the procedural hand", |b| {
        b.iter(|| black_box(pose_hand(&hand, &shape, &pose).unwrap()));
    });
}

criterion_group! {
    name = benches;
    config = Criterion::default().sample_size(20);
    targets = benchmark
}
criterion_main!(benches);
