//! A run of `train`: its folder, how it is stopped, and its results.

pub mod demo_capture;
pub mod evaluation;
pub mod folder_lock;
pub mod interruption;
pub mod results;
pub mod run_folder;
pub mod training_poses;
