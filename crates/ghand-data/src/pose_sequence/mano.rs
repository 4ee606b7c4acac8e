//! MANO parameters, as data sets and trackers leave them.
//!
//! Rotations are about the axes of MANO's right or left model, in MANO's order (wrist, index, middle, little, ring, thumb, three
//! each), metres. What is understood:
//!
//! - **InterHand2.6M** (`..._MANO_NeuralAnnot.json`): `{capture: {frame: {"right": {"pose": 48, "shape": 10, "trans": 3}, "left": ..}}}`,
//!   or one capture of it. 5 frames a second, measured from MANO's mean pose. Frames come in the order of their numbers.
//! - **HaMeR, WiLoR** and their kin: dictionaries with `global_orient` and `hand_pose`, as matrices (1, 3, 3), (15, 3, 3) or
//!   axis-angles 3, 45; the programs write none themselves, so that users dump what the network returns in JSON, `.npz` or a pickle:
//!   plainly, or under `pred_mano_params`, `wilor_preds`, `mano_params` or the like, one dictionary with all frames in its arrays, or a
//!   list or a map of frames with one or several hands each. `is_right` or `right` tells the side. The parameters are of a right
//!   hand always: for a left one, of the mirrored picture, so that they are mirrored here. `cam_t`, `pred_cam_t_full` or `transl`
//!   place the hand before the camera (x right, y down, z forward). Measured from the flat hand. Pickles with tensors of PyTorch are
//!   refused: nothing in a file is run; write `.cpu().numpy()`.
//! - **HaWoR** (`.npz`): `pred_rot` (2, T, 3), `pred_hand_pose` (2, T, 45), `pred_trans`, `pred_betas`, `pred_valid`; left hand first, each in
//!   its own model's axes. Measured from the flat hand.
//! - **ARCTIC** (`.mano.npy`, or as `.npz`): for each hand `rot` (T, 3), `pose` (T, 45), `trans` (T, 3), `shape` (10); in maps `right` and
//!   `left`, with endings `_r` and `_l`, or plain. Measured from MANO's mean pose. 30 frames a second.
//! - **AMASS** (`.npz`): `poses` (T, 156) of SMPL-H or (T, 165) of SMPL-X, whose last 90 numbers are the left and the right hand, or
//!   `pose_hand` (T, 90); also `right_hand_pose` and `left_hand_pose` (T, 45). Only the fingers move. From the flat hand.
//!
//! A field `flat_hand_mean` in the file says otherwise where it is there.

use ghand_core::hand_model::joint_names::JointRole;
use ghand_core::hand_model::mano::JOINT_NAMES;
use ghand_core::rotation::axis_angle_from_rotation;
use ghand_core::value::Value;
use ghand_core::{Pose, Side};
use glam::{DMat3, DVec3};

use super::recording::{id_of, side_of};
use super::{Motion, PoseError, PoseFrame, Recording, Skipped, Source};
use crate::retarget::mirrored;
use crate::rig::Rig;

/// How deep parameters may lie in lists and maps.
const MAX_DEPTH: usize = 5;

/// Matrices whose columns are this far from being units at right angles are no rotations: half precision stays below.
const ROTATION_TOLERANCE: f64 = 2e-2;

const POSE_NAMES: [&str; 3] = ["hand_pose", "mano_hand_pose", "pred_hand_pose"];
const ORIENT_NAMES: [&str; 4] = ["global_orient", "mano_global_orient", "pred_global_orient", "root_orient"];
const SHAPE_NAMES: [&str; 4] = ["betas", "mano_betas", "pred_betas", "shape"];
const PLACE_NAMES: [&str; 6] = ["pred_cam_t_full", "cam_t_full", "cam_t", "transl", "trans", "pred_cam_t"];
const SIDE_NAMES: [&str; 6] = ["is_right", "right", "side", "handedness", "hand_type", "hand_side"];

/// Frames of both hands, before one is chosen.
struct Hand {
    id: String,
    side: Option<Side>,
    frame: Result<PoseFrame, String>,
}

