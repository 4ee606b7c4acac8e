//! Properties of a film, for all encoders.

use crate::Background;
use crate::format::FilmFormat;

/// Properties of a film.
#[derive(Debug, Clone, Copy)]
pub struct FilmOptions {
    /// The format.
    pub format: FilmFormat,
    /// Size of every picture.
    pub size: [u32; 2],
    /// What is behind every picture.
    pub background: Background,
    /// Pictures per second.
    pub fps: f64,
}
