//! Why a data set cannot become a capture.

use std::io;
use std::path::{Path, PathBuf};

use ghand_capture::CaptureError;
use ghand_footage::FootageError;
use ghand_hand_model::HandModelError;
use ghand_motion::PoseError;

/// Why a data set cannot become a capture, in one sentence.
#[derive(Debug, thiserror::Error)]
pub enum DatasetError {
    /// A folder is of no known data set.
    #[error(
        "{}: is not a sequence of DexYCB, HO-3D, FreiHAND, HanCo, ContactPose, ARCTIC, TACO or HOT3D-Clips; give the folder of \
         one as it was unpacked",
        .0.display()
    )]
    Unknown(PathBuf),
    /// A file or folder is unusable.
    #[error("{}: {problem}", path.display())]
    File {
        /// The file or folder.
        path: PathBuf,
        /// The problem, and what to do about it.
        problem: String,
    },
    /// A part of a file has an unusable value.
    #[error("{}: {field}: {problem}", path.display())]
    Field {
        /// The file.
        path: PathBuf,
        /// The part, as in `frames[3].oTw`.
        field: String,
        /// The problem, and what to do about it.
        problem: String,
    },
    /// A file of the capture cannot be written.
    #[error("{}: cannot be written", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// The capture cannot be written or read again.
    #[error(transparent)]
    Capture(#[from] CaptureError),
    /// A video cannot be read.
    #[error(transparent)]
    Footage(#[from] FootageError),
    /// The hand model cannot be used.
    #[error(transparent)]
    HandModel(#[from] HandModelError),
    /// Joints are not a hand's.
    #[error(transparent)]
    Pose(#[from] PoseError),
    /// The caller stopped it.
    #[error("the import was stopped")]
    Stopped,
}

impl DatasetError {
    pub(crate) fn file(path: &Path, problem: impl Into<String>) -> DatasetError {
        DatasetError::File { path: path.into(), problem: problem.into() }
    }

    pub(crate) fn write(path: &Path) -> impl FnOnce(io::Error) -> DatasetError {
        let path = path.into();
        move |source| DatasetError::Write { path, source }
    }
}
