//! CPU twins of the GPU stages, in plain f64, against which tests compare the shaders.

pub mod adam;
pub mod bin;
pub mod image_loss;
pub mod mesh;
pub mod penalty;
pub mod project;
pub mod rasterize;
pub mod sort;
pub mod spherical_harmonics;
mod wireframe;
