//! MANO files of all layouts are read to the last bit, and damaged ones are rejected with a clear sentence.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a test fails by panicking")]

#[path = "../support/mod.rs"]
mod support;

mod hostile;
mod layouts;
mod left;
mod python_files;
