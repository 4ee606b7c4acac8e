//! What a mask does not know: on which side of an outline the pixels next to it are.

use ghand_measure::error_bands::depths;

/// Masks are off by about this much, pixels.
const WIDTH: f64 = 2.0;
/// A value of the mask that the loss takes for neither hand nor background.
const UNKNOWN: u8 = 128;

/// The pixels of a row-major image, with the mask's value replaced where the centre of a pixel is up to two pixels from
/// the outline: from there on, the mask counts only where it is 0 or 255.
pub fn with_unknown_outline(pixels: &[[u8; 4]], size: [u32; 2]) -> Vec<[u8; 4]> {
    let is_inside = || pixels.iter().map(|pixel| pixel[3] >= 128);
    let (inside, outside) = (depths(is_inside(), size), depths(is_inside().map(|inside| !inside), size));
    let near = inside.iter().zip(&outside).map(|(inside, outside)| inside.max(*outside) <= WIDTH);
    pixels.iter().zip(near).map(|(&[r, g, b, mask], near)| [r, g, b, if near { UNKNOWN } else { mask }]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_pixels_on_either_side_of_an_outline_are_unknown_and_the_edge_of_the_image_is_not_an_outline() {
        // Hand from the left edge to x = 6, with a hole of one pixel in row 20.
        let masks: Vec<u8> = (0..21 * 12).map(|i| if i % 12 <= 6 && i != 20 * 12 + 1 { 255 } else { 0 }).collect();
        let pixels: Vec<[u8; 4]> = masks.iter().map(|mask| [1, 2, 3, *mask]).collect();
        let banded = with_unknown_outline(&pixels, [12, 21]);
        assert!(banded.iter().all(|pixel| pixel[..3] == [1, 2, 3]));
        let row = |y: usize| -> Vec<u8> { banded[12 * y..][..12].iter().map(|pixel| pixel[3]).collect() };
        assert_eq!(row(5), [255, 255, 255, 255, 255, 128, 128, 128, 128, 0, 0, 0]);
        assert_eq!(row(20), [128, 128, 128, 128, 255, 128, 128, 128, 128, 0, 0, 0]);
    }

    #[test]
    fn a_mask_without_outline_is_known_everywhere() {
        for mask in [0, 255] {
            let pixels = vec![[9, 9, 9, mask]; 20];
            assert_eq!(with_unknown_outline(&pixels, [5, 4]), pixels);
        }
    }
}
