//! Poses and a person's shape from landmarks.

use ghand_core::{Camera, HandModel, Pose, Side};
use glam::DVec2;

use super::landmark_report::{KeptFrame, LandmarkFit, report};
use crate::ik::person::proportions::Proportions;
use crate::ik::person::sightings::{SeenFrame, Sighting, SightingPosition, WRONG};
use crate::ik::person::{fit_person, refitted};
use crate::pose_sequence::reading::recording::{ImageFrame, LandmarkFrame};
use crate::pose_sequence::{PoseError, PoseFrame, PoseOptions, Skipped, Source, side_name};
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
    let ids: Vec<&str> = options.cameras.iter().map(|lens| lens.camera.id.as_str()).collect();
    if ids.is_empty() {
        let problem = "are pixels, which need their cameras; give --cameras capture.json, or a file of cameras like it";
        return Err(source.invalid("image_landmarks", problem.into()));
    }
    if side != model.side {
        let [theirs, own] = [side, model.side].map(side_name);
        let problem = format!(
            "are of a {theirs} hand, which cannot be mirrored in images; give a {theirs} hand model, or --side {own} if \
             the file is wrong"
        );
        return Err(source.invalid("image_landmarks", problem));
    }
    let points = || frames.iter().flat_map(|frame| &frame.cameras).flat_map(|(_, points)| points.iter().flatten());
    let is_fraction = points().all(|point| point.at.abs().max_element() <= LARGEST_FRACTION);
    let mut seen = vec![];
    for frame in frames {
        let mut sightings = vec![];
        for (id, points) in &frame.cameras {
            let Some(camera) = ids.iter().position(|known| known == id) else {
                let field = format!("frames[{:?}].image_landmarks", frame.id);
                let problem = format!("has the camera {id:?}, which --cameras lacks; it has {}", ids.join(", "));
                return Err(source.invalid(&field, problem));
            };
            let lens = &options.cameras[camera];
            let size = DVec2::new(f64::from(lens.camera.width), f64::from(lens.camera.height));
            for (landmark, point) in points.iter().enumerate().filter_map(|(k, point)| Some((k, (*point)?))) {
                let pixel = if is_fraction { point.at * size } else { point.at };
                if let Some(pixel) = lens.undistorted(pixel) {
                    let place = SightingPosition::Pixel(camera, pixel);
                    sightings.push(Sighting { landmark, confidence: point.score, place });
                }
            }
        }
        seen.push(SeenFrame { id: frame.id.clone(), sightings });
    }
    let cameras: Vec<Camera> = options.cameras.iter().map(|lens| lens.camera.clone()).collect();
    fitted(source, &seen, &cameras, tip_inset, model, warnings)
}

fn fitted(
    source: &Source,
    seen: &[SeenFrame],
    cameras: &[Camera],
    tip_inset: f64,
    model: &HandModel,
    warnings: &mut Vec<String>,
) -> Result<(Vec<PoseFrame>, LandmarkFit), PoseError> {
    let mut skipped = Skipped::default();
    let mut rejected = vec![];
    let mut reject = |id: &str, problem: String| {
        skipped.add(id, problem.clone());
        rejected.push((id.to_owned(), problem));
    };
    let (seen, few): (Vec<SeenFrame>, Vec<SeenFrame>) =
        seen.iter().cloned().partition(|frame| frame.sightings.len() >= LEAST_SIGHTINGS);
    for frame in &few {
        let count = frame.sightings.len();
        reject(&frame.id, format!("has {count} landmarks, at least {LEAST_SIGHTINGS} are needed"));
    }
    let proportions = Proportions::new(model, tip_inset)?;
    let fit = fit_person(&proportions, &seen, cameras);
    let shape = proportions.shape(&fit.parameters);
    // A model with the person's shape is put where the landmarks are, whatever its bones lack. Of one without shapes, the
    // bones' directions are right.
    let poses: Vec<Option<Pose>> = if proportions.has_shape() {
        refitted(&proportions, &fit, &seen, cameras)
    } else {
        fit.frames.iter().map(|frame| Some(frame.as_ref()?.pose.clone())).collect()
    };
    let mut kept = vec![];
    let mut frames = vec![];
    for ((frame, found), pose) in seen.iter().zip(&fit.frames).zip(poses) {
        let (Some(found), Some(pose)) = (found, pose) else {
            reject(&frame.id, "its landmarks are not a hand: they are at one point or on a line".into());
            continue;
        };
        let kept_frame = KeptFrame::new(frame, found, cameras, (WRONG * fit.noise).max(LEAST_WRONG));
        if (kept_frame.wrong_count() as f64) > (1.0 - LEAST_RIGHT) * found.distances.len() as f64 {
            reject(&frame.id, kept_frame.cause());
            continue;
        }
        kept.push(kept_frame);
        frames.push(PoseFrame { id: frame.id.clone(), pose, shape: shape.clone() });
    }
    warnings.extend(skipped.finish(source, frames.len())?);
    Ok((frames, report(model, &proportions, &fit, &kept, cameras, rejected)))
}
