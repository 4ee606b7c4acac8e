//! JSON files that are small enough to be read whole.

use std::path::Path;

use ghand_files::atomic_file::write_atomically;
use ghand_files::json_error::plain_json_error;
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_path_to_error::{Deserializer, Track};

use crate::error::CaptureError;

/// Larger files are probably a mistake, bytes: ten thousand frames of 25 joints take 15 MB. Reading may take nine times
/// as much memory.
pub(crate) const LARGEST_FILE: u64 = 1 << 26;

/// Parses a file's text.
pub(crate) fn parse<T: DeserializeOwned>(path: &Path, text: &str) -> Result<T, CaptureError> {
    let mut json = serde_json::Deserializer::from_str(text);
    let mut track = Track::new();
    let value = T::deserialize(Deserializer::new(&mut json, &mut track));
    value.and_then(|value| json.end().map(|()| value)).map_err(|error| not_as_expected(path, track, &error))
}

/// The error of a parser that has recorded its position in `track`.
pub(crate) fn not_as_expected(path: &Path, track: Track, error: &serde_json::Error) -> CaptureError {
    let field = track.path().to_string();
    let problem = plain_json_error(error);
    // Text that is not JSON has no fields, and `.` means the whole file.
    let is_named = error.is_data() && field != ".";
    CaptureError::Json { path: path.into(), problem: if is_named { format!("{field}: {problem}") } else { problem } }
}

/// Writes a file atomically.
pub(crate) fn write_json(path: &Path, value: &impl Serialize) -> Result<(), CaptureError> {
    let text = serde_json::to_vec(value)
        .map_err(|error| CaptureError::Json { path: path.into(), problem: plain_json_error(&error) })?;
    write_atomically(path, &text).map_err(|source| CaptureError::Io {
        path: path.into(),
        action: "write the capture",
        source,
        remedy: "check that the folder exists, is writable and has free space",
    })
}
