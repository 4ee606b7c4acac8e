//! The program ffmpeg, which receives raw pictures through a pipe and encodes them.

use std::fs::File;
use std::io::{ErrorKind, Read, Seek, SeekFrom, Write};
use std::path::Path;
use std::process::{Child, ChildStdin, Command, Stdio};

use ghand_files::atomic_file::write_atomically;
use ghand_files::temporary::{Registered, Temporary};
use tempfile::TempPath;

use crate::PictureError;

const PROGRAM: &str = "ffmpeg";

/// What says that the encoded colours are display values (sRGB) in BT.709's matrix and limited range.
pub(crate) const DISPLAY_TAGS: &str =
    "-colorspace bt709 -color_primaries bt709 -color_trc iec61966-2-1 -color_range tv";

/// Arguments that contain no spaces.
pub(crate) fn words(text: &str) -> Vec<String> {
    text.split(' ').map(String::from).collect()
}

/// What ffmpeg is for, in the words of its errors.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Purpose {
    /// What needs it, with the verb: "videos need".
    pub needed_by: &'static str,
    /// What to do without it.
    pub remedy: &'static str,
}

/// An ffmpeg that is encoding. If dropped before its end, it leaves no file.
pub struct Ffmpeg {
    child: Child,
    pictures: Option<ChildStdin>,
    /// Messages of ffmpeg; a file, because nothing reads a pipe during encoding.
    complaints: File,
    encoded: TempPath,
    purpose: Purpose,
    _known: Registered,
}

impl Ffmpeg {
    /// Starts it with all arguments except the last, the file.
    ///
    /// # Errors
    /// One sentence if it is not installed.
    pub(crate) fn start(arguments: &[String], purpose: Purpose) -> Result<Ffmpeg, PictureError> {
        let file = |what| move |source| PictureError::Temporary { what, source };
        // MP4 is not written sequentially.
        let encoded = tempfile::Builder::new().prefix("ghand-").tempfile().map_err(file("the film"))?;
        let encoded = encoded.into_temp_path();
        let known = Registered::new(Temporary::File(encoded.to_path_buf()));
        let complaints = tempfile::tempfile().map_err(file("ffmpeg's messages"))?;
        let stderr = complaints.try_clone().map_err(file("ffmpeg's messages"))?;
        let child = Command::new(PROGRAM)
            .args(arguments)
            .arg(&encoded)
            .stdin(Stdio::piped())
            .stdout(Stdio::null())
            .stderr(stderr)
            .spawn();
        let Purpose { needed_by, remedy } = purpose;
        let mut child = child.map_err(|error| match error.kind() {
            ErrorKind::NotFound => {
                PictureError::Ffmpeg(format!("{needed_by} ffmpeg, which is not installed; {remedy}"))
            }
            _ => PictureError::Ffmpeg(format!("ffmpeg cannot be started: {error}; {remedy}")),
        })?;
        let pictures = child.stdin.take();
        Ok(Ffmpeg { child, pictures, complaints, encoded, purpose, _known: known })
    }

    /// Sends raw pixels, row by row.
    ///
    /// # Errors
    /// The message of ffmpeg, if it has ended.
    pub fn send(&mut self, pixels: &[u8]) -> Result<(), PictureError> {
        let sent = match &mut self.pictures {
            Some(pipe) => pipe.write_all(pixels),
            None => Ok(()),
        };
        match sent {
            Ok(()) => Ok(()),
            Err(error) => {
                // It has ended, or will end without more input.
                self.pictures = None;
                let _ = self.child.wait();
                Err(self.failure(&error.to_string()))
            }
        }
    }

    /// Waits for the end of the encoding and writes the film.
    ///
    /// # Errors
    /// The message of ffmpeg, or an error that names the file.
    pub fn write(mut self, path: &Path) -> Result<(), PictureError> {
        // The end of the pictures.
        self.pictures = None;
        let status = self.child.wait();
        let status = status.map_err(|error| PictureError::Ffmpeg(format!("cannot wait for ffmpeg: {error}")))?;
        if !status.success() {
            return Err(self.failure(&status.to_string()));
        }
        let bytes = std::fs::read(&self.encoded);
        bytes
            .and_then(|bytes| write_atomically(path, &bytes))
            .map_err(PictureError::file(path, "cannot write the film"))
    }

    fn failure(&mut self, otherwise: &str) -> PictureError {
        let mut text = String::new();
        let _ = self.complaints.seek(SeekFrom::Start(0));
        let _ = self.complaints.read_to_string(&mut text);
        let first = text.lines().map(str::trim).find(|line| !line.is_empty());
        let first = first.unwrap_or(otherwise);
        PictureError::Ffmpeg(format!("ffmpeg cannot encode the film: {first}; {}", self.purpose.remedy))
    }
}

impl Drop for Ffmpeg {
    fn drop(&mut self) {
        // Nothing to do if it has ended, and no way to report if it cannot be stopped.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
