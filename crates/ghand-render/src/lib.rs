//! Differentiable Gaussian splatting, image losses and mesh rasterising on any wgpu device.
//!
//! Every stage is a WGSL file in `shaders/`, a host part of the same name here, and a plain-Rust twin in
//! [`mod@reference`], or in `ghand-core` if the stage is part of the method itself.

pub mod bindings;
pub mod buffers;
pub mod device;
pub mod image_loss;
pub mod mesh;
pub mod optimizer;
pub mod penalty;
pub mod pipeline;
pub mod reference;
pub mod roughness;
pub mod shader_sources;
pub mod splat;
pub mod stages;
pub mod texture_pass;
pub mod tier;
pub mod timing;
pub mod viridis;

pub use device::{AdapterChoice, DeviceError, Gpu, RenderError};
pub use tier::Tier;
