//! Fields of a `capture.json` by name: an unknown field is an error that suggests the nearest name.
//!
//! Otherwise a misspelt optional field, such as `"mask_paht"`, would count as missing, and the hand could be anywhere
//! in the images.

use std::path::Path;

use serde::de::value::Error as AnyError;
use serde::de::{DeserializeOwned, Error, Visitor};
use serde::{Deserializer, forward_to_deserialize_any};
use serde_ignored::Path as FieldPath;
use serde_path_to_error::Track;

use super::{CaptureFile, FrameFile, HandModelFile, SplitFile};
use crate::cameras::file::CameraFile;
use crate::error::CaptureError;
use crate::reading::json_file::not_as_expected;
use crate::reading::validation::FileValidator;

/// Prefixes of comments' names.
const COMMENTS: [&str; 3] = ["_", "//", "$"];
/// Names that are less similar (Jaro-Winkler, 1 for equal) are not suggested.
const LEAST_LIKENESS: f64 = 0.75;
/// Most characters of a field in a message.
const LONGEST_FIELD: usize = 100;

/// The content of a file's text, if it has no unknown field. An unknown field takes precedence over other errors,
/// because a misspelt name leaves another field missing.
pub(super) fn read_fields(path: &Path, text: &str) -> Result<CaptureFile, CaptureError> {
    read_known(path, text, |top| match top {
        None => field_names::<CaptureFile>(),
        Some("hand_model") => field_names::<HandModelFile>(),
        Some("cameras") => field_names::<CameraFile>(),
        Some("frames") => field_names::<FrameFile>(),
        Some(_) => field_names::<SplitFile>(),
    })
}

/// As [`read_fields`], for the one camera of a file.
pub(crate) fn read_camera_fields(path: &Path, text: &str) -> Result<CameraFile, CaptureError> {
    read_known(path, text, |_| field_names::<CameraFile>())
}

/// As [`read_fields`], for the part `T` of a `capture.json`, or of a file of cameras, which has `cameras` and perhaps
/// `own`.
pub(crate) fn read_cameras_fields<T: DeserializeOwned>(
    path: &Path,
    text: &str,
    own: &'static str,
) -> Result<T, CaptureError> {
    let names: Vec<&str> = field_names::<CaptureFile>().iter().copied().chain([own]).collect();
    read_known(path, text, |top| if top.is_none() { &names } else { field_names::<CameraFile>() })
}

/// The content of a file's text, if it has no field but the `known` ones of the top-level field of that name, or of the
/// file itself. What `T` does not read of them is not looked at.
fn read_known<'a, T: DeserializeOwned>(
    path: &Path,
    text: &str,
    known: impl Fn(Option<&str>) -> &'a [&'a str],
) -> Result<T, CaptureError> {
    let mut unknown = None;
    let mut json = serde_json::Deserializer::from_str(text);
    let mut track = Track::new();
    let read = serde_ignored::deserialize(serde_path_to_error::Deserializer::new(&mut json, &mut track), |field| {
        let field = FieldLocation::of(&field);
        let is_known = || known(field.top.as_deref()).contains(&field.name.as_str());
        if unknown.is_none() && !is_comment(&field.name) && !is_known() {
            unknown = Some(field);
        }
    });
    let read = read.and_then(|file: T| json.end().map(|()| file));
    match unknown {
        Some(field) => {
            let known = known(field.top.as_deref());
            Err(unknown_field(FileValidator { path }, &field.written, &field.name, known))
        }
        None => read.map_err(|error| not_as_expected(path, track, &error)),
    }
}

fn is_comment(name: &str) -> bool {
    COMMENTS.iter().any(|mark| name.starts_with(mark))
}

/// The location of a field.
struct FieldLocation {
    /// Its full path of names and indices.
    written: String,
    /// Its own name.
    name: String,
    /// The top-level field that contains it; `None` for a top-level field.
    top: Option<String>,
}

impl FieldLocation {
    fn of(path: &FieldPath) -> FieldLocation {
        match path {
            FieldPath::Map { parent, key } => {
                let above = FieldLocation::of(parent);
                let is_top = above.written.is_empty();
                let written = if is_top { key.clone() } else { format!("{}.{key}", above.written) };
                let top = if is_top { None } else { above.top.or(Some(above.name)) };
                FieldLocation { written, name: key.clone(), top }
            }
            FieldPath::Seq { parent, index } => {
                let above = FieldLocation::of(parent);
                FieldLocation { written: format!("{}[{index}]", above.written), ..above }
            }
            FieldPath::Some { parent } | FieldPath::NewtypeStruct { parent } | FieldPath::NewtypeVariant { parent } => {
                FieldLocation::of(parent)
            }
            FieldPath::Root => FieldLocation { written: String::new(), name: String::new(), top: None },
        }
    }
}

fn unknown_field(validator: FileValidator, field: &str, name: &str, known: &[&str]) -> CaptureError {
    let likeness = |known: &str| strsim::jaro_winkler(&name.to_lowercase(), known);
    let nearest = known.iter().copied().max_by(|a, b| likeness(a).total_cmp(&likeness(b)));
    let instead = match nearest.filter(|nearest| likeness(nearest) >= LEAST_LIKENESS) {
        Some(nearest) => format!("the nearest known field is {nearest:?}"),
        None => format!("known fields are {}", known.join(", ")),
    };
    // Names in a hostile file may have any length.
    let field: String = field.chars().take(LONGEST_FIELD).collect();
    let problem = format!(
        "is not a field of the format; {instead}; correct or remove it, or begin its name with _ if it is a comment"
    );
    validator.invalid(field, problem)
}

/// The names of a struct's fields in files.
fn field_names<T: DeserializeOwned>() -> &'static [&'static str] {
    let mut names: &'static [&'static str] = &[];
    // Fails because there is no value; only the names are needed.
    drop(T::deserialize(FieldNames(&mut names)));
    names
}

/// Records the names of the fields that a struct requests.
struct FieldNames<'a>(&'a mut &'static [&'static str]);

impl<'de> Deserializer<'de> for FieldNames<'_> {
    type Error = AnyError;

    fn deserialize_struct<V: Visitor<'de>>(
        self,
        _: &'static str,
        fields: &'static [&'static str],
        _: V,
    ) -> Result<V::Value, AnyError> {
        *self.0 = fields;
        Err(AnyError::custom("has no value"))
    }

    fn deserialize_any<V: Visitor<'de>>(self, _: V) -> Result<V::Value, AnyError> {
        Err(AnyError::custom("has no value"))
    }

    forward_to_deserialize_any! {
        bool i8 i16 i32 i64 i128 u8 u16 u32 u64 u128 f32 f64 char str string bytes byte_buf option unit unit_struct newtype_struct
        seq tuple tuple_struct map enum identifier ignored_any
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_names_are_those_of_the_files() {
        assert_eq!(field_names::<SplitFile>(), ["cameras", "frames"]);
        assert_eq!(field_names::<FrameFile>(), ["id", "pose", "translation", "shape"]);
        assert!(field_names::<CameraFile>().contains(&"distortion"));
    }
}
