//! One picture: filled piece by piece with the device's renders, and encoded.

use std::io::Cursor;
use std::path::Path;

use bytemuck::cast_slice;
use ghand_files::atomic_file::write_atomically;
use ghand_render::mesh::MeshImage;
use ghand_render::splat::Image;
use image::codecs::openexr::OpenExrEncoder;
use image::codecs::png::PngEncoder;
use image::{ExtendedColorType, ImageEncoder, ImageFormat, ImageResult, RgbImage};

use crate::{Background, PictureError, StillFormat};

/// A picture in the form in which its file stores it.
#[derive(Debug, Clone, PartialEq)]
pub struct Picture {
    /// Columns and rows.
    pub size: [u32; 2],
    background: Background,
    pixels: Pixels,
    /// Number of pixels that are not only background.
    covered: usize,
}

/// Rows from the top, straight alpha: colours are not multiplied by it.
#[derive(Debug, Clone, PartialEq)]
enum Pixels {
    /// Display values and alpha, which is 255 over a colour.
    Bytes(Vec<[u8; 4]>),
    /// Display values and alpha, which is the coverage even over a colour.
    Floats(Vec<[f32; 4]>),
}

impl Picture {
    /// An empty picture of 8-bit values.
    pub fn bytes(size: [u32; 2], background: Background) -> Picture {
        let count = size[0] as usize * size[1] as usize;
        Picture { size, background, pixels: Pixels::Bytes(vec![[0; 4]; count]), covered: 0 }
    }

    /// An empty picture of the kind that a format stores.
    pub fn blank(size: [u32; 2], background: Background, format: StillFormat) -> Picture {
        match format {
            StillFormat::Png => Picture::bytes(size, background),
            StillFormat::Exr => {
                let count = size[0] as usize * size[1] as usize;
                Picture { size, background, pixels: Pixels::Floats(vec![[0.0; 4]; count]), covered: 0 }
            }
        }
    }

    /// Number of pixels that show something in front of the background.
    pub fn covered(&self) -> usize {
        self.covered
    }

    /// The colour to render with, see [`Background::color`].
    pub fn background(&self) -> Background {
        self.background
    }

    /// The picture as OpenEXR defines colours: linear light, multiplied by alpha over a transparent background. An 8-bit picture
    /// stays as it is.
    #[must_use]
    pub fn in_linear_light(mut self) -> Picture {
        let transparent = self.background == Background::Transparent;
        if let Pixels::Floats(pixels) = &mut self.pixels {
            for [r, g, b, a] in pixels {
                let part = if transparent { *a } else { 1.0 };
                for value in [r, g, b] {
                    *value = part * linear(*value);
                }
            }
        }
        self
    }

    /// Copies a piece, rendered over the picture's background, to the position of its top left pixel. Parts outside the
    /// picture are dropped.
    pub fn place(&mut self, [left, top]: [u32; 2], piece: &Image) {
        let pixel = |x: u32, y: u32| piece.rgba[y as usize * piece.width as usize + x as usize];
        self.fill([left, top], [piece.width, piece.height], pixel);
    }

    /// Like [`Picture::place`], for a piece that has no background yet.
    pub fn place_mesh(&mut self, [left, top]: [u32; 2], piece: &MeshImage) {
        let color = self.background.color();
        let pixel = |x: u32, y: u32| {
            let [r, g, b, a] = piece.rgba[y as usize * piece.width as usize + x as usize];
            let over = |value: f32, behind: f32| value + (1.0 - a) * behind;
            [over(r, color[0]), over(g, color[1]), over(b, color[2]), a]
        };
        self.fill([left, top], [piece.width, piece.height], pixel);
    }

