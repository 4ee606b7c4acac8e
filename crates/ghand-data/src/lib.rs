//! Captures of hands: calibrated images, masks and poses, read into one type whatever their format, and a synthetic
//! capture whose truth is known. And poses that drive a hand, whatever wrote them down.
//!
//! [`Capture`] is what the rest of the system sees; [`Capture::open_with`] tells by a folder's looks which reader it is for.
//! [`ghand_format`] reads and writes the project's own format, [`interhand`] and [`hand_appearance`] read published data
//! sets; [`synthetic`] makes a small capture of a hand that is richer than the template it comes with. [`ViewStore`] decodes
//! images in the background, [`inspection`] looks a capture over.
//!
//! [`PoseSequence`] is what drives an avatar: [`pose_sequence`] reads it from many kinds of files, [`retarget`] carries poses over from
//! one rig to another, [`ik`] finds them from landmarks, and [`motions`] has a few by name.

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
