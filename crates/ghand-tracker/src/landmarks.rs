//! Finds the landmarks of the hand in a region, with MediaPipe's hand landmark network.

use glam::{DVec2, DVec3};

use crate::Region;
use crate::network::Network;
use crate::picture::{Outside, Picture};

/// MediaPipe's network, which comes with this crate.
pub(crate) const NETWORK: &[u8] = include_bytes!("../../../assets/hand-tracker/hand_landmark_full.tflite");

/// Edge of the network's input, pixels.
const EDGE: usize = 224;

/// Landmarks of a hand.
const LANDMARKS: usize = 21;

/// What the network sees in a region.
pub(crate) struct Landmarks {
    /// In the picture, pixels.
    pub pixels: [DVec2; LANDMARKS],
    /// Metres: x right, y down, z away; the origin is near the hand's middle.
    pub world: [DVec3; LANDMARKS],
    /// How certain it is that the region has a hand, 0 to 1.
    pub presence: f64,
    /// How certain it is that the hand is a right one, 0 to 1.
    pub right: f64,
}

/// The network.
pub(crate) struct LandmarkDetector {
    network: Network,
}

impl LandmarkDetector {
    /// Reads the network.
    pub fn new() -> Self {
        LandmarkDetector { network: Network::from_tflite(NETWORK) }
    }

    /// Looks at a region.
    pub fn detect(&self, picture: Picture, region: &Region) -> Landmarks {
        let outputs = self.network.run(&picture.crop(region, EDGE, Outside::Edge));
        let number = |output: usize, k: usize| f64::from(outputs[output][k]);
        let upright = DVec2::from_angle(region.turn);
        let pixel = |k| region.to_picture(DVec2::new(number(0, 3 * k), number(0, 3 * k + 1)) / EDGE as f64);
        let metres =
            |k| upright.rotate(DVec2::new(number(3, 3 * k), number(3, 3 * k + 1))).extend(number(3, 3 * k + 2));
        Landmarks {
            pixels: std::array::from_fn(pixel),
            world: std::array::from_fn(metres),
            presence: number(1, 0),
            // The network tells how certain it is of a left hand in a mirrored picture.
            right: number(2, 0),
        }
    }
}
