//! Estimates of networks: dictionaries of parameters at any place in a file.

use ghand_core::Side;
use ghand_files::value::Value;

use super::super::recording::LeftRotations;
use super::super::source::{id_of, side_of};
use super::super::{PoseError, Source};
use super::{Hand, SIDE_NAMES, first, flat, frame};

/// Largest depth of parameters in lists and maps.
const MAX_DEPTH: usize = 5;

/// Longest id of a frame, bytes: each of its hands has a copy.
const LONGEST_ID: usize = 256;
/// Most shape parameters of a hand; MANO has 10.
const MOST_SHAPES: usize = 300;

const POSE_NAMES: [&str; 3] = ["hand_pose", "mano_hand_pose", "pred_hand_pose"];
const ORIENT_NAMES: [&str; 4] = ["global_orient", "mano_global_orient", "pred_global_orient", "root_orient"];
const SHAPE_NAMES: [&str; 4] = ["betas", "mano_betas", "pred_betas", "shape"];
const PLACE_NAMES: [&str; 6] = ["pred_cam_t_full", "cam_t_full", "cam_t", "transl", "trans", "pred_cam_t"];
/// Names that only the results of networks for right hands have: HaMeR, WiLoR and their kin.
const FLAG_NAMES: [&str; 3] = ["is_right", "isRight", "right"];
const NETWORK_NAMES: [&str; 2] = ["wilor_preds", "pred_mano_params"];

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
    let holds_one = |(name, child): &(String, Value)| {
        let named = ["params", "preds", "mano"].iter().any(|part| name.contains(part));
        (named || side_of(&Value::Text(name.clone())).is_some()) && has_parameters(child, 1)
    };
    if first(&[top], &POSE_NAMES).is_some() || top.entries().iter().any(holds_one) {
        walk(source, top, None, &[], None, 0, &mut hands)?;
        return Ok(hands);
    }
    match top {
        Value::List(frames) => {
            for (number, frame) in frames.iter().enumerate() {
                let before = hands.len();
                let id = id_of(frame, number);
                check_id(source, &id)?;
                walk(source, frame, Some(&id), &[], None, 0, &mut hands)?;
                if hands.len() == before {
                    hands.push(Hand::own(id, None, Err("has no hand".into())));
                }
            }
        }
        _ => {
            for (id, frame) in top.entries() {
                check_id(source, id)?;
                walk(source, frame, Some(id), &[], None, 0, &mut hands)?;
            }
        }
    }
    Ok(hands)
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
        return parameters(source, id, side, &maps, pose, orient, hands);
    }
    match value {
        Value::List(items) => {
            for item in items {
                walk(source, item, id, &maps, side, depth + 1, hands)?;
            }
        }
        Value::Map(entries) => {
            for (name, child) in entries {
                let side = side_of(&Value::Text(name.clone())).or(side);
                walk(source, child, id, &maps, side, depth + 1, hands)?;
            }
        }
        _ => {}
    }
    Ok(())
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
    let mut unusable = |problem: String| hands.push(Hand::own(id.unwrap_or("0000").into(), side, Err(problem)));
    if *pose == Value::Nothing {
        unusable("has no hand".into());
        return Ok(());
    }
    let Some(pose) = pose.numbers() else {
        return Err(source.invalid("hand_pose", format!("is {}, expected numbers", pose.kind())));
    };
    let width = match pose.shape[..] {
        [.., 15, 3, 3] => 135,
        [.., 15, 3] | [.., 45] => 45,
        [.., 135] => 135,
        _ => {
            unusable(format!("has the shape {:?}, expected (T, 15, 3, 3), (T, 15, 3) or (T, 45)", pose.shape));
            return Ok(());
        }
    };
    let count = pose.values.len() / width;
    let [shapes, places] = [first(maps, &SHAPE_NAMES), first(maps, &PLACE_NAMES)];
    // All dictionaries of a file may share parameters of an enclosing one, and each would have a copy.
    for (name, value, most) in
        [("global_orient", Some(orient), 9), ("betas", shapes, MOST_SHAPES), ("the place", places, 3)]
    {
        let numbers = value.and_then(Value::numbers).map_or(0, |array| array.values.len());
        if numbers > most * count.max(1) {
            unusable(format!("has {numbers} numbers in {name} for {count} hands, expected at most {most} each"));
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
    let (shapes, places) = (flat(shapes), flat(places));
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
        let fingers: Vec<f64> = pose.values.iter().skip(k * width).take(width).copied().collect();
        let shape = shared(&shapes, k, &[10]);
        let found = frame(&id, &per_hand(&orient, k), &fingers, &shape, &shared(&places, k, &[3]));
        hands.push(Hand { id, side: own_side, frame: found, left });
    }
    Ok(())
}

/// What the rotations of a left hand are, by the names around them.
pub(in super::super) fn left_rotations(maps: &[&Value]) -> LeftRotations {
    let has_flag =
        maps.iter().any(|map| FLAG_NAMES.iter().any(|name| map.get(name).is_some_and(|flag| flag.numbers().is_some())));
    match first(maps, &["mirrored", "is_mirrored"]).and_then(Value::number) {
        Some(0.0) => LeftRotations::Own,
        Some(_) => LeftRotations::Mirrored,
        None if has_flag || first(maps, &NETWORK_NAMES).is_some() => LeftRotations::AssumedMirrored,
        None => LeftRotations::Assumed,
    }
}
