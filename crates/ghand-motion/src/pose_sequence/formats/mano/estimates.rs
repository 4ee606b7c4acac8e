//! Estimates of networks: dictionaries of parameters at any place in a file.

use ghand_core::Side;
use ghand_files::npz::NumericArray;
use ghand_files::value::Value;

use super::components::{Fingers, meaning, said};
use super::{Hand, NO_HAND, SIDE_NAMES, first, flat, frame};
use crate::pose_sequence::reading::recording::LeftRotations;
use crate::pose_sequence::reading::source::{id_of, side_of};
use crate::pose_sequence::{PoseError, Source};

/// Largest depth of parameters in lists and maps.
const MAX_DEPTH: usize = 5;

/// Longest id of a frame, bytes: each of its hands has a copy.
const LONGEST_ID: usize = 256;
/// Most shape parameters of a hand; MANO has 10.
const MOST_SHAPES: usize = 300;

const POSE_NAMES: [&str; 3] = ["hand_pose", "mano_hand_pose", "pred_hand_pose"];
pub(super) const ORIENT_NAMES: [&str; 4] = ["global_orient", "mano_global_orient", "pred_global_orient", "root_orient"];
const SHAPE_NAMES: [&str; 4] = ["betas", "mano_betas", "pred_betas", "shape"];
const PLACE_NAMES: [&str; 6] = ["pred_cam_t_full", "cam_t_full", "cam_t", "transl", "trans", "pred_cam_t"];
/// Names that only the results of networks for right hands have: HaMeR, WiLoR and their kin.
const FLAG_NAMES: [&str; 3] = ["is_right", "isRight", "right"];
const NETWORK_NAMES: [&str; 2] = ["wilor_preds", "pred_mano_params"];
/// Poses of a body without its hands.
const BODY_NAMES: [&str; 3] = ["body_pose", "pose_body", "pred_body_pose"];

pub(super) fn has_parameters(value: &Value, depth: usize) -> bool {
    let children = |value: &Value| match value {
        Value::Map(entries) => entries.iter().any(|(_, child)| has_parameters(child, depth + 1)),
        Value::List(items) => items.iter().any(|child| has_parameters(child, depth + 1)),
        _ => false,
    };
    let here = first(&[value], &POSE_NAMES).is_some() && first(&[value], &ORIENT_NAMES).is_some();
    here || (depth < MAX_DEPTH && children(value))
}

/// All dictionaries of parameters below a value, with the frame that contains them.
pub(super) fn estimates(source: &Source, value: &Value) -> Result<Vec<Hand>, PoseError> {
    let mut hands = Vec::new();
    let top = value.get("frames").unwrap_or(value);
    let said = said(value);
    // What the file says outside the frames belongs to all of them.
    let above = &[&said][..];
    let holds_one = |(name, child): &(String, Value)| {
        let named = ["params", "preds", "mano"].iter().any(|part| name.contains(part));
        (named || side_of_name(name).is_some()) && has_parameters(child, 1)
    };
    if first(&[top], &POSE_NAMES).is_some() || top.entries().iter().any(holds_one) {
        walk(source, top, None, above, None, 0, &mut hands)?;
        return Ok(hands);
    }
    match top {
        Value::List(frames) => {
            for (number, frame) in frames.iter().enumerate() {
                let before = hands.len();
                let id = id_of(frame, number);
                check_id(source, &id)?;
                walk(source, frame, Some(&id), above, None, 0, &mut hands)?;
                if hands.len() == before {
                    hands.push(Hand::new(id, None, Err(NO_HAND.into())));
                }
            }
        }
        _ => {
            for (id, frame) in top.entries() {
                check_id(source, id)?;
                walk(source, frame, Some(id), above, None, 0, &mut hands)?;
            }
        }
    }
    Ok(hands)
}

/// The side that a name inside a file says.
fn side_of_name(name: &str) -> Option<Side> {
    match name {
        "rhand" | "r_hand" | "hand_r" => Some(Side::Right),
        "lhand" | "l_hand" | "hand_l" => Some(Side::Left),
        _ => side_of(&Value::Text(name.into())),
    }
}

fn check_id(source: &Source, id: &str) -> Result<(), PoseError> {
    if id.len() <= LONGEST_ID {
        return Ok(());
    }
    Err(source.invalid("frames", format!("has an id of {} bytes; give ids of at most {LONGEST_ID}", id.len())))
}

fn walk<'a>(
    source: &Source,
    value: &'a Value,
    id: Option<&str>,
    above: &[&'a Value],
    side: Option<Side>,
    depth: usize,
    hands: &mut Vec<Hand>,
) -> Result<(), PoseError> {
    if depth > MAX_DEPTH {
        return Ok(());
    }
    let maps: Vec<&Value> = std::iter::once(value).chain(above.iter().copied()).collect();
    if let (Some(pose), Some(orient)) = (first(&[value], &POSE_NAMES), first(&[value], &ORIENT_NAMES)) {
        let full = full_fingers(value, pose, &maps);
        return parameters(source, id, side, &maps, full.as_ref().unwrap_or(pose), orient, hands);
    }
    match value {
        Value::List(items) => {
            for item in items {
                walk(source, item, id, &maps, side, depth + 1, hands)?;
            }
        }
        Value::Map(entries) => {
            for (name, child) in entries {
                let side = side_of_name(name).or(side);
                walk(source, child, id, &maps, side, depth + 1, hands)?;
            }
        }
        _ => {}
    }
    Ok(())
}