pub(super) fn read(source: &Source, value: &Value) -> Option<Result<Recording, PoseError>> {
    let (hands, fps, from_mean) = match () {
        () if value.get("pred_rot").is_some() => (hawor(source, value), None, false),
        () if interhand_captures(value).is_some() => (interhand(source, value), Some(5.0), true),
        () if is_arctic(value) => (arctic(source, value), Some(30.0), true),
        () if is_body(value) => (body(source, value), None, false),
        () if has_parameters(value, 0) => (estimates(source, value), None, false),
        () => return None,
    };
    Some(hands.and_then(|hands| recording(source, value, hands, fps, from_mean)))
}

fn recording(
    source: &Source,
    value: &Value,
    hands: Vec<Hand>,
    fps: Option<f64>,
    from_mean: bool,
) -> Result<Recording, PoseError> {
    let flat = value.get("flat_hand_mean").and_then(Value::number);
    let from_mean = flat.map_or(from_mean, |flat| flat == 0.0);
    let has = |side: Side| hands.iter().any(|hand| hand.side == Some(side) && hand.frame.is_ok());
    let other = crate::retarget::other_side(source.wanted);
    let side = match (has(source.wanted), has(other)) {
        (true, _) => Some(source.wanted),
        (false, true) => Some(other),
        (false, false) => None,
    };
    let chosen: Vec<Hand> = hands.into_iter().filter(|hand| side.is_none() || hand.side == side).collect();
    let (total, mut frames, mut skipped) = (chosen.len(), Vec::<PoseFrame>::new(), Skipped::default());
    let mut seen = std::collections::HashSet::new();
    for Hand { id, frame, .. } in chosen {
        match frame {
            Ok(_) if !seen.insert(id.clone()) => skipped.add(&id, "has a second hand of the same side"),
            Ok(frame) => frames.push(frame),
            Err(problem) => skipped.add(&id, problem),
        }
    }
    let warnings = skipped.finish(source, total)?.into_iter().collect();
    let rates = ["fps", "mocap_framerate", "mocap_frame_rate", "frame_rate"];
    let fps = source.fps(value, &rates)?.or(fps);
    Ok(Recording { side, fps, motion: Motion::Mano { frames, from_mean }, warnings })
}

/// Numbers of one hand and one frame: the root and 15 joints as axis-angles or matrices.
fn frame(id: &str, orient: &[f64], fingers: &[f64], shape: &[f64], place: &[f64]) -> Result<PoseFrame, String> {
    let mut rotations = axis_angles(orient, 1)?;
    rotations.extend(axis_angles(fingers, 15)?);
    let translation = match place {
        [] => DVec3::ZERO,
        [x, y, z] => DVec3::new(*x, *y, *z),
        other => return Err(format!("has a translation of {} numbers, expected 3", other.len())),
    };
    if !translation.is_finite() || shape.iter().any(|value| !value.is_finite()) {
        return Err("holds a number that is not finite".into());
    }
    Ok(PoseFrame { id: id.into(), pose: Pose { rotations, translation }, shape: shape.to_vec() })
}

fn axis_angles(values: &[f64], joints: usize) -> Result<Vec<DVec3>, String> {
    if values.iter().any(|value| !value.is_finite()) {
        return Err("holds a number that is not finite".into());
    }
    if values.len() == 3 * joints {
        return Ok(values.chunks_exact(3).map(DVec3::from_slice).collect());
    }
    if values.len() != 9 * joints {
        let [few, many] = [3 * joints, 9 * joints];
        return Err(format!("has {} numbers for {joints} joints, expected {few} or {many}", values.len()));
    }
    let axis_angle = |values: &[f64]| {
        // Rows in the file, columns in glam.
        let matrix = DMat3::from_cols_slice(values).transpose();
        let error = (matrix * matrix.transpose() - DMat3::IDENTITY).to_cols_array();
        if !(error.iter().all(|e| e.abs() <= ROTATION_TOLERANCE) && matrix.determinant() > 0.0) {
            return Err("holds a matrix that is no rotation".to_owned());
        }
        let mut rotation = matrix;
        // Newton's iteration for the polar factor: 2e-2, 4e-4, 2e-7, 3e-14, rounding.
        for _ in 0..5 {
            rotation = (rotation + rotation.inverse().transpose()) * 0.5;
        }
        Ok(axis_angle_from_rotation(&rotation))
    };
    values.chunks_exact(9).map(axis_angle).collect()
}

