//! Boards in rendered images, and cameras calibrated by them, against the truth.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking; clippy knows that only inside #[test]")]

mod calibrating;
mod finding;
mod rendered;
mod scene;
