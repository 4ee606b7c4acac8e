//! Poses that drive a hand, whatever wrote them down.
//!
//! [`PoseSequence`] is what drives an avatar: [`pose_sequence`] reads it from many kinds of files, [`retarget`] carries poses over from
//! one rig to another, [`ik`] finds them from landmarks, and [`motions`] has a few by name.

mod error;
pub mod ik;
pub mod motions;
pub mod pose_sequence;
pub mod rest_skeleton;
pub mod retarget;
#[cfg(test)]
mod test_hands;

pub use error::PoseError;
pub use pose_sequence::{PoseFrame, PoseOptions, PoseSequence, read_poses};
pub use rest_skeleton::RestSkeleton;
