//! The inputs of `fuzz/corpus`, and changes of them, through the readers of captures and poses that the targets of
//! `fuzz/fuzz_targets` run; those of hand models are in `ghand-hand-model`.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]
#![allow(dead_code, reason = "the fixtures are those of `data_sets`, which needs more of them")]

#[path = "../../../fuzz/src/lib.rs"]
mod arrays;
#[path = "../data_sets/fixtures.rs"]
mod fixtures;
#[path = "../../../crates/ghand-hand-model/tests/support/mod.rs"]
mod support;

mod captures;
mod poses;