    /// Fills a rectangle with colours over the background and coverages.
    fn fill(&mut self, [left, top]: [u32; 2], [width, height]: [u32; 2], pixel: impl Fn(u32, u32) -> [f32; 4]) {
        let [columns, rows] = self.size;
        let transparent = self.background == Background::Transparent;
        for y in 0..height.min(rows.saturating_sub(top)) {
            let start = (top + y) as usize * columns as usize;
            for x in 0..width.min(columns.saturating_sub(left)) {
                let at = start + (left + x) as usize;
                let drawn = pixel(x, y);
                self.covered += usize::from(to_byte(drawn[3]) > 0);
                let value = if transparent { straight(drawn) } else { drawn };
                match &mut self.pixels {
                    Pixels::Floats(pixels) => pixels[at] = value,
                    Pixels::Bytes(pixels) => {
                        let [r, g, b, a] = value.map(to_byte);
                        pixels[at] = match (transparent, a) {
                            (false, _) => [r, g, b, 255],
                            // An invisible colour would only make the file larger.
                            (true, 0) => [0; 4],
                            (true, a) => [r, g, b, a],
                        };
                    }
                }
            }
        }
    }

    /// The pixels as 8-bit red, green, blue and alpha.
    pub fn to_rgba8(&self) -> Vec<[u8; 4]> {
        match &self.pixels {
            Pixels::Bytes(pixels) => pixels.clone(),
            Pixels::Floats(pixels) => pixels.iter().map(|pixel| pixel.map(to_byte)).collect(),
        }
    }

    /// The contents of a file: PNG with alpha only if the background is transparent, or OpenEXR with 32-bit floats.
    ///
    /// # Errors
    /// An error of the encoder.
    pub fn encode(self) -> ImageResult<Vec<u8>> {
        let [width, height] = self.size;
        let mut bytes = Cursor::new(Vec::new());
        match self.pixels {
            Pixels::Bytes(pixels) => {
                let png = PngEncoder::new(&mut bytes);
                if self.background == Background::Transparent {
                    png.write_image(pixels.as_flattened(), width, height, ExtendedColorType::Rgba8)?;
                } else {
                    let opaque: Vec<[u8; 3]> = pixels.iter().map(|[r, g, b, _]| [*r, *g, *b]).collect();
                    png.write_image(opaque.as_flattened(), width, height, ExtendedColorType::Rgb8)?;
                }
            }
            Pixels::Floats(pixels) => {
                let exr = OpenExrEncoder::new(&mut bytes);
                exr.write_image(cast_slice(&pixels), width, height, ExtendedColorType::Rgba32F)?;
            }
        }
        Ok(bytes.into_inner())
    }

    /// Writes the picture atomically.
    ///
    /// # Errors
    /// An error that names the file.
    pub fn write(self, path: &Path) -> Result<(), PictureError> {
        write(path, self.encode())
    }
}

/// Converts colour over black with coverage to straight colour with coverage.
fn straight([r, g, b, a]: [f32; 4]) -> [f32; 4] {
    if a > 0.0 { [r / a, g / a, b / a, a] } else { [0.0; 4] }
}

/// Linear light of a display value (sRGB, IEC 61966-2-1).
fn linear(value: f32) -> f32 {
    if value <= 0.040_45 { value / 12.92 } else { ((value + 0.055) / 1.055).powf(2.4) }
}

fn to_byte(value: f32) -> u8 {
    (value.clamp(0.0, 1.0) * 255.0).round() as u8
}

/// Writes a picture as PNG, atomically.
///
/// # Errors
/// An error that names the file.
pub fn write_png(path: &Path, picture: &RgbImage) -> Result<(), PictureError> {
    let mut png = Cursor::new(Vec::new());
    let encoded = picture.write_to(&mut png, ImageFormat::Png);
    write(path, encoded.map(|()| png.into_inner()))
}

