//! ghand's own poses, as JSON and as `.npz`.
//!
//! JSON: `{"fps":30,"frames":[{"id":"0000","pose":[[rx,ry,rz], ...],"translation":[x,y,z],"shape":[]}]}`, axis-angle rotations in
//! radians in the order of the model's joints, metres; rate, ids, translations and shapes may be missing. A capture's
//! `capture.json` is such a file whose `hand_model.joints` names the rows: they are matched to the model's joints. For a MANO model,
//! rotations are measured from its mean pose, unless the file says `"flat_hand_mean":true`.
//!
//! `.npz`: `pose` (T, n_b, 3), and if you like `translation` (T, 3), `shape` (T, n_s), `fps`, `flat_hand_mean`, and names: `ids` (T), `joints` (n_b).

use std::collections::HashSet;
use std::path::Path;

use ghand_core::Pose;
use ghand_core::atomic_file::write_atomically;
use ghand_core::value::Value;
use glam::DVec3;
use serde_json::json;

use super::{PoseError, PoseFrame, PoseSequence, Recording, Source};
use crate::pose_sequence::Motion;

/// Names of the format and its version that a capture has.
const CAPTURE_FORMAT: &str = "ghand-capture";

pub(super) fn read(source: &Source, value: &Value) -> Option<Result<Recording, PoseError>> {
    let is_array = |name: &str| value.get(name).and_then(Value::numbers).is_some_and(|array| array.shape.len() == 3);
    if value.get("frames").is_some() {
        Some(json(source, value))
    } else if is_array("pose") {
        Some(archive(source, value))
    } else {
        None
    }
}

fn json(source: &Source, value: &Value) -> Result<Recording, PoseError> {
    let format = value.get("format");
    if let Some(format) = format {
        if format.text() != Some(CAPTURE_FORMAT) {
            let found = format.text().map_or_else(|| format.kind(), |text| format!("{text:?}"));
            return Err(source.invalid("format", format!("is {found}, must be {CAPTURE_FORMAT:?} or absent")));
        }
        if value.get("version").and_then(Value::number) != Some(1.0) {
            return Err(source.invalid("version", "must be 1; use the ghand that wrote the file".into()));
        }
    }
    let joints = match value.get("hand_model").and_then(|model| model.get("joints")) {
        Some(names) => Some(texts(source, "hand_model.joints", names)?),
        None => None,
    };
    let frames = match value.get("frames") {
        Some(Value::List(frames)) => frames.as_slice(),
        Some(other) => return Err(source.invalid("frames", format!("is {}, must be a list", other.kind()))),
        None => &[],
    };
    let mut ids = HashSet::new();
    let frame = |(number, frame): (usize, &Value)| {
        let id = match frame.get("id") {
            Some(Value::Text(id)) => id.clone(),
            None => format!("{number:04}"),
            Some(other) => {
                return Err(
                    source.invalid(&format!("frames[{number}].id"), format!("is {}, must be text", other.kind()))
                );
            }
        };
        if !ids.insert(id.clone()) {
            return Err(source.invalid("frames", format!("the id {id:?} is there twice; give each frame its own")));
        }
        let field = |name: &str| format!("frames[{id:?}].{name}");
        let Some(pose) = frame.get("pose") else {
            return Err(source.invalid(&field("pose"), "is missing; give one axis-angle rotation a joint".into()));
        };
        let rotations = rotations(source, &field("pose"), pose)?;
        let translation = match frame.get("translation") {
            None => DVec3::ZERO,
            Some(value) => match numbers(source, &field("translation"), value)?[..] {
                [x, y, z] => DVec3::new(x, y, z),
                _ => return Err(source.invalid(&field("translation"), "must be 3 numbers, metres".into())),
            },
        };
        let shape = match frame.get("shape") {
            None => vec![],
            Some(value) => numbers(source, &field("shape"), value)?,
        };
        Ok(PoseFrame { pose: Pose { rotations, translation }, shape, id: id.clone() })
    };
    let frames = frames.iter().enumerate().map(frame).collect::<Result<Vec<_>, PoseError>>()?;
    let motion = Motion::Rows { joints, frames, is_capture: format.is_some(), from_mean: from_mean(value) };
    let fps = source.fps(value, &["fps"])?;
    // The side of ghand's own poses is that of the model that they are for.
    Ok(Recording { side: None, fps, motion, warnings: vec![] })
}

/// Whether poses are measured from a MANO model's mean pose, which is so unless the file says otherwise.
fn from_mean(value: &Value) -> bool {
    value.get("flat_hand_mean").and_then(Value::number).is_none_or(|flat| flat == 0.0)
}

