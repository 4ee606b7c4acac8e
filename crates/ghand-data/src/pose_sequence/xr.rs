//! Joints of WebXR (25) and OpenXR (26: the palm first, then WebXR's), as positions and orientations in space.
//!
//! Neither defines a file. Read is JSON with a list of frames (`{"fps":72,"frames":[...]}` or the list alone), each with the joints in
//! `joints` (or `jointTransforms`, `poses`): as a map by name, or a list in order. A joint is `{"position": .., "orientation": ..}`, also
//! inside of `pose` or `transform`, as lists (x, y, z, w) or by the names of the components, or `matrix` / `offsetMatrix` of 16 numbers,
//! column by column, as WebXR's `fillPoses` gives them; or a row of 7 numbers. A frame may hold both hands, in `left` and `right`, in
//! `hands` as a map or as a list with `handedness`. `.npz`: `positions` (T, 25 or 26, 3) and `orientations` (T, 25 or 26, 4).
//!
//! Metres; quaternions x, y, z, w; the frame of a joint has -Z along the bone and +Y out of the back of the hand. XR's world has y
//! upwards and looks along -z; ghand's pictures have y downwards and look along z: the world is turned by half a turn about x.

use ghand_core::hand_model::joint_names::JointRole;
use ghand_core::rotation::axis_angle_from_rotation;
use ghand_core::value::Value;
use ghand_core::{Pose, Side};
use glam::{DMat3, DQuat, DVec3};

use super::recording::{fps_of_times, frames_of, id_of, side_of, vector};
use super::{Motion, PoseError, PoseFrame, Recording, Skipped, Source};
use crate::rig::Rig;

const JOINTS_NAMES: [&str; 4] = ["joints", "jointTransforms", "joint_poses", "poses"];
const POSITION_NAMES: [&str; 5] = ["position", "positions", "translation", "pos", "p"];
const ORIENTATION_NAMES: [&str; 6] = ["orientation", "orientations", "rotation", "quaternion", "rot", "q"];
const MATRIX_NAMES: [&str; 3] = ["matrix", "offsetMatrix", "transform"];
const SIDE_NAMES: [&str; 4] = ["handedness", "side", "hand", "hand_side"];

/// Where a joint is in space, in ghand's world.
type Placed = (DVec3, DMat3);

pub(super) fn read(source: &Source, value: &Value) -> Option<Result<Recording, PoseError>> {
    if value.get("positions").is_some() && value.get("orientations").is_some() {
        return Some(archive(source, value));
    }
    let single = [value.clone()];
    let frames = if joints(value).is_some() { &single[..] } else { frames_of(value)? };
    let is_xr = |frame: &Value| hands(frame).iter().any(|(_, hand)| joints(hand).is_some());
    if !frames.iter().any(is_xr) {
        return None;
    }
    Some(frames_of_joints(source, value, frames))
}

fn find<'a>(value: &'a Value, names: &[&str]) -> Option<&'a Value> {
    names.iter().find_map(|name| value.get(name))
}

/// What holds the joints of a hand, if anything does.
fn joints(value: &Value) -> Option<&Value> {
    find(value, &JOINTS_NAMES).filter(|joints| match joints {
        Value::Map(entries) => entries.iter().any(|(name, _)| JointRole::of(name).is_some()),
        Value::List(items) => matches!(items.len(), 25 | 26),
        Value::Numbers(array) => matches!(array.shape[..], [25 | 26, 7 | 16] | [25 | 26, 4, 4] | [400 | 416]),
        _ => false,
    })
}

/// The hands of a frame, with their sides where the file says.
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
    let other = crate::retarget::other_side(source.wanted);
    let side = if has(source.wanted) { source.wanted } else { other };
    let (mut posed, mut skipped) = (Vec::new(), Skipped::default());
    let mut known_side = shared;
    for (number, frame) in frames.iter().enumerate() {
        let id = id_of(frame, number);
        let hands = hands(frame);
        let hand = hands.iter().find(|(own, _)| own.or(shared).is_none_or(|own| own == side));
        known_side = known_side.or(hand.and_then(|(own, _)| *own));
        match hand.and_then(|(_, hand)| joints(hand)) {
            None => skipped.add(&id, "has no joints of this hand"),
            Some(joints) => match placed_joints(joints).and_then(|placed| pose(&placed)) {
                Ok(pose) => posed.push(PoseFrame { id, pose, shape: vec![] }),
                Err(problem) => skipped.add(&id, problem),
            },
        }
    }
    let warnings = skipped.finish(source, frames.len())?.into_iter().collect();
    let fps = source.fps(value, &["fps", "frame_rate", "frameRate"])?.or_else(|| fps_of_times(frames));
    Ok(Recording { side: known_side, fps, motion: Motion::WebXr { frames: posed }, warnings })
}