/// Captures by name, if the value is of InterHand's layout; one without a name if it is a capture alone.
fn interhand_captures(value: &Value) -> Option<Vec<(&str, &Value)>> {
    let is_hand = |value: &Value| *value == Value::Nothing || value.get("pose").is_some();
    let is_frame = |value: &Value| {
        let entries = value.entries();
        !entries.is_empty() && entries.iter().all(|(name, hand)| (name == "right" || name == "left") && is_hand(hand))
    };
    let is_capture = |value: &Value| value.entries().first().is_some_and(|(_, frame)| is_frame(frame));
    if is_capture(value) {
        return Some(vec![("", value)]);
    }
    let captures = value.entries();
    let all = !captures.is_empty() && captures.iter().all(|(_, capture)| is_capture(capture));
    all.then(|| captures.iter().map(|(name, capture)| (name.as_str(), capture)).collect())
}

fn interhand(source: &Source, value: &Value) -> Result<Vec<Hand>, PoseError> {
    let captures = interhand_captures(value).unwrap_or_default();
    let names: Vec<&str> = captures.iter().map(|(name, _)| *name).collect();
    let capture = match (source.take, &captures[..]) {
        (Some(take), _) => captures.iter().find(|(name, _)| *name == take).map(|(_, capture)| *capture),
        (None, [(_, only)]) => Some(*only),
        (None, _) => None,
    };
    let Some(capture) = capture else {
        let problem = format!("there are {}; take one of them with --take", names.join(", "));
        return Err(source.invalid("captures", problem));
    };
    let mut frames: Vec<(&String, &Value)> = capture.entries().iter().map(|(id, frame)| (id, frame)).collect();
    frames.sort_by(|(a, _), (b, _)| a.parse::<u64>().ok().cmp(&b.parse::<u64>().ok()).then_with(|| a.cmp(b)));
    let hands = frames.iter().flat_map(|(id, both)| {
        both.entries().iter().filter_map(move |(name, hand)| {
            let side = if name == "right" { Side::Right } else { Side::Left };
            if *hand == Value::Nothing {
                return None;
            }
            let part = |name: &str| flat(hand.get(name));
            let pose = part("pose");
            let found = match pose.split_at_checked(3) {
                Some((orient, fingers)) if pose.len() == 48 => {
                    frame(id, orient, fingers, &part("shape"), &part("trans"))
                }
                _ => Err(format!("has a pose of {} numbers, expected 48", pose.len())),
            };
            Some(Hand { id: (*id).clone(), side: Some(side), frame: found })
        })
    });
    Ok(hands.collect())
}

/// The numbers of a value in one row; none if there are none.
fn flat(value: Option<&Value>) -> Vec<f64> {
    value.and_then(Value::numbers).map(|array| array.values.clone()).unwrap_or_default()
}

fn first<'a>(maps: &[&'a Value], names: &[&str]) -> Option<&'a Value> {
    names.iter().find_map(|name| maps.iter().find_map(|map| map.get(name)))
}

fn has_parameters(value: &Value, depth: usize) -> bool {
    let children = |value: &Value| match value {
        Value::Map(entries) => entries.iter().any(|(_, child)| has_parameters(child, depth + 1)),
        Value::List(items) => items.iter().any(|child| has_parameters(child, depth + 1)),
        _ => false,
    };
    let here = first(&[value], &POSE_NAMES).is_some() && first(&[value], &ORIENT_NAMES).is_some();
    here || (depth < MAX_DEPTH && children(value))
}

/// All dictionaries of parameters below a value, with the frame that they lie in.
fn estimates(source: &Source, value: &Value) -> Result<Vec<Hand>, PoseError> {
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
                walk(source, frame, Some(&id), &[], None, 0, &mut hands)?;
                if hands.len() == before {
                    hands.push(Hand { id, side: Some(source.wanted), frame: Err("has no hand".into()) });
                }
            }
        }
        _ => {
            for (id, frame) in top.entries() {
                walk(source, frame, Some(id), &[], None, 0, &mut hands)?;
            }
        }
    }
    Ok(hands)
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

