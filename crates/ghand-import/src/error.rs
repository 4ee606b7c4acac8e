//! Why an import failed.

use std::io;
use std::path::PathBuf;

use ghand_board::BoardError;
use ghand_capture::CaptureError;
use ghand_fit::alignment::AlignmentError;
use ghand_footage::FootageError;
use ghand_hand_model::HandModelError;
use ghand_motion::PoseError;
use ghand_tracker::TrackerError;

/// Why an import failed, in one sentence.
#[derive(Debug, thiserror::Error)]
pub enum ImportError {
    /// Footage cannot be read.
    #[error(transparent)]
    Footage(#[from] FootageError),
    /// Cameras cannot be read, or the capture cannot be written.
    #[error(transparent)]
    Capture(#[from] CaptureError),
    /// Landmarks are not a hand's.
    #[error(transparent)]
    Pose(#[from] PoseError),
    /// Outlines cannot be followed.
    #[error(transparent)]
    Alignment(#[from] AlignmentError),
    /// Cameras cannot be calibrated by the board.
    #[error(transparent)]
    Board(#[from] BoardError),
    /// The hand model cannot be used.
    #[error(transparent)]
    HandModel(#[from] HandModelError),
    /// The tracker refuses a frame.
    #[error(transparent)]
    Tracker(#[from] TrackerError),
    /// A folder of footage cannot be read.
    #[error("{}: cannot be read", path.display())]
    Read {
        /// The folder.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// A file of the import cannot be written.
    #[error("{}: cannot be written", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// Something else about the footage, with the remedy.
    #[error("{0}")]
    Unusable(String),
    /// The caller stopped it.
    #[error("the import was stopped")]
    Stopped,
}

impl ImportError {
    pub(crate) fn write(path: &std::path::Path) -> impl FnOnce(io::Error) -> ImportError {
        let path = path.into();
        move |source| ImportError::Write { path, source }
    }
}
