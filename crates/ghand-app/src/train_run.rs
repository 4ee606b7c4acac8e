//! A run of `train`: its folder, how it is stopped, and its results.

pub mod demo_capture;
pub mod evaluation;
pub mod full_disk;
pub mod interruption;
pub mod live_files;
pub mod live_viewer;
pub mod metrics;
pub mod report_page;
pub mod report_picture;
pub mod results;
pub mod run_folder;
pub mod run_record;
pub mod settings_args;
pub mod training_poses;
