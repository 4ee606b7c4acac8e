//! Films as GIF: each picture has the 255 colours that suit it best, and one exact colour for the background.

use std::collections::HashMap;
use std::path::Path;

use color_quant::NeuQuant;
use ghand_files::atomic_file::write_atomically;
use gif::{DisposalMethod, Encoder, Frame, Repeat};

use crate::film_options::FilmOptions;
use crate::{Background, Picture, PictureError};

/// Browsers show frames shorter than two hundredths of a second for ten hundredths.
const FASTEST: f64 = 50.0;
/// One pixel in this many is sampled to find the colours; a prime, so that no row or column is missed.
const SAMPLING: i32 = 3;
/// Index of the background in the palette; it is the transparent colour if there is no background.
const BEHIND: u8 = 0;
/// Number of colours besides that of the background.
const COLORS: usize = 255;

/// A GIF being made.
pub struct GifFilm {
    encoder: Encoder<Vec<u8>>,
    options: FilmOptions,
    count: u32,
}

impl GifFilm {
    /// Begins a GIF that repeats forever.
    ///
    /// # Errors
    /// One sentence if it would be too fast.
    pub fn start(options: FilmOptions) -> Result<GifFilm, PictureError> {
        if options.fps > FASTEST {
            return Err(PictureError::Unsuitable(format!(
                "a GIF shows at most {FASTEST} pictures per second, not {}; give a smaller --fps, or use .webm",
                options.fps
            )));
        }
        let [width, height] = options.size.map(u16::try_from);
        let (Ok(width), Ok(height)) = (width, height) else {
            return Err(PictureError::Unsuitable("a GIF has at most 65535 columns and rows".into()));
        };
        let mut encoder = Encoder::new(Vec::new(), width, height, &[])?;
        encoder.set_repeat(Repeat::Infinite)?;
        Ok(GifFilm { encoder, options, count: 0 })
    }

    /// Adds a picture.
    ///
    /// # Errors
    /// An error of the encoder.
    pub fn add(&mut self, picture: &Picture) -> Result<(), PictureError> {
        let pixels = picture.to_rgba8();
        let transparent = self.options.background == Background::Transparent;
        let Indexed { palette, indices } = indexed(&pixels, self.options.background);
        // Hundredths of a second, rounded so that the whole film has its length.
        let at = |count: u32| (100.0 * f64::from(count) / self.options.fps).round();
        let delay = at(self.count + 1) - at(self.count);
        self.encoder.write_frame(&Frame {
            delay: delay.clamp(0.0, f64::from(u16::MAX)) as u16,
            // Transparent pixels must not show the previous picture.
            dispose: if transparent { DisposalMethod::Background } else { DisposalMethod::Keep },
            transparent: transparent.then_some(BEHIND),
            width: picture.size[0] as u16,
            height: picture.size[1] as u16,
            palette: Some(palette),
            buffer: indices.into(),
            ..Frame::default()
        })?;
        self.count += 1;
        Ok(())
    }

    /// Ends and writes it.
    ///
    /// # Errors
    /// An error that names the file.
    pub fn write(self, path: &Path) -> Result<(), PictureError> {
        let bytes = self.encoder.into_inner()?;
        write_atomically(path, &bytes).map_err(PictureError::file(path, "cannot write the GIF"))
    }
}

/// A picture as indices into a palette.
struct Indexed {
    /// Red, green, blue, one after the other.
    palette: Vec<u8>,
    indices: Vec<u8>,
}

