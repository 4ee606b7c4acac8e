//! Joints of WebXR (25) and OpenXR (26: the palm first, then WebXR's), as positions and orientations in space.
//!
//! Neither defines a file format. This reads JSON with a list of frames (`{"fps":72,"frames":[...]}`, the list alone,
//! or JSON Lines), each with the joints in `joints` (or `jointTransforms`, `poses`, `matrices`): as a map by name, or a
//! list in order. A joint is `{"position": .., "orientation": ..}`, also inside `pose` or `transform`, as lists (x, y,
//! z, w) or by the names of the components, or `matrix` / `offsetMatrix` of 16 numbers (`transform.matrix` of an
//! `XRJointPose`), column by column; or a row of 7 numbers. The output of WebXR's `fillPoses`, 16 numbers per joint in
//! one row, is read directly, also if `JSON.stringify` converted the `Float32Array` to a map. A frame may have both
//! hands, in `left` and `right`, in `hands` as a map or as a list with `handedness`.
//!
//! `.npz`: `positions` (T, 25 or 26, 3) and `orientations` (T, 25 or 26, 4), or positions alone. `.npy`, or numbers alone: (T, 25 or 26,
//! 7), (T, 25 or 26, 16), (T, 25 or 26, 4, 4), (T, 400 or 416), or one frame without T. A matrix that has its
//! translation in the last column of its rows, as in NumPy's (4, 4), is read row by row.
//!
//! Metres; quaternions x, y, z, w; the frame of a joint has -Z along the bone and +Y out of the back of the hand. The
//! positions are compared with that ([`axes`]): where the frames are other ones, or missing, the positions alone are fitted.
//! XR's world has y up and looks along -z; ghand's pictures have y down and look along z: the world is rotated by half a
//! turn about x.

mod axes;

use ghand_core::Side;
use ghand_files::npz::NumericArray;
use ghand_files::value::Value;
use ghand_hand_model::joints::names::JointRole;
use glam::{DMat3, DMat4, DQuat, DVec3};

use crate::pose_sequence::reading::source::{OPENGL_AXES, frames_of, id_of, point_in_range, side_of, vector};
use crate::pose_sequence::{PoseError, Recording, Skipped, Source};
use crate::rest_skeleton::RestSkeleton;
use axes::XrFrame;

const JOINTS_NAMES: [&str; 8] =
    ["joints", "jointTransforms", "joint_poses", "jointPoses", "poses", "matrices", "transforms", "fillPoses"];
const POSITION_NAMES: [&str; 5] = ["position", "positions", "translation", "pos", "p"];
const ORIENTATION_NAMES: [&str; 6] = ["orientation", "orientations", "rotation", "quaternion", "rot", "q"];
const MATRIX_NAMES: [&str; 3] = ["matrix", "offsetMatrix", "transform"];
const SIDE_NAMES: [&str; 4] = ["handedness", "side", "hand", "hand_side"];

/// Tolerance of the entries of a row-major matrix, and of the last row of a transform.
const AFFINE_TOLERANCE: f64 = 1e-4;

/// A joint in ghand's world. Its frame may be missing or wrong.
#[derive(Debug, Clone)]
struct Joint {
    position: DVec3,
    orientation: Result<DMat3, String>,
}

pub(crate) fn read(source: &Source, value: &Value) -> Option<Result<Recording, PoseError>> {
    if value.get("positions").and_then(Value::numbers).is_some_and(|array| array.shape.len() == 3) {
        return Some(archive(source, value));
    }
    let numbers = value.get("frames").unwrap_or(value);
    if is_joints(numbers) {
        return Some(numbers_of_joints(source, value, numbers));
    }
    let is_single = joints(value).is_some() || (matches!(value, Value::Map(_)) && holds_joints(value));
    let frames = if is_single { std::slice::from_ref(value) } else { frames_of(value)? };
    if !frames.iter().any(holds_joints) {
        return None;
    }
    Some(frames_of_joints(source, value, frames))
}

fn holds_joints(frame: &Value) -> bool {
    hands(frame).iter().any(|(_, hand)| joints(hand).is_some())
}