fn archive(source: &Source, value: &Value) -> Result<Recording, PoseError> {
    let array = |name: &str, width: usize| match value.get(name).and_then(Value::numbers) {
        Some(found) => match found.shape[..] {
            [count, joints @ (25 | 26), found_width] if found_width == width => Ok((count, joints, &found.values)),
            _ => Err(source.invalid(name, format!("has the shape {:?}, expected (T, 25 or 26, {width})", found.shape))),
        },
        None => Err(source.invalid(name, "must be numbers".into())),
    };
    let (count, joints, positions) = array("positions", 3)?;
    let (other_count, other_joints, orientations) = array("orientations", 4)?;
    if (count, joints) != (other_count, other_joints) {
        return Err(
            source.invalid("orientations", format!("must be for {count} frames of {joints} joints as positions"))
        );
    }
    let (mut frames, mut skipped) = (Vec::new(), Skipped::default());
    for k in 0..count {
        let id = format!("{k:04}");
        let place = |j: usize| {
            let at = k * joints + j;
            let q = orientations.get(4 * at..4 * at + 4)?;
            placed(DVec3::from_slice(positions.get(3 * at..3 * at + 3)?), DQuat::from_slice(q))
        };
        // OpenXR's palm is not needed.
        let joints: Option<Vec<Placed>> = (joints - 25..joints).map(place).collect();
        match joints.ok_or_else(|| "holds a joint that is not known".into()).and_then(|placed| pose(&placed)) {
            Ok(pose) => frames.push(PoseFrame { id, pose, shape: vec![] }),
            Err(problem) => skipped.add(&id, problem),
        }
    }
    let warnings = skipped.finish(source, count)?.into_iter().collect();
    let side = find(value, &SIDE_NAMES).and_then(side_of);
    let fps = source.fps(value, &["fps"])?;
    Ok(Recording { side, fps, motion: Motion::WebXr { frames }, warnings })
}

/// The 25 joints of WebXR in order.
fn placed_joints(joints: &Value) -> Result<Vec<Placed>, String> {
    let rig = Rig::webxr(Side::Right);
    let named = |name: &str| {
        let role = JointRole::of(name);
        rig.joint_names
            .iter()
            .zip(&rig.roles)
            .position(|(own, own_role)| own == name || (role.is_some() && *own_role == role))
    };
    let mut found: Vec<Option<Placed>> = vec![None; rig.joints.len()];
    if let Value::Map(entries) = joints {
        for (name, joint) in entries {
            if let Some(slot) = named(name).and_then(|k| found.get_mut(k)) {
                *slot = placed_joint(joint);
            }
        }
    } else {
        let items = match joints.numbers().map(|array| (&array.shape[..], array)) {
            Some(([400 | 416], array)) => array.values.chunks(16).map(matrix).collect(),
            _ => joints.items().unwrap_or_default().iter().map(placed_joint).collect::<Vec<_>>(),
        };
        let names: Vec<Option<usize>> = match joints {
            Value::List(items) => items
                .iter()
                .map(|item| find(item, &["name", "jointName", "joint"]).and_then(Value::text).and_then(named))
                .collect(),
            _ => vec![],
        };
        let by_name = !names.is_empty() && names.iter().filter(|name| name.is_some()).count() >= rig.joints.len();
        let palm = items.len().saturating_sub(rig.joints.len());
        for (k, joint) in items.into_iter().enumerate() {
            let to = if by_name { names.get(k).copied().flatten() } else { k.checked_sub(palm) };
            if let Some(slot) = to.and_then(|to| found.get_mut(to)) {
                *slot = joint;
            }
        }
    }
    match found.iter().position(Option::is_none) {
        Some(k) => Err(format!("lacks the joint {:?}, or holds a number that is not finite", rig.joint_names[k])),
        None => Ok(found.into_iter().flatten().collect()),
    }
}

fn placed_joint(joint: &Value) -> Option<Placed> {
    if let Some(array) = joint.numbers() {
        return match array.values.len() {
            7 => placed(DVec3::from_slice(array.values.get(..3)?), DQuat::from_slice(array.values.get(3..)?)),
            16 => matrix(&array.values),
            _ => None,
        };
    }
    let inner = [joint.get("pose"), joint.get("transform"), Some(joint)];
    inner.into_iter().flatten().find_map(|map| {
        if let Some(values) = find(map, &MATRIX_NAMES).and_then(Value::numbers).filter(|array| array.values.len() == 16)
        {
            return matrix(&values.values);
        }
        placed(vector(find(map, &POSITION_NAMES)?)?, quaternion(find(map, &ORIENTATION_NAMES)?)?)
    })
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

/// 16 numbers column by column.
fn matrix(values: &[f64]) -> Option<Placed> {
    let columns = values.first_chunk::<16>()?;
    let matrix = glam::DMat4::from_cols_array(columns);
    let rotation = DMat3::from_mat4(matrix);
    let error = (rotation * rotation.transpose() - DMat3::IDENTITY).to_cols_array();
    let is_rotation = error.iter().all(|e| e.abs() <= 1e-2) && rotation.determinant() > 0.0;
    is_rotation.then(|| placed(matrix.w_axis.truncate(), DQuat::from_mat3(&rotation)))?
}

/// From XR's world to ghand's.
fn placed(position: DVec3, orientation: DQuat) -> Option<Placed> {
    let length = orientation.length();
    if !(position.is_finite() && (0.5..2.0).contains(&length)) {
        return None;
    }
    let world = DMat3::from_diagonal(DVec3::new(1.0, -1.0, -1.0));
    Some((world * position, world * DMat3::from_quat(orientation.normalize())))
}

/// Rotations of each joint in the frame of its parent.
fn pose(placed: &[Placed]) -> Result<Pose, String> {
    let parents = Rig::webxr(Side::Right).parents;
    let rotation = |(k, parent): (usize, &Option<usize>)| {
        let (_, here) = placed.get(k)?;
        let above = parent.map_or(Some(DMat3::IDENTITY), |p| Some(placed.get(p)?.1))?;
        Some(axis_angle_from_rotation(&(above.transpose() * *here)))
    };
    let rotations: Option<Vec<DVec3>> = parents.iter().enumerate().map(rotation).collect();
    match (rotations, placed.first()) {
        (Some(rotations), Some((wrist, _))) => Ok(Pose { rotations, translation: *wrist }),
        _ => Err("lacks joints".into()),
    }
}
