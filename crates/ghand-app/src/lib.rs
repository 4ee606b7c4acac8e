//! Parts of the programs `train`, `viewer` and `ghand`: the commands, the viewer, and the reading of input.

mod allocator;
pub mod baked;
pub mod bare_hand;
pub mod capture_preflight;
pub mod capture_source;
pub mod cli;
pub mod command_inputs;
pub mod commands;
pub mod demo_avatar;
pub mod file_kind;
pub mod hand_model_file;
mod html_page;
pub mod lighting;
pub mod lpips_weights;
pub mod pose_choice;
pub mod run_files;
pub mod runtime_dir;
pub mod same_tracker;
pub mod scene_file;
pub mod train_run;
#[cfg(feature = "viewer")]
pub mod viewer;
pub mod web_page;
pub mod world_landmarks;
