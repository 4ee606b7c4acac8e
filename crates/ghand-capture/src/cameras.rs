//! Cameras: in files, also of other tools, by name, with their lenses, and a choice of few with different views; rigid motions.

pub mod calibration_files;
pub mod distortion;
pub mod file;
pub mod list;
pub mod named;
pub mod rigid;
pub mod sampling;