/// Whether a value consists of numbers that can only be the joints of one or more frames.
pub(crate) fn is_joints(value: &Value) -> bool {
    value.numbers().is_some_and(|array| is_frame(&array.shape) || is_sequence(&array.shape))
}

/// Joints as plain numbers, with the other fields of `value`.
pub(crate) fn numbers_of_joints(source: &Source, value: &Value, numbers: &Value) -> Result<Recording, PoseError> {
    match numbers {
        Value::Numbers(array) if is_frame(&array.shape) => {
            frames_of_joints(source, value, std::slice::from_ref(numbers))
        }
        _ => frames_of_joints(source, value, &numbers.items().unwrap_or_default()),
    }
}

/// Positions alone, with the other fields of `value`; the side is that of a field or unknown.
pub(crate) fn positions_alone(source: &Source, value: &Value, array: &NumericArray) -> Result<Recording, PoseError> {
    let joints = array.shape.iter().rev().nth(1).copied().unwrap_or(25);
    let mut frames = vec![];
    let mut skipped = Skipped::default();
    for (k, numbers) in array.values.chunks_exact(3 * joints).enumerate() {
        let positions = numbers.chunks_exact(3).skip(joints - 25).map(DVec3::from_slice);
        add_frame(
            format!("{k:04}"),
            positions.map(|at| joint(at, Err(NO_ORIENTATION.into()))),
            &mut frames,
            &mut skipped,
        );
    }
    let side = find(value, &SIDE_NAMES).and_then(side_of);
    axes::recording(source, frames, side, skipped)
}

/// Adds the frame of these 25 joints.
fn add_frame(
    id: String,
    joints: impl Iterator<Item = Result<Joint, String>>,
    frames: &mut Vec<XrFrame>,
    skipped: &mut Skipped,
) {
    let names = &RestSkeleton::webxr(Side::Right).joint_names;
    let named = |(joint, name): (Result<Joint, String>, &String)| {
        joint.map_err(|problem| match problem.as_str() {
            MISSING => format!("joint {name:?} {problem}"),
            _ => format!("joint {name:?}: {problem}"),
        })
    };
    match joints.zip(names).map(named).collect::<Result<Vec<Joint>, String>>() {
        Ok(joints) => frames.push(XrFrame { id, joints }),
        Err(problem) => skipped.add(&id, problem),
    }
}

/// The shape of the joints of one frame.
fn is_frame(shape: &[usize]) -> bool {
    matches!(shape, [25 | 26, 7 | 16] | [25 | 26, 4, 4] | [400 | 416])
}

/// The shape of the joints of many frames.
fn is_sequence(shape: &[usize]) -> bool {
    shape.split_first().is_some_and(|(_, frame)| is_frame(frame))
}

fn find<'a>(value: &'a Value, names: &[&str]) -> Option<&'a Value> {
    names.iter().find_map(|name| value.get(name))
}

/// The value that contains the joints of a hand, if there is one.
fn joints(value: &Value) -> Option<&Value> {
    let (holder, is_named) = match value {
        Value::Map(_) => (find(value, &JOINTS_NAMES)?, true),
        other => (other, false),
    };
    let is_joints = match holder {
        Value::Map(entries) => entries.iter().any(|(name, _)| JointRole::of(name).is_some()),
        Value::List(items) => matches!(items.len(), 25 | 26) && (is_named || items.iter().any(is_joint)),
        Value::Numbers(array) => {
            let are_positions = value.get("joints").is_some() && matches!(array.shape[..], [25 | 26, 3]);
            is_frame(&array.shape) || are_positions
        }
        _ => false,
    };
    is_joints.then_some(holder)
}

/// The hands of a frame, with their sides if the file gives them.
fn hands(frame: &Value) -> Vec<(Option<Side>, &Value)> {
    let own = |hand: &Value| find(hand, &SIDE_NAMES).and_then(side_of);
    if joints(frame).is_some() {
        return vec![(own(frame), frame)];
    }
    let holder = frame.get("hands").unwrap_or(frame);
    match holder {
        Value::List(items) => items.iter().map(|hand| (own(hand), hand)).collect(),
        _ => holder
            .entries()
            .iter()
            .filter_map(|(name, hand)| Some((Some(side_of(&Value::Text(name.clone()))?), hand)))
            .collect(),
    }
}

