//! Files for the tests and benchmarks of the MANO reader.
#![allow(dead_code, reason = "not every test and benchmark needs every helper")]
#![allow(clippy::unwrap_used, missing_docs, reason = "a test fails by panicking, and is read with its helpers")]

pub mod hands;
pub mod python;
