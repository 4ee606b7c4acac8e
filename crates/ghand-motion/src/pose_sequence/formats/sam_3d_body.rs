//! SAM 3D Body's estimates: `pred_keypoints_3d` with the 70 keypoints of its body (MHR70), 21 of which are those of each
//! hand, metres; `pred_cam_t` is where the body is in the camera's axes (x right, y down, z forward).
//!
//! A file has one body, all frames in arrays (T, 70, 3), or a list of frames with one body or a list of bodies each. Of
//! several bodies, the first is taken, with a warning.

use ghand_core::Side;
use ghand_files::npz::NumericArray;
use ghand_files::value::Value;
use glam::DVec3;

use super::landmarks::points_of;
use crate::ik::LANDMARK_COUNT;
use crate::pose_sequence::reading::recording::LandmarkFrame;
use crate::pose_sequence::reading::source::{frames_of, id_of};
use crate::pose_sequence::{Motion, PoseError, Recording, Skipped, Source};

const POINTS: &str = "pred_keypoints_3d";
const PLACE: &str = "pred_cam_t";
const BODY_POINTS: usize = 70;
/// MHR70's keypoint at each of MediaPipe's landmarks of the right hand. Its fingers go from the tip to the palm, and the
/// wrist follows them; those of the left hand are 21 further.
const RIGHT: [usize; LANDMARK_COUNT] =
    [41, 24, 23, 22, 21, 28, 27, 26, 25, 32, 31, 30, 29, 36, 35, 34, 33, 40, 39, 38, 37];
const LEFT_AFTER_RIGHT: usize = 21;

/// The keypoints of a body, or of a body in each frame.
fn points(value: &Value) -> Option<&NumericArray> {
    let array = value.get(POINTS)?.numbers()?;
    matches!(array.shape[..], [BODY_POINTS, 3] | [_, BODY_POINTS, 3]).then_some(array)
}

/// The first body of a frame, and the number of bodies.
fn first_body(frame: &Value) -> Option<(&Value, usize)> {
    if points(frame).is_some() {
        return Some((frame, 1));
    }
    let lists = ["outputs", "people", "persons", "bodies"].iter().filter_map(|name| frame.get(name));
    lists.chain([frame]).find_map(|list| match list {
        Value::List(bodies) => Some((
            bodies.iter().find(|body| points(body).is_some())?,
            bodies.iter().filter(|b| points(b).is_some()).count(),
        )),
        _ => None,
    })
}

pub(crate) fn read(source: &Source, value: &Value) -> Option<Result<Recording, PoseError>> {
    if points(value).is_some() {
        return Some(Ok(recording(source, &[(id_of(value, 0), value)])));
    }
    // Frames by name, such as that of the image, or a list of them.
    let frames: Vec<(String, &Value)> = match value.get("frames").unwrap_or(value) {
        Value::Map(frames) => frames.iter().map(|(name, frame)| (name.clone(), frame)).collect(),
        _ => frames_of(value)?.iter().enumerate().map(|(number, frame)| (id_of(frame, number), frame)).collect(),
    };
    frames.iter().any(|(_, frame)| first_body(frame).is_some()).then(|| Ok(recording(source, &frames)))
}

fn recording(source: &Source, frames: &[(String, &Value)]) -> Recording {
    let mut found = Vec::new();
    let mut skipped = Skipped::default();
    let mut most = 1;
    for (id, frame) in frames {
        let Some((body, count)) = first_body(frame) else {
            skipped.add(id, "has no body");
            continue;
        };
        most = most.max(count);
        let keypoints = points(body).map(|array| array.values.as_slice()).unwrap_or_default();
        let bodies = keypoints.chunks_exact(3 * BODY_POINTS);
        let places = body.get(PLACE).and_then(Value::numbers).map(|array| array.values.as_slice()).unwrap_or_default();
        let is_one = bodies.len() == 1;
        for (k, body) in bodies.enumerate() {
            let id = if is_one { id.clone() } else { format!("{k:04}") };
            let place = places.get(3 * k..3 * k + 3).map_or(DVec3::ZERO, DVec3::from_slice);
            match hand(body, place, source.wanted) {
                Ok(points) => found.push(LandmarkFrame { id, points }),
                Err(problem) => skipped.add(&id, problem),
            }
        }
    }
    let mut warnings = vec![];
    if most > 1 {
        warnings.push(format!("frames have up to {most} bodies; the hand is that of the first in each frame"));
    }
    let motion = Motion::Landmarks { frames: found, tip_inset: 0.0 };
    Recording { side: Some(source.wanted), usual_fps: None, motion, skipped, warnings }
}

/// The landmarks of a body's hand.
fn hand(body: &[f64], place: DVec3, side: Side) -> Result<[DVec3; LANDMARK_COUNT], String> {
    let after = if side == Side::Left { LEFT_AFTER_RIGHT } else { 0 };
    let keypoints = RIGHT.map(|keypoint| body.get(3 * (keypoint + after)..).and_then(|rest| rest.first_chunk::<3>()));
    let numbers: Vec<f64> =
        keypoints.iter().flatten().flat_map(|point| (DVec3::from_array(**point) + place).to_array()).collect();
    points_of(&numbers).map_err(|problem| format!("{POINTS}: {problem}"))
}
