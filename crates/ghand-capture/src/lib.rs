//! Captures of hands: calibrated images, masks and poses, read from any format into one type.
//!
//! [`Capture`] is what the rest of the system sees; [`Capture::open_with`] recognises the format from the folder's
//! contents. [`ghand_format`] reads and writes the project's own format, [`interhand`] and [`hand_appearance`] read
//! published data sets. [`ViewStore`] decodes images in the background, [`inspection`] checks any capture.

pub mod blur;
pub mod camera_file;
pub mod camera_list;
pub mod camera_sampling;
pub mod capture;
mod capture_validation;
pub mod color_correction;
pub mod distortion;
mod error;
pub mod ghand_format;
pub mod hand_appearance;
mod image_file;
pub mod inspection;
pub mod interhand;
mod json;
mod json_file;
pub mod mask;
mod mask_values;
pub mod named_camera;
pub mod open;
mod opened;
pub mod skipped_images;
mod split;
mod text_file;
mod truth;
mod usable_images;
pub mod view;
pub mod view_store;

pub use capture::{Capture, CaptureError, Frame, Split, SplitView};
pub use color_correction::ColorCorrection;
pub use open::OpenOptions;
pub use opened::{CaptureKind, Opened};
pub use view::{CroppedView, View};
pub use view_store::{ViewStore, ViewStoreOptions};
