//! Poses that drive a hand, from any source.
//!
//! A [`PoseSequence`] drives an avatar: [`pose_sequence`] reads it from many kinds of files, [`retarget`] transfers
//! poses from one skeleton to another, [`ik`] fits them to landmarks, and [`motions`] has named ones. [`live`] makes
//! poses of packets that arrive one by one; [`one_euro`] smooths them.

mod average_hand;
mod error;
pub mod ik;
pub mod image_landmarks;
pub mod key_frames;
pub mod live;
pub mod motions;
pub mod one_euro;
pub mod pose_sequence;
pub mod rest_skeleton;
pub mod retarget;
pub mod space_landmarks;
#[cfg(test)]
mod test_hands;

pub use error::PoseError;
pub use key_frames::KeyFrames;
pub use pose_sequence::{LandmarkFit, PoseFrame, PoseOptions, PoseSequence, read_poses};
pub use rest_skeleton::RestSkeleton;
