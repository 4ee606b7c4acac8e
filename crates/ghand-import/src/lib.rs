//! From videos of a hand to a capture.
//!
//! [`import()`] does it all, in these steps:
//!
//! 1. [`landmarks`]: the tracker finds hands in each camera's frames; [`track`] is one of them in one camera.
//! 2. [`solve`](mod@solve): how the cameras' clocks differ ([`clocks`], [`uneven`]) and where the cameras are ([`rig`]), if that is not
//!    given.
//!    A calibration [`board`] tells it, too.
//! 3. [`hand`]: one hand and all its poses.
//! 4. [`choice`]: of the [`candidates`], frames that are sharp, sure and different; [`writing`] makes a capture of them, with the pixels of
//!    other hands where these are near ([`apart`]).
//! 5. [`outlines`]: the hand's shape and poses once more, by its outlines in these frames.

pub mod apart;
pub mod board;
mod cameras;
pub mod candidates;
mod checks;
pub mod choice;
pub mod clocks;
mod error;
pub mod hand;
pub mod import;
pub mod landmarks;
pub mod moments;
pub mod outlines;
pub mod progress;
pub mod residuals;
pub mod rig;
mod sharpness;
pub mod solve;
pub mod sources;
mod stillness;
pub mod track;
pub mod uneven;
pub mod writing;

pub use error::ImportError;
pub use import::{ImportOptions, Imported, import};
