//! Why a picture or a film could not be written.

use std::io;
use std::path::{Path, PathBuf};

use ghand_files::claim::ClaimError;

/// Why a picture or a film could not be written, in one sentence.
#[derive(Debug, thiserror::Error)]
pub enum PictureError {
    /// The destination or the format does not take these pictures.
    #[error("{0}")]
    Unsuitable(String),
    /// ffmpeg is missing, or cannot encode the film.
    #[error("{0}")]
    Ffmpeg(String),
    /// No temporary file.
    #[error("cannot create a temporary file for {what}")]
    Temporary {
        /// What it was for.
        what: &'static str,
        /// The error of the file system.
        source: io::Error,
    },
    /// The file system refuses.
    #[error("{}: {problem}", path.display())]
    File {
        /// The file or folder.
        path: PathBuf,
        /// What could not be done.
        problem: &'static str,
        /// The error of the file system.
        source: io::Error,
    },
    /// A picture cannot be encoded.
    #[error("{}: cannot write the picture", path.display())]
    Encoding {
        /// Its file.
        path: PathBuf,
        /// The error of the encoder.
        source: image::ImageError,
    },
    /// A film cannot be encoded as GIF.
    #[error(transparent)]
    Gif(#[from] gif::EncodingError),
    /// Another process writes there, or the folder cannot be made.
    #[error(transparent)]
    Claim(#[from] ClaimError),
}

impl PictureError {
    /// [`PictureError::File`] of a path.
    pub(crate) fn file(path: &Path, problem: &'static str) -> impl FnOnce(io::Error) -> PictureError {
        let path = path.into();
        move |source| PictureError::File { path, problem, source }
    }
}
