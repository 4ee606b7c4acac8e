//! Finds hands in pictures and films: 21 landmarks of each hand, in the picture and in space, without a GPU.
//!
//! [`HandTracker`] follows hands from picture to picture. It searches palms in the whole picture, then landmarks in the
//! [`Region`] of each hand, with MediaPipe's networks, which come with this crate (Apache-2.0), and its rules.

mod error;
mod landmarks;
mod network;
mod palms;
mod picture;
mod region;
mod tracker;

pub use error::TrackerError;
pub use region::Region;
pub use tracker::{HandTracker, TrackedHand};
