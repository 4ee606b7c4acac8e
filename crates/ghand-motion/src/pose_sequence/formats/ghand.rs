//! ghand's own poses, as JSON, JSON Lines and `.npz`.
//!
//! JSON: `{"fps":30,"frames":[{"id":"0000","pose":[[rx,ry,rz], ...],"translation":[x,y,z],"shape":[]}]}`, axis-angle
//! rotations in radians in the order of the model's joints, metres; rate, ids, translations and shapes may be missing.
//! A shape may also be given by names, `{"finger-length":2}`.
//! The frames alone, as a list or one on each line, and one frame alone are read, too. `hand_model` describes the
//! skeleton that the rows are for (`file_skeleton.rs`): they are matched to the model's joints by name, or carried over
//! if the skeleton is another one. A capture's `capture.json` is such a file; its skeleton is that of its hand model.
//! `"keys":["0000", ...]` names the frames that are the keys of a motion of key frames.
//! For a MANO model, rotations are measured from its mean pose, unless the file says `"flat_hand_mean":true` or is a
//! capture.
//!
//! `.npz`: `pose` (T, n_b, 3), and optionally `translation` (T, 3), `shape` (T, n_s), `fps`, `flat_hand_mean`, `ids`
//! (T), and the members of `hand_model`.

use std::collections::HashSet;
use std::path::Path;

use ghand_core::{HandModel, Pose, Side};
use ghand_files::atomic_file::write_atomically;
use ghand_files::value::Value;
use ghand_hand_model::shape_values::shape_from_names;
use glam::DVec3;
use serde_json::json;

use crate::pose_sequence::reading::file_skeleton::{FileSkeleton, texts};
use crate::pose_sequence::reading::recording::Rows;
use crate::pose_sequence::reading::source::{id_of, shown, side_of};
use crate::pose_sequence::time::timeline;
use crate::pose_sequence::{LandmarkFit, Motion, PoseError, PoseFrame, PoseSequence, Recording, Skipped, Source};

/// Format name and version of a capture.
const CAPTURE_FORMAT: &str = "ghand-capture";

pub(crate) fn read(source: &Source, value: &Value) -> Option<Result<Recording, PoseError>> {
    let is_array = |name: &str| value.get(name).and_then(Value::numbers).is_some_and(|array| array.shape.len() == 3);
    if let Some(frames) = value.get("frames") {
        return Some(match frames {
            Value::List(frames) => json(source, value, frames),
            other => Err(source.invalid("frames", format!("is {}, must be a list of frames", other.kind()))),
        });
    }
    match value {
        Value::List(frames) if frames.iter().any(is_frame) => Some(json(source, value, frames)),
        frame if is_frame(frame) => Some(json(source, value, std::slice::from_ref(frame))),
        _ if is_array("pose") => Some(archive(source, value)),
        _ => None,
    }
}

/// Whether a value is a frame: a map with rows of three numbers.
fn is_frame(value: &Value) -> bool {
    let pose = value.get("pose").and_then(Value::numbers);
    pose.is_some_and(|pose| matches!(pose.shape[..], [_, 3]))
}