fn frames_of_joints(source: &Source, value: &Value, frames: &[Value]) -> Result<Recording, PoseError> {
    let shared = find(value, &SIDE_NAMES).and_then(side_of);
    let has = |wanted: Side| {
        frames.iter().any(|frame| {
            hands(frame)
                .iter()
                .any(|(side, hand)| side.or(shared).is_none_or(|side| side == wanted) && joints(hand).is_some())
        })
    };
    let other = source.wanted.other();
    let side = if has(source.wanted) { source.wanted } else { other };
    let mut placed = Vec::new();
    let mut skipped = Skipped::default();
    let mut known_side = shared;
    for (number, frame) in frames.iter().enumerate() {
        let id = id_of(frame, number);
        let hands = hands(frame);
        let hand = hands.iter().find(|(own, _)| own.or(shared).is_none_or(|own| own == side));
        known_side = known_side.or(hand.and_then(|(own, _)| *own));
        match hand.and_then(|(_, hand)| joints(hand)) {
            None => skipped.add(&id, "has no joints of this hand"),
            Some(joints) => add_frame(id, placed_joints(joints).into_iter(), &mut placed, &mut skipped),
        }
    }
    axes::recording(source, placed, known_side, skipped)
}

fn archive(source: &Source, value: &Value) -> Result<Recording, PoseError> {
    let array = |name: &str, width: usize| match value.get(name).and_then(Value::numbers) {
        Some(found) => match found.shape[..] {
            [count, joints @ (25 | 26), found_width] if found_width == width => Ok((count, joints, found)),
            _ => Err(source.invalid(name, format!("has the shape {:?}, expected (T, 25 or 26, {width})", found.shape))),
        },
        None => Err(source.invalid(name, "must be numbers".into())),
    };
    let (count, joints, positions) = array("positions", 3)?;
    if value.get("orientations").is_none() {
        return positions_alone(source, value, positions);
    }
    let (other_count, other_joints, orientations) = array("orientations", 4)?;
    if (count, joints) != (other_count, other_joints) {
        return Err(
            source.invalid("orientations", format!("must be for {count} frames of {joints} joints as positions"))
        );
    }
    let mut frames = Vec::new();
    let mut skipped = Skipped::default();
    for k in 0..count {
        let place = |j: usize| {
            let at = k * joints + j;
            let position = positions.values.get(3 * at..3 * at + 3).map_or(DVec3::NAN, DVec3::from_slice);
            let orientation = orientations.values.get(4 * at..4 * at + 4).map_or(DQuat::NAN, DQuat::from_slice);
            joint(position, rotation(orientation))
        };
        // OpenXR's palm is not needed.
        add_frame(format!("{k:04}"), (joints - 25..joints).map(place), &mut frames, &mut skipped);
    }
    let side = find(value, &SIDE_NAMES).and_then(side_of);
    axes::recording(source, frames, side, skipped)
}

