//! Landmarks of a hand in space, and the hand that fits them.

use ghand_core::HandModel;
use glam::DVec3;

use crate::PoseError;
use crate::ik::LANDMARK_COUNT;
use crate::ik::person::sightings::{SeenFrame, Sighting, SightingPosition};
pub use crate::pose_sequence::LandmarkFit;
pub use crate::pose_sequence::transfer::landmark_fit::FittedHand;
use crate::pose_sequence::transfer::landmark_fit::fit;
pub use crate::pose_sequence::transfer::proportions::MANO_ORDER;

/// Where the landmarks of a hand are at one moment.
#[derive(Debug, Clone, PartialEq)]
pub struct SpaceFrame {
    /// Id of the frame.
    pub id: String,
    /// Metres, in the order of MediaPipe: the wrist, then four from the palm to the tip of each finger, thumb first. `None`
    /// where no hand was seen; those that are not finite do not count.
    pub points: Option<[DVec3; LANDMARK_COUNT]>,
}

/// Fits one hand, with one shape, and its pose at every moment. `model` must be of the side of the landmarks, whose
/// fingertips lie `tip_inset` metres before the ends of the fingers.
///
/// # Errors
/// [`PoseError`] if the names of the model's joints do not identify their parts.
pub fn fit_hand_in_space(frames: &[SpaceFrame], model: &HandModel, tip_inset: f64) -> Result<FittedHand, PoseError> {
    let sighting = |(landmark, at): (usize, &DVec3)| {
        let at = Some(*at).filter(|at| at.is_finite())?;
        Some(Sighting { landmark, confidence: 1.0, place: SightingPosition::Point(at) })
    };
    let seen: Vec<SeenFrame> = (frames.iter())
        .map(|frame| SeenFrame {
            id: frame.id.clone(),
            sightings: frame.points.iter().flatten().enumerate().filter_map(sighting).collect(),
        })
        .collect();
    fit(&seen, &[], &[], None, tip_inset, &[], model)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::RestSkeleton;
    use crate::ik::HandIk;
    use ghand_core::Side;
    use ghand_hand_model::builtin::builtin_hand;
    use ghand_hand_model::named_poses::named_pose;

    #[test]
    fn a_hand_is_where_its_landmarks_are_and_a_frame_without_any_has_no_pose() {
        let model = builtin_hand(Side::Left).unwrap();
        let hand = HandIk::new(&RestSkeleton::of(&model).unwrap());
        let points = |(k, name): (usize, &str)| {
            let mut pose = named_pose(name, &model).unwrap();
            pose.rotations[0] = DVec3::new(0.3, -0.2 * k as f64, 0.1);
            pose.translation = DVec3::new(0.01 * k as f64, 0.5, -0.2);
            hand.landmarks(&pose)
        };
        let truth: Vec<_> = ["relaxed", "spread", "point", "four"].into_iter().enumerate().map(points).collect();
        let mut seen: Vec<_> = truth.iter().copied().map(Some).collect();
        let mut broken = truth[0];
        broken[7] = DVec3::NAN;
        seen.extend([None, Some(broken)]);
        let frames: Vec<SpaceFrame> =
            (0..).zip(seen).map(|(k, points): (usize, _)| SpaceFrame { id: format!("{k}"), points }).collect();
        let fitted = fit_hand_in_space(&frames, &model, 0.0).unwrap();
        let rejected: Vec<&str> = fitted.report.rejected.iter().map(|(id, _)| id.as_str()).collect();
        assert_eq!(rejected, ["4"]);
        assert_eq!(fitted.poses.iter().map(Option::is_some).collect::<Vec<_>>(), [true, true, true, true, false, true]);
        let truth = truth.iter().chain([&truth[0]]);
        for (pose, (k, truth)) in fitted.poses.iter().flatten().zip(truth.enumerate()) {
            for (landmark, (found, truth)) in hand.landmarks(pose).iter().zip(truth).enumerate() {
                // The one that is not seen lies between its neighbours.
                let most = if (k, landmark) == (4, 7) { 0.005 } else { 0.001 };
                assert!(found.distance(*truth) < most, "{k}, {landmark}: {found} {truth}");
            }
        }
    }
}