fn json(source: &Source, value: &Value, frames: &[Value]) -> Result<Recording, PoseError> {
    let format = value.get("format");
    if let Some(format) = format {
        if format.text() != Some(CAPTURE_FORMAT) {
            return Err(source.invalid("format", format!("is {}, must be {CAPTURE_FORMAT:?} or absent", shown(format))));
        }
        if value.get("version").and_then(Value::number) != Some(1.0) {
            return Err(source.invalid("version", "must be 1; use the ghand that wrote the file".into()));
        }
    }
    if format.is_none() {
        check_names(source, value, frames)?;
    }
    let hand_model = value.get("hand_model");
    let side = side(source, value)?;
    let rig = hand_model.map_or(Ok(None), |model| FileSkeleton::read(source, model, "hand_model."))?;
    let capture_kind = format
        .map(|_| hand_model.and_then(|model| model.get("kind")).and_then(Value::text).unwrap_or_default().to_owned());
    let mut ids = HashSet::new();
    let frame = |(number, frame): (usize, &Value)| {
        let id = match frame.get("id") {
            Some(other) if other.text().is_none() && other.number().is_none() => {
                let problem = format!("is {}, must be text or a number", other.kind());
                return Err(source.invalid(&format!("frames[{number}].id"), problem));
            }
            _ => id_of(frame, number),
        };
        if !ids.insert(id.clone()) {
            return Err(source.invalid("frames", format!("the id {id:?} occurs twice; give each frame its own")));
        }
        let field = |name: &str| format!("frames[{id:?}].{name}");
        let Some(pose) = frame.get("pose") else {
            return Err(
                source.invalid(&field("pose"), "is missing; give one axis-angle rotation for each joint".into())
            );
        };
        let rotations = rotations(source, &field("pose"), pose, rig.as_ref())?;
        let translation = match frame.get("translation") {
            None => DVec3::ZERO,
            Some(value) => match numbers(source, &field("translation"), value)?[..] {
                [x, y, z] => DVec3::new(x, y, z),
                _ => return Err(source.invalid(&field("translation"), "must be 3 numbers, metres".into())),
            },
        };
        let shape = match frame.get("shape") {
            None => vec![],
            Some(Value::Map(_)) if source.model.shape_directions.is_empty() => vec![],
            Some(Value::Map(values)) => named_shape(source, &field("shape"), values)?,
            Some(value) => numbers(source, &field("shape"), value)?,
        };
        Ok(PoseFrame { pose: Pose { rotations, translation }, shape, id: id.clone() })
    };
    let frames = frames.iter().enumerate().map(frame).collect::<Result<Vec<_>, PoseError>>()?;
    let from_mean = from_mean(value, capture_kind.is_none());
    let motion = Motion::Rows(Box::new(Rows { rig, frames, capture_kind, from_mean, side }));
    Ok(Recording { side, usual_fps: None, motion, skipped: Skipped::default(), warnings: vec![] })
}

/// Fields of a file besides those of its frames, and of a frame.
const FIELDS: [&str; 7] = ["frames", "fps", "side", "flat_hand_mean", "hand_model", "keys", "landmark_fit"];
const FRAME_FIELDS: [&str; 4] = ["pose", "translation", "shape", "sent_ms"];

/// Rejects fields that ghand's files do not have: a misspelt one would be ignored.
fn check_names(source: &Source, value: &Value, frames: &[Value]) -> Result<(), PoseError> {
    let of_frame = |name: &str| FRAME_FIELDS.contains(&name) || timeline::is_known(name);
    let of_file = |name: &str| FIELDS.contains(&name) || timeline::is_known(name);
    let is_single = value.get("frames").is_none();
    let unknown =
        value.entries().iter().map(|(name, _)| name).find(|name| !(of_file(name) || is_single && of_frame(name)));
    let in_frames = || frames.iter().flat_map(Value::entries).map(|(name, _)| name);
    let in_frames = || in_frames().find(|name| !of_frame(name) && !FIELDS[1..4].contains(&name.as_str()));
    let Some(name) = unknown.or_else(in_frames) else { return Ok(()) };
    let problem = "is no field of ghand's files of poses, which have frames, fps, side, flat_hand_mean and hand_model; frames have \
                   id, pose, translation, shape and time; correct or remove it";
    Err(source.invalid(name, problem.into()))
}

/// The side that a file gives outside its hand model.
fn side(source: &Source, value: &Value) -> Result<Option<Side>, PoseError> {
    let Some(side) = value.get("side") else { return Ok(None) };
    match side_of(side) {
        Some(side) => Ok(Some(side)),
        None => Err(source.invalid("side", format!("is {}, must be \"right\" or \"left\"", shown(side)))),
    }
}

/// Whether poses are measured from a MANO model's mean pose, if the file says.
fn from_mean(value: &Value, otherwise: bool) -> bool {
    value.get("flat_hand_mean").and_then(Value::number).map_or(otherwise, |flat| flat == 0.0)
}

/// Shape parameters by the names of the model's shape directions.
fn named_shape(source: &Source, field: &str, values: &[(String, Value)]) -> Result<Vec<f64>, PoseError> {
    let value = |(name, value): &(String, Value)| match value.number() {
        Some(number) => Ok((name.clone(), number)),
        None => Err(source.invalid(field, format!("{name:?} is {}, must be a number", value.kind()))),
    };
    let values = values.iter().map(value).collect::<Result<Vec<_>, PoseError>>()?;
    shape_from_names(source.model, &values).map_err(|error| source.invalid(field, error.problem))
}

