//! Writes several pictures, one after the other, to a destination.

use std::path::PathBuf;

use ghand_files::atomic_file::check_writable;
use indicatif::{ProgressBar, ProgressStyle};
use serde::{Deserialize, Serialize};

use crate::film::Film;
use crate::film_options::FilmOptions;
use crate::folder::Folder;
use crate::{Background, Destination, Picture, PictureError, StillFormat};

/// The content of a picture in a series.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Shot {
    /// Number of the frame, if frames are rendered.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub frame: Option<usize>,
    /// Its id in the file of poses.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub id: Option<String>,
    /// Number of the view around it, if there are several.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub view: Option<usize>,
}

/// Pictures being written to files. Outlives the device that renders them, so that added pictures need not be rendered
/// again.
pub struct Series {
    sink: Sink,
    size: [u32; 2],
    background: Background,
    format: StillFormat,
    count: usize,
    next: usize,
    bar: ProgressBar,
}

enum Sink {
    Picture(PathBuf),
    Film(PathBuf, Box<Film>, f64),
    Folder(PathBuf, Folder),
}

impl Series {
    /// Prepares for one picture of each shot, all of one size; `fps` is for films. Checks everything that can be
    /// checked before the first picture is rendered, and writes nothing.
    ///
    /// # Errors
    /// One sentence if the destination cannot accept these pictures.
    pub fn new(
        destination: &Destination,
        shots: &[Shot],
        size: [u32; 2],
        background: Background,
        fps: f64,
    ) -> Result<Series, PictureError> {
        if let Destination::Picture(path, _) | Destination::Film(path, _) = destination {
            let option = PathBuf::from(format!("--out {}", path.display()));
            check_writable(path).map_err(PictureError::file(&option, "cannot be written"))?;
        }
        let mut still = StillFormat::Png;
        let sink = match destination {
            Destination::Picture(path, format) => {
                if shots.len() != 1 {
                    return Err(PictureError::Unsuitable(format!(
                        "--out {}: is one picture, but there are {} to write; give a folder, or a film such as .gif",
                        path.display(),
                        shots.len()
                    )));
                }
                still = *format;
                Sink::Picture(path.clone())
            }
            Destination::Film(path, format) => {
                let film = Film::start(FilmOptions { format: *format, size, background, fps })?;
                Sink::Film(path.clone(), Box::new(film), fps)
            }
            Destination::Folder(path, format) => {
                still = *format;
                Sink::Folder(path.clone(), Folder::new(path, *format, shots)?)
            }
        };
        // Draws nothing if stderr is not a terminal.
        let bar = if shots.len() > 1 { ProgressBar::new(shots.len() as u64) } else { ProgressBar::hidden() };
        let style = ProgressStyle::with_template("{bar:30} {pos}/{len} pictures {elapsed} (left {eta})");
        bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
        Ok(Series { sink, size, background, format: still, count: shots.len(), next: 0, bar })
    }

    /// Number of the shot to render next; none at the end.
    pub fn next(&self) -> Option<usize> {
        (self.next < self.count).then_some(self.next)
    }

    /// The picture to fill next.
    pub fn blank(&self) -> Picture {
        Picture::blank(self.size, self.background, self.format)
    }

    /// Adds the picture of the next shot.
    ///
    /// # Errors
    /// An error that names the file.
    pub fn add(&mut self, picture: Picture) -> Result<(), PictureError> {
        match &mut self.sink {
            Sink::Picture(path) => picture.write(path)?,
            Sink::Film(_, film, _) => film.add(&picture)?,
            Sink::Folder(_, folder) => folder.add(self.next, picture)?,
        }
        self.next += 1;
        self.bar.set_position(self.next as u64);
        Ok(())
    }

    /// Completes the files; returns what was written, as text.
    ///
    /// # Errors
    /// An error that names the file.
    pub fn finish(self) -> Result<String, PictureError> {
        self.bar.finish_and_clear();
        let [width, height] = self.size;
        let count = self.count;
        Ok(match self.sink {
            Sink::Picture(path) => format!("{}: {width} x {height} pixels", path.display()),
            Sink::Film(path, film, fps) => {
                let [width, height] = film.size([width, height]);
                film.write(&path)?;
                let seconds = count as f64 / fps;
                // A number and its unit stay on one line.
                format!("{}: {count} pictures of {width} x {height} pixels, {seconds:.1}\u{a0}s", path.display())
            }
            Sink::Folder(path, folder) => {
                let names = folder.ends().map_or(String::new(), |[first, last]| match count {
                    1 => format!(", {first}"),
                    _ => format!(", {first} to {last}"),
                });
                let removed = match folder.finish()? {
                    0 => String::new(),
                    removed => format!("; {removed} pictures of an earlier render were removed"),
                };
                let pictures = if count == 1 { "picture" } else { "pictures" };
                format!("{}: {count} {pictures} of {width} x {height} pixels{names}{removed}", path.display())
            }
        })
    }
}
