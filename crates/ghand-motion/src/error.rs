//! What can be wrong with a file of poses.

use std::path::PathBuf;

use ghand_files::value::ValueError;
use ghand_hand_model::HandModelError;

/// What is wrong with a file of poses. Every message names the file, the field and what to do.
#[derive(Debug, thiserror::Error)]
pub enum PoseError {
    /// The file cannot be read, or is of no kind that is read.
    #[error("{path}: the poses: {source}")]
    File {
        /// The file.
        path: PathBuf,
        /// The cause.
        source: ValueError,
    },
    /// The file cannot be written.
    #[error("{path}: cannot write the poses: {source}")]
    Write {
        /// The file.
        path: PathBuf,
        /// The cause.
        source: std::io::Error,
    },
    /// A field holds something unusable.
    #[error("{origin}: {field}: {problem}")]
    Invalid {
        /// The file, or the hand model.
        origin: String,
        /// The field, as in `frames["0003"].pose`.
        field: String,
        /// What is wrong and what to do about it.
        problem: String,
    },
    /// The hand model that poses are carried over from cannot be made.
    #[error(transparent)]
    HandModel(#[from] HandModelError),
}