/// A list of finite numbers.
fn numbers(source: &Source, field: &str, value: &Value) -> Result<Vec<f64>, PoseError> {
    let values = match value {
        Value::Numbers(array) if array.shape.len() == 1 => array.values.clone(),
        Value::List(items) if items.is_empty() => vec![],
        other => return Err(source.invalid(field, format!("is {}, must be a list of numbers", other.kind()))),
    };
    match values.iter().find(|value| !value.is_finite()) {
        Some(_) => Err(source.invalid(field, "has a number that is not finite".into())),
        None => Ok(values),
    }
}

/// Rows of three finite numbers; messages name the joint if the skeleton does.
fn rotations(source: &Source, field: &str, value: &Value, rig: Option<&FileSkeleton>) -> Result<Vec<DVec3>, PoseError> {
    let joint = |row: usize| {
        let name = rig.and_then(|rig| rig.joint_names.get(row));
        name.map_or_else(|| format!("row {row}"), |name| format!("row {row}, joint {name:?},"))
    };
    let rows = value.items().unwrap_or_default();
    if rows.is_empty() {
        return Err(source.invalid(field, format!("is {}, must be rows of 3 numbers", value.kind())));
    }
    let row = |(number, row): (usize, &Value)| {
        let values = row.numbers().map(|array| array.values.as_slice()).unwrap_or_default();
        match values {
            [x, y, z] if x.is_finite() && y.is_finite() && z.is_finite() => Ok(DVec3::new(*x, *y, *z)),
            [_, _, _] => Err(source.invalid(field, format!("{} has a number that is not finite", joint(number)))),
            _ => {
                let problem = format!(
                    "{} has {} numbers, expected 3: an axis-angle rotation in radians",
                    joint(number),
                    values.len()
                );
                Err(source.invalid(field, problem))
            }
        }
    };
    rows.iter().enumerate().map(row).collect()
}

fn archive(source: &Source, value: &Value) -> Result<Recording, PoseError> {
    let array = |name: &str| value.get(name).and_then(Value::numbers);
    let pose = array("pose").filter(|pose| pose.shape.last() == Some(&3));
    let Some((pose, &[count, rows, _])) = pose.and_then(|pose| Some((pose, pose.shape.first_chunk::<3>()?))) else {
        let found = array("pose").map_or_else(Vec::new, |pose| pose.shape.clone());
        let problem =
            format!("has the shape {found:?}, must have (T, n_b, 3): rows of 3 numbers for each joint of each frame");
        return Err(source.invalid("pose", problem));
    };
    // One row per frame, or one row for all of them.
    let per_frame = |name: &str, width: Option<usize>| -> Result<Vec<Vec<f64>>, PoseError> {
        let Some(found) = array(name) else { return Ok(vec![vec![]; count]) };
        let (rows, columns) = match found.shape[..] {
            [columns] => (1, columns),
            [rows, columns] => (rows, columns),
            _ => (0, 0),
        };
        let fits = (rows == count || found.shape.len() == 1) && width.is_none_or(|width| width == columns);
        if !fits {
            let width = width.map_or("n_s".into(), |width| width.to_string());
            return Err(source.invalid(name, format!("has the shape {:?}, expected ({count}, {width})", found.shape)));
        }
        source.copied(name, columns, count)?;
        let row = |k: usize| found.values.chunks(columns.max(1)).nth(k.min(rows - 1)).unwrap_or_default().to_vec();
        Ok((0..count).map(row).collect())
    };
    let translations = per_frame("translation", Some(3))?;
    let shapes = per_frame("shape", None)?;
    let rig = FileSkeleton::read(source, value, "")?;
    if let Some(rig) = rig.as_ref().filter(|rig| rig.joint_names.len() != rows) {
        return Err(source.invalid("joints", format!("has {} names, expected {rows}", rig.joint_names.len())));
    }
    let ids = match value.get("ids") {
        None => (0..count).map(|k| format!("{k:04}")).collect(),
        Some(found) => texts(source, "ids", found)?,
    };
    if ids.len() != count {
        return Err(source.invalid("ids", format!("has {} names, expected {count}", ids.len())));
    }
    let mut seen = HashSet::new();
    if let Some(id) = ids.iter().find(|id| !seen.insert(id.as_str())) {
        return Err(source.invalid("ids", format!("{id:?} occurs twice; give each frame its own")));
    }
    let mut frames = Vec::with_capacity(count);
    for (k, id) in ids.iter().enumerate() {
        let numbers = pose.values.iter().skip(3 * rows * k).take(3 * rows).copied().collect::<Vec<f64>>();
        let translation = translations.get(k).map(Vec::as_slice).unwrap_or_default();
        let shape = shapes.get(k).cloned().unwrap_or_default();
        for (name, values) in [("pose", &numbers[..]), ("translation", translation), ("shape", &shape)] {
            if values.iter().any(|value| !value.is_finite()) {
                return Err(source.invalid(&format!("{name}[{k}]"), "has a number that is not finite".into()));
            }
        }
        let rotations = numbers.chunks_exact(3).map(DVec3::from_slice).collect();
        let translation = if let &[x, y, z] = translation { DVec3::new(x, y, z) } else { DVec3::ZERO };
        frames.push(PoseFrame { id: id.clone(), pose: Pose { rotations, translation }, shape });
    }
    let side = side(source, value)?;
    let motion =
        Motion::Rows(Box::new(Rows { rig, frames, capture_kind: None, from_mean: from_mean(value, true), side }));
    Ok(Recording { side, usual_fps: None, motion, skipped: Skipped::default(), warnings: vec![] })
}

