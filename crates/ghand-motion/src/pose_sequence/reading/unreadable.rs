//! Parts of a file that cannot be read, such as tensors without plain numbers: said, whether something else of the file
//! is read or not.

use ghand_files::value::Value;

use crate::pose_sequence::{PoseError, Recording};

/// Largest depth at which such parts are looked for.
const MAX_DEPTH: usize = 6;

/// The name of the first unreadable part, and its problem.
fn first(value: &Value, depth: usize) -> Option<(&str, &str)> {
    if depth == MAX_DEPTH {
        return None;
    }
    match value {
        Value::Map(entries) => entries.iter().find_map(|(name, child)| match child {
            Value::Unreadable(problem) => Some((name.as_str(), problem.as_str())),
            child => first(child, depth + 1),
        }),
        Value::List(items) => items.iter().find_map(|item| first(item, depth + 1)),
        _ => None,
    }
}

/// Adds what cannot be read to the warnings, or to the error.
pub(crate) fn said(value: &Value, found: Result<Recording, PoseError>) -> Result<Recording, PoseError> {
    let Some((name, cause)) = first(value, 0) else { return found };
    match found {
        Ok(mut recording) => {
            recording.warnings.push(format!("{name:?} {cause}; it is ignored"));
            Ok(recording)
        }
        Err(PoseError::Invalid { origin, field, problem }) if !problem.contains(cause) => {
            Err(PoseError::Invalid { origin, field, problem: format!("{problem}; {name:?} {cause}") })
        }
        Err(error) => Err(error),
    }
}
