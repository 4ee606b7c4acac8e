//! `--light`: the light in which an avatar is shown.

use std::path::PathBuf;

use clap::Args;

use crate::lighting::{LightSource, Lighting};

/// Options for the light.
#[derive(Debug, Clone, Args)]
pub struct LightArgs {
    /// Light of the avatar: of its capture, of a studio, or of a panorama of all directions (.exr, .hdr)
    #[arg(long, value_name = "capture|studio|FILE", default_value = "capture")]
    light: PathBuf,
    /// Turn the light about the vertical, degrees
    #[arg(long, value_name = "DEGREES", default_value = "0", allow_negative_numbers = true, value_parser = parse_turn)]
    light_turn: f64,
}

impl LightArgs {
    /// The light.
    pub fn lighting(&self) -> Lighting {
        let source = match self.light.to_str() {
            Some("capture") => LightSource::Capture,
            Some("studio") => LightSource::Studio,
            _ => LightSource::Panorama(self.light.clone()),
        };
        Lighting { source, turn: self.light_turn }
    }
}

fn parse_turn(text: &str) -> Result<f64, String> {
    let degrees = text.parse().ok().filter(|degrees: &f64| degrees.is_finite());
    degrees.ok_or_else(|| "must be a number of degrees, such as 90 or -45".into())
}
