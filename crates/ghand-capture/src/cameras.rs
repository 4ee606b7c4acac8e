//! Cameras: in files, also of other tools, by name, with their lenses, and a choice of few with different views.

pub mod calibration_files;
pub mod distortion;
pub mod file;
pub mod list;
pub mod named;
pub mod sampling;