/// The rotations of the fingers, if a dictionary has them beside their components.
fn full_fingers(value: &Value, pose: &Value, maps: &[&Value]) -> Option<Value> {
    let Ok(Fingers::Components(_)) = meaning(pose.numbers()?, maps) else { return None };
    let full = first(&[value], &["fullpose", "full_pose"])?.numbers()?;
    let width = full.shape.last().copied()?;
    if !matches!(width, 45 | 48) {
        return None;
    }
    // 48 numbers begin with the wrist.
    let values: Vec<f64> = full.values.chunks_exact(width).flat_map(|row| &row[width - 45..]).copied().collect();
    Some(Value::Numbers(NumericArray { shape: vec![values.len() / 45, 15, 3], values }))
}

/// The hands of one dictionary, whose arrays contain one or many.
fn parameters(
    source: &Source,
    id: Option<&str>,
    side: Option<Side>,
    maps: &[&Value],
    pose: &Value,
    orient: &Value,
    hands: &mut Vec<Hand>,
) -> Result<(), PoseError> {
    if *pose == Value::Nothing {
        hands.push(Hand::new(id.unwrap_or("0000").into(), side, Err(NO_HAND.into())));
        return Ok(());
    }
    let Some(pose) = pose.numbers() else {
        return Err(source.invalid("hand_pose", format!("is {}, expected numbers", pose.kind())));
    };
    let unusable = |problem: String| Hand::new(id.unwrap_or("0000").into(), side.or(Some(source.wanted)), Err(problem));
    if let Some(body) = first(maps, &BODY_NAMES) {
        let problem = format!(
            "has {} of a body beside hand_pose, so that the root is not the wrist's; name the hands right_hand_pose and \
             left_hand_pose",
            body.kind()
        );
        hands.push(unusable(problem));
        return Ok(());
    }
    let fingers = match meaning(pose, maps) {
        Ok(fingers) => fingers,
        Err(problem) => {
            hands.push(unusable(problem));
            return Ok(());
        }
    };
    let width = fingers.width();
    let count = pose.values.len() / width;
    let [shapes, places] = [first(maps, &SHAPE_NAMES), first(maps, &PLACE_NAMES)];
    // All dictionaries of a file may share parameters of an enclosing one, and each would have a copy.
    for (name, value, most) in
        [("global_orient", Some(orient), 9), ("betas", shapes, MOST_SHAPES), ("the place", places, 3)]
    {
        let numbers = value.and_then(Value::numbers).map_or(0, |array| array.values.len());
        if numbers > most * count.max(1) {
            let problem = format!("has {numbers} numbers in {name} for {count} hands, expected at most {most} each");
            hands.push(unusable(problem));
            return Ok(());
        }
    }
    let orient = flat(Some(orient));
    let per_hand = |values: &[f64], k: usize| -> Vec<f64> {
        let width = values.len() / count.max(1);
        values.iter().skip(k * width).take(width).copied().collect()
    };
    // One shape, position or side may be given for all.
    let shared = |values: &[f64], k: usize, widths: &[usize]| {
        if widths.contains(&values.len()) && count != 1 { values.to_vec() } else { per_hand(values, k) }
    };
    let sides = first(maps, &SIDE_NAMES);
    let left = left_rotations(maps);
    let shapes = flat(shapes);
    let places = flat(places);
    for k in 0..count {
        let own_side = match sides {
            Some(Value::Numbers(array)) => array
                .values
                .get(if array.values.len() == count { k } else { 0 })
                .map(|right| if *right >= 0.5 { Side::Right } else { Side::Left }),
            Some(value) => side_of(value),
            None => None,
        };
        let own_side = own_side.or(side);
        let id = id.map_or_else(|| format!("{k:04}"), str::to_owned);
        let numbers = pose.values.get(k * width..(k + 1) * width).unwrap_or_default();
        let shape = shared(&shapes, k, &[10]);
        let place = shared(&places, k, &[3]);
        let rotations = fingers.rotations(source, own_side.unwrap_or(Side::Right), numbers);
        let rotations = rotations.map_err(|problem| format!("hand_pose {problem}"));
        let found = rotations.and_then(|rotations| frame(&id, &per_hand(&orient, k), &rotations, &shape, &place));
        // Components are those of the model of that side.
        let from_components = matches!(fingers, Fingers::Components(_));
        let left = if from_components { LeftRotations::Own } else { left };
        hands.push(Hand { id, side: own_side, frame: found, left, from_components });
    }
    Ok(())
}

/// What the rotations of a left hand are, by the names around them.
pub(crate) fn left_rotations(maps: &[&Value]) -> LeftRotations {
    let has_flag =
        maps.iter().any(|map| FLAG_NAMES.iter().any(|name| map.get(name).is_some_and(|flag| flag.numbers().is_some())));
    match first(maps, &["mirrored", "is_mirrored"]).and_then(Value::number) {
        Some(0.0) => LeftRotations::Own,
        Some(_) => LeftRotations::Mirrored,
        None if has_flag || first(maps, &NETWORK_NAMES).is_some() => LeftRotations::AssumedMirrored,
        None => LeftRotations::Assumed,
    }
}
