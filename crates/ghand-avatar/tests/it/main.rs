//! Avatars on the device: models, light, scenes, files.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking; clippy knows that only inside #[test]")]

mod common;

#[cfg(feature = "bake")]
mod baked;
mod deform;
mod gloss;
mod host_pass;
#[cfg(feature = "networks")]
mod network;
#[cfg(feature = "networks")]
mod network_file;
mod pose_pipeline;
mod rigid_motion;
mod scene;
