//! Writes single pictures, folders of pictures, and films.

mod background;
mod destination;
mod ffmpeg;
mod film;
mod film_options;
mod folder;
mod format;
mod gif;
mod picture;
mod series;

pub use background::{Background, parse_background};
pub use destination::{Destination, FormatArgs};
pub use film::{LONGEST_TURN_SECONDS, turn_rate};
pub use format::{Format, StillFormat};
pub use picture::{Picture, write_png};
pub use series::{Series, Shot};
