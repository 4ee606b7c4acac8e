//! OpenPose: `people` with `hand_right_keypoints_2d` of 63 numbers, x, y and confidence of 21 points in the order of
//! MediaPipe. A file holds one frame of one camera; a folder holds `VIDEO_000000000012_keypoints.json`.

use ghand_core::Side;
use ghand_files::value::Value;

use super::view::{Content, Landmarks, Problem, View, Views, point, problem};
use super::{ImagePoint, LANDMARK_COUNT};

/// How the names of its files end.
pub(super) const FILE_ENDING: &str = "_keypoints.json";

/// Names of a side's points, newest version first.
fn names(side: Side) -> [&'static str; 2] {
    match side {
        Side::Right => ["hand_right_keypoints_2d", "hand_right_keypoints"],
        Side::Left => ["hand_left_keypoints_2d", "hand_left_keypoints"],
    }
}

/// Whether this is a frame of OpenPose.
pub(super) fn is_frame(value: &Value) -> bool {
    let people = value.get("people").and_then(Value::items);
    let has = |person: &Value| person.entries().iter().any(|(key, _)| key.contains("keypoints"));
    people.is_some_and(|people| people.iter().any(has) || (people.is_empty() && value.get("version").is_some()))
}

/// One frame or a list of frames.
pub(super) fn read(value: &Value, side: Side) -> Option<Result<Content, Problem>> {
    let frames = match value.get("frames").unwrap_or(value) {
        Value::List(frames) if frames.iter().any(is_frame) => frames.as_slice(),
        _ if is_frame(value) => std::slice::from_ref(value),
        _ => return None,
    };
    let view = (0..).zip(frames).map(|(number, frame)| Ok((number, landmarks(frame, side)?)));
    Some(view.collect::<Result<View, Problem>>().map(|view| Content::new(Views::One(view), 0.0)))
}

/// The hand of a frame: of several people the one that is seen best.
pub(super) fn landmarks(frame: &Value, side: Side) -> Result<Landmarks, Problem> {
    let mut best = [None; LANDMARK_COUNT];
    for (number, person) in frame.get("people").and_then(Value::items).unwrap_or_default().iter().enumerate() {
        let Some((name, points)) = names(side).into_iter().find_map(|name| Some((name, person.get(name)?))) else {
            continue;
        };
        let numbers = points.numbers().map_or(&[][..], |array| array.values.as_slice());
        if numbers.is_empty() {
            continue;
        }
        if numbers.len() != 3 * LANDMARK_COUNT {
            let text = format!(
                "has {} numbers, must have {}: x, y and confidence of {LANDMARK_COUNT} points",
                numbers.len(),
                3 * LANDMARK_COUNT
            );
            return problem(&format!("people[{number}].{name}"), text);
        }
        let mut found = [None; LANDMARK_COUNT];
        for (place, values) in found.iter_mut().zip(numbers.as_chunks::<3>().0) {
            let [x, y, score] = *values;
            *place = point(x, y, score);
        }
        if sum(&found) > sum(&best) {
            best = found;
        }
    }
    Ok(best)
}

fn sum(points: &Landmarks) -> f64 {
    points.iter().flatten().map(|ImagePoint { score, .. }| score).sum()
}
