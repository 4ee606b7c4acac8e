//! Lines of text in pictures, in the font of the plots.

use image::imageops::{FilterType, resize};
use image::{Rgb, RgbImage};
use plotters::prelude::*;

use super::{FONT, ensure_font};

/// Text is drawn this many times larger and scaled down: the backend puts letters at whole pixels.
const FINER: u32 = 4;
/// Space above the letters and the height of a line, as fractions of the height of the text.
const ABOVE: f64 = 0.3;
const LINE: f64 = 1.6;

/// Writes a line of text of this height (pixels) with its top left corner at (x, y). What is outside the picture is cut
/// off.
pub fn label(picture: &mut RgbImage, [x, y]: [i32; 2], height: f64, color: Rgb<u8>, text: &str) {
    ensure_font();
    let width = label_width(height, text) + height.ceil() as u32;
    let rows = (LINE * height).ceil() as u32;
    let large = height * f64::from(FINER);
    let mut ink = RgbImage::from_pixel(width * FINER, rows * FINER, Rgb([255; 3]));
    let size = ink.dimensions();
    let top = (ABOVE * large).round() as i32;
    let style = (FONT, large).into_font().color(&BLACK);
    let mut backend = BitMapBackend::with_buffer(&mut ink, size);
    // A text that cannot be laid out is missing, the picture is not.
    if backend.draw_text(text, &style, (0, top)).and_then(|()| backend.present()).is_err() {
        log::warn!("the text {text:?} could not be drawn");
    }
    drop(backend);
    for (dx, dy, pixel) in resize(&ink, width, rows, FilterType::Triangle).enumerate_pixels() {
        let (Ok(x), Ok(y)) = (u32::try_from(x + dx as i32), u32::try_from(y + dy as i32)) else { continue };
        let Some(Rgb(below)) = picture.get_pixel_mut_checked(x, y) else { continue };
        let cover = 1.0 - f64::from(pixel.0[0]) / 255.0;
        for (value, color) in below.iter_mut().zip(color.0) {
            *value = (f64::from(*value) * (1.0 - cover) + f64::from(color) * cover).round() as u8;
        }
    }
}

/// Width of a line of text of this height, pixels.
pub fn label_width(height: f64, text: &str) -> u32 {
    ensure_font();
    let size = (FONT, height * f64::from(FINER)).into_font().box_size(text);
    size.map_or(0, |(width, _)| width.div_ceil(FINER))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_is_as_wide_as_it_says_and_may_cross_the_edge() {
        let mut picture = RgbImage::from_pixel(200, 40, Rgb([255; 3]));
        label(&mut picture, [10, 10], 16.0, Rgb([0; 3]), "skinning");
        let inked: Vec<u32> = picture.enumerate_pixels().filter(|(_, _, p)| p.0[0] < 128).map(|(x, ..)| x).collect();
        let (low, high) = (inked.iter().min().unwrap(), inked.iter().max().unwrap());
        let width = label_width(16.0, "skinning");
        assert!(*low >= 10 && *high <= 10 + width + 1 && high - low > width * 3 / 4, "{low} to {high}, {width}");
        label(&mut picture, [190, 30], 16.0, Rgb([0; 3]), "beyond");
        label(&mut picture, [-5, -5], 16.0, Rgb([0; 3]), "before");
    }
}
