//! Questions over the view, and the help.

pub mod command_palette;
pub mod file_dialog;
pub mod help_overlay;
pub mod name_dialog;
pub mod output_dialog;
