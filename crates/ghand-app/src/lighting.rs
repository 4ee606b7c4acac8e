//! The light in which an avatar is shown.

use std::io::Cursor;
use std::path::{Path, PathBuf};

use anyhow::{Context, anyhow, bail};
use clap::Args;
use clap::builder::{PathBufValueParser, TypedValueParser};
use ghand_avatar::{Avatar, Light};
use ghand_files::input_file;
use image::{ImageFormat, ImageReader};

/// Most bytes of a panorama: 16k x 8k pixels in half precision.
const MOST_BYTES: u64 = 1 << 30;

/// Where the light comes from.
#[derive(Debug, Clone, Default, PartialEq)]
pub enum LightSource {
    /// The light of the avatar's capture, which it has anyway.
    #[default]
    Capture,
    /// A studio.
    Studio,
    /// A panorama of all directions, a file.
    Panorama(PathBuf),
}

impl LightSource {
    /// A light by name, or else a panorama's file.
    pub fn of(name: PathBuf) -> LightSource {
        match name.to_str() {
            Some("capture") => LightSource::Capture,
            Some("studio") => LightSource::Studio,
            _ => LightSource::Panorama(name),
        }
    }
}

/// Options for the light in which an avatar is shown.
#[derive(Debug, Clone, Default, PartialEq, Args)]
pub struct Lighting {
    /// Light of the avatar: of its capture, of a studio, or of a panorama of all directions (.exr, .hdr)
    #[arg(long = "light", value_name = "capture|studio|FILE", default_value = "capture")]
    #[arg(value_parser = PathBufValueParser::new().map(LightSource::of))]
    pub source: LightSource,
    /// Turn the light about the vertical, degrees
    #[arg(long = "light-turn", value_name = "DEGREES", default_value = "0", allow_negative_numbers = true)]
    #[arg(value_parser = parse_turn)]
    pub turn: f64,
}

fn parse_turn(text: &str) -> Result<f64, String> {
    let degrees = text.parse().ok().filter(|degrees: &f64| degrees.is_finite());
    degrees.ok_or_else(|| "must be a number of degrees, such as 90 or -45".into())
}

impl Lighting {
    /// The file of the light, if it is not one by name.
    pub fn input(&self) -> Option<&Path> {
        match &self.source {
            LightSource::Panorama(path) => Some(path),
            LightSource::Capture | LightSource::Studio => None,
        }
    }

    /// Whether the avatar's own light is wanted, as it is.
    pub fn is_default(&self) -> bool {
        *self == Lighting::default()
    }

    /// Puts an avatar into the light.
    ///
    /// # Errors
    /// An error that names the file and its problem, or says that the avatar's light is part of its colours.
    pub fn apply_to(&self, avatar: &mut Avatar) -> anyhow::Result<()> {
        if self.is_default() {
            return Ok(());
        }
        let Some(lit) = &mut avatar.light else {
            bail!(
                "--light: the avatar's colours contain the light of its capture; train it again with \
                 --set light=transfer"
            );
        };
        let light = match &self.source {
            LightSource::Capture => lit.light.clone(),
            LightSource::Studio => Light::studio(),
            LightSource::Panorama(path) => panorama(path)?,
        };
        lit.light = light.turned(self.turn.to_radians());
        Ok(())
    }
}

/// The light of a panorama's file.
fn panorama(path: &Path) -> anyhow::Result<Light> {
    let name = path.display();
    let format = ImageFormat::from_path(path).ok();
    if !matches!(format, Some(ImageFormat::OpenExr | ImageFormat::Hdr)) {
        bail!("--light: `{name}` must be `capture`, `studio`, or a panorama whose name ends in .exr or .hdr");
    }
    let bytes = input_file::read(path, MOST_BYTES).with_context(|| format!("{name}: cannot read the panorama"))?;
    let bytes = bytes.ok_or_else(|| anyhow!("{name}: has more than 1 GiB; reduce the panorama"))?;
    let mut reader = ImageReader::new(Cursor::new(bytes));
    reader.set_format(format.unwrap_or(ImageFormat::OpenExr));
    let image = reader.decode().map_err(|error| anyhow!("{name}: is no readable panorama: {error}"))?.into_rgb32f();
    let pixels: Vec<[f32; 3]> = image.pixels().map(|pixel| pixel.0).collect();
    Light::of_panorama(image.width() as usize, image.height() as usize, &pixels)
        .map_err(|error| anyhow!("{name}: {error}"))
}