fn indexed(pixels: &[[u8; 4]], background: Background) -> Indexed {
    let behind = match background {
        Background::Color(color) => color.map(|v| (v.clamp(0.0, 1.0) * 255.0).round() as u8),
        Background::Transparent => [0; 3],
    };
    let is_behind = |[r, g, b, a]: [u8; 4]| match background {
        Background::Color(_) => [r, g, b] == behind,
        // GIF has no partial transparency: pixels with less than half coverage are transparent.
        Background::Transparent => a < 128,
    };
    let seen: Vec<[u8; 4]> = pixels.iter().filter(|p| !is_behind(**p)).map(|[r, g, b, _]| [*r, *g, *b, 255]).collect();
    let mut places: HashMap<[u8; 3], u8> = HashMap::new();
    let mut palette = behind.to_vec();
    let mut distinct = seen.clone();
    distinct.sort_unstable();
    distinct.dedup();
    if distinct.len() <= COLORS {
        for (color, place) in distinct.iter().zip(1..=u8::MAX) {
            places.insert([color[0], color[1], color[2]], place);
            palette.extend(&color[..3]);
        }
    } else {
        let network = NeuQuant::new(SAMPLING, COLORS, seen.as_flattened());
        palette.extend(network.color_map_rgb());
        for color in &distinct {
            // At most 254: the network has 255 colours.
            places.insert([color[0], color[1], color[2]], network.index_of(color) as u8 + 1);
        }
    }
    let index = |p: &[u8; 4]| if is_behind(*p) { BEHIND } else { places.get(&p[..3]).copied().unwrap_or(BEHIND) };
    Indexed { indices: pixels.iter().map(index).collect(), palette }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::format::FilmFormat;
    use ghand_render::splat::Image;

    fn film(size: [u32; 2], background: Background, fps: f64) -> Result<GifFilm, PictureError> {
        GifFilm::start(FilmOptions { format: FilmFormat::Gif, size, background, fps })
    }

    /// A smooth picture with more colours than a palette has, its left half empty.
    fn smooth(background: Background) -> Picture {
        let mut picture = Picture::bytes([128, 64], background);
        let behind = background.color();
        let rgba = (0..64 * 128).map(|i| {
            let (x, y) = ((i % 128) as f32 / 127.0, (i / 128) as f32 / 63.0);
            if x < 0.5 { [behind[0], behind[1], behind[2], 0.0] } else { [x, 0.2 + 0.5 * y, 0.7 * y * x, 1.0] }
        });
        picture.place([0, 0], &Image { width: 128, height: 64, rgba: rgba.collect() });
        picture
    }

    #[test]
    fn a_gif_is_near_its_pictures_and_has_its_background_exactly() {
        for background in [Background::Color([0.1, 0.2, 0.3]), Background::Transparent] {
            let mut film = film([128, 64], background, 30.0).unwrap();
            let picture = smooth(background);
            (0..7).for_each(|_| film.add(&picture).unwrap());
            let folder = tempfile::tempdir().unwrap();
            let path = folder.path().join("a.gif");
            film.write(&path).unwrap();

            let mut options = gif::DecodeOptions::new();
            options.set_color_output(gif::ColorOutput::RGBA);
            let mut decoder = options.read_info(std::fs::File::open(&path).unwrap()).unwrap();
            assert_eq!(decoder.repeat(), Repeat::Infinite);
            let mut frames = 0;
            let mut time = 0;
            let mut worst = 0;
            let mut sum = 0u64;
            while let Some(frame) = decoder.read_next_frame().unwrap() {
                frames += 1;
                time += frame.delay;
                for (shown, wanted) in frame.buffer.as_chunks::<4>().0.iter().zip(picture.to_rgba8()) {
                    match (background, wanted) {
                        (Background::Transparent, [.., 0]) => assert_eq!(shown[3], 0),
                        (Background::Color(_), [26, 51, 77, 255]) => assert_eq!(*shown, wanted),
                        _ => {
                            let apart = (0..3).map(|c| shown[c].abs_diff(wanted[c])).max().unwrap();
                            worst = worst.max(apart);
                            sum += u64::from(apart);
                            assert_eq!(shown[3], 255);
                        }
                    }
                }
            }
            assert_eq!((frames, time), (7, 23), "7 / 30 s");
            let mean = sum as f64 / (7.0 * 64.0 * 64.0);
            assert!(worst <= 24 && mean < 6.0, "{worst} at worst, {mean} on average");
        }
    }

    #[test]
    fn few_colours_are_kept_exactly() {
        let colors: Vec<[u8; 4]> = (0..=255u8).map(|v| [v, 255 - v, 7, 255]).collect();
        let Indexed { palette, indices } = indexed(&colors, Background::Color([0.0, 1.0, 7.0 / 255.0]));
        for (color, index) in colors.iter().zip(indices) {
            assert_eq!(palette[3 * usize::from(index)..][..3], color[..3]);
        }
    }

    #[test]
    fn a_frame_rate_too_high_for_a_gif_is_an_error() {
        let error = film([4, 4], Background::Transparent, 60.0).err().unwrap().to_string();
        assert!(error.contains("at most 50") && error.contains("--fps"), "{error}");
        assert!(film([4, 4], Background::Transparent, 50.0).is_ok());
    }
}
