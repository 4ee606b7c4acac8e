//! Pictures as files: single ones, folders of them, films; plots, and letters in pictures.

// Plots' library reads no fonts in browsers.
pub mod blank_pictures;
#[cfg(not(target_arch = "wasm32"))]
pub mod color_scale;
pub mod draw_text;
#[cfg(not(target_arch = "wasm32"))]
pub mod plot;

mod background;
mod destination;
mod ffmpeg;
mod film;
mod film_options;
mod folder;
mod format;
mod gif;
mod picture;
mod picture_error;
mod piped_film;
mod series;
mod video;

pub use background::{Background, parse_background};
pub use destination::Destination;
pub use ffmpeg::Ffmpeg;
pub use film::{LONGEST_TURN_SECONDS, turn_rate};
pub use format::{Format, StillFormat};
pub use picture::{Picture, write_png};
pub use picture_error::PictureError;
pub use series::{Series, Shot};
pub use video::{VideoOptions, start_video};
