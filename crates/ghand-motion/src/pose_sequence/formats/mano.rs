//! MANO parameters in the files of data sets and trackers.
//!
//! Rotations are about the axes of MANO's right or left model, in MANO's order (wrist, index, middle, little, ring,
//! thumb, three each), metres. These layouts are read:
//!
//! - **InterHand2.6M** (`..._MANO_NeuralAnnot.json`):
//!   `{capture: {frame: {"right": {"pose": 48, "shape": 10, "trans": 3}, "left": ..}}}`, or one capture of it. 5 frames
//!   per second, measured from MANO's mean pose. Frames are in the order of their numbers.
//! - **HaMeR, WiLoR** and similar: dictionaries with `global_orient` and `hand_pose`, as matrices (1, 3, 3), (15, 3, 3)
//!   or axis-angles 3, 45; the programs do not write files themselves, so users dump the network's output to JSON,
//!   `.npz` or a pickle: directly, or under `pred_mano_params`, `wilor_preds`, `mano_params` or the like, one
//!   dictionary with all frames in its arrays, or a list or a map of frames with one or several hands each. `is_right`
//!   or `right` gives the side. The parameters are always those of a right hand: for a left hand, those of the mirrored
//!   picture, so they are mirrored here. `cam_t`, `pred_cam_t_full` or `transl` give the hand's position in camera axes
//!   (x right, y down, z forward). Measured from the flat hand.
//! - **HaWoR** (`.npz`): `pred_rot` (2, T, 3), `pred_hand_pose` (2, T, 45), `pred_trans`, `pred_betas`, `pred_valid`;
//!   left hand first, each in the axes of its own model. Measured from the flat hand.
//! - **Dyn-HaMR** (`*_world_results.npz`): see `mano/world_results.rs`.
//! - **GRAB** (`.npz`): see `mano/grab.rs`.
//! - **principal components** under any of these names, **DexYCB**: see `mano/components.rs`.
//! - **ARCTIC** (`.mano.npy`, or as `.npz`): for each hand `rot` (T, 3), `pose` (T, 45), `trans` (T, 3), `shape` (10);
//!   in maps `right` and `left`, with suffixes `_r` and `_l`, or without. Measured from MANO's mean pose. 30 frames per
//!   second.
//! - **AMASS** (`.npz`): `poses` (T, 156) of SMPL-H or (T, 165) of SMPL-X, whose last 90 numbers are the left and the
//!   right hand, or `pose_hand` (T, 90); also `right_hand_pose` and `left_hand_pose` (T, 45) and other names of them in
//!   `mano/bodies.rs`. Only the fingers move. Measured from the flat hand.
//!
//! A field `flat_hand_mean` in the file overrides these.

mod arrays;
mod bodies;
mod components;
mod estimates;
mod grab;
mod world_results;

use std::sync::OnceLock;

use ghand_core::rotation::axis_angle_from_rotation;
use ghand_core::{Pose, Side};
use ghand_files::value::Value;
use ghand_hand_model::files::mano::JOINT_NAMES;
use ghand_hand_model::joints::names::JointRole;
use glam::{DMat3, DVec3};

use super::plain;
use crate::average_hand::average_hand;
use crate::pose_sequence::reading::known_layouts;
use crate::pose_sequence::reading::recording::{LeftRotations, ManoRows};
use crate::pose_sequence::reading::source::in_range;
use crate::pose_sequence::{Motion, PoseError, PoseFrame, Recording, Skipped, Source};
use crate::rest_skeleton::RestSkeleton;
use arrays::{arctic, hawor, is_arctic};
pub(crate) use estimates::left_rotations;
use estimates::{estimates, has_parameters};

/// Matrices whose columns are this far from orthonormal are not rotations: half precision stays below.
const ROTATION_TOLERANCE: f64 = 2e-2;

const SIDE_NAMES: [&str; 7] = ["is_right", "isRight", "right", "side", "handedness", "hand_type", "hand_side"];

/// The problem of a frame in which a tracker found nothing.
const NO_HAND: &str = "has no hand";

/// Frames of both hands, before one is chosen.
struct Hand {
    id: String,
    side: Option<Side>,
    frame: Result<PoseFrame, String>,
    /// What its rotations are if it is a left one.
    left: LeftRotations,
    /// Whether it was made of components, which are measured from the mean pose unless the file says otherwise.
    from_components: bool,
}

impl Hand {
    /// A hand of a data set, whose rotations are about the axes of its own model.
    fn new(id: String, side: Option<Side>, frame: Result<PoseFrame, String>) -> Hand {
        Hand { id, side, frame, left: LeftRotations::Own, from_components: false }
    }
}

