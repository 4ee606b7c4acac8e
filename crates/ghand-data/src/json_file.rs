//! JSON files that are small enough to be held as a whole.

use std::path::Path;

use ghand_core::atomic_file::write_atomically;
use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::error::CaptureError;

/// Larger files are taken for a mistake, bytes: ten thousand frames of 25 joints take 15 MB. Reading may take nine times as much
/// memory.
pub(crate) const LARGEST_FILE: u64 = 1 << 26;

/// What a file's text says.
pub(crate) fn parse<T: DeserializeOwned>(path: &Path, text: &str) -> Result<T, CaptureError> {
    serde_json::from_str(text).map_err(|source| CaptureError::Json { path: path.into(), source })
}

/// Writes a file, whole or not at all.
pub(crate) fn write_json(path: &Path, value: &impl Serialize) -> Result<(), CaptureError> {
    let text = serde_json::to_vec(value).map_err(|source| CaptureError::Json { path: path.into(), source })?;
    write_atomically(path, &text).map_err(|source| CaptureError::Io {
        path: path.into(),
        action: "write the capture",
        source,
        remedy: "check that the folder exists, may be written and has space",
    })
}
