//! Data sets and trackers that store all frames in arrays: HaWoR and ARCTIC.

use ghand_core::Side;
use ghand_files::value::Value;

use super::{Hand, NO_HAND, SIDE_NAMES, first, flat, frame};
use crate::pose_sequence::reading::source::side_of;
use crate::pose_sequence::{PoseError, Source};

pub(super) fn hawor(source: &Source, value: &Value) -> Result<Vec<Hand>, PoseError> {
    let array = |name: &str, width: usize| -> Result<(usize, Vec<f64>), PoseError> {
        match value.get(name).and_then(Value::numbers) {
            Some(found) if found.shape.first() == Some(&2) && found.shape.len() >= 2 => {
                let frames = found.shape.get(1).copied().unwrap_or(0);
                if found.values.len() == 2 * frames * width {
                    return Ok((frames, found.values.clone()));
                }
                Err(source.invalid(name, format!("has the shape {:?}, expected (2, T, {width})", found.shape)))
            }
            _ => Err(source.invalid(name, format!("must have the shape (2, T, {width}): left hand, right hand"))),
        }
    };
    let (count, orient) = array("pred_rot", 3)?;
    let (fingers_count, fingers) = array("pred_hand_pose", 45)?;
    let (place_count, places) = array("pred_trans", 3)?;
    if [fingers_count, place_count].iter().any(|other| *other != count) {
        return Err(source.invalid("pred_hand_pose", format!("and pred_trans must have {count} frames like pred_rot")));
    }
    let shapes = value.get("pred_betas").map_or(Ok((count, vec![])), |_| array("pred_betas", 10))?.1;
    let valid = value.get("pred_valid").map_or(Ok((count, vec![])), |_| array("pred_valid", 1))?.1;
    let mut hands = Vec::with_capacity(2 * count);
    for (place, side) in [Side::Left, Side::Right].into_iter().enumerate() {
        for k in (0..count).map(|k| place * count + k) {
            let part = |values: &[f64], width: usize| -> Vec<f64> {
                values.iter().skip(k * width).take(width).copied().collect()
            };
            let id = format!("{:04}", k - place * count);
            let shown = valid.get(k).is_none_or(|valid| *valid >= 0.5);
            let found = if shown {
                frame(&id, &part(&orient, 3), &part(&fingers, 45), &part(&shapes, 10), &part(&places, 3))
            } else {
                Err(NO_HAND.into())
            };
            hands.push(Hand::new(id, Some(side), found));
        }
    }
    Ok(hands)
}

/// Arrays of one hand by the names that ARCTIC uses.
fn arctic_parts<'a>(value: &'a Value, ending: &str) -> Option<[Option<&'a Value>; 4]> {
    let part = |name: &str| value.get(&format!("{name}{ending}"));
    let pose = part("pose")?.numbers()?;
    matches!(pose.shape[..], [_, 45 | 48] | [_, 15, 3]).then(|| ["rot", "pose", "trans", "shape"].map(part))
}

pub(super) fn is_arctic(value: &Value) -> bool {
    ["", "_r", "_l"].iter().any(|ending| arctic_parts(value, ending).is_some())
        || ["right", "left"].iter().any(|name| value.get(name).is_some_and(|hand| arctic_parts(hand, "").is_some()))
}

pub(super) fn arctic(source: &Source, value: &Value) -> Result<Vec<Hand>, PoseError> {
    let mut hands = Vec::new();
    for (side, name, ending) in [(Side::Right, "right", "_r"), (Side::Left, "left", "_l")] {
        let nested = value.get(name).and_then(|hand| arctic_parts(hand, ""));
        if let Some(parts) = nested.or_else(|| arctic_parts(value, ending)) {
            rows_of_hand(source, Some(side), parts, &mut hands)?;
        }
    }
    if let Some(parts) = arctic_parts(value, "") {
        let side = first(&[value], &SIDE_NAMES).and_then(side_of);
        rows_of_hand(source, side, parts, &mut hands)?;
    }
    Ok(hands)
}

/// Frames of the arrays `rot`, `pose`, `trans` and `shape` of a hand; 48 numbers of a pose begin with the root.
fn rows_of_hand(
    source: &Source,
    side: Option<Side>,
    [rot, pose, trans, shape]: [Option<&Value>; 4],
    hands: &mut Vec<Hand>,
) -> Result<(), PoseError> {
    let Some(pose) = pose.and_then(Value::numbers) else { return Ok(()) };
    let count = pose.shape.first().copied().unwrap_or(0);
    let width = pose.values.len().checked_div(count).unwrap_or(0);
    let rot = flat(rot);
    let trans = flat(trans);
    let shape = flat(shape);
    for (name, values) in [("rot", &rot), ("trans", &trans)] {
        if !values.is_empty() && values.len() != 3 * count {
            let problem = format!("has {} numbers for {count} frames, expected 3 each", values.len());
            return Err(source.invalid(name, problem));
        }
    }
    // One shape for all frames, or one per frame.
    let one_each = shape.len().is_multiple_of(count.max(1)) && shape.len() >= 10 * count;
    let width_of_shape = if one_each { shape.len() / count.max(1) } else { shape.len() };
    source.copied("shape", width_of_shape, count)?;
    let shape_of = |k: usize| {
        let first = if one_each { k * width_of_shape } else { 0 };
        shape.iter().skip(first).take(width_of_shape).copied().collect::<Vec<f64>>()
    };
    for k in 0..count {
        let row: Vec<f64> = pose.values.iter().skip(k * width).take(width).copied().collect();
        let root = rot.get(3 * k..3 * k + 3).unwrap_or(&[0.0; 3]);
        let place = trans.get(3 * k..3 * k + 3).unwrap_or(&[]);
        let id = format!("{k:04}");
        let (orient, fingers) = if width == 48 { row.split_at(3) } else { (root, row.as_slice()) };
        let found = frame(&id, orient, fingers, &shape_of(k), place);
        hands.push(Hand::new(id, side, found));
    }
    Ok(())
}
