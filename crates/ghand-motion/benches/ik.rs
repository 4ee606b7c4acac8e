//! Inverse kinematics of a hand from 21 landmarks, with and without a previous frame.
//! `cargo bench -p ghand-motion --profile dev --bench ik`
#![allow(
    clippy::unwrap_used,
    missing_docs,
    reason = "a benchmark fails by panicking; criterion's macros make functions"
)]

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use ghand_core::Pose;
use ghand_motion::RestSkeleton;
use ghand_motion::ik::HandIk;
use ghand_motion::motions::motion;
use ghand_test_support::procedural_hand::ProceduralHand;
use glam::DVec3;

fn benchmark(c: &mut Criterion) {
    let hand = ProceduralHand { detail: 1, ..Default::default() }.build().unwrap();
    let ik = HandIk::new(&RestSkeleton::of(&hand).unwrap());
    let poses: Vec<Pose> = motion("tour", &hand, 30.0).unwrap().unwrap().frames.into_iter().map(|f| f.pose).collect();
    let exact: Vec<[DVec3; 21]> = poses.iter().map(|pose| ik.landmarks(pose)).collect();
    // A tracker's noise, 3 mm in each coordinate, different in each frame.
    let noise = |seed: usize| {
        let wave = |k: usize| 0.0042 * ((seed * 21 + k) as f64 * 12.9898).sin();
        DVec3::new(wave(1), wave(2), wave(3))
    };
    let noisy = |(frame, points): (usize, &[DVec3; 21])| {
        let mut points = *points;
        points.iter_mut().enumerate().for_each(|(k, point)| *point += noise(63 * frame + 3 * k));
        points
    };
    let noisy: Vec<[DVec3; 21]> = exact.iter().enumerate().map(noisy).collect();
    for (name, frames) in [("exact", &exact), ("noisy", &noisy)] {
        c.bench_function(&format!("ik/a frame after another, {name}"), |bencher| {
            let mut k = 0;
            let mut before = None;
            bencher.iter(|| {
                let solution = ik.solve(black_box(&frames[k % frames.len()]), before.as_ref()).unwrap();
                k += 1;
                before = Some(solution.pose);
            });
        });
        c.bench_function(&format!("ik/a first frame, {name}"), |bencher| {
            let mut k = 0;
            bencher.iter(|| {
                k += 1;
                black_box(ik.solve(black_box(&frames[7 * k % frames.len()]), None).unwrap())
            });
        });
    }
}

criterion_group! {
    name = benches;
    config = Criterion::default().sample_size(30);
    targets = benchmark
}
criterion_main!(benches);
