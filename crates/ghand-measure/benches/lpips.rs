//! What LPIPS costs on the host: for a figure, and in a training step, which also needs the gradient.
//! `cargo bench -p ghand-measure --profile dev --bench lpips`
#![allow(
    clippy::unwrap_used,
    missing_docs,
    reason = "a benchmark fails by panicking; criterion's macros make functions"
)]

use criterion::{Criterion, criterion_group, criterion_main};
use ghand_measure::lpips::{Lpips, Pair};

/// Width and height of the crops.
const SIZES: [[u32; 2]; 2] = [[200, 300], [334, 512]];

fn picture([width, height]: [u32; 2], seed: u32) -> Vec<[f32; 3]> {
    let value = |i: u32, c: u32| ((i * 31 + c * 57 + seed * 13) % 251) as f32 / 250.0;
    (0..width * height).map(|i| [0, 1, 2].map(|c| value(i, c))).collect()
}

fn benchmark(c: &mut Criterion) {
    let lpips = Lpips::built_in().unwrap();
    for size in SIZES {
        let (picture, truth) = (picture(size, 0), picture(size, 1));
        let pair = Pair { size, picture: &picture, truth: &truth };
        let [width, height] = size;
        c.bench_function(&format!("lpips/{width}x{height}, distance"), |bencher| {
            bencher.iter(|| lpips.distances(size, [&picture], &truth).unwrap());
        });
        c.bench_function(&format!("lpips/{width}x{height}, distance and gradient"), |bencher| {
            bencher.iter(|| lpips.distance_and_gradient(&pair).unwrap());
        });
    }
}

criterion_group! {
    name = benches;
    config = Criterion::default().sample_size(10);
    targets = benchmark
}
criterion_main!(benches);
