//! Shared fixtures.

pub mod shaders;
