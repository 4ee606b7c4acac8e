//! Errors of captures.

use std::path::{Path, PathBuf};

use ghand_hand_model::HandModelError;

/// The problem with a capture. Every message names the file, the field and what to do.
#[derive(Debug, thiserror::Error)]
pub enum CaptureError {
    /// A file could not be read or written.
    #[error("{path}: cannot {action}: {source}; {remedy}")]
    Io {
        /// The file.
        path: PathBuf,
        /// The attempted action, such as "read the capture".
        action: &'static str,
        /// The cause.
        source: std::io::Error,
        /// What to do about it.
        remedy: &'static str,
    },
    /// A file is not JSON, or a field is missing or has the wrong type.
    #[error("{path}: {problem}; correct the file there, or export it again")]
    Json {
        /// The file.
        path: PathBuf,
        /// The field, if known, its problem, and the line and column.
        problem: String,
    },
    /// A field has an unusable value.
    #[error("{path}: {field}: {problem}")]
    Invalid {
        /// The file.
        path: PathBuf,
        /// The field, as in `frames["0003"].pose`.
        field: String,
        /// The problem, and what to do about it.
        problem: String,
    },
    /// The capture's hand model is unusable.
    #[error("{path}: hand_model: {source}")]
    HandModel {
        /// The file of the capture.
        path: PathBuf,
        /// The cause.
        source: HandModelError,
    },
    /// A file of MANO parameters is unusable.
    #[error(transparent)]
    Parameters(HandModelError),
    /// An image or mask could not be decoded or encoded.
    #[error("{path}: {what}: {source}; replace the file with a valid PNG, JPEG or EXR")]
    Image {
        /// The file.
        path: PathBuf,
        /// "image" or "mask".
        what: &'static str,
        /// The cause.
        source: image::ImageError,
    },
    /// The renderer of a synthetic capture failed.
    #[error("synthetic capture: frame {frame} from camera {camera} could not be rendered: {problem}")]
    Render {
        /// Id of the frame.
        frame: String,
        /// Id of the camera.
        camera: String,
        /// The renderer's message.
        problem: String,
    },
}

impl CaptureError {
    /// The faulty file, if there is one.
    pub fn path(&self) -> Option<&Path> {
        match self {
            CaptureError::Io { path, .. }
            | CaptureError::Json { path, .. }
            | CaptureError::Invalid { path, .. }
            | CaptureError::HandModel { path, .. }
            | CaptureError::Image { path, .. } => Some(path),
            CaptureError::Parameters(_) | CaptureError::Render { .. } => None,
        }
    }
}