/// The hands of one dictionary, of which its arrays hold one or many.
fn parameters(
    source: &Source,
    id: Option<&str>,
    side: Option<Side>,
    maps: &[&Value],
    pose: &Value,
    orient: &Value,
    hands: &mut Vec<Hand>,
) -> Result<(), PoseError> {
    let Some(pose) = pose.numbers() else {
        return Err(source.invalid("hand_pose", format!("is {}, expected numbers", pose.kind())));
    };
    let width = match pose.shape[..] {
        [.., 15, 3, 3] => 135,
        [.., 15, 3] | [.., 45] => 45,
        [.., 135] => 135,
        _ => {
            let problem = format!("has the shape {:?}, expected (T, 15, 3, 3), (T, 15, 3) or (T, 45)", pose.shape);
            hands.push(Hand {
                id: id.unwrap_or("0000").into(),
                side: side.or(Some(source.wanted)),
                frame: Err(problem),
            });
            return Ok(());
        }
    };
    let count = pose.values.len() / width;
    let orient = flat(Some(orient));
    let per_hand = |values: &[f64], k: usize| -> Vec<f64> {
        let width = values.len() / count.max(1);
        values.iter().skip(k * width).take(width).copied().collect()
    };
    // One shape, place or side may stand for all.
    let shared = |values: &[f64], k: usize, widths: &[usize]| {
        if widths.contains(&values.len()) && count != 1 { values.to_vec() } else { per_hand(values, k) }
    };
    let sides = first(maps, &SIDE_NAMES);
    let shapes = flat(first(maps, &SHAPE_NAMES));
    let places = flat(first(maps, &PLACE_NAMES));
    for k in 0..count {
        let own_side = match sides {
            Some(Value::Numbers(array)) => {
                array
                    .values
                    .get(if array.values.len() == count { k } else { 0 })
                    .map(|right| if *right >= 0.5 { Side::Right } else { Side::Left })
            }
            Some(value) => side_of(value),
            None => None,
        };
        let own_side = own_side.or(side);
        let id = id.map_or_else(|| format!("{k:04}"), str::to_owned);
        let fingers: Vec<f64> = pose.values.iter().skip(k * width).take(width).copied().collect();
        let shape = shared(&shapes, k, &[10]);
        let mut found = frame(&id, &per_hand(&orient, k), &fingers, &shape, &shared(&places, k, &[3]));
        if let (Ok(found), Some(Side::Left)) = (&mut found, own_side) {
            // The place is that in the picture, which was never mirrored.
            found.pose.rotations = mirrored(&found.pose).rotations;
        }
        hands.push(Hand { id, side: own_side.or(Some(Side::Right)), frame: found });
    }
    Ok(())
}

fn hawor(source: &Source, value: &Value) -> Result<Vec<Hand>, PoseError> {
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
        return Err(source.invalid("pred_hand_pose", format!("and pred_trans must have {count} frames as pred_rot")));
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
                Err("has no hand".into())
            };
            hands.push(Hand { id, side: Some(side), frame: found });
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

fn is_arctic(value: &Value) -> bool {
    ["", "_r", "_l"].iter().any(|ending| arctic_parts(value, ending).is_some())
        || ["right", "left"].iter().any(|name| value.get(name).is_some_and(|hand| arctic_parts(hand, "").is_some()))
}

