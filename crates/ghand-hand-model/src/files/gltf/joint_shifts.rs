//! How the shapes of a glTF hand move its joints. Morph targets move only the skin, so the skin's extras say it:
//! `"shape": [{"name": "finger-length", "unit": "5 mm", "joint_shift": [[x, y, z], ...]}, ...]`, metres per unit of the
//! target's weight, one row per joint of the skin.

use ::gltf::json::extras::RawValue;
use glam::DVec3;
use serde::Deserialize;
use serde_json::Value;

use super::Source;
use super::raw_mesh::{Binding, Moves};
use crate::HandModelError;

#[derive(Deserialize)]
struct SkinExtras<'a> {
    #[serde(borrow)]
    shape: &'a RawValue,
}

/// Displacements `[n_s][n_b]` of the model's `joints`, if the file has any. Entries belong to the targets of their names,
/// or in order if no name is a target's. Extras of other programs are ignored.
pub(super) fn joint_directions(
    extras: Option<&RawValue>,
    target_names: &[Option<String>],
    binding: &Binding,
    joints: usize,
    source: &Source,
    warnings: &mut Vec<String>,
) -> Result<Option<Vec<DVec3>>, HandModelError> {
    let entries = entries(extras, source)?;
    if entries.is_empty() || target_names.is_empty() {
        return Ok(None);
    }
    let mut directions = vec![DVec3::ZERO; target_names.len() * joints];
    let mut without = Vec::new();
    let found = entries_of_targets(entries, target_names);
    for (k, (entry, moved)) in found.iter().zip(directions.chunks_exact_mut(joints)).enumerate() {
        let name = target_names[k].clone().unwrap_or_else(|| k.to_string());
        let Some(entry) = entry else {
            without.push(name);
            continue;
        };
        let rows = rows(entry, binding.joints.len())
            .map_err(|problem| source.invalid(&format!("skins.extras.shape[{name:?}].joint_shift"), problem))?;
        for (row, moves) in rows.into_iter().zip(&binding.joints) {
            if let Moves::Hand(to) = moves {
                moved[*to] = binding.direction(row);
            }
        }
    }
    if !without.is_empty() {
        warnings.push(format!(
            "{} of {} shape directions have no joint shifts and do not move the joints: {}",
            without.len(),
            target_names.len(),
            without.join(", ")
        ));
    }
    Ok(Some(directions))
}

/// What the extras have under `shape`, if it says anything about joints.
fn entries(extras: Option<&RawValue>, source: &Source) -> Result<Vec<Value>, HandModelError> {
    let extras: Option<SkinExtras> = extras.and_then(|extras| serde_json::from_str(extras.get()).ok());
    let text = extras.map_or("", |extras| extras.shape.get());
    if !text.contains(r#""joint_shift""#) {
        return Ok(vec![]);
    }
    match serde_json::from_str(text) {
        Ok(Value::Array(entries)) => Ok(entries),
        Ok(_) => Ok(vec![]),
        Err(error) => Err(source.invalid("skins.extras.shape", format!("{error}; export the hand again"))),
    }
}

/// The entry of each target.
fn entries_of_targets(entries: Vec<Value>, target_names: &[Option<String>]) -> Vec<Option<Value>> {
    let mut entries: Vec<Option<Value>> = entries.into_iter().map(Some).collect();
    let belongs = |entry: &Option<Value>, name: &Option<String>| {
        let found = entry.as_ref().and_then(|entry| entry.get("name")?.as_str());
        found.is_some() && found == name.as_deref()
    };
    let by_name = target_names.iter().any(|name| entries.iter().any(|entry| belongs(entry, name)));
    if !by_name {
        entries.resize(target_names.len(), None);
        return entries;
    }
    // Of targets with the same name, each takes the next entry.
    let take = |name| entries.iter_mut().find(|entry| belongs(entry, name)).and_then(Option::take);
    target_names.iter().map(take).collect()
}

/// The rows of an entry, one per joint of the skin.
fn rows(entry: &Value, joints: usize) -> Result<Vec<DVec3>, String> {
    let remedy = "write one row [x, y, z] per joint of the skin, metres";
    let rows = entry.get("joint_shift").and_then(Value::as_array).ok_or_else(|| format!("is missing; {remedy}"))?;
    if rows.len() != joints {
        return Err(format!("has {} rows for {joints} joints; {remedy}", rows.len()));
    }
    let number = |value: &Value| value.as_f64().filter(|x| (*x as f32).is_finite());
    let row = |(k, row): (usize, &Value)| {
        let numbers: Option<Vec<f64>> = row.as_array().and_then(|row| row.iter().map(number).collect());
        match numbers.as_deref() {
            Some(&[x, y, z]) => Ok(DVec3::new(x, y, z)),
            _ => Err(format!("row {k} is not three finite numbers; {remedy}")),
        }
    };
    rows.iter().enumerate().map(row).collect()
}
