//! Cameras: in files, by name, with their lenses, and a choice of few with different views.

pub mod distortion;
pub mod file;
pub mod list;
pub mod named;
pub mod sampling;
