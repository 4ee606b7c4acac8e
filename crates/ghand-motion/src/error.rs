//! Errors of files of poses.

use std::path::PathBuf;

use ghand_files::value::ValueError;
use ghand_hand_model::HandModelError;

/// The problem with a file of poses. Every message names the file, the field and what to do.
#[derive(Debug, thiserror::Error)]
pub enum PoseError {
    /// The file cannot be read, or is not of a supported kind.
    #[error("{path}: {source}")]
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
    /// A field has an unusable value.
    #[error("{origin}: {field}: {problem}")]
    Invalid {
        /// The file, or the hand model.
        origin: String,
        /// The field, as in `frames["0003"].pose`.
        field: String,
        /// The problem, and what to do about it.
        problem: String,
    },
    /// The source hand model of a transfer cannot be built.
    #[error(transparent)]
    HandModel(#[from] HandModelError),
}
