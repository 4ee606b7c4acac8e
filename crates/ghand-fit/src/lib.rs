//! What is fitted to a capture before training: poses, cameras and proportions, light, exposure, and the texels that images show.

pub mod alignment;
pub mod exposure;
pub mod light_fit;
pub mod sharpness;
pub mod texels;
pub mod views;