fn arctic(source: &Source, value: &Value) -> Result<Vec<Hand>, PoseError> {
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
    let (rot, trans, shape) = (flat(rot), flat(trans), flat(shape));
    for (name, values) in [("rot", &rot), ("trans", &trans)] {
        if !values.is_empty() && values.len() != 3 * count {
            let problem = format!("has {} numbers for {count} frames, expected 3 each", values.len());
            return Err(source.invalid(name, problem));
        }
    }
    // One shape for all frames, or one each.
    let shape_of = |k: usize| {
        let width = if shape.len().is_multiple_of(count.max(1)) && shape.len() >= 10 * count {
            shape.len() / count.max(1)
        } else {
            return shape.clone();
        };
        shape.iter().skip(k * width).take(width).copied().collect()
    };
    for k in 0..count {
        let row: Vec<f64> = pose.values.iter().skip(k * width).take(width).copied().collect();
        let root = rot.get(3 * k..3 * k + 3).unwrap_or(&[0.0; 3]);
        let place = trans.get(3 * k..3 * k + 3).unwrap_or(&[]);
        let id = format!("{k:04}");
        let (orient, fingers) = if width == 48 { row.split_at(3) } else { (root, row.as_slice()) };
        let found = frame(&id, orient, fingers, &shape_of(k), place);
        hands.push(Hand { id, side, frame: found });
    }
    Ok(())
}

fn columns(value: &Value, name: &str, widths: &[usize]) -> Option<usize> {
    match value.get(name)?.numbers()?.shape[..] {
        [_, width] if widths.contains(&width) => Some(width),
        _ => None,
    }
}

fn is_body(value: &Value) -> bool {
    columns(value, "poses", &[156, 165]).is_some()
        || columns(value, "pose_hand", &[90]).is_some()
        || ["right_hand_pose", "left_hand_pose"].iter().any(|name| columns(value, name, &[45]).is_some())
}

fn body(source: &Source, value: &Value) -> Result<Vec<Hand>, PoseError> {
    let mut hands = Vec::new();
    let both = [("poses", vec![156, 165]), ("pose_hand", vec![90])];
    let both = both.into_iter().find_map(|(name, widths)| Some((name, columns(value, name, &widths)?)));
    for (side, name, from_end) in [(Side::Left, "left_hand_pose", 90), (Side::Right, "right_hand_pose", 45)] {
        let (name, width, start) = match both {
            Some((name, width)) => (name, width, width - from_end),
            None if value.get(name).is_some() => (name, 45, 0),
            None => continue,
        };
        let rows = flat(value.get(name));
        if !rows.len().is_multiple_of(width) {
            return Err(source.invalid(name, format!("must have the shape (T, {width})")));
        }
        for (k, row) in rows.chunks_exact(width).enumerate() {
            let id = format!("{k:04}");
            let found = frame(&id, &[0.0; 3], row.get(start..start + 45).unwrap_or(&[]), &[], &[]);
            hands.push(Hand { id, side: Some(side), frame: found });
        }
    }
    Ok(hands)
}

/// Whether a rig has MANO's joints, in MANO's axes: fingers along -X of a right hand (+X of a left one), back of the hand +Y.
pub(super) fn is_mano(rig: &Rig) -> bool {
    let same = rig.joint_names.iter().map(String::as_str).eq(JOINT_NAMES);
    let sign = if rig.side == Side::Right { -1.0 } else { 1.0 };
    same && rig.palm().is_some_and(|[forward, back, _]| forward.x * sign > 0.7 && back.y > 0.7)
}

/// A MANO-like rig from the built-in hand's, turned into MANO's axes about the wrist: fingers from -Y to -X (of a left hand to
/// +X), back of the hand from +X (-X) to +Y.
pub(super) fn stand_in(rig: &Rig) -> Rig {
    let turn = match rig.side {
        Side::Right => DMat3::from_cols(DVec3::Y, DVec3::X, DVec3::NEG_Z),
        Side::Left => DMat3::from_cols(DVec3::NEG_Y, DVec3::NEG_X, DVec3::NEG_Z),
    };
    let wrist = rig.at(JointRole::Wrist).unwrap_or_default();
    let place = |p: DVec3| turn * (p - wrist);
    let frames = |frames: &[DMat3]| frames.iter().map(|frame| turn * *frame).collect();
    Rig {
        name: "MANO's axes".into(),
        joints: rig.joints.iter().map(|joint| place(*joint)).collect(),
        frames: frames(&rig.frames),
        hinges: frames(&rig.hinges),
        tips: rig.tips.map(place),
        ..rig.clone()
    }
}
