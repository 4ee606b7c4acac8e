//! Poses and a person's shape from landmarks.

use ghand_capture::cameras::list::LensCamera;
use ghand_core::{Camera, HandModel, Pose, Side};
use glam::{DVec2, DVec3};

use super::landmark_report::{KeptFrame, LandmarkFit, SightingDistance, report};
use crate::ik::person::camera_freedom::CameraFreedom;
use crate::ik::person::proportions::Proportions;
use crate::ik::person::sightings::{SeenFrame, Sighting, SightingPosition, WRONG};
use crate::ik::person::{fit_person_and_cameras, model_poses};
use crate::image_landmarks::ImageFrame;
use crate::pose_sequence::reading::recording::LandmarkFrame;
use crate::pose_sequence::{PoseError, PoseFrame, PoseOptions, Skipped, Source};
use crate::retarget::mirrored_point;

/// A frame of which less than this part of the landmarks fits the hand has no pose: what is left does not say which of
/// them are right, as if one of two cameras saw another hand.
const LEAST_RIGHT: f64 = 0.6;
/// Fewer landmarks than this, over all cameras, do not determine where a hand is and how it is turned.
const LEAST_SIGHTINGS: usize = 8;
/// A landmark within this of the hand is not called wrong, however exact the others are, metres: models and trackers
/// place joints some millimetres apart.
const LEAST_WRONG: f64 = 0.005;
/// Coordinates up to this are fractions of an image's width and height; no hand is as small in pixels.
const LARGEST_FRACTION: f64 = 2.0;
/// Poses and shape from landmarks in space.
pub(crate) fn from_points(
    source: &Source,
    frames: &[LandmarkFrame],
    tip_inset: f64,
    side: Side,
    model: &HandModel,
    warnings: &mut Vec<String>,
) -> Result<(Vec<PoseFrame>, LandmarkFit), PoseError> {
    let seen = |frame: &LandmarkFrame| {
        let own = |point| if side == model.side { point } else { mirrored_point(point) };
        let sighting =
            |(landmark, point)| Sighting { landmark, confidence: 1.0, place: SightingPosition::Point(own(point)) };
        SeenFrame { id: frame.id.clone(), sightings: frame.points.into_iter().enumerate().map(sighting).collect() }
    };
    let seen: Vec<SeenFrame> = frames.iter().map(seen).collect();
    fitted(source, &seen, &[], tip_inset, model, warnings)
}

/// Poses and shape from landmarks in images.
pub(crate) fn from_images(
    source: &Source,
    frames: &[ImageFrame],
    tip_inset: f64,
    side: Side,
    model: &HandModel,
    options: &PoseOptions,
    warnings: &mut Vec<String>,
) -> Result<(Vec<PoseFrame>, LandmarkFit), PoseError> {
    if options.cameras.is_empty() {
        let problem = "are pixels, which need their cameras; give --cameras capture.json, or a file of cameras like it";
        return Err(source.invalid("image_landmarks", problem.into()));
    }
    if side != model.side {
        let own = model.side;
        let problem = format!(
            "are of a {side} hand, which cannot be mirrored in images; give a {side} hand model, or --side {own} if \
             the file is wrong"
        );
        return Err(source.invalid("image_landmarks", problem));
    }
    let seen = seen_by_cameras(source.origin, frames, &options.cameras)?;
    let cameras: Vec<Camera> = options.cameras.iter().map(|lens| lens.camera.clone()).collect();
    fitted(source, &seen, &cameras, tip_inset, model, warnings)
}

/// What cameras saw, in pixels without distortion. `origin` is the file's name, for messages.
pub(crate) fn seen_by_cameras(
    origin: &str,
    frames: &[ImageFrame],
    cameras: &[LensCamera],
) -> Result<Vec<SeenFrame>, PoseError> {
    // Cameras may have been tracked by different programs.
    let is_fraction: Vec<bool> = cameras
        .iter()
        .map(|lens| {
            let views = frames.iter().flat_map(|frame| &frame.cameras).filter(|(id, _)| *id == lens.camera.id);
            let mut points = views.flat_map(|(_, points)| points.iter().flatten());
            points.all(|point| point.at.abs().max_element() <= LARGEST_FRACTION)
        })
        .collect();
    let mut seen = vec![];
    for frame in frames {
        let mut sightings = vec![];
        for (id, points) in &frame.cameras {
            let Some((camera, lens)) = cameras.iter().enumerate().find(|(_, lens)| lens.camera.id == *id) else {
                let ids: Vec<&str> = cameras.iter().map(|lens| lens.camera.id.as_str()).collect();
                let problem = format!("has the camera {id:?}, which the cameras lack; they are {}", ids.join(", "));
                let field = format!("frames[{:?}].image_landmarks", frame.id);
                return Err(PoseError::Invalid { origin: origin.into(), field, problem });
            };
            let size = DVec2::new(f64::from(lens.camera.width), f64::from(lens.camera.height));
            for (landmark, point) in points.iter().enumerate().filter_map(|(k, point)| Some((k, (*point)?))) {
                let pixel = if is_fraction[camera] { point.at * size } else { point.at };
                if let Some(pixel) = lens.undistorted(pixel) {
                    let place = SightingPosition::Pixel(camera, pixel);
                    sightings.push(Sighting { landmark, confidence: point.score, place });
                }
            }
        }
        seen.push(SeenFrame { id: frame.id.clone(), sightings });
    }
    Ok(seen)
}

