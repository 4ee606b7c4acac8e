//! MediaPipe's 21 landmarks of a hand, in metres.
//!
//! Only *world* landmarks are read: image landmarks have no scale, and their depth is a guess. MediaPipe does not
//! define a file format. This reads a list of frames (`{"fps":30,"frames":[...]}` or the list alone), each with
//! `worldLandmarks`, `world_landmarks`, `hand_world_landmarks` or `multi_hand_world_landmarks`, as the JavaScript and
//! Python interfaces call them: for each hand 21 points `{"x","y","z"}` or (x, y, z), or one hand alone. `handedness`
//! (`handednesses`, `multi_handedness`) gives the sides. MediaPipe's older interfaces assume mirrored selfies, so that
//! the sides of other pictures may be swapped: then choose the side. `.npz`: `world_landmarks` (T, 21, 3).
//!
//! Axes are those of the picture: x right, y down, z away from the camera; the origin is in the middle of the hand, so
//! that the hand's motion through space is not known. Order: wrist, then thumb to little finger, four each from the
//! palm to the tip.

use ghand_core::Side;
use ghand_files::value::Value;
use glam::DVec3;

use crate::ik::LANDMARK_COUNT;
use crate::pose_sequence::reading::recording::LandmarkFrame;
use crate::pose_sequence::reading::source::{frames_of, id_of, point_in_range, side_of, vector};
use crate::pose_sequence::{Motion, PoseError, Recording, Skipped, Source};

const NAMES: [&str; 7] = [
    "worldLandmarks",
    "world_landmarks",
    "hand_world_landmarks",
    "handWorldLandmarks",
    "multi_hand_world_landmarks",
    "multiHandWorldLandmarks",
    "landmarks_world",
];
/// Landmarks in the picture, as fractions of its width and height.
pub(crate) const IMAGE_NAMES: [&str; 5] =
    ["landmarks", "hand_landmarks", "handLandmarks", "multi_hand_landmarks", "multiHandLandmarks"];
pub(crate) const SIDE_NAMES: [&str; 6] =
    ["handedness", "handednesses", "multi_handedness", "multiHandedness", "side", "hand"];

/// How far MediaPipe's landmarks of fingertips lie before the end of the finger, metres. On 179 fingers that stand clear
/// in images of a real hand (two cameras, 64 frames) the outline is 5.7 to 9.4 mm (quartiles by finger) further along
/// the last bone, a little of which is the outline's blur.
pub const MEDIAPIPE_TIP_INSET: f64 = 0.006;

pub(crate) fn read(source: &Source, value: &Value) -> Option<Result<Recording, PoseError>> {
    let found = find(value, &NAMES);
    let sides = find(value, &SIDE_NAMES).map(all_sides).unwrap_or_default();
    // Two arrays of points are two frames, unless they have two sides.
    let is_frames = |shape: &[usize]| match *shape {
        [2, 21, 3 | 4] => !matches!(sides[..], [first, second] if first != second),
        [_, 21, 3 | 4] => true,
        _ => false,
    };
    if let Some(array) = found.and_then(Value::numbers).filter(|array| is_frames(&array.shape)) {
        let frames: Vec<Value> = Value::Numbers(array.clone()).items().unwrap_or_default();
        return Some(recording(source, value, &frames, |frame| vec![(None, frame.clone())]));
    }
    if found.is_some() {
        return Some(recording(source, value, std::slice::from_ref(value), hands));
    }
    let frames = frames_of(value)?;
    if frames.iter().any(|frame| find(frame, &NAMES).is_some()) {
        return Some(recording(source, value, frames, hands));
    }
    if frames.iter().any(|frame| find(frame, &IMAGE_NAMES).is_some()) {
        let problem = "are those of the image, which have no scale; record the world landmarks (worldLandmarks) beside them, or \
             give the calibrated cameras with --cameras";
        return Some(Err(source.invalid("landmarks", problem.into())));
    }
    None
}

pub(crate) fn find<'a>(value: &'a Value, names: &[&str]) -> Option<&'a Value> {
    names.iter().find_map(|name| value.get(name))
}

type Hands = Vec<(Option<Side>, Value)>;

