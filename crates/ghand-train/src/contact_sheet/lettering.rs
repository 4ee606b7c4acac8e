//! Labels in pictures.

use image::{Rgb, RgbImage};
use noto_sans_mono_bitmap::{FontWeight, RasterHeight, get_raster, get_raster_width};

/// Height of a line, pixels.
pub const LINE: u32 = 18;
const SIZE: RasterHeight = RasterHeight::Size16;
const WEIGHT: FontWeight = FontWeight::Regular;

/// Width of a letter, pixels; all have the same.
pub fn letter_width() -> u32 {
    get_raster_width(WEIGHT, SIZE) as u32
}

/// Writes a line of text with its top left corner at (x, y). What does not fit into `width` pixels is taken out of its middle,
/// since ids differ at their ends.
pub fn write(sheet: &mut RgbImage, [x, y]: [u32; 2], width: u32, color: Rgb<u8>, text: &str) {
    let letters = shortened(text, (width / letter_width().max(1)) as usize);
    for (left, letter) in (0..).map(|i| x + i * letter_width()).zip(letters) {
        let Some(raster) = get_raster(letter, WEIGHT, SIZE).or_else(|| get_raster('?', WEIGHT, SIZE)) else { continue };
        for (row, line) in (y..).zip(raster.rows()) {
            for (column, coverage) in (left..).zip(line) {
                if let Some(pixel) = sheet.get_pixel_mut_checked(column, row) {
                    let part = f32::from(*coverage) / 255.0;
                    let mix = |c: usize| f32::from(color.0[c]) * part + f32::from(pixel.0[c]) * (1.0 - part);
                    *pixel = Rgb([0, 1, 2].map(|c| mix(c).round() as u8));
                }
            }
        }
    }
}

/// At most `most` letters of a text, `..` in place of what is taken out.
fn shortened(text: &str, most: usize) -> Vec<char> {
    let letters: Vec<char> = text.chars().collect();
    if letters.len() <= most {
        return letters;
    }
    let kept = most.saturating_sub(2);
    let (head, tail) = (kept - kept / 2, kept / 2);
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
