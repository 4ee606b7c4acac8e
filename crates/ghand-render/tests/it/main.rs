//! Every stage on the device against its twin.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking; clippy knows that only inside #[test]")]

mod common;

mod bands;
mod device_loss;
mod extremes;
mod image_loss;
mod mesh;
mod optimizer;
mod penalty;
mod roughness;
mod splat;
mod thresholds;
mod wireframe;
