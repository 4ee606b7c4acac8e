//! Landmarks in the images of calibrated cameras.
//!
//! `{"fps":30,"side":"right","frames":[{"id":"0000","image_landmarks":{"cam0":[[x,y], ...],"cam1":[[x,y,score], ...]}}]}`:
//! for each camera, by its id, 21 points in the order of MediaPipe, as lists or as `{"x","y","score"}`. The list of
//! frames alone, or one frame on each line, are read, too. Coordinates are pixels of the image as filmed, the middle of
//! the first pixel at (0.5, 0.5), or, as MediaPipe has them, fractions of the image's width and height; which of them,
//! follows from their size. A score is how sure the tracker is, from 0 to 1. `null` or NaN stands for a point that was
//! not found, as does a camera that is missing.
//!
//! Landmarks of fingertips are taken for MediaPipe's, which lie inside the finger, unless the file has `"tips":"skin"`. Those
//! of the palm are taken for joints, unless the file has `"tracker":"mediapipe"`, as `ghand track` writes.

use ghand_core::Side;
use ghand_files::npz::NumericArray;
use ghand_files::value::Value;
use glam::DVec2;

use super::landmarks::MEDIAPIPE_TIP_INSET;
use crate::ik::LANDMARK_COUNT;
use crate::image_landmarks::{ImageFrame, ImagePoint};
use crate::pose_sequence::reading::source::{frames_of, id_of, shown, side_of};
use crate::pose_sequence::{Motion, PoseError, Recording, Skipped, Source};

const NAMES: [&str; 2] = ["image_landmarks", "imageLandmarks"];
/// The tracker whose landmarks of the palm are known to lie beside the joints.
const MEDIAPIPE: &str = "mediapipe";

/// The content of such a file.
pub(crate) struct OwnLandmarks {
    pub side: Option<Side>,
    /// How far landmarks of fingertips lie before the ends of the fingers, metres.
    pub tip_inset: f64,
    /// Whether MediaPipe found them, so that those of the palm lie beside their joints.
    pub is_mediapipe: bool,
    pub frames: Vec<ImageFrame>,
}

pub(crate) fn read(source: &Source, value: &Value) -> Option<Result<Recording, PoseError>> {
    let found = frames(source.origin, value)?;
    Some(found.map(|OwnLandmarks { side, tip_inset, frames, .. }| {
        let motion = Motion::ImageLandmarks { frames, tip_inset };
        Recording { side, usual_fps: None, motion, skipped: Skipped::default(), warnings: vec![] }
    }))
}

/// The frames of such a file; `None` for another kind. `origin` is the file's name, for messages.
pub(crate) fn frames(origin: &str, value: &Value) -> Option<Result<OwnLandmarks, PoseError>> {
    let find = |value: &Value| NAMES.iter().any(|name| value.get(name).is_some());
    if find(value) {
        return Some(landmarks(origin, value, std::slice::from_ref(value)));
    }
    let frames = frames_of(value)?;
    frames.iter().any(find).then(|| landmarks(origin, value, frames))
}

fn landmarks(origin: &str, value: &Value, frames: &[Value]) -> Result<OwnLandmarks, PoseError> {
    let tip_inset = match value.get("tips") {
        None => MEDIAPIPE_TIP_INSET,
        Some(tips) if tips.text() == Some("inside") => MEDIAPIPE_TIP_INSET,
        Some(tips) if tips.text() == Some("skin") => 0.0,
        Some(tips) => {
            let problem = format!(
                "is {}; give \"skin\" for landmarks at the ends of the fingers, or \"inside\" for MediaPipe's",
                shown(tips)
            );
            return Err(invalid(origin, "tips", problem));
        }
    };
    let is_mediapipe = match value.get("tracker") {
        None | Some(Value::Nothing) => false,
        Some(tracker) => match tracker.text() {
            Some(name) => name.eq_ignore_ascii_case(MEDIAPIPE),
            None => {
                let problem = format!("is {}; give the tracker's name, as \"{MEDIAPIPE}\", or omit it", shown(tracker));
                return Err(invalid(origin, "tracker", problem));
            }
        },
    };
    let side = side(value).or_else(|| frames.iter().find_map(side));
    let frames = frames.iter().enumerate().map(|(number, frame)| image_frame(origin, frame, number));
    Ok(OwnLandmarks { side, tip_inset, is_mediapipe, frames: frames.collect::<Result<_, PoseError>>()? })
}

fn invalid(origin: &str, field: &str, problem: String) -> PoseError {
    PoseError::Invalid { origin: origin.into(), field: field.into(), problem }
}

/// A file of these frames.
pub(crate) fn to_value(frames: &[ImageFrame], fps: Option<f64>, side: Side, tip_inset: f64) -> Value {
    let text = |text: &str| Value::Text(text.into());
    let numbers = |values: Vec<f64>, shape: Vec<usize>| Value::Numbers(NumericArray { shape, values });
    let point = |point: &Option<ImagePoint>| match point {
        Some(ImagePoint { at, score }) => numbers(vec![at.x, at.y, *score], vec![3]),
        None => Value::Nothing,
    };
    let view = |(id, points): &(String, [Option<ImagePoint>; LANDMARK_COUNT])| {
        (id.clone(), Value::List(points.iter().map(point).collect()))
    };
    let frame = |frame: &ImageFrame| {
        let cameras = Value::Map(frame.cameras.iter().map(view).collect());
        Value::Map(vec![("id".into(), text(&frame.id)), (NAMES[0].into(), cameras)])
    };
    let tips = if tip_inset == 0.0 { "skin" } else { "inside" };
    let mut file = vec![
        ("side".to_owned(), text(&side.to_string())),
        ("tips".to_owned(), text(tips)),
        ("frames".to_owned(), Value::List(frames.iter().map(frame).collect())),
    ];
    file.extend(fps.map(|fps| ("fps".to_owned(), numbers(vec![fps], vec![]))));
    Value::Map(file)
}

fn side(value: &Value) -> Option<Side> {
    ["side", "handedness"].iter().find_map(|name| side_of(value.get(name)?))
}

fn image_frame(origin: &str, frame: &Value, number: usize) -> Result<ImageFrame, PoseError> {
    let id = id_of(frame, number);
    let field = format!("frames[{id:?}].image_landmarks");
    let mut cameras = vec![];
    match NAMES.iter().find_map(|name| frame.get(name)) {
        None | Some(Value::Nothing) => {}
        Some(Value::Map(entries)) => {
            for (camera, points) in entries.iter().filter(|(_, points)| *points != Value::Nothing) {
                let points = image_points(points);
                let points = points.map_err(|problem| invalid(origin, &format!("{field}[{camera:?}]"), problem))?;
                cameras.push((camera.clone(), points));
            }
        }
        Some(other) => {
            let problem = format!(
                "is {}, must be a map from the cameras' ids to {LANDMARK_COUNT} points each, {{\"cam0\":[[x,y], ...]}}",
                other.kind()
            );
            return Err(invalid(origin, &field, problem));
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
        // Among nothing but missing points, `null` is read as NaN.
        [number] if number.is_nan() => return Ok(None),
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
