//! Errors of hand models and their files.

use std::path::PathBuf;

use ghand_core::InvalidHandModel;

/// The problem with a hand model or its file.
#[derive(Debug, thiserror::Error)]
pub enum HandModelError {
    /// The file could not be read.
    #[error("{path}: cannot read the hand model: {source}")]
    Io {
        /// The file.
        path: PathBuf,
        /// The cause.
        source: std::io::Error,
    },
    /// The file could not be written.
    #[error("{path}: cannot write the hand model: {source}")]
    Write {
        /// The file.
        path: PathBuf,
        /// The cause.
        source: std::io::Error,
    },
    /// A field of the model is unusable.
    #[error(transparent)]
    Invalid(#[from] InvalidHandModel),
}

impl HandModelError {
    /// The error of an unusable field in a model from `origin`; `problem` includes a remedy.
    pub fn invalid(origin: impl Into<String>, field: impl Into<String>, problem: impl Into<String>) -> HandModelError {
        InvalidHandModel { origin: origin.into(), field: field.into(), problem: problem.into() }.into()
    }
}
