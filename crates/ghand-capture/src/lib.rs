//! Captures of hands: calibrated images, masks and poses, read from any format into one type.
//!
//! [`Capture`] is what the rest of the system sees; [`Capture::open_with`] recognises the format from the folder's
//! contents. [`ghand_format`] reads and writes the project's own format, [`interhand`] and [`hand_appearance`] read
//! published data sets. [`ViewStore`] decodes images in the background, [`inspection`] checks any capture.

pub mod cameras;
pub mod capture;
mod error;
pub mod ghand_format;
pub mod hand_appearance;
pub mod images;
pub mod inspection;
mod interhand;
pub mod mask;
pub mod reading;
mod split;
mod truth;

pub use capture::{Capture, CaptureError, Frame, Split, SplitView};
pub use images::color_correction::ColorCorrection;
pub use images::view::{CroppedView, View};
pub use images::view_store::{ViewStore, ViewStoreOptions};
pub use reading::open::OpenOptions;
pub use reading::opened::{CaptureKind, Opened};
