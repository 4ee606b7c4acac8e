//! The viewer's parts. [`app`] is the user interface, the same in a window and in a screenshot without a display.

pub mod app;
pub mod camera;
pub mod picture;
pub mod pose_panel;
pub mod screenshot;
pub mod timeline;
pub mod window;
