//! The option `--format`.

use std::path::Path;

use clap::Args;
use ghand_pictures::{Destination, Format, PictureError};

/// The option `--format`.
#[derive(Debug, Clone, Copy, Default, Args)]
pub struct FormatArgs {
    /// png or exr pictures, or one film: gif, or, with ffmpeg installed, webm or mp4 [default: what --out ends in, else
    /// png]
    #[arg(long, value_name = "FORMAT", value_parser = Format::parse)]
    format: Option<Format>,
}

impl FormatArgs {
    /// As [`Destination::new`].
    ///
    /// # Errors
    /// As there.
    pub fn destination(self, out: &Path, name: &str) -> Result<Destination, PictureError> {
        Destination::new(out, self.format, name)
    }
}