pub(crate) fn read(source: &Source, value: &Value) -> Option<Result<Recording, PoseError>> {
    let mut remark = None;
    let (hands, fps, from_mean) = if value.get("pred_rot").is_some() {
        (hawor(source, value), None, false)
    } else if interhand_captures(value).is_some() {
        (interhand(source, value), Some(5.0), true)
    } else if components::are_named(source, value) {
        (components::hands(source, value), Some(30.0), true)
    } else if is_arctic(value) {
        (arctic(source, value), Some(30.0), true)
    } else if grab::is_grab(value) {
        (grab::hands(source, value), None, false)
    } else if bodies::is_body(value) {
        remark = bodies::warning(value);
        (bodies::hands(source, value), None, false)
    } else if world_results::is_results(value) {
        (world_results::hands(source, value), None, false)
    } else if has_parameters(value, 0) && !crate::pose_sequence::reading::sides::holds_lists(value) {
        (estimates(source, value), None, false)
    } else if let Some(inner) = bodies::inside(value) {
        remark = bodies::warning(inner);
        (bodies::hands(source, inner), None, false)
    } else if let Some(problem) = known_layouts::body_without_hands(value).filter(|_| !plain::has_hand(source, value)) {
        return Some(Err(source.invalid("content", problem.into())));
    } else {
        return None;
    };
    let mut found = hands.and_then(|hands| recording(source, value, hands, fps, from_mean));
    if let (Ok(recording), Some(remark)) = (&mut found, remark) {
        recording.warnings.push(remark.into());
    }
    Some(found)
}

fn recording(
    source: &Source,
    value: &Value,
    hands: Vec<Hand>,
    fps: Option<f64>,
    from_mean: bool,
) -> Result<Recording, PoseError> {
    let Chosen { side, hands: chosen, remark } = chosen(source.wanted, hands);
    let mut frames = Vec::<PoseFrame>::new();
    let mut skipped = Skipped::default();
    let mut seen = std::collections::HashSet::new();
    let mut left = LeftRotations::Own;
    let by_components = chosen.iter().any(|hand| hand.from_components && hand.frame.is_ok());
    let flat = components::flag(value, "flat_hand_mean");
    let from_mean = flat.map_or(from_mean || by_components, |flat| !flat);
    for Hand { id, frame, from_components, left: own_left, .. } in chosen {
        match frame {
            Ok(_) if from_components != by_components => {
                skipped.add(&id, "has rotations, other frames have components, which have another zero");
            }
            Ok(_) if !seen.insert(id.clone()) => skipped.add(&id, "has a second hand of the same side"),
            Ok(frame) => {
                if frames.is_empty() {
                    left = own_left;
                }
                frames.push(frame);
            }
            Err(problem) => skipped.add(&id, problem),
        }
    }
    let motion = Motion::Mano(ManoRows { frames, from_mean, opengl: false, left });
    Ok(Recording { side, usual_fps: fps, motion, skipped, warnings: remark.into_iter().collect() })
}

/// The hands of one side.
struct Chosen {
    side: Option<Side>,
    hands: Vec<Hand>,
    /// Why it is not the wanted side, if the file has that too.
    remark: Option<String>,
}

/// The hands of the wanted side if one of them is usable, else those of the other.
fn chosen(wanted: Side, hands: Vec<Hand>) -> Chosen {
    let has = |side: Side| hands.iter().any(|hand| hand.side == Some(side) && hand.frame.is_ok());
    let other = wanted.other();
    let side = match (has(wanted), has(other)) {
        (true, _) => Some(wanted),
        (false, true) => Some(other),
        (false, false) => None,
    };
    let problem = hands.iter().filter(|hand| hand.side == Some(wanted)).find_map(|hand| {
        let problem = hand.frame.as_ref().err().filter(|problem| *problem != NO_HAND)?;
        Some(format!("no {wanted} hand can be used; frame {:?}: {problem}", hand.id))
    });
    let remark = problem.filter(|_| side == Some(other));
    // If none is usable, the error is about the wanted one.
    let kept = side.or_else(|| hands.iter().any(|hand| hand.side == Some(wanted)).then_some(wanted));
    // A frame without a hand is of either side.
    let is_kept = |hand: &Hand| kept.is_none() || hand.side == kept || (hand.side.is_none() && hand.frame.is_err());
    let hands = hands.into_iter().filter(is_kept).collect();
    Chosen { side, hands, remark }
}

/// Numbers of one hand and one frame: the root and 15 joints as axis-angles or matrices.
pub(crate) fn frame(
    id: &str,
    orient: &[f64],
    fingers: &[f64],
    shape: &[f64],
    place: &[f64],
) -> Result<PoseFrame, String> {
    let mut rotations = axis_angles(orient, 0..1)?;
    rotations.extend(axis_angles(fingers, 1..16)?);
    let translation = match place {
        [] => DVec3::ZERO,
        [x, y, z] => DVec3::new(*x, *y, *z),
        other => return Err(format!("has a translation of {} numbers, expected 3", other.len())),
    };
    let pose = Pose { rotations, translation };
    let names = JOINTS.get_or_init(|| JOINT_NAMES.map(String::from));
    in_range(&pose, shape, names).map_err(|(field, problem)| format!("{field}: {problem}"))?;
    Ok(PoseFrame { id: id.into(), pose, shape: shape.to_vec() })
}

