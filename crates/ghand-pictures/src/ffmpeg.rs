//! Films encoded by ffmpeg, which receives raw pictures through a pipe.

use std::fs::File;
use std::io::{ErrorKind, Read, Seek, SeekFrom, Write};
use std::path::Path;
use std::process::{Child, ChildStdin, Command, Stdio};

use ghand_files::atomic_file::write_atomically;
use ghand_files::temporary::{Registered, Temporary};
use tempfile::TempPath;

use crate::film_options::FilmOptions;
use crate::format::FilmFormat;
use crate::{Background, Picture, PictureError};

const PROGRAM: &str = "ffmpeg";
const REMEDY: &str =
    "install ffmpeg (Debian or Ubuntu: `apt-get install ffmpeg`), or render a .gif or a folder of PNG pictures";

/// A film that ffmpeg is encoding. If dropped before its end, it leaves no file.
pub struct PipedFilm {
    child: Child,
    pictures: Option<ChildStdin>,
    /// Messages of ffmpeg; a file, because nothing reads a pipe during encoding.
    complaints: File,
    encoded: TempPath,
    _known: Registered,
}

impl PipedFilm {
    /// Starts ffmpeg.
    ///
    /// # Errors
    /// One sentence if it is not installed, or the format cannot be transparent.
    pub fn start(options: FilmOptions) -> Result<PipedFilm, PictureError> {
        if options.format == FilmFormat::Mp4 && options.background == Background::Transparent {
            return Err(PictureError::Unsuitable(
                "--background transparent: MP4 has no transparency; give .webm, .gif or a folder of PNG pictures"
                    .into(),
            ));
        }
        let file = |what| move |source| PictureError::Temporary { what, source };
        // MP4 is not written sequentially.
        let encoded = tempfile::Builder::new().prefix("ghand-").tempfile().map_err(file("the film"))?;
        let encoded = encoded.into_temp_path();
        let known = Registered::new(Temporary::File(encoded.to_path_buf()));
        let complaints = tempfile::tempfile().map_err(file("ffmpeg's messages"))?;
        let stderr = complaints.try_clone().map_err(file("ffmpeg's messages"))?;
        let child = Command::new(PROGRAM)
            .args(arguments(&options))
            .arg(&encoded)
            .stdin(Stdio::piped())
            .stdout(Stdio::null())
            .stderr(stderr)
            .spawn();
        let mut child = child.map_err(|error| match error.kind() {
            ErrorKind::NotFound => {
                PictureError::Ffmpeg(format!("webm and mp4 need ffmpeg, which is not installed; {REMEDY}"))
            }
            _ => PictureError::Ffmpeg(format!("ffmpeg cannot be started: {error}; {REMEDY}")),
        })?;
        let pictures = child.stdin.take();
        Ok(PipedFilm { child, pictures, complaints, encoded, _known: known })
    }

    /// Adds a picture.
    ///
    /// # Errors
    /// The message of ffmpeg, if it has ended.
    pub fn add(&mut self, picture: &Picture) -> Result<(), PictureError> {
        let sent = match &mut self.pictures {
            Some(pipe) => pipe.write_all(picture.to_rgba8().as_flattened()),
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
        PictureError::Ffmpeg(format!("ffmpeg cannot encode the film: {first}; {REMEDY}"))
    }
}

impl Drop for PipedFilm {
    fn drop(&mut self) {
        // Nothing to do if it has ended, and no way to report if it cannot be stopped.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// All arguments except the last, the file.
fn arguments(options: &FilmOptions) -> Vec<String> {
    let [width, height] = options.size;
    let (behind, pixels) = match options.background {
        Background::Transparent => ("black@0".into(), "yuva420p"),
        Background::Color(color) => {
            let [r, g, b] = color.map(|v| (v.clamp(0.0, 1.0) * 255.0).round() as u8);
            (format!("0x{r:02x}{g:02x}{b:02x}"), "yuv420p")
        }
    };
    // Colour has half as many columns and rows, so that both must be even.
    let even = format!("pad=ceil(iw/2)*2:ceil(ih/2)*2:color={behind}");
    let filters = format!("{even},scale=out_color_matrix=bt709:out_range=tv,format={pixels}");
    let input = format!("-y -loglevel error -f rawvideo -pixel_format rgba -video_size {width}x{height} -framerate");
    let tags = "-colorspace bt709 -color_primaries bt709 -color_trc iec61966-2-1 -color_range tv";
    let codec = match options.format {
        FilmFormat::Mp4 => "-c:v libx264 -crf 16 -preset medium -movflags +faststart -f mp4",
        // GIF is not handled here.
        FilmFormat::Webm | FilmFormat::Gif => "-c:v libvpx-vp9 -crf 20 -b:v 0 -row-mt 1 -f webm",
    };
    let words = |text: &str| text.split(' ').map(String::from).collect::<Vec<_>>();
    let fps = options.fps.to_string();
    [words(&input), vec![fps], words("-i - -an -vf"), vec![filters], words(tags), words(codec)].concat()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_mp4_cannot_be_transparent() {
        let options =
            FilmOptions { format: FilmFormat::Mp4, size: [4, 4], background: Background::Transparent, fps: 30.0 };
        let error = PipedFilm::start(options).err().unwrap().to_string();
        assert!(error.contains("transparent") && error.contains(".webm"), "{error}");
    }
}