fn write(path: &Path, encoded: ImageResult<Vec<u8>>) -> Result<(), PictureError> {
    let bytes = encoded.map_err(|source| PictureError::Encoding { path: path.into(), source })?;
    write_atomically(path, &bytes).map_err(PictureError::file(path, "cannot write the picture"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::DynamicImage;

    /// Two pixels: nothing, and red that covers a quarter, over a background.
    fn piece(background: [f32; 3]) -> Image {
        let over = |c: f32, behind: f32| 0.25 * c + 0.75 * behind;
        let [r, g, b] = background;
        Image { width: 2, height: 1, rgba: vec![[r, g, b, 0.0], [over(0.8, r), over(0.2, g), over(0.1, b), 0.25]] }
    }

    fn decoded(picture: Picture) -> DynamicImage {
        image::load_from_memory(&picture.encode().unwrap()).unwrap()
    }

    #[test]
    fn transparent_pictures_have_the_colours_of_the_foreground() {
        for format in [StillFormat::Png, StillFormat::Exr] {
            let mut picture = Picture::blank([2, 1], Background::Transparent, format);
            picture.place([0, 0], &piece([0.0; 3]));
            let image = decoded(picture);
            assert!(image.color().has_alpha());
            let pixels = image.into_rgba32f();
            assert_eq!(pixels.get_pixel(0, 0).0, [0.0; 4]);
            let expected = [0.8, 0.2, 0.1, 0.25];
            let bound = if format == StillFormat::Png { 0.5 / 255.0 + 1e-6 } else { 1e-6 };
            let apart = pixels.get_pixel(1, 0).0.iter().zip(expected).map(|(a, b): (&f32, f32)| (a - b).abs());
            assert!(apart.fold(0.0, f32::max) <= bound, "{:?}", pixels.get_pixel(1, 0));
        }
    }

    #[test]
    fn an_exr_in_linear_light_is_read_as_the_picture_that_a_png_shows() {
        for background in [Background::Transparent, Background::Color([0.4, 0.6, 1.0])] {
            let picture = |format| {
                let mut picture = Picture::blank([2, 1], background, format);
                picture.place([0, 0], &piece(background.color()));
                picture
            };
            let floats = decoded(picture(StillFormat::Exr).in_linear_light()).into_rgba32f();
            let shown = decoded(picture(StillFormat::Png)).into_rgba8();
            let encode = |v: f32| if v <= 0.003_130_8 { 12.92 * v } else { 1.055 * v.powf(1.0 / 2.4) - 0.055 };
            for (linear, byte) in floats.pixels().zip(shown.pixels()) {
                let alpha = if background == Background::Transparent { linear.0[3].max(1e-6) } else { 1.0 };
                for channel in 0..3 {
                    let apart = encode(linear.0[channel] / alpha) - f32::from(byte.0[channel]) / 255.0;
                    assert!(apart.abs() <= 0.5 / 255.0 + 1e-5, "{background:?}: {linear:?} {byte:?}");
                }
            }
        }
        let bytes = Picture::bytes([1, 1], Background::Transparent);
        assert_eq!(bytes.clone().in_linear_light(), bytes);
        // A half of display values is a fifth of the light.
        assert!((linear(0.5) - 0.214_041).abs() < 1e-5);
    }

    #[test]
    fn opaque_pictures_have_their_background_and_no_alpha_in_png() {
        let color = [0.4, 0.6, 1.0];
        let mut picture = Picture::blank([2, 1], Background::Color(color), StillFormat::Png);
        picture.place([0, 0], &piece(color));
        let image = decoded(picture);
        assert_eq!(image.color(), image::ColorType::Rgb8);
        assert_eq!(image.into_rgb8().into_raw(), [102, 153, 255, 128, 128, 198]);
    }

    #[test]
    fn meshes_and_splats_look_the_same_and_pieces_are_cropped() {
        let mesh =
            MeshImage { width: 2, height: 1, rgba: vec![[0.0; 4], [0.2, 0.05, 0.025, 0.25]], depth: vec![1.0; 2] };
        for background in [Background::Transparent, Background::Color([0.4, 0.6, 1.0])] {
            let mut pictures = [[3, 2]; 2].map(|size| Picture::bytes(size, background));
            let [first, second] = &mut pictures;
            first.place([1, 1], &piece(background.color()));
            second.place_mesh([1, 1], &mesh);
            assert_eq!(first, second);
            let before = first.clone();
            first.place([3, 0], &piece(background.color()));
            first.place([0, 2], &piece(background.color()));
            assert_eq!(*first, before);
        }
    }
}
