//! Captures of hands: calibrated images, masks and poses, read into one type from several formats, and a synthetic
//! capture with known truth. Also poses that drive a hand, from many kinds of files.
//!
//! [`Capture`] is the type that the rest of the system uses; [`Capture::open_with`] chooses a reader from the folder's
//! contents. [`ghand_format`] reads and writes the project's own format, [`interhand`] and [`hand_appearance`] read
//! published data sets; [`synthetic`] makes a small capture of a hand with more detail than its template. [`ViewStore`]
//! decodes images in the background, [`inspection`] checks a capture.
//!
//! [`PoseSequence`] drives an avatar: [`pose_sequence`] reads it from many kinds of files, [`retarget`] transfers poses
//! from one rig to another, [`ik`] computes them from landmarks, and [`motions`] has a few by name.

mod camera_choice;
pub mod camera_file;
pub mod capture;
mod checks;
pub mod distortion;
mod error;
pub mod ghand_format;
pub mod hand_appearance;
pub mod ik;
mod image_file;
pub mod inspection;
pub mod interhand;
mod json;
mod json_file;
pub mod left_out;
mod mask;
mod mask_values;
pub mod motions;
pub mod named_camera;
pub mod open;
pub mod pose_sequence;
pub mod retarget;
pub mod rig;
mod split;
pub mod synthetic;
#[cfg(test)]
mod test_hands;
mod text_file;
mod truth;
pub mod untrusted;
mod usable;
pub mod view;
pub mod view_store;

pub use capture::{Capture, CaptureError, Frame, Split, SplitView};
pub use open::{CaptureKind, OpenOptions, Opened};
pub use pose_sequence::{PoseError, PoseFrame, PoseOptions, PoseSequence, read_poses};
pub use rig::Rig;
pub use view::{CroppedView, View};
pub use view_store::{ViewStore, ViewStoreOptions};