fn texts(source: &Source, field: &str, value: &Value) -> Result<Vec<String>, PoseError> {
    let texts = match value {
        Value::List(items) => items.iter().map(|item| item.text().map(str::to_owned)).collect(),
        _ => None,
    };
    texts.ok_or_else(|| source.invalid(field, format!("is {}, must be a list of names", value.kind())))
}

/// Numbers in a row, all finite.
fn numbers(source: &Source, field: &str, value: &Value) -> Result<Vec<f64>, PoseError> {
    let values = match value {
        Value::Numbers(array) if array.shape.len() == 1 => array.values.clone(),
        Value::List(items) if items.is_empty() => vec![],
        other => return Err(source.invalid(field, format!("is {}, must be a list of numbers", other.kind()))),
    };
    match values.iter().find(|value| !value.is_finite()) {
        Some(_) => Err(source.invalid(field, "holds a number that is not finite".into())),
        None => Ok(values),
    }
}

/// Rows of three finite numbers.
fn rotations(source: &Source, field: &str, value: &Value) -> Result<Vec<DVec3>, PoseError> {
    let rows = value.items().unwrap_or_default();
    if rows.is_empty() {
        return Err(source.invalid(field, format!("is {}, must be rows of 3 numbers", value.kind())));
    }
    let row = |(number, row): (usize, &Value)| {
        let values = row.numbers().map(|array| array.values.as_slice()).unwrap_or_default();
        match values {
            [x, y, z] if x.is_finite() && y.is_finite() && z.is_finite() => Ok(DVec3::new(*x, *y, *z)),
            [_, _, _] => Err(source.invalid(field, format!("row {number} holds a number that is not finite"))),
            _ => {
                let problem = format!("row {number} has {} numbers, expected 3 (axis-angle)", values.len());
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
        return Err(source.invalid("pose", "must have the shape (T, n_b, 3)".into()));
    };
    // One row a frame, or one row for all of them.
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
    let names = |name: &str, wanted: usize| match value.get(name) {
        None => Ok(None),
        Some(found) => {
            let texts = texts(source, name, found)?;
            if texts.len() == wanted {
                return Ok(Some(texts));
            }
            Err(source.invalid(name, format!("has {} names, expected {wanted}", texts.len())))
        }
    };
    let joints = names("joints", rows)?;
    let ids = names("ids", count)?.unwrap_or_else(|| (0..count).map(|k| format!("{k:04}")).collect());
    let mut seen = HashSet::new();
    if let Some(id) = ids.iter().find(|id| !seen.insert(id.as_str())) {
        return Err(source.invalid("ids", format!("{id:?} is there twice; give each frame its own")));
    }
    let mut frames = Vec::with_capacity(count);
    for (k, id) in ids.iter().enumerate() {
        let numbers = pose.values.iter().skip(3 * rows * k).take(3 * rows).copied().collect::<Vec<f64>>();
        let translation = translations.get(k).map(Vec::as_slice).unwrap_or_default();
        let shape = shapes.get(k).cloned().unwrap_or_default();
        for (name, values) in [("pose", &numbers[..]), ("translation", translation), ("shape", &shape)] {
            if values.iter().any(|value| !value.is_finite()) {
                return Err(source.invalid(&format!("{name}[{k}]"), "holds a number that is not finite".into()));
            }
        }
        let rotations = numbers.chunks_exact(3).map(DVec3::from_slice).collect();
        let translation = if let &[x, y, z] = translation { DVec3::new(x, y, z) } else { DVec3::ZERO };
        frames.push(PoseFrame { id: id.clone(), pose: Pose { rotations, translation }, shape });
    }
    let fps = source.fps(value, &["fps"])?;
    let motion = Motion::Rows { joints, frames, is_capture: false, from_mean: from_mean(value) };
    Ok(Recording { side: None, fps, motion, warnings: vec![] })
}

/// Writes poses as ghand's own JSON, with the names of the joints, whole or not at all.
///
/// # Errors
/// [`PoseError::Write`] when the file cannot be written; it is then as it was before.
pub fn write_poses(path: &Path, sequence: &PoseSequence) -> Result<(), PoseError> {
    let frame = |frame: &PoseFrame| {
        let rows: Vec<[f64; 3]> = frame.pose.rotations.iter().map(DVec3::to_array).collect();
        json!({"id": frame.id, "pose": rows, "translation": frame.pose.translation.to_array(), "shape": frame.shape})
    };
    let frames: Vec<serde_json::Value> = sequence.frames.iter().map(frame).collect();
    let model = json!({"joints": sequence.joint_names});
    let file = json!({"fps": sequence.fps, "flat_hand_mean": true, "hand_model": model, "frames": frames});
    write_atomically(path, file.to_string().as_bytes()).map_err(|source| PoseError::Write { path: path.into(), source })
}
