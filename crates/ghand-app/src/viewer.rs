//! The viewer. [`app`] is the user interface, the same in a window and in a screenshot without a display.

pub mod app;
pub mod blend_control;
pub mod camera;
pub mod capture_panel;
pub mod command;
pub mod command_palette;
pub mod drawing;
pub mod hand;
pub mod handles;
pub mod help_overlay;
pub mod light_panel;
pub mod navigation;
pub mod number_slider;
pub mod picture;
pub mod pose_history;
pub mod pose_panel;
pub mod scene;
pub mod screen;
pub mod screenshot;
pub mod shape_panel;
pub mod slow_frames;
pub mod subject;
pub mod timeline;
pub mod toasts;
pub mod window;
