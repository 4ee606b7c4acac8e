//! The laboratory's commands, as programs.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

#[path = "../../../ghand-app/tests/it/common/mod.rs"]
mod common;

mod ablate;
mod bench;
mod cleanliness;
mod explain;
mod light_where_nobody_looked;
mod stress;