/// The hands of a frame.
fn hands(frame: &Value) -> Hands {
    let Some(points) = find(frame, &NAMES) else { return vec![] };
    let sides = find(frame, &SIDE_NAMES).map(all_sides).unwrap_or_default();
    let hands = match points {
        Value::Numbers(array) if array.shape.len() == 3 => points.items().unwrap_or_default(),
        Value::List(items) if items.len() != LANDMARK_COUNT => items.clone(),
        _ => vec![points.clone()],
    };
    hands.into_iter().enumerate().map(|(k, hand)| (sides.get(k).copied(), hand)).collect()
}

/// The sides named in a value at any depth, in order.
pub(crate) fn all_sides(value: &Value) -> Vec<Side> {
    match value {
        Value::Text(_) => side_of(value).into_iter().collect(),
        Value::List(items) => items.iter().flat_map(all_sides).collect(),
        Value::Map(_) => {
            let names = ["categoryName", "category_name", "label", "displayName", "display_name", "classification"];
            find(value, &names).map(all_sides).unwrap_or_default()
        }
        _ => vec![],
    }
}

fn recording(
    source: &Source,
    value: &Value,
    frames: &[Value],
    hands: impl Fn(&Value) -> Hands,
) -> Result<Recording, PoseError> {
    let shared = find(value, &SIDE_NAMES).and_then(|side| all_sides(side).first().copied());
    let all: Vec<Hands> = frames.iter().map(hands).collect();
    let is = |own: &Option<Side>, wanted: Side| own.or(shared).is_none_or(|own| own == wanted);
    let has = |wanted: Side| all.iter().flatten().any(|(own, _)| is(own, wanted));
    let side = if has(source.wanted) { source.wanted } else { source.wanted.other() };
    let mut found = Vec::new();
    let mut skipped = Skipped::default();
    let mut known_side = None;
    for (number, (frame, hands)) in frames.iter().zip(&all).enumerate() {
        let id = id_of(frame, number);
        let Some((own, hand)) = hands.iter().find(|(own, _)| is(own, side)) else {
            skipped.add(&id, "has no such hand");
            continue;
        };
        // Of a single frame with two hands, the shared side is that of the first.
        known_side = known_side.or(*own).or(shared);
        match points(hand) {
            Ok(points) => found.push(LandmarkFrame { id, points }),
            Err(problem) => skipped.add(&id, problem),
        }
    }
    let motion = Motion::Landmarks { frames: found, tip_inset: MEDIAPIPE_TIP_INSET };
    Ok(Recording { side: known_side, usual_fps: None, motion, skipped, warnings: vec![] })
}

fn points(hand: &Value) -> Result<[DVec3; LANDMARK_COUNT], String> {
    // Protocol buffer messages as JSON wrap the points in one field.
    let hand = find(hand, &["landmark", "landmarks"]).unwrap_or(hand);
    let items = hand.items().unwrap_or_default();
    if items.len() != LANDMARK_COUNT {
        return Err(format!("has {} landmarks, expected {LANDMARK_COUNT}", items.len()));
    }
    let mut points = [DVec3::ZERO; LANDMARK_COUNT];
    for (k, (point, item)) in points.iter_mut().zip(&items).enumerate() {
        *point = vector(item).ok_or_else(|| format!("landmark {k} is not a point: give x, y and z"))?;
        point_in_range(*point).map_err(|problem| format!("landmark {k} {problem}"))?;
    }
    Ok(points)
}

/// Landmarks as plain numbers, 3 each.
pub(crate) fn points_of(numbers: &[f64]) -> Result<[DVec3; LANDMARK_COUNT], String> {
    let mut points = [DVec3::ZERO; LANDMARK_COUNT];
    if numbers.len() != 3 * LANDMARK_COUNT {
        return Err(format!("has {} numbers, expected {LANDMARK_COUNT} landmarks of 3", numbers.len()));
    }
    for (k, (point, values)) in points.iter_mut().zip(numbers.chunks_exact(3)).enumerate() {
        *point = DVec3::from_slice(values);
        if !point.is_finite() {
            return Err(format!("landmark {k} is not finite"));
        }
    }
    for (k, point) in points.iter().enumerate() {
        point_in_range(*point).map_err(|problem| format!("landmark {k} {problem}"))?;
    }
    Ok(points)
}
