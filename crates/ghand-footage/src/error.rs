//! Why footage could not be read.

use std::io;
use std::path::{Path, PathBuf};

/// Why footage could not be read, in one sentence.
#[derive(Debug, thiserror::Error)]
pub enum FootageError {
    /// A program of ffmpeg is missing.
    #[error(
        "{}: {program} is needed, which is not installed; install ffmpeg: `apt-get install ffmpeg` (Debian, Ubuntu), \
         `dnf install ffmpeg-free` (Fedora), `brew install ffmpeg` (macOS) or `winget install ffmpeg` (Windows)",
        path.display()
    )]
    NotInstalled {
        /// The video.
        path: PathBuf,
        /// `ffmpeg` or `ffprobe`.
        program: &'static str,
    },
    /// The file system refuses.
    #[error("{}: cannot be read", path.display())]
    File {
        /// The file or folder.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// A picture cannot be decoded.
    #[error("{}: cannot be read as a picture; export it again, or remove it", path.display())]
    Picture {
        /// Its file.
        path: PathBuf,
        /// Why.
        source: image::ImageError,
    },
    /// It is not footage, or cannot be used.
    #[error("{}: {problem}", path.display())]
    Unusable {
        /// The file or folder.
        path: PathBuf,
        /// What is wrong, and the remedy.
        problem: String,
    },
}

impl FootageError {
    pub(crate) fn unusable(path: &Path, problem: impl Into<String>) -> FootageError {
        FootageError::Unusable { path: path.into(), problem: problem.into() }
    }

    pub(crate) fn file(path: &Path) -> impl FnOnce(io::Error) -> FootageError {
        let path = path.into();
        move |source| FootageError::File { path, source }
    }
}
