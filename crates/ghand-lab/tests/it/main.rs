//! The laboratory's commands, as programs.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

#[path = "../../../ghand-app/tests/it/common/mod.rs"]
mod common;

mod ablate;
mod bench;
mod explain;
mod stress;
