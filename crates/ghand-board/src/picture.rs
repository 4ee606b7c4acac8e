//! Pictures of boards: for printing, and for made footage.

use glam::DVec2;
use image::{GrayImage, Luma};

use crate::BoardKind;
use crate::kind::{Markers, Tags};

/// Samples along each axis of a pixel: edges may be within it.
const SAMPLES: u32 = 4;

/// White around what is printed, metres: a square, or the gap between tags.
pub fn margin(kind: &BoardKind) -> f64 {
    kind.side() * kind.tags().map_or(1.0, |tags| tags.gap)
}

/// Whether a place of the board is printed black; its origin is the outer corner at the top left of its squares, metres.
/// Places beyond its squares are white.
pub fn is_black(kind: &BoardKind, place: DVec2) -> bool {
    match kind.tags() {
        Some(tags) => is_black_among_tags(kind, tags, place),
        None => is_black_among_squares(kind, place),
    }
}

fn is_black_among_tags(kind: &BoardKind, tags: &Tags, place: DVec2) -> bool {
    let size = kind.size();
    if place.min_element() < 0.0 || place.x >= size.x || place.y >= size.y {
        return false;
    }
    // The tag, or the gap to the left of it or above it, and where in it, sides of a tag.
    let pitch = 1.0 + tags.gap;
    let number = (place / kind.side() / pitch).floor();
    let within = place / kind.side() - number * pitch - tags.gap;
    match (within.x < 0.0, within.y < 0.0) {
        (true, true) => true,
        (false, false) => {
            let [across, down] = kind.tag_counts();
            let row_from_below = (down - 1).saturating_sub(number.y as usize);
            let cell = within * tags.cells() as f64;
            tags.is_black(row_from_below * across + number.x as usize, cell.x as usize, cell.y as usize)
        }
        _ => false,
    }
}

fn is_black_among_squares(kind: &BoardKind, place: DVec2) -> bool {
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

/// A picture of the board with its white margin, so many pixels per square or tag.
pub fn board_picture(kind: &BoardKind, pixels_per_square: u32) -> GrayImage {
    let size = (kind.size() + 2.0 * margin(kind)) / kind.side();
    let [width, height] = size.to_array().map(|edge| (edge * f64::from(pixels_per_square)).round() as u32);
    let pixel = kind.side() / f64::from(pixels_per_square);
    let gray = |x: u32, y: u32| {
        let sample = |i: u32| {
            let within = DVec2::new(f64::from(i % SAMPLES), f64::from(i / SAMPLES)) + 0.5;
            let at = DVec2::new(f64::from(x), f64::from(y)) + within / f64::from(SAMPLES);
            !is_black(kind, at * pixel - margin(kind))
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
    #[test]
    fn tags_begin_at_the_bottom_left_with_black_squares_between_their_corners() {
        let kind: BoardKind = "aprilgrid:3x2:40mm:0.25".parse().unwrap();
        // Four pixels for each cell; gaps of ten.
        let picture = board_picture(&kind, 40);
        assert_eq!(picture.dimensions(), (3 * 40 + 6 * 10, 2 * 40 + 5 * 10));
        let is_white = |x: u32, y: u32| picture.get_pixel(x, y).0[0] > 128;
        // The margin, the square beyond the first corner at the bottom left, and white beside it.
        assert_eq!(
            [is_white(5, 125), is_white(15, 115), is_white(25, 115), is_white(15, 105)],
            [true, false, true, true]
        );
        // Codes of tags 0, 2, and 3 to the left in the upper row, as AprilTag's authors write them.
        for (left, top, code) in [(20, 70, 0xd5d628584), (120, 70, 0xdd280910e), (20, 20, 0xe479e9c98_u64)] {
            let bit = |k: u32| u64::from(is_white(left + 8 + 4 * (k % 6) + 2, top + 8 + 4 * (k / 6) + 2));
            assert_eq!((0..36).fold(0, |code, k| code << 1 | bit(k)), code, "{left} {top}");
        }
    }
}
