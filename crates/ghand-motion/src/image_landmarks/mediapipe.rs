//! MediaPipe's landmarks in the image, as people write them to JSON: `multi_hand_landmarks`, `landmarks`, `handLandmarks`
//! and their kin, or `right_hand_landmarks` of its holistic model. Coordinates are fractions of the image's width and
//! height; z and visibility, which say nothing of hands, are not used.

use ghand_core::Side;
use ghand_files::value::Value;

use super::view::{Content, Landmarks, Problem, View, Views, point, problem};
use super::{LANDMARK_COUNT, MEDIAPIPE_TIP_INSET};
use crate::pose_sequence::formats::landmarks::{IMAGE_NAMES, SIDE_NAMES, all_sides, find};
use crate::pose_sequence::reading::source::{frames_of, own_id};

/// Names of the hands of the holistic model.
fn holistic_names(side: Side) -> [&'static str; 2] {
    match side {
        Side::Right => ["right_hand_landmarks", "rightHandLandmarks"],
        Side::Left => ["left_hand_landmarks", "leftHandLandmarks"],
    }
}

fn is_frame(value: &Value) -> bool {
    let holistic = [Side::Right, Side::Left].into_iter().flat_map(holistic_names);
    IMAGE_NAMES.into_iter().chain(holistic).any(|name| value.get(name).is_some())
}

pub(super) fn read(value: &Value, side: Side) -> Option<Result<Content, Problem>> {
    let frames = match frames_of(value) {
        Some(frames) if frames.iter().any(is_frame) => frames,
        _ if is_frame(value) => std::slice::from_ref(value),
        _ => return None,
    };
    Some(content(frames, side))
}

fn content(frames: &[Value], side: Side) -> Result<Content, Problem> {
    let ids: Vec<Option<u64>> = frames.iter().map(|frame| own_id(frame)?.parse().ok()).collect();
    let has_numbers = ids.windows(2).all(|pair| pair[0].is_some() && pair[0] < pair[1]);
    let of = |side: Side| -> Result<View, Problem> {
        (0..)
            .zip(frames)
            .zip(&ids)
            .map(|((number, frame), id)| {
                let number = id.filter(|_| has_numbers).unwrap_or(number);
                let hand = hand(frame, side).map_err(|(field, text)| (format!("frames[{number}].{field}"), text))?;
                Ok((number, hand.unwrap_or([None; LANDMARK_COUNT])))
            })
            .collect()
    };
    let is_seen = |view: &View| view.values().flatten().any(Option::is_some);
    let mut view = of(side)?;
    let mut remarks = vec![];
    if !is_seen(&view) {
        let other = of(side.other())?;
        if is_seen(&other) {
            view = other;
            let [wanted, named] = if side == Side::Right { ["right", "left"] } else { ["left", "right"] };
            remarks.push(format!(
                "has {named} hands only, which are taken as {wanted} ones: MediaPipe's older interfaces swap sides of pictures \
                 that are not mirrored"
            ));
        }
    }
    Ok(Content { remarks, is_mediapipe: true, ..Content::new(Views::One(view), MEDIAPIPE_TIP_INSET) })
}

/// The hand of a side, if the frame has it.
fn hand(frame: &Value, side: Side) -> Result<Option<Landmarks>, Problem> {
    if let Some(points) = holistic_names(side).into_iter().find_map(|name| frame.get(name)) {
        return if is_nothing(points) { Ok(None) } else { landmarks(points).map(Some) };
    }
    let Some(hands) = find(frame, &IMAGE_NAMES).filter(|hands| !is_nothing(hands)) else { return Ok(None) };
    let sides = find(frame, &SIDE_NAMES).map(all_sides).unwrap_or_default();
    let items = hands.items().unwrap_or_default();
    // A single hand may stand alone.
    let hands =
        if items.len() == LANDMARK_COUNT || hands.get("landmark").is_some() { vec![hands.clone()] } else { items };
    let is_wanted = |number: &usize| sides.get(*number).is_none_or(|own| *own == side);
    match (0..hands.len()).find(is_wanted).and_then(|number| hands.get(number)) {
        Some(points) if !is_nothing(points) => landmarks(points).map(Some),
        _ => Ok(None),
    }
}

fn is_nothing(value: &Value) -> bool {
    *value == Value::Nothing
        || matches!(value, Value::List(items) if items.is_empty())
        || value.numbers().is_some_and(|array| array.values.is_empty())
}

fn landmarks(hand: &Value) -> Result<Landmarks, Problem> {
    // Protocol buffer messages as JSON wrap the points in one field.
    let hand = find(hand, &["landmark", "landmarks"]).unwrap_or(hand);
    let items = hand.items().unwrap_or_default();
    if items.len() != LANDMARK_COUNT {
        return problem("landmarks", format!("has {} points, must have {LANDMARK_COUNT}", items.len()));
    }
    let mut found = [None; LANDMARK_COUNT];
    for (number, (place, item)) in found.iter_mut().zip(&items).enumerate() {
        let named = |name: &str| item.get(name).and_then(Value::number);
        let plain = || match item.numbers()?.values[..] {
            [x, y, ..] => Some((x, y)),
            _ => None,
        };
        *place = match named("x").zip(named("y")).or_else(plain) {
            Some((x, y)) => point(x, y, 1.0),
            None if *item == Value::Nothing || item.number().is_some_and(f64::is_nan) => None,
            None => {
                return problem(&format!("landmarks[{number}]"), format!("is {}, must have x and y", item.kind()));
            }
        };
    }
    Ok(found)
}
