//! Reads whole text files, within a bound.

use std::path::Path;

use ghand_files::input_file;

use super::validation::FileValidator;
use crate::error::CaptureError;

/// The text of a file of at most `most` bytes. `action` and `remedy` are for messages.
pub(crate) fn read_text(
    path: &Path,
    most: u64,
    action: &'static str,
    remedy: &'static str,
) -> Result<String, CaptureError> {
    let validator = FileValidator { path };
    let bytes = input_file::read(path, most)
        .map_err(|source| CaptureError::Io { path: path.into(), action, source, remedy })?
        .ok_or_else(|| {
            validator
                .invalid("file", format!("is larger than {} MiB; split it, or keep only what is needed", most >> 20))
        })?;
    text_of(path, bytes)
}

/// The text of a file's bytes.
pub(crate) fn text_of(path: &Path, bytes: Vec<u8>) -> Result<String, CaptureError> {
    let wrong = |what: &str| FileValidator { path }.invalid("file", format!("is {what}; save it as UTF-8"));
    // Some editors write a byte order mark, which JSON does not allow.
    let bytes = match bytes.as_slice() {
        [0xEF, 0xBB, 0xBF, text @ ..] => text.to_vec(),
        [0xFF, 0xFE, ..] | [0xFE, 0xFF, ..] => return Err(wrong("text in UTF-16")),
        _ => bytes,
    };
    String::from_utf8(bytes).map_err(|error| wrong(&format!("not text in UTF-8 ({})", error.utf8_error())))
}
