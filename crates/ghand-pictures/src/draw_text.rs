//! Labels in pictures.

use std::convert::Infallible;

use embedded_graphics::Pixel;
use embedded_graphics::draw_target::DrawTarget;
use embedded_graphics::geometry::{OriginDimensions, Point, Size};
use embedded_graphics::mono_font::ascii::FONT_7X13;
use embedded_graphics::mono_font::{MonoFont, MonoTextStyle};
use embedded_graphics::pixelcolor::Rgb888;
use embedded_graphics::prelude::{Drawable, RgbColor};
use embedded_graphics::text::{Baseline, Text};
use image::{Rgb, RgbImage};

/// Height of a line, pixels.
pub const LINE: u32 = 18;
const FONT: MonoFont = FONT_7X13;

/// Width of a letter, pixels; the font is monospaced.
pub fn letter_width() -> u32 {
    FONT.character_size.width + FONT.character_spacing
}

/// A picture to draw letters in, which clips them.
struct Canvas<'a>(&'a mut RgbImage);

impl OriginDimensions for Canvas<'_> {
    fn size(&self) -> Size {
        Size::new(self.0.width(), self.0.height())
    }
}

impl DrawTarget for Canvas<'_> {
    type Color = Rgb888;
    type Error = Infallible;

    fn draw_iter<I: IntoIterator<Item = Pixel<Rgb888>>>(&mut self, pixels: I) -> Result<(), Infallible> {
        for Pixel(Point { x, y }, color) in pixels {
            let (Ok(x), Ok(y)) = (u32::try_from(x), u32::try_from(y)) else { continue };
            if let Some(pixel) = self.0.get_pixel_mut_checked(x, y) {
                *pixel = Rgb([color.r(), color.g(), color.b()]);
            }
        }
        Ok(())
    }
}

/// Writes a line of text with its top left corner at (x, y). Text wider than `width` pixels is shortened in its middle,
/// because ids differ at their ends.
pub fn write(sheet: &mut RgbImage, [x, y]: [u32; 2], width: u32, color: Rgb<u8>, text: &str) {
    let letters: String = shortened(text, (width / letter_width().max(1)) as usize).into_iter().collect();
    let [r, g, b] = color.0;
    let style = MonoTextStyle::new(&FONT, Rgb888::new(r, g, b));
    // Letters that the font lacks become question marks.
    let Ok(_) =
        Text::with_baseline(&letters, Point::new(x as i32, y as i32), style, Baseline::Top).draw(&mut Canvas(sheet));
}

/// At most `most` letters of a text, with `..` in place of the removed ones.
fn shortened(text: &str, most: usize) -> Vec<char> {
    let letters: Vec<char> = text.chars().collect();
    if letters.len() <= most {
        return letters;
    }
    let kept = most.saturating_sub(2);
    let head = kept - kept / 2;
    let tail = kept / 2;
    let ends = letters.iter().take(head).chain(&['.', '.']).chain(letters.iter().skip(letters.len() - tail));
    ends.take(most).copied().collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_texts_lose_their_middle() {
        let short = |most| shortened("abcdefgh", most).into_iter().collect::<String>();
        assert_eq!([8, 7, 6, 2, 1, 0].map(short), ["abcdefgh", "abc..gh", "ab..gh", "..", ".", ""]);
    }

    #[test]
    fn letters_stay_within_their_width_and_the_picture() {
        let ink = Rgb([255; 3]);
        let inked = |at, width, text| {
            let mut sheet = RgbImage::new(60, LINE);
            write(&mut sheet, at, width, ink, text);
            let columns = sheet.enumerate_pixels().filter(|(_, _, p)| p.0 != [0; 3]).map(|(x, _, _)| x);
            columns.fold(None, |range: Option<[u32; 2]>, x| Some(range.map_or([x, x], |[l, h]| [l.min(x), h.max(x)])))
        };
        let [low, high] = inked([10, 0], 30, "HHHHHHHHHH").unwrap();
        assert!(low >= 10 && high < 40, "{low} to {high}");
        assert!(inked([55, 10], 500, "H\u{e9}\u{4e2d}").is_some());
        assert_eq!(inked([0, 0], 60, "   "), None);
    }
}
