//! Reading packets of live poses for the built-in hand.
//! `cargo bench -p ghand-motion --profile dev --bench live`
#![allow(
    clippy::unwrap_used,
    missing_docs,
    reason = "a benchmark fails by panicking; criterion's macros make functions"
)]

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use ghand_core::Side;
use ghand_hand_model::builtin::builtin_hand;
use ghand_motion::live::{LiveOptions, LivePoses};

/// Packets of the fuzz target's corpus.
const PACKETS: [(&str, &str); 4] = [
    ("joints of WebXR", include_str!("../../../fuzz/corpus/live/webxr_right.jsonl")),
    ("landmarks", include_str!("../../../fuzz/corpus/live/landmarks.jsonl")),
    ("MANO", include_str!("../../../fuzz/corpus/live/mano.jsonl")),
    ("webcam page, two hands", include_str!("../../../examples/live/webcam_packet.json")),
];

fn benchmark(c: &mut Criterion) {
    let hand = builtin_hand(Side::Right).unwrap();
    for (name, text) in PACKETS {
        let packets: Vec<&str> = text.lines().collect();
        c.bench_function(&format!("live/{name}"), |bencher| {
            let mut live = LivePoses::default();
            let mut k = 0;
            bencher.iter(|| {
                k += 1;
                let packet = black_box(packets[k % packets.len()].as_bytes());
                live.read(packet, &hand, k as f64 / 60.0, &LiveOptions::default()).unwrap()
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
