//! The report picture: truth, rendering, error and baseline of several test views, with captions.

use ghand_measure::evaluation::EvaluatedView;
use ghand_measure::hand_box::Square;
use ghand_pictures::draw_text::{LINE, letter_width, write};
use image::{Rgb, RgbImage};

/// Gap between columns, pixels.
const GAP: u32 = 4;
/// Space around the sheet and between views, pixels.
const MARGIN: u32 = 12;
/// Factor on the error column.
const ERROR_GAIN: u32 = 4;
/// Heads of the columns.
const HEADS: [&str; 4] = ["truth", "rendering", "error x4", "floor"];
/// Grey of the sheet, and the colours of its text.
const PAPER: Rgb<u8> = Rgb([40, 40, 44]);
const INK: Rgb<u8> = Rgb([235, 235, 235]);
const FAINT: Rgb<u8> = Rgb([165, 165, 170]);

/// One row per view: truth, rendering, absolute error times four and baseline, below the names of camera and frame,
/// each cut to the hand and what is near it. Each column has a head; above rendering and baseline is their PSNR in the
/// hand's square.
pub fn report(views: &[EvaluatedView]) -> RgbImage {
    let parts: Vec<Part> = views.iter().map(Part::around_hand).collect();
    let widest_head = HEADS.iter().map(|head| head.len() as u32 * letter_width()).max().unwrap_or(0);
    let width = parts.iter().map(|part| part.size[0]).max().unwrap_or(1).max(widest_head);
    let sheet_width = 4 * (width + GAP) - GAP + 2 * MARGIN;
    // The two lines above each view are its name and its PSNR figures.
    let height: u32 = parts.iter().map(|part| part.size[1] + 2 * LINE + MARGIN).sum();
    let mut sheet = RgbImage::from_pixel(sheet_width, MARGIN + LINE + height, PAPER);
    let left = |column: u32| MARGIN + column * (width + GAP);
    for (column, head) in (0..).zip(HEADS) {
        write(&mut sheet, [left(column), MARGIN], width, INK, head);
    }
    let mut top = MARGIN + LINE;
    for (view, part) in views.iter().zip(&parts) {
        let [camera, frame] = &view.name;
        let title = format!("camera {camera}  frame {frame}");
        write(&mut sheet, [MARGIN, top], sheet_width - 2 * MARGIN, FAINT, &title);
        for (column, likeness) in [(1, &view.likeness), (3, &view.baseline_likeness)] {
            let psnr = likeness.psnr_square.unwrap_or(likeness.psnr);
            write(&mut sheet, [left(column), top + LINE], width, FAINT, &format!("{psnr:.1} dB"));
        }
        top += 2 * LINE;
        let truth = |i: usize| [view.truth[i][0], view.truth[i][1], view.truth[i][2]];
        part.place(&mut sheet, [left(0), top], truth);
        part.place(&mut sheet, [left(1), top], |i| view.render[i]);
        part.place(&mut sheet, [left(2), top], |i| {
            let (t, r) = (truth(i), view.render[i]);
            [0, 1, 2].map(|c| (u32::from(t[c].abs_diff(r[c])) * ERROR_GAIN).min(255) as u8)
        });
        part.place(&mut sheet, [left(3), top], |i| view.baseline[i]);
        top += part.size[1] + MARGIN;
    }
    sheet
}

/// A part of an image.
struct Part {
    corner: [u32; 2],
    size: [u32; 2],
    /// Columns of the image.
    width: u32,
}

impl Part {
    /// The square around the hand as far as it is in the image; the whole image if there is no hand.
    fn around_hand(view: &EvaluatedView) -> Part {
        let [width, height] = view.size;
        let Some(Square { corner, side }) = Square::around_mask(&view.truth, width) else {
            return Part { corner: [0; 2], size: view.size, width };
        };
        let clip = |at: f64, size: u32| at.clamp(0.0, f64::from(size)) as u32;
        let low = [clip(corner.x, width), clip(corner.y, height)];
        let high = [clip(corner.x + side, width), clip(corner.y + side, height)];
        Part { corner: low, size: [0, 1].map(|axis| high[axis] - low[axis]), width }
    }

