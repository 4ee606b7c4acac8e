//! How long a MANO file takes to read. `cargo bench -p ghand-core --bench mano`
#![allow(clippy::unwrap_used, missing_docs, reason = "a benchmark fails by panicking")]

#[path = "../tests/support/mod.rs"]
mod support;

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use ghand_core::hand_model::mano::{ManoOptions, read_mano_bytes};

use support::hands::{Hand, as_npz, as_pickle};

/// The published size: 778 vertices, 20 shape directions of which 10 are selected, 135 pose directions.
fn read_mano(criterion: &mut Criterion) {
    let entries = Hand::procedural(778, (20, 10)).published();
    let options = ManoOptions::default();
    for (name, bytes) in [("pickle", as_pickle(&entries)), ("npz", as_npz(&entries, true))] {
        println!("{name}: {} bytes", bytes.len());
        let read = || read_mano_bytes("right.pkl", black_box(&bytes), None, &options).unwrap();
        criterion.bench_function(&format!("read_mano/{name}"), |bencher| bencher.iter(read));
    }
}

criterion_group!(benches, read_mano);
criterion_main!(benches);
