//! The picture of the pose library: some views of each pose, with a line of text above.

use image::imageops::{FilterType, replace, resize};
use image::{Rgb, RgbImage};

use ghand_pictures::draw_text::{LINE, write};

/// Largest width and height of a view, pixels.
const CELL: u32 = 320;
/// Poses side by side.
const ACROSS: u32 = 2;
/// Space around the sheet and between poses, pixels.
const MARGIN: u32 = 12;
/// Grey of the sheet, and the colour of its text.
const PAPER: Rgb<u8> = Rgb([40, 40, 44]);
const INK: Rgb<u8> = Rgb([235, 235, 235]);

/// Some views of a pose.
#[derive(Debug, Clone)]
pub struct PoseViews {
    /// The line above them.
    pub title: String,
    /// The views.
    pub pictures: Vec<RgbImage>,
}

/// Lays the poses out two side by side. Pictures larger than a cell of 320 pixels are scaled down.
pub fn cleanliness_sheet(poses: &[PoseViews]) -> RgbImage {
    let pictures = || poses.iter().flat_map(|pose| &pose.pictures);
    let cell = pictures().map(|picture| picture.width().max(picture.height())).max().unwrap_or(1).min(CELL);
    let views = poses.iter().map(|pose| pose.pictures.len()).max().unwrap_or(1) as u32;
    let [width, height] = [views * cell + MARGIN, LINE + cell + MARGIN];
    let rows = (poses.len() as u32).div_ceil(ACROSS);
    let mut sheet = RgbImage::from_pixel(ACROSS * width + MARGIN, rows * height + MARGIN, PAPER);
    for (number, pose) in (0..).zip(poses) {
        let [left, top] = [MARGIN + number % ACROSS * width, MARGIN + number / ACROSS * height];
        write(&mut sheet, [left, top], width - MARGIN, INK, &pose.title);
        for (view, picture) in (0..).zip(&pose.pictures) {
            let place = [left + view * cell, top + LINE].map(i64::from);
            replace(&mut sheet, &fitted(picture, cell), place[0], place[1]);
        }
    }
    sheet
}

/// The picture, no larger than a cell.
fn fitted(picture: &RgbImage, cell: u32) -> RgbImage {
    let longest = picture.width().max(picture.height());
    if longest <= cell {
        return picture.clone();
    }
    let scaled = |n: u32| (u64::from(n) * u64::from(cell) / u64::from(longest)).max(1) as u32;
    resize(picture, scaled(picture.width()), scaled(picture.height()), FilterType::Triangle)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn poses_are_laid_out_two_side_by_side_without_touching() {
        let pose = |color| PoseViews {
            title: "fist".into(),
            pictures: vec![RgbImage::from_pixel(50, 40, Rgb([color, 0, 0])); 3],
        };
        let sheet = cleanliness_sheet(&[pose(1), pose(2), pose(3)]);
        assert_eq!(sheet.dimensions(), (2 * (150 + MARGIN) + MARGIN, 2 * (LINE + 50 + MARGIN) + MARGIN));
        for color in 1..=3 {
            assert_eq!(sheet.pixels().filter(|p| p.0 == [color, 0, 0]).count(), 3 * 50 * 40, "{color}");
        }
        assert!(sheet.rows().take((MARGIN + LINE) as usize).flatten().any(|p| *p == INK), "no title");
    }

    #[test]
    fn large_pictures_are_scaled_to_a_cell() {
        let picture = RgbImage::from_pixel(1000, 500, Rgb([9, 9, 9]));
        let sheet = cleanliness_sheet(&[PoseViews { title: String::new(), pictures: vec![picture] }]);
        assert_eq!(sheet.pixels().filter(|p| p.0 == [9, 9, 9]).count(), 320 * 160);
        assert!(cleanliness_sheet(&[]).width() > 0);
    }
}
