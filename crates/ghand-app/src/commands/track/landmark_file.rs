//! Landmarks as files of poses.

use ghand_core::Side;
use ghand_footage::Footage;
use serde_json::{Map, Value, json};

use super::seen_hands::SeenHands;
use crate::world_landmarks;

/// Landmarks in space, as MediaPipe names them: of `side`, or of both hands. Pictures without a hand have none, so that
/// gaps stay gaps.
pub(super) fn world_landmarks(footage: &Footage, hands: &SeenHands, side: Option<Side>) -> Value {
    let sides: Vec<Side> = side.map_or(vec![Side::Right, Side::Left], |side| vec![side]);
    let frame = |number: usize| {
        let found = sides.iter().filter_map(|side| Some((*side, hands.hand(number, *side)?)));
        let mut frame = head(footage, number);
        frame.extend(world_landmarks::world_landmarks(found));
        Value::Object(frame)
    };
    file(footage, side, frame)
}

/// Landmarks in the images of a camera, pixels, in ghand's own form; they are MediaPipe's. The score is how sure it is that there is a hand.
pub(super) fn image_landmarks(footage: &Footage, hands: &SeenHands, camera: &str, side: Side) -> Value {
    let frame = |number: usize| {
        let mut cameras = Map::new();
        if let Some(hand) = hands.hand(number, side) {
            let score = rounded(hand.presence, 1e3);
            let points: Vec<Value> =
                hand.landmarks.iter().map(|at| json!([rounded(at.x, 1e2), rounded(at.y, 1e2), score])).collect();
            cameras.insert(camera.into(), json!(points));
        }
        let mut frame = head(footage, number);
        frame.insert("image_landmarks".into(), Value::Object(cameras));
        Value::Object(frame)
    };
    let mut file = file(footage, Some(side), frame);
    file["tracker"] = json!("mediapipe");
    file
}

fn file(footage: &Footage, side: Option<Side>, frame: impl Fn(usize) -> Value) -> Value {
    let mut file = Map::new();
    if footage.has_times() {
        file.insert("fps".into(), json!(rounded(footage.rate(), 1e4)));
    }
    if let Some(side) = side {
        file.insert("side".into(), json!(side.to_string()));
    }
    file.insert("frames".into(), (0..footage.times().len()).map(frame).collect());
    Value::Object(file)
}

/// The id of a frame, and its time if it has one.
fn head(footage: &Footage, number: usize) -> Map<String, Value> {
    let mut head = Map::new();
    head.insert("id".into(), json!(footage.name(number)));
    if let (true, Some(time)) = (footage.has_times(), footage.times().get(number)) {
        head.insert("time".into(), json!(rounded(*time, 1e6)));
    }
    head
}

/// A number to a part of a unit.
fn rounded(number: f64, parts: f64) -> f64 {
    (number * parts).round() / parts
}
