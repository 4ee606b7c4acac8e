//! Cameras from the hand itself: its 21 landmarks in many frames are correspondences between the cameras.
//!
//! [`start`] places the cameras by what the tracker guesses of the hand in space; [`bundle`] then refines them together
//! with the points of all frames and the lengths of the hand's bones, which stay the same. Lengths are metres as far as
//! the mean hand is this hand, or as a given hand length says.

pub mod bundle;
pub(crate) mod equations;
pub mod lengths;
mod noise;
mod points_factor;
pub mod start;

use ghand_core::Camera;
use glam::{DVec2, DVec3};

/// Number of landmarks of a hand.
pub const LANDMARKS: usize = 21;

/// What one camera saw of the hand at one moment.
#[derive(Debug, Clone, PartialEq)]
pub struct View {
    /// Landmarks, pixels without distortion of the lens.
    pub pixels: [DVec2; LANDMARKS],
    /// How fast they move, pixels per second.
    pub velocities: [DVec2; LANDMARKS],
    /// The tracker's guess of the same points in space: metres, axes of the camera, any origin.
    pub world: [DVec3; LANDMARKS],
}

/// What all cameras saw at one moment, by camera.
pub type Moment = Vec<Option<View>>;

/// Cameras and the hand that they see.
#[derive(Debug, Clone, PartialEq)]
pub struct Rig {
    /// The cameras, in units of length that make the hand `size` times the mean hand.
    pub cameras: Vec<Camera>,
    /// The hand's size relative to the mean hand.
    pub size: f64,
    /// Logarithm of the length of each of [`lengths::BONES`] relative to the mean hand's, beyond the size.
    pub bones: [f64; lengths::BONES.len()],
    /// By how many seconds the clock of each camera is to be corrected.
    pub offsets: Vec<f64>,
}

/// What of a [`Rig`] is unknown.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Unknowns {
    /// Where cameras are; the first one stays.
    pub places: bool,
    /// Their focal lengths.
    pub focals: bool,
    /// Their clocks; the first one's is right.
    pub clocks: bool,
    /// The hand's size, where the cameras' unit of length is known or fixed.
    pub size: bool,
}