/// Writes poses of a hand model as ghand's own JSON ([`poses_json`]), atomically.
///
/// # Errors
/// [`PoseError::Write`] when the file cannot be written; it is then unchanged.
pub fn write_poses(path: &Path, sequence: &PoseSequence, model: &HandModel) -> Result<(), PoseError> {
    let json = poses_json(sequence, model);
    write_atomically(path, json.as_bytes()).map_err(|source| PoseError::Write { path: path.into(), source })
}

/// Like [`write_poses`], with how well the hand fits the landmarks that the poses are from. Readers of poses ignore it.
///
/// # Errors
/// As in [`write_poses`].
pub fn write_fitted_poses(
    path: &Path,
    sequence: &PoseSequence,
    fit: &LandmarkFit,
    model: &HandModel,
) -> Result<(), PoseError> {
    let mut document = document(sequence, model);
    document["landmark_fit"] = fit.to_json();
    let json = document.to_string();
    write_atomically(path, json.as_bytes()).map_err(|source| PoseError::Write { path: path.into(), source })
}

/// Poses of a hand model as ghand's own JSON. It describes the model's skeleton, so that the poses can drive any other
/// skeleton.
pub fn poses_json(sequence: &PoseSequence, model: &HandModel) -> String {
    document(sequence, model).to_string()
}

/// Like [`poses_json`], with the ids of the frames that are the keys of the motion. Readers of poses ignore them;
/// [`key_ids`] reads them.
pub fn keyed_poses_json(sequence: &PoseSequence, keys: &[String], model: &HandModel) -> String {
    let mut document = document(sequence, model);
    document["keys"] = json!(keys);
    document.to_string()
}

/// The ids of the frames that are keys, of a file of poses; none if it is not a file with keys.
pub fn key_ids(path: &Path) -> Vec<String> {
    let value = Value::read(path).ok();
    let items = value.as_ref().and_then(|value| value.get("keys")).and_then(Value::items).unwrap_or_default();
    items.iter().filter_map(|item| item.text().map(str::to_owned)).collect()
}

fn document(sequence: &PoseSequence, model: &HandModel) -> serde_json::Value {
    let frame = |frame: &PoseFrame| {
        let rows: Vec<[f64; 3]> = frame.pose.rotations.iter().map(DVec3::to_array).collect();
        json!({"id": frame.id, "pose": rows, "translation": frame.pose.translation.to_array(), "shape": frame.shape})
    };
    let frames: Vec<serde_json::Value> = sequence.frames.iter().map(frame).collect();
    let model = FileSkeleton::of(model).to_json();
    json!({"fps": sequence.fps, "flat_hand_mean": true, "hand_model": model, "frames": frames})
}
