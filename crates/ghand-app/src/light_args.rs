//! `--light`: the light in which an avatar is shown.

use std::io::Cursor;
use std::path::{Path, PathBuf};

use anyhow::{Context, anyhow, bail};
use clap::Args;
use ghand_avatar::{Avatar, Light};
use ghand_files::input_file;
use image::{ImageFormat, ImageReader};

/// Most bytes of a panorama: 16k x 8k pixels in half precision.
const MOST_BYTES: u64 = 1 << 30;

/// The light that an avatar has anyway.
const AS_CAPTURED: &str = "capture";

/// Options for the light.
#[derive(Debug, Clone, Args)]
pub struct LightArgs {
    /// Light of the avatar: of its capture, of a studio, or of a panorama of all directions (.exr, .hdr)
    #[arg(long, value_name = "capture|studio|FILE", default_value = AS_CAPTURED)]
    light: PathBuf,
    /// Turn the light about the vertical, degrees
    #[arg(long, value_name = "DEGREES", default_value = "0", allow_negative_numbers = true, value_parser = parse_turn)]
    light_turn: f64,
}

impl Default for LightArgs {
    fn default() -> Self {
        LightArgs { light: AS_CAPTURED.into(), light_turn: 0.0 }
    }
}

fn parse_turn(text: &str) -> Result<f64, String> {
    let degrees = text.parse().ok().filter(|degrees: &f64| degrees.is_finite());
    degrees.ok_or_else(|| "must be a number of degrees, such as 90 or -45".into())
}

impl LightArgs {
    /// The file of the light, if it is not one by name.
    pub fn input(&self) -> Option<&Path> {
        Some(self.light.as_path()).filter(|light| *light != Path::new(AS_CAPTURED) && *light != Path::new("studio"))
    }

    /// Whether the avatar's own light is wanted, as it is.
    pub fn is_default(&self) -> bool {
        self.light == Path::new(AS_CAPTURED) && self.light_turn == 0.0
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
        let light = match self.light.to_str() {
            Some("capture") => lit.light.clone(),
            Some("studio") => Light::studio(),
            _ => panorama(&self.light)?,
        };
        lit.light = light.turned(self.light_turn.to_radians());
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
