//! Tests that span crates.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a test fails by panicking")]

mod data_sets;
mod documentation;
mod fixtures;
mod fuzz_corpus;
mod golden;
mod hand_appearance_files;
mod interhand_files;
mod invariants;
mod layouts;
mod shaders;
mod threads;
