//! Landmarks of a hand in space, and the hand that fits them.

use ghand_core::{HandModel, Pose};
use glam::DVec3;

use crate::PoseError;
use crate::ik::LANDMARK_COUNT;
use crate::ik::person::sightings::{SeenFrame, Sighting, SightingPosition};
pub use crate::pose_sequence::LandmarkFit;
use crate::pose_sequence::transfer::landmark_fit::{SeenHand, fit};
pub use crate::pose_sequence::transfer::proportions::MANO_ORDER;

/// Where the landmarks of a hand are at one moment.
#[derive(Debug, Clone, PartialEq)]
pub struct SpaceFrame {
    /// Id of the frame.
    pub id: String,
    /// Metres, in the order of MediaPipe: the wrist, then four from the palm to the tip of each finger, thumb first.
    pub points: [Option<DVec3>; LANDMARK_COUNT],
}

/// A hand that was fitted to the landmarks of all frames.
#[derive(Debug, Clone, PartialEq)]
pub struct FittedSpaceHand {
    /// The pose of each frame, one rotation for each joint of the model; `None` as [`LandmarkFit::rejected`] says.
    pub poses: Vec<Option<Pose>>,
    /// Shape parameters of the model; empty if it has none that change lengths.
    pub shape: Vec<f64>,
    /// How well it fits, by landmark and frame.
    pub report: LandmarkFit,
}

/// Fits one hand, with one shape, and its pose at every moment. `model` must be of the side of the landmarks, whose
/// fingertips lie `tip_inset` metres before the ends of the fingers.
///
/// # Errors
/// [`PoseError`] if the names of the model's joints do not identify their parts.
pub fn fit_hand_in_space(
    frames: &[SpaceFrame],
    model: &HandModel,
    tip_inset: f64,
) -> Result<FittedSpaceHand, PoseError> {
    let sighting = |(landmark, point): (usize, &Option<DVec3>)| {
        let at = point.filter(|point| point.is_finite())?;
        Some(Sighting { landmark, confidence: 1.0, place: SightingPosition::Point(at) })
    };
    let seen: Vec<SeenFrame> = (frames.iter())
        .map(|frame| SeenFrame {
            id: frame.id.clone(),
            sightings: frame.points.iter().enumerate().filter_map(sighting).collect(),
        })
        .collect();
    let SeenHand { poses, shape, report, .. } = fit(&seen, &[], None, tip_inset, model)?;
    Ok(FittedSpaceHand { poses, shape, report })
}