/// A hand that was fitted to the landmarks of all frames.
#[derive(Debug, Clone, PartialEq)]
pub struct FittedHand {
    /// The pose of each frame, one rotation for each joint of the model, in the world of the landmarks, metres; `None` if
    /// there are fewer than 8 landmarks, or more than 40 % of them contradict the hand of the other frames.
    pub poses: Vec<Option<Pose>>,
    /// Shape parameters of the model; empty if it has none that change lengths.
    pub shape: Vec<f64>,
    /// Noise of a coordinate of a landmark, metres at the hand.
    pub noise: f64,
    /// Of each frame, how far each landmark is from the hand. Empty without a hand.
    pub distances: Vec<Vec<SightingDistance>>,
    /// How well it fits, by landmark, camera and frame; `rejected` says why frames have no pose.
    pub report: LandmarkFit,
    /// The cameras, without distortion, as given or fitted.
    pub cameras: Vec<Camera>,
}

/// Fits one hand to all frames, and the cameras if they are free. `times` are those of a film's frames, seconds; empty
/// without a film.
pub(crate) fn fit(
    seen: &[SeenFrame],
    times: &[f64],
    cameras: &[Camera],
    freedom: Option<&CameraFreedom>,
    tip_inset: f64,
    beside: &[(usize, DVec3)],
    model: &HandModel,
) -> Result<FittedHand, PoseError> {
    let (numbers, enough): (Vec<usize>, Vec<SeenFrame>) = seen
        .iter()
        .enumerate()
        .filter(|(_, frame)| frame.sightings.len() >= LEAST_SIGHTINGS)
        .map(|(number, frame)| (number, frame.clone()))
        .unzip();
    let few = seen.iter().filter(|frame| frame.sightings.len() < LEAST_SIGHTINGS);
    let mut rejected: Vec<(String, String)> = few
        .map(|frame| {
            let count = frame.sightings.len();
            (frame.id.clone(), format!("has {count} landmarks, at least {LEAST_SIGHTINGS} are needed"))
        })
        .collect();
    let proportions = Proportions::new(model, tip_inset, beside)?;
    let fit = fit_person_and_cameras(&proportions, &enough, cameras, freedom);
    let cameras = &fit.cameras;
    let times: Vec<f64> = numbers.iter().filter_map(|number| times.get(*number).copied()).collect();
    let found = model_poses(&proportions, &fit, &enough, cameras, &times);
    let mut kept = vec![];
    let mut poses = vec![None; seen.len()];
    let mut distances = vec![vec![]; seen.len()];
    for (((number, frame), found), pose) in numbers.into_iter().zip(&enough).zip(&fit.frames).zip(found) {
        let (Some(found), Some(pose)) = (found, pose) else {
            rejected
                .push((frame.id.clone(), "its landmarks are not a hand: they are at one point or on a line".into()));
            continue;
        };
        let kept_frame = KeptFrame::new(frame, found, cameras, (WRONG * fit.noise).max(LEAST_WRONG));
        distances[number] = kept_frame.distances().collect();
        if (kept_frame.wrong_count() as f64) > (1.0 - LEAST_RIGHT) * distances[number].len() as f64 {
            rejected.push((frame.id.clone(), kept_frame.cause()));
            continue;
        }
        kept.push(kept_frame);
        poses[number] = Some(pose);
    }
    let shape = proportions.shape(&fit.parameters);
    let report = report(model, &proportions, &fit, &kept, cameras, rejected);
    Ok(FittedHand { poses, shape, noise: fit.noise, distances, report, cameras: fit.cameras })
}

fn fitted(
    source: &Source,
    seen: &[SeenFrame],
    cameras: &[Camera],
    tip_inset: f64,
    model: &HandModel,
    warnings: &mut Vec<String>,
) -> Result<(Vec<PoseFrame>, LandmarkFit), PoseError> {
    let FittedHand { poses, shape, report, .. } = fit(seen, &[], cameras, None, tip_inset, &[], model)?;
    let mut skipped = Skipped::default();
    report.rejected.iter().for_each(|(id, problem)| skipped.add(id, problem.clone()));
    let frame = |(frame, pose): (&SeenFrame, Option<Pose>)| {
        Some(PoseFrame { id: frame.id.clone(), pose: pose?, shape: shape.clone() })
    };
    let frames: Vec<PoseFrame> = seen.iter().zip(poses).filter_map(frame).collect();
    warnings.extend(skipped.finish(source, frames.len())?);
    Ok((frames, report))
}
