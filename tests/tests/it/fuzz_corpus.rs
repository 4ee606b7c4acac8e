//! Runs the capture and pose readers of `fuzz/fuzz_targets` on the inputs of `fuzz/corpus` and changed copies of them;
//! the tests of hand model readers are in `ghand-hand-model`.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

#[path = "../../../fuzz/src/lib.rs"]
mod arrays;

mod captures;
mod live;
mod poses;
