//! Runs the capture and pose readers of `fuzz/fuzz_targets` on the inputs of `fuzz/corpus` and changed copies of them;
//! the tests of hand model readers are in `ghand-hand-model`.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]
#![allow(dead_code, reason = "the fixtures are shared with `data_sets`, which uses more of them")]

#[path = "../../../fuzz/src/lib.rs"]
mod arrays;
#[path = "../data_sets/fixtures.rs"]
mod fixtures;

mod captures;
mod live;
mod poses;
