//! Tracked hands in MediaPipe's form: landmarks in space.

use ghand_core::Side;
use ghand_tracker::TrackedHand;
use serde_json::{Map, Value, json};

/// Parts of a metre to which landmarks are rounded.
const PARTS: f64 = 1e5;

/// The fields `handedness` and `worldLandmarks` of one picture, metres: x right, y down, z away from the camera.
pub fn world_landmarks<'a>(hands: impl Iterator<Item = (Side, &'a TrackedHand)>) -> Map<String, Value> {
    let rounded = |value: f64| (value * PARTS).round() / PARTS;
    let point = |at: &glam::DVec3| json!({"x": rounded(at.x), "y": rounded(at.y), "z": rounded(at.z)});
    let (names, points): (Vec<String>, Vec<Vec<Value>>) =
        hands.map(|(side, hand)| (side.to_string(), hand.world.iter().map(point).collect::<Vec<_>>())).unzip();
    Map::from_iter([("handedness".into(), json!(names)), ("worldLandmarks".into(), json!(points))])
}
