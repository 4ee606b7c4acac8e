//! Landmarks in the images of calibrated cameras.
//!
//! `{"fps":30,"side":"right","frames":[{"id":"0000","image_landmarks":{"cam0":[[x,y], ...],"cam1":[[x,y,score], ...]}}]}`:
//! for each camera, by its id, 21 points in the order of MediaPipe, as lists or as `{"x","y","score"}`. The list of
//! frames alone, or one frame on each line, are read, too. Coordinates are pixels of the image as filmed, the middle of
//! the first pixel at (0.5, 0.5), or, as MediaPipe has them, fractions of the image's width and height; which of them,
//! follows from their size. A score is how sure the tracker is, from 0 to 1. `null` or NaN stands for a point that was
//! not found, as does a camera that is missing.
//!
//! Landmarks of fingertips are taken for MediaPipe's, which lie inside the finger, unless the file has `"tips":"skin"`.

use ghand_core::Side;
use ghand_files::value::Value;
use glam::DVec2;

use super::landmarks::MEDIAPIPE_TIP_INSET;
use crate::ik::LANDMARK_COUNT;
use crate::image_landmarks::{ImageFrame, ImagePoint};
use crate::pose_sequence::reading::source::{frames_of, id_of, shown, side_of};
use crate::pose_sequence::{Motion, PoseError, Recording, Skipped, Source};

const NAMES: [&str; 2] = ["image_landmarks", "imageLandmarks"];

pub(crate) fn read(source: &Source, value: &Value) -> Option<Result<Recording, PoseError>> {
    let find = |value: &Value| NAMES.iter().any(|name| value.get(name).is_some());
    if find(value) {
        return Some(recording(source, value, std::slice::from_ref(value)));
    }
    let frames = frames_of(value)?;
    frames.iter().any(find).then(|| recording(source, value, frames))
}

fn recording(source: &Source, value: &Value, frames: &[Value]) -> Result<Recording, PoseError> {
    let tip_inset = match value.get("tips") {
        None => MEDIAPIPE_TIP_INSET,
        Some(tips) if tips.text() == Some("inside") => MEDIAPIPE_TIP_INSET,
        Some(tips) if tips.text() == Some("skin") => 0.0,
        Some(tips) => {
            let problem = format!(
                "is {}; give \"skin\" for landmarks at the ends of the fingers, or \"inside\" for MediaPipe's",
                shown(tips)
            );
            return Err(source.invalid("tips", problem));
        }
    };
    let side = side(value).or_else(|| frames.iter().find_map(side));
    let frames = frames.iter().enumerate().map(|(number, frame)| image_frame(source, frame, number));
    let frames = frames.collect::<Result<Vec<ImageFrame>, PoseError>>()?;
    let motion = Motion::ImageLandmarks { frames, tip_inset };
    Ok(Recording { side, usual_fps: None, motion, skipped: Skipped::default(), warnings: vec![] })
}

fn side(value: &Value) -> Option<Side> {
    ["side", "handedness"].iter().find_map(|name| side_of(value.get(name)?))
}

fn image_frame(source: &Source, frame: &Value, number: usize) -> Result<ImageFrame, PoseError> {
    let id = id_of(frame, number);
    let field = format!("frames[{id:?}].image_landmarks");
    let mut cameras = vec![];
    match NAMES.iter().find_map(|name| frame.get(name)) {
        None | Some(Value::Nothing) => {}
        Some(Value::Map(entries)) => {
            for (camera, points) in entries.iter().filter(|(_, points)| *points != Value::Nothing) {
                let points = image_points(points);
                let points = points.map_err(|problem| source.invalid(&format!("{field}[{camera:?}]"), problem))?;
                cameras.push((camera.clone(), points));
            }
        }
        Some(other) => {
            let problem = format!(
                "is {}, must be a map from the cameras' ids to {LANDMARK_COUNT} points each, {{\"cam0\":[[x,y], ...]}}",
                other.kind()
            );
            return Err(source.invalid(&field, problem));
        }
    }
    Ok(ImageFrame { id, cameras })
}

fn image_points(points: &Value) -> Result<[Option<ImagePoint>; LANDMARK_COUNT], String> {
    let items = points.items().unwrap_or_default();
    if items.len() != LANDMARK_COUNT {
        return Err(format!("has {} landmarks, expected {LANDMARK_COUNT}, null for those not found", items.len()));
    }
    let mut found = [None; LANDMARK_COUNT];
    for (k, (place, item)) in found.iter_mut().zip(&items).enumerate() {
        *place = image_point(item).map_err(|problem| format!("landmark {k} {problem}"))?;
    }
    Ok(found)
}

fn image_point(item: &Value) -> Result<Option<ImagePoint>, String> {
    let numbers = match item {
        Value::Nothing => return Ok(None),
        Value::Map(_) => {
            let number = |name: &str| item.get(name).and_then(Value::number);
            let score = ["score", "confidence"].iter().find_map(|name| number(name)).unwrap_or(1.0);
            match (number("x"), number("y")) {
                (Some(x), Some(y)) => vec![x, y, score],
                _ => vec![],
            }
        }
        _ => item.numbers().map(|array| array.values.clone()).unwrap_or_default(),
    };
    let (at, score) = match numbers[..] {
        [x, y] => (DVec2::new(x, y), 1.0),
        [x, y, score] => (DVec2::new(x, y), score),
        _ => return Err(format!("is {}, not a point: give [x, y] or [x, y, score]", item.kind())),
    };
    if !at.is_finite() {
        return Ok(None);
    }
    if !(0.0..=1.0).contains(&score) {
        return Err(format!("has the score {score}, which must be from 0 to 1; omit MediaPipe's z"));
    }
    Ok((score > 0.0).then_some(ImagePoint { at, score }))
}