/// The 25 joints of WebXR in order.
fn placed_joints(joints: &Value) -> Vec<Result<Joint, String>> {
    let rig = RestSkeleton::webxr(Side::Right);
    let by_rows = is_row_by_row(joints);
    let mut found: Vec<Option<Result<Joint, String>>> = vec![None; rig.joints.len()];
    if let Value::Map(entries) = joints {
        let names: Vec<Option<&str>> = entries.iter().map(|(name, _)| Some(name.as_str())).collect();
        for ((_, joint), place) in entries.iter().zip(places(rig, &names)) {
            if let Some(slot) = place.and_then(|k| found.get_mut(k)) {
                *slot = (*joint != Value::Nothing).then(|| placed_joint(joint, by_rows));
            }
        }
    } else {
        let items: Vec<Result<Joint, String>> = match joints.numbers() {
            Some(array) if array.shape.len() == 1 => array.values.chunks(16).map(|m| matrix(m, by_rows)).collect(),
            _ => joints.items().unwrap_or_default().iter().map(|item| placed_joint(item, by_rows)).collect(),
        };
        let names: Vec<Option<usize>> = match joints {
            Value::List(items) => {
                let name = |item| find(item, &["name", "jointName", "joint"]).and_then(Value::text);
                places(rig, &items.iter().map(name).collect::<Vec<_>>())
            }
            _ => vec![],
        };
        let by_name = !names.is_empty() && names.iter().filter(|name| name.is_some()).count() >= rig.joints.len();
        let palm = items.len().saturating_sub(rig.joints.len());
        for (k, joint) in items.into_iter().enumerate() {
            let to = if by_name { names.get(k).copied().flatten() } else { k.checked_sub(palm) };
            if let Some(slot) = to.and_then(|to| found.get_mut(to)) {
                *slot = Some(joint);
            }
        }
    }
    found.into_iter().map(|joint| joint.unwrap_or_else(|| Err(MISSING.into()))).collect()
}

/// The joint of a rig that each name means, by all names together.
fn places(rig: &RestSkeleton, names: &[Option<&str>]) -> Vec<Option<usize>> {
    let texts: Vec<String> = names.iter().map(|name| name.unwrap_or_default().to_owned()).collect();
    let roles = JointRole::of_any_joints(&texts);
    let place = |(name, role): (&String, &Option<JointRole>)| {
        let own = |(own, own_role): (&String, &Option<JointRole>)| own == name || (role.is_some() && own_role == role);
        rig.joint_names.iter().zip(&rig.roles).position(own)
    };
    texts.iter().zip(&roles).map(place).collect()
}

/// Whether the joints are matrices with their translations at the ends of rows.
fn is_row_by_row(joints: &Value) -> bool {
    let largest = |places: [usize; 3]| {
        let of = |m: &[f64]| {
            places.map(|place| m.get(place).map_or(0.0, |entry| entry.abs())).into_iter().fold(0.0, f64::max)
        };
        matrices(joints).into_iter().map(of).fold(0.0, f64::max)
    };
    largest([12, 13, 14]) <= AFFINE_TOLERANCE && largest([3, 7, 11]) > AFFINE_TOLERANCE
}

/// The matrices of all joints that have one, 16 numbers each.
fn matrices(joints: &Value) -> Vec<&[f64]> {
    match joints {
        Value::Numbers(array) if array.values.len().is_multiple_of(16) && !matches!(array.shape[..], [_, 7 | 3]) => {
            array.values.chunks_exact(16).collect()
        }
        Value::Map(entries) => entries.iter().filter_map(|(_, joint)| matrix_of(joint)).collect(),
        Value::List(items) => items.iter().filter_map(matrix_of).collect(),
        _ => vec![],
    }
}

fn matrix_of(joint: &Value) -> Option<&[f64]> {
    let array = match joint {
        Value::Numbers(array) => array,
        _ => holders(joint).find_map(|map| find(map, &MATRIX_NAMES)?.numbers())?,
    };
    Some(array.values.as_slice()).filter(|values| values.len() == 16)
}

/// Fields that may contain the position of a joint, the most specific first.
fn holders(joint: &Value) -> impl Iterator<Item = &Value> {
    let pose = joint.get("pose");
    [pose.and_then(|pose| pose.get("transform")), pose, joint.get("transform"), Some(joint)].into_iter().flatten()
}

/// Whether a list's value looks like a joint.
fn is_joint(value: &Value) -> bool {
    holders(value).any(|map| {
        find(map, &MATRIX_NAMES).is_some()
            || (find(map, &POSITION_NAMES).is_some() && find(map, &ORIENTATION_NAMES).is_some())
    })
}

const MISSING: &str = "is missing";
const NO_ORIENTATION: &str = "has no orientation";

