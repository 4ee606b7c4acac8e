//! What the programs `train`, `viewer` and `ghand` are made of: commands, the viewer's parts, and reading of their input.

pub mod bare_hand;
pub mod capture_args;
pub mod capture_checks;
pub mod cli;
pub mod commands;
pub mod framing;
pub mod hand_model_file;
pub mod mesh_picture;
pub mod pose_choice;
pub mod viewer;

/// Where `train` leaves its avatar unless told otherwise, and where `viewer` looks for it; relative to the current folder.
pub const LAST_AVATAR: &str = "out/train/avatar.ghand";
/// Where `ghand inspect` leaves the pictures of a capture unless told otherwise; relative to the current folder.
pub const LAST_SHEET: &str = "out/inspect.png";
