//! Captures of hands: calibrated images, masks and poses, read into one type whatever their format, and a synthetic
//! capture whose truth is known. And poses that drive a hand, whatever wrote them down.
//!
//! [`Capture`] is what the rest of the system sees. [`ghand_format`] reads and writes the project's own format;
//! [`synthetic`] makes a small capture of a hand that is richer than the template it comes with.
//!
//! [`PoseSequence`] is what drives an avatar: [`pose_sequence`] reads it from many kinds of files, [`retarget`] carries poses over from
//! one rig to another, [`ik`] finds them from landmarks, and [`motions`] has a few by name.

pub mod camera_file;
pub mod capture;
pub mod ghand_format;
pub mod ik;
pub mod motions;
pub mod pose_sequence;
pub mod retarget;
pub mod rig;
pub mod synthetic;
#[cfg(test)]
mod test_hands;

pub use capture::{Capture, CaptureError, Frame, Split, View};
pub use pose_sequence::{PoseError, PoseFrame, PoseOptions, PoseSequence, read_poses};
pub use rig::Rig;
