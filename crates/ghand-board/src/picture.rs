//! Pictures of boards: for printing, and for made footage.

use glam::DVec2;
use image::{GrayImage, Luma};

use crate::BoardKind;
use crate::kind::Markers;

/// White around the squares, relative to the side of one.
pub const MARGIN: f64 = 1.0;
/// Samples along each axis of a pixel: edges may be within it.
const SAMPLES: u32 = 4;

/// Whether a place of the board is printed black; its origin is the outer corner at the top left of its squares, metres.
/// Places beyond its squares are white.
pub fn is_black(kind: &BoardKind, place: DVec2) -> bool {
    let at = place / kind.side();
    let [across, down] = kind.squares();
    if at.x < 0.0 || at.y < 0.0 || at.x >= across as f64 || at.y >= down as f64 {
        return false;
    }
    let (x, y) = (at.x as usize, at.y as usize);
    let shift = usize::from(kind.markers().is_some_and(|markers| markers.is_legacy));
    if (x + y + shift).is_multiple_of(2) {
        return true;
    }
    let Some(Markers { part, dictionary, .. }) = kind.markers() else { return false };
    // Markers are counted along rows of white squares.
    let before = (0..y).map(|y| white_squares(across, y + shift)).sum::<usize>() + white_squares(x, y + shift);
    let cells = dictionary.marker_size() + 2;
    let cell = ((at.fract() - 0.5 * (1.0 - part)) / part * cells as f64).floor();
    if cell.min_element() < 0.0 || cell.max_element() >= cells as f64 {
        return false;
    }
    let (column, row) = (cell.x as usize, cell.y as usize);
    let is_border = |i: usize| i == 0 || i + 1 == cells;
    if is_border(column) || is_border(row) {
        return true;
    }
    let bit = (row - 1) * dictionary.marker_size() + column - 1;
    dictionary.codes().get(before).is_some_and(|code| (code >> bit) & 1 == 1)
}

/// How many of the first squares of a row are white; row 0 begins with a black one.
fn white_squares(count: usize, row: usize) -> usize {
    (count + row % 2) / 2
}

/// A picture of the board with a white margin of one square's side, so many pixels per square.
pub fn board_picture(kind: &BoardKind, pixels_per_square: u32) -> GrayImage {
    let size = kind.size() / kind.side() + 2.0 * MARGIN;
    let [width, height] = size.to_array().map(|edge| (edge * f64::from(pixels_per_square)).round() as u32);
    let pixel = kind.side() / f64::from(pixels_per_square);
    let gray = |x: u32, y: u32| {
        let sample = |i: u32| {
            let within = DVec2::new(f64::from(i % SAMPLES), f64::from(i / SAMPLES)) + 0.5;
            let at = DVec2::new(f64::from(x), f64::from(y)) + within / f64::from(SAMPLES);
            !is_black(kind, at * pixel - MARGIN * kind.side())
        };
        let white = (0..SAMPLES * SAMPLES).filter(|i| sample(*i)).count() as u32;
        Luma([(255 * white / (SAMPLES * SAMPLES)) as u8])
    };
    GrayImage::from_fn(width, height, gray)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_have_black_squares_where_rows_and_columns_are_even_and_markers_in_the_others() {
        let kind: BoardKind = "charuco:5x4:40mm:20mm".parse().unwrap();
        let picture = board_picture(&kind, 24);
        assert_eq!(picture.dimensions(), (7 * 24, 6 * 24));
        let at = |x: u32, y: u32| picture.get_pixel(x, y).0[0];
        assert_eq!([at(3, 3), at(24, 24), at(24 + 24, 24), at(24 + 12, 24 + 12)], [255, 0, 255, 0]);
        // The border of the first marker: a twelfth of a square from a quarter of it.
        assert_eq!(
            [at(48 + 5, 24 + 12), at(48 + 6, 24 + 12), at(48 + 17, 24 + 12), at(48 + 18, 24 + 12)],
            [255, 0, 0, 255]
        );
        // Bits of marker 0 of this dictionary, as OpenCV publishes them: 1011 0101 0011 0010, of which 1 is white.
        let bits: String = (0..16)
            .map(|i| at(48 + 6 + 2 + 2 * (i % 4) + 1, 24 + 6 + 2 + 2 * (i / 4) + 1))
            .map(|gray| if gray > 128 { '1' } else { '0' })
            .collect();
        assert_eq!(bits, "1011010100110010");
    }
}
