//! Times the reading of hand models. `cargo bench -p ghand-hand-model --profile dev --bench reading`
#![allow(clippy::unwrap_used, missing_docs, reason = "a benchmark fails by panicking")]

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use ghand_core::Side;
use ghand_hand_model::builtin::builtin_hand;
use ghand_hand_model::files::mano::{ManoOptions, read_mano_bytes};
use ghand_hand_model::surface::sample_surface;
use ghand_test_support::procedural_hand::ProceduralHand;

use ghand_test_support::mano_files::hands::{Hand, as_npz, as_pickle};

/// The coarsest procedural hand, which has one and a half times MANO's 778 vertices, with as many directions: 20 for the
/// shape, of which 10 are selected, and 135 for the pose.
fn read_mano(criterion: &mut Criterion) {
    let vertices = ProceduralHand { detail: 1, ..Default::default() }.build().unwrap().vertices.len();
    let entries = Hand::procedural(vertices, (20, 10)).published();
    let options = ManoOptions::default();
    for (name, bytes) in [("pickle", as_pickle(&entries)), ("npz", as_npz(&entries, true))] {
        println!("{name}: {} bytes", bytes.len());
        let read = || read_mano_bytes("right.pkl", black_box(&bytes), None, &options).unwrap();
        criterion.bench_function(&format!("read_mano/{name}"), |bencher| bencher.iter(read));
    }
}

/// The built-in hand, and the points that an avatar's Gaussians start from.
fn read_builtin(criterion: &mut Criterion) {
    let read = || builtin_hand(black_box(Side::Right)).unwrap();
    criterion.bench_function("builtin/read", |bencher| bencher.iter(read));
    for resolution in [256, 512] {
        let sampled = || sample_surface(&read(), resolution).unwrap();
        println!("{resolution}: {} points", sampled().len());
        criterion.bench_function(&format!("builtin/read and sample at {resolution}"), |b| b.iter(sampled));
    }
}

criterion_group!(benches, read_mano, read_builtin);
criterion_main!(benches);