fn placed_joint(value: &Value, by_rows: bool) -> Result<Joint, String> {
    if let Some(array) = value.numbers() {
        return match array.values[..] {
            [px, py, pz] => joint(DVec3::new(px, py, pz), Err(NO_ORIENTATION.into())),
            [px, py, pz, x, y, z, w] => joint(DVec3::new(px, py, pz), rotation(DQuat::from_xyzw(x, y, z, w))),
            _ if array.values.len() == 16 => matrix(&array.values, by_rows),
            _ => Err(format!(
                "has {} numbers, expected 3 (a position), 7 (position and quaternion) or 16 (a matrix)",
                array.values.len()
            )),
        };
    }
    let found = holders(value).find_map(|map| {
        if let Some(values) = find(map, &MATRIX_NAMES).and_then(Value::numbers).filter(|array| array.values.len() == 16)
        {
            return Some(matrix(&values.values, by_rows));
        }
        let Some(position) = vector(find(map, &POSITION_NAMES)?) else {
            return Some(Err("its position is not 3 numbers".into()));
        };
        let orientation = match find(map, &ORIENTATION_NAMES) {
            None => Err(NO_ORIENTATION.into()),
            Some(orientation) => match quaternion(orientation) {
                Some(orientation) => rotation(orientation),
                None => Err("its orientation is not a quaternion: x, y, z and w".into()),
            },
        };
        Some(joint(position, orientation))
    });
    // A point as MediaPipe's.
    let found = found.or_else(|| Some(joint(vector(value)?, Err(NO_ORIENTATION.into()))));
    found.unwrap_or_else(|| Err("has neither a position nor a matrix of 16 numbers".into()))
}

fn quaternion(value: &Value) -> Option<DQuat> {
    if let Some(array) = value.numbers() {
        return match array.values[..] {
            [x, y, z, w] => Some(DQuat::from_xyzw(x, y, z, w)),
            _ => None,
        };
    }
    let part = |name: &str| value.get(name)?.number();
    Some(DQuat::from_xyzw(part("x")?, part("y")?, part("z")?, part("w")?))
}

/// 16 numbers, column by column or row by row.
fn matrix(values: &[f64], by_rows: bool) -> Result<Joint, String> {
    let Some(numbers) = values.first_chunk::<16>() else {
        return Err(format!("has a matrix of {} numbers, expected 16", values.len()));
    };
    if numbers.iter().any(|number| !number.is_finite()) {
        return Err("its matrix has a number that is not finite".into());
    }
    let matrix = DMat4::from_cols_array(numbers);
    let matrix = if by_rows { matrix.transpose() } else { matrix };
    let rotation = DMat3::from_mat4(matrix);
    if rotation == DMat3::ZERO {
        return Err("its matrix is all zeros: the joint was not tracked".into());
    }
    let error = (rotation * rotation.transpose() - DMat3::IDENTITY).to_cols_array();
    let is_rotation = error.iter().all(|e| e.abs() <= 1e-2) && rotation.determinant() > 0.0;
    let orientation = if is_rotation {
        Ok(DMat3::from_quat(DQuat::from_mat3(&rotation).normalize()))
    } else {
        Err("its matrix is not a rotation with a translation".into())
    };
    joint(matrix.w_axis.truncate(), orientation)
}

fn rotation(orientation: DQuat) -> Result<DMat3, String> {
    let length = orientation.length();
    if !length.is_finite() {
        return Err("its quaternion has a number that is not finite".into());
    }
    if length == 0.0 {
        return Err("its quaternion is all zeros; the rest is 0, 0, 0, 1".into());
    }
    if !(0.5..2.0).contains(&length) {
        return Err(format!("its quaternion has the length {length:?}, expected 1"));
    }
    Ok(DMat3::from_quat(orientation.normalize()))
}

/// Converts from XR's world to ghand's.
fn joint(position: DVec3, orientation: Result<DMat3, String>) -> Result<Joint, String> {
    point_in_range(position).map_err(|problem| format!("its position {problem}"))?;
    Ok(Joint { position: OPENGL_AXES * position, orientation: orientation.map(|turn| OPENGL_AXES * turn) })
}
