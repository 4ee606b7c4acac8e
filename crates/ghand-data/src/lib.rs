//! Captures of hands: calibrated images, masks and poses, read into one type whatever their format, and a synthetic
//! capture whose truth is known.
//!
//! [`Capture`] is what the rest of the system sees; [`Capture::open_with`] tells by a folder's looks which reader it is for.
//! [`ghand_format`] reads and writes the project's own format, [`interhand`] and [`hand_appearance`] read published data
//! sets; [`synthetic`] makes a small capture of a hand that is richer than the template it comes with. [`ViewStore`] decodes
//! images in the background.

mod camera_choice;
pub mod capture;
mod checks;
mod error;
pub mod ghand_format;
pub mod hand_appearance;
mod image_file;
pub mod interhand;
mod json;
pub mod left_out;
mod mask;
pub mod open;
mod split;
pub mod synthetic;
pub mod untrusted;
mod usable;
pub mod view;
pub mod view_store;

pub use capture::{Capture, CaptureError, Frame, Split, SplitView};
pub use open::{OpenOptions, Opened};
pub use view::{CroppedView, View};
pub use view_store::{ViewStore, ViewStoreOptions};