/// Names of MANO's joints.
static JOINTS: OnceLock<[String; 16]> = OnceLock::new();

/// Rotations of those of MANO's joints.
fn axis_angles(values: &[f64], joints: std::ops::Range<usize>) -> Result<Vec<DVec3>, String> {
    let [few, many] = [3 * joints.len(), 9 * joints.len()];
    if values.len() != few && values.len() != many {
        let count = joints.len();
        return Err(format!("has {} numbers for {count} joints, expected {few} or {many}", values.len()));
    }
    let width = if values.len() == few { 3 } else { 9 };
    let rotation = |(joint, values): (usize, &[f64])| {
        let name = JOINT_NAMES.get(joint).copied().unwrap_or_default();
        axis_angle(values).map_err(|problem| format!("joint {name:?} {problem}"))
    };
    joints.zip(values.chunks_exact(width)).map(rotation).collect()
}

/// The rotation of an axis-angle vector or of a matrix, row by row.
fn axis_angle(values: &[f64]) -> Result<DVec3, &'static str> {
    if values.iter().any(|value| !value.is_finite()) {
        return Err("has a number that is not finite");
    }
    if values.len() == 3 {
        return Ok(DVec3::from_slice(values));
    }
    if values.iter().all(|value| *value == 0.0) {
        return Err("has a matrix of zeros, which is not a rotation");
    }
    // Rows in the file, columns in glam.
    let matrix = DMat3::from_cols_slice(values).transpose();
    let error = (matrix * matrix.transpose() - DMat3::IDENTITY).to_cols_array();
    if !(error.iter().all(|e| e.abs() <= ROTATION_TOLERANCE) && matrix.determinant() > 0.0) {
        return Err("has a matrix that is not a rotation: its rows must be units at right angles, right-handed");
    }
    let mut rotation = matrix;
    // Newton's iteration for the polar factor: 2e-2, 4e-4, 2e-7, 3e-14, rounding.
    for _ in 0..5 {
        rotation = (rotation + rotation.inverse().transpose()) * 0.5;
    }
    Ok(axis_angle_from_rotation(&rotation))
}

/// Captures by name, if the value has InterHand's layout; one without a name if it is a single capture.
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

/// Whether a value has InterHand2.6M's layout.
pub(crate) fn is_interhand(value: &Value) -> bool {
    value.get("pred_rot").is_none() && interhand_captures(value).is_some()
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
        let problem = format!("there are {}; choose one with --take", names.join(", "));
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
            Some(Hand::new((*id).clone(), Some(side), found))
        })
    });
    Ok(hands.collect())
}

/// The numbers of a value as one row; empty if there are none.
fn flat(value: Option<&Value>) -> Vec<f64> {
    value.and_then(Value::numbers).map(|array| array.values.clone()).unwrap_or_default()
}

fn first<'a>(maps: &[&'a Value], names: &[&str]) -> Option<&'a Value> {
    names.iter().find_map(|name| maps.iter().find_map(|map| map.get(name)))
}

/// Whether a skeleton has MANO's joints, in MANO's axes: fingers along -X of a right hand (+X of a left one), back of
/// the hand +Y.
pub(crate) fn is_mano(rig: &RestSkeleton) -> bool {
    let same = rig.joint_names.iter().map(String::as_str).eq(JOINT_NAMES);
    let sign = if rig.side == Side::Right { -1.0 } else { 1.0 };
    same && rig.palm().is_some_and(|[forward, back, _]| forward.x * sign > 0.7 && back.y > 0.7)
}

/// A MANO-like skeleton from the average hand's, turned into MANO's axes about the wrist: fingers from -Y to -X (of a
/// left hand to +X), back of the hand from +X (-X) to +Y.
pub(crate) fn stand_in(side: Side) -> Result<RestSkeleton, PoseError> {
    let turn = match side {
        Side::Right => DMat3::from_cols(DVec3::Y, DVec3::X, DVec3::NEG_Z),
        Side::Left => DMat3::from_cols(DVec3::NEG_Y, DVec3::NEG_X, DVec3::NEG_Z),
    };
    let rig = average_hand(side)?;
    let wrist = rig.joint_position(JointRole::Wrist).unwrap_or_default();
    let place = |p: DVec3| turn * (p - wrist);
    Ok(RestSkeleton {
        name: "MANO's axes".into(),
        joints: rig.joints.iter().map(|joint| place(*joint)).collect(),
        frames: rig.frames.iter().map(|frame| turn * *frame).collect(),
        axes: rig.axes.iter().map(|axes| axes.turned(turn)).collect(),
        tips: rig.tips.map(place),
        ..rig
    })
}
