//! Describes a file that is not supported, and the supported kinds.

use ghand_files::value::Value;

use super::known_layouts;
use crate::pose_sequence::Source;
use crate::pose_sequence::formats::plain;

/// Poses as principal components, which are useless without the model's components.
pub(crate) const COMPONENT_NAMES: [&str; 8] =
    ["pose_m", "pose_pca", "pca_pose", "hand_pose_pca", "mano_pose_pca", "mano_pca", "pca_components", "pose_coeffs"];

/// Most names of a map in a message; further ones are counted.
const MOST_NAMES: usize = 8;
/// Most characters of a name in a message.
const LONGEST_NAME: usize = 40;

/// Explains why a file contains no poses.
pub(crate) fn problem(source: &Source, value: &Value) -> String {
    if let Some(known) = known_layouts::problem(value) {
        return known.into();
    }
    let first = match value.get("frames").unwrap_or(value) {
        Value::List(items) => items.first(),
        _ => None,
    };
    let components =
        COMPONENT_NAMES.iter().find(|name| [Some(value), first].iter().flatten().any(|v| v.get(name).is_some()));
    if let Some(name) = components {
        return format!(
            "{name:?} contains principal components of a pose, not rotations, and only MANO's own file has what they mean; \
             give it with --pose-model MANO_RIGHT.pkl (or MANO_LEFT.pkl), or store MANO's full pose, 45 or 48 axis-angle \
             numbers (components @ hands_components + hands_mean)"
        );
    }
    if let Some(problem) =
        [Some(value), first].into_iter().flatten().find_map(|value| plain::problem_of_names(source, value))
    {
        return problem;
    }
    format!(
        "is {}, which is not a supported kind of poses; give ghand's own (\"frames\" with \"pose\", n_b rows of 3); \
         MANO's rotations as an array (T, 45), (T, 48), (T, 15, 3), (T, 16, 3), (T, 15, 3, 3) or (T, 16, 3, 3), as \
         \"global_orient\" with \"hand_pose\", \"rot\" with \"pose\", \"poses\" (T, 156 or 165) or \"handPose\"; \
         landmarks (T, 21, 3) or \"world_landmarks\"; joints of WebXR or OpenXR as \"joints\" or (T, 25, 16); see \
         docs/poses.md for all of them",
        found(value, true)
    )
}

fn found(value: &Value, with_first: bool) -> String {
    match value {
        Value::Map(entries) if !entries.is_empty() => {
            let named = entries.iter().take(MOST_NAMES).map(|(name, value)| {
                let name: String = name.chars().take(LONGEST_NAME).collect();
                format!("{name:?} ({})", value.kind())
            });
            let named: Vec<String> = named.collect();
            let more = entries.len().saturating_sub(MOST_NAMES);
            let more = if more > 0 { format!(" and {more} more") } else { String::new() };
            format!("a map with {}{more}", named.join(", "))
        }
        Value::List(items) if with_first => match items.first() {
            Some(first) => format!("a list of {}, the first {}", items.len(), found(first, false)),
            None => "an empty list".into(),
        },
        other => other.kind(),
    }
}
