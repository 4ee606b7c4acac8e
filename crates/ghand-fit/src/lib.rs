//! What is fitted to a capture before training: poses, cameras and proportions, light, exposure, and the texels that images show.

pub mod alignment;
pub mod alignment_figures;
pub mod alignment_picture;
pub mod exposure;
pub mod floor;
pub mod light_fit;
pub mod needed_texels;
pub mod pose_offsets;
pub mod protocol;
pub mod sharpness;
pub mod texel_frames;
pub mod texel_views;
pub mod views;
