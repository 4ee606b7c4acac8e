//! The tracker on pictures.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking; clippy knows that only inside #[test]")]

mod footage;
mod pictures;
