//! Films: pictures of one size, one after the other, as one file.

use std::path::Path;

use crate::ffmpeg::Ffmpeg;
use crate::film_options::FilmOptions;
use crate::format::FilmFormat;
use crate::gif::GifFilm;
use crate::{Picture, PictureError, piped_film};

/// Duration of one turn around a hand or scene that does not move, seconds, if there are enough pictures.
pub const LONGEST_TURN_SECONDS: f64 = 4.0;
/// Highest frame rate; with more pictures a turn takes longer.
const SMOOTH_RATE: f64 = 30.0;

/// Frame rate of a film of one turn with this many views.
pub fn turn_rate(views: usize) -> f64 {
    (views as f64 / LONGEST_TURN_SECONDS).clamp(1.0, SMOOTH_RATE)
}

/// A film being made.
pub enum Film {
    /// Encoded here.
    Gif(GifFilm),
    /// Encoded by ffmpeg.
    Piped(Ffmpeg),
}

impl Film {
    /// Begins a film. Fails before anything is rendered if the film cannot be made.
    ///
    /// # Errors
    /// One sentence on what the format cannot do, or that ffmpeg is missing.
    pub fn start(options: FilmOptions) -> Result<Film, PictureError> {
        Ok(match options.format {
            FilmFormat::Gif => Film::Gif(GifFilm::start(options)?),
            FilmFormat::Webm | FilmFormat::Mp4 => Film::Piped(piped_film::start(&options)?),
        })
    }

    /// Columns and rows of the film for pictures of this size: those that ffmpeg encodes are even.
    pub fn size(&self, [width, height]: [u32; 2]) -> [u32; 2] {
        match self {
            Film::Gif(_) => [width, height],
            Film::Piped(_) => [width, height].map(|edge| edge.next_multiple_of(2)),
        }
    }

    /// Adds a picture of the film's size.
    ///
    /// # Errors
    /// An error of the encoder.
    pub fn add(&mut self, picture: &Picture) -> Result<(), PictureError> {
        match self {
            Film::Gif(film) => film.add(picture),
            Film::Piped(film) => film.send(picture.to_rgba8().as_flattened()),
        }
    }

    /// Ends the film and writes it atomically.
    ///
    /// # Errors
    /// An error that names the file.
    pub fn write(self, path: &Path) -> Result<(), PictureError> {
        match self {
            Film::Gif(film) => film.write(path),
            Film::Piped(film) => film.write(path),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_turn_takes_four_seconds_unless_it_has_very_many_or_few_pictures() {
        assert_eq!([1, 2, 24, 120, 500].map(turn_rate), [1.0, 1.0, 6.0, 30.0, 30.0]);
    }
}
