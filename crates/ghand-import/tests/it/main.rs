//! From landmarks to cameras, clocks and frames.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking; clippy knows that only inside #[test]")]

mod apart;
mod hands;
mod rig;