    /// Draws it with its top left corner at a pixel of the sheet; `color` is that of a pixel of the image.
    fn place(&self, sheet: &mut RgbImage, [left, top]: [u32; 2], color: impl Fn(usize) -> [u8; 3]) {
        let [width, height] = self.size;
        for (x, y) in (0..height).flat_map(|y| (0..width).map(move |x| (x, y))) {
            let at = (self.corner[1] + y) * self.width + self.corner[0] + x;
            sheet.put_pixel(left + x, top + y, Rgb(color(at as usize)));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ghand_measure::metrics::ImageSimilarity;

    fn view(size: [u32; 2], psnr: f64) -> EvaluatedView {
        let pixels = (size[0] * size[1]) as usize;
        let likeness = ImageSimilarity { psnr, psnr_hand: psnr, ..ImageSimilarity::default() };
        EvaluatedView {
            name: ["cam03".into(), "0012".into()],
            size,
            truth: vec![[100, 10, 10, 255]; pixels],
            render: vec![[90, 10, 10]; pixels],
            baseline: vec![[10, 10, 200]; pixels],
            likeness,
            baseline_likeness: likeness,
        }
    }

    /// Pixel rows of the sheet that have letters in a range of pixel columns.
    fn lettered(sheet: &RgbImage, columns: std::ops::Range<u32>) -> Vec<u32> {
        let is_letter = |x: u32, y: u32| [INK, FAINT].contains(sheet.get_pixel(x, y));
        (0..sheet.height()).filter(|y| columns.clone().any(|x| is_letter(x, *y))).collect()
    }

    #[test]
    fn every_column_has_a_head_and_every_view_a_name() {
        let views = [view([80, 20], 31.5), view([60, 30], 7.0)];
        let sheet = report(&views);
        assert_eq!(sheet.dimensions(), (4 * 84 - 4 + 24, 12 + 18 + (20 + 36 + 12) + (30 + 36 + 12)));
        for (color, count) in [([100, 10, 10], 1), ([90, 10, 10], 1), ([40, 0, 0], 1), ([10, 10, 200], 1)] {
            let seen = sheet.pixels().filter(|p| p.0 == color).count();
            assert_eq!(seen, count * (80 * 20 + 60 * 30), "{color:?} is covered or missing");
        }
        for column in 0..4 {
            let rows = lettered(&sheet, 12 + column * 84..12 + column * 84 + 80);
            assert!(rows.iter().any(|y| (12..30).contains(y)), "column {column} has no head");
        }
        let names = lettered(&sheet, 12..90);
        assert!(names.iter().any(|y| (30..48).contains(y)) && names.iter().any(|y| (98..116).contains(y)));
        assert!(lettered(&sheet, 96..176).iter().any(|y| (48..66).contains(y)), "no PSNR above the rendering");
        // A different name gives different letters.
        let mut renamed = views.clone();
        renamed[1].name[1] = "0013".into();
        assert_ne!(report(&renamed), sheet);
    }

    #[test]
    fn a_small_hand_fills_its_row() {
        let mut small = view([100, 90], 20.0);
        // 20 x 10 pixels, so a square of 26 pixels.
        small.truth.iter_mut().enumerate().for_each(|(i, pixel)| {
            pixel[3] = if (40..60).contains(&(i % 100)) && (30..40).contains(&(i / 100)) { 255 } else { 0 };
        });
        assert_eq!(report(&[small]).height(), 12 + 18 + (26 + 36 + 12));
    }

    #[test]
    fn a_report_of_narrow_pictures_or_none_still_fits_its_heads() {
        assert!(report(&[view([4, 4], 1.0)]).width() >= 4 * 9 * letter_width());
        assert!(report(&[]).height() > 0);
    }
}
