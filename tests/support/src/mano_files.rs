//! MANO files with synthetic numbers, in the layouts of Python's programs.
#![allow(clippy::unwrap_used, missing_docs, reason = "a test fails by panicking, and is read with its helpers")]

pub mod hands;
pub mod model;
pub mod python;
