//! The contact sheet: some images of a capture, each with the posed template over it, which shows wrong conventions at
//! a glance.

mod overlay;
mod window;

use ghand_capture::Capture;
use ghand_capture::inspection::{ViewFit, posed_template, true_pose};
use ghand_pictures::draw_text::{LINE, letter_width, write};
use ghand_render::Gpu;
use ghand_render::mesh::{MeshError, MeshRenderer};
use glam::DVec3;
use image::{Rgb, RgbImage};

use overlay::{Cell, MISSED, OFF_MASK, ON_MASK};
use window::window;

/// Largest size of a picture, pixels.
const CELL: [u32; 2] = [320, 240];
/// Rows and columns of views fill about this width, pixels.
const SHEET_WIDTH: u32 = 1600;
/// Between the pictures of a view, and between views, pixels.
const GAP: u32 = 4;
const MARGIN: u32 = 16;
/// Grey of the sheet, and the colours of the text.
const PAPER: Rgb<u8> = Rgb([40, 40, 44]);
const INK: Rgb<u8> = Rgb([235, 235, 235]);
const FAINT: Rgb<u8> = Rgb([165, 165, 170]);

/// One view of the sheet.
#[derive(Debug, Clone, PartialEq)]
pub struct SheetView {
    /// Name of its split.
    pub split: String,
    /// The view, and how well the template matches its mask.
    pub fit: ViewFit,
}

/// The pictures of a view with a line of text each: the image, the template in the given pose, and the template in the
/// true pose if this is known and different.
struct Row {
    title: String,
    pictures: Vec<(String, RgbImage)>,
}

/// Draws views in the order given, numbered from 1.
///
/// # Errors
/// If an image or the hand model is unusable, or the device fails.
pub fn contact_sheet(gpu: &Gpu, capture: &Capture, views: &[SheetView]) -> anyhow::Result<RgbImage> {
    let renderer = MeshRenderer::new(gpu)?;
    let numbered = (1..).zip(views);
    let rows: anyhow::Result<Vec<Row>> = numbered.map(|(number, view)| row(&renderer, capture, number, view)).collect();
    Ok(laid_out(&rows?))
}

fn row(renderer: &MeshRenderer, capture: &Capture, number: usize, view: &SheetView) -> anyhow::Result<Row> {
    let fit = view.fit;
    let rgba = capture.load_view(fit.camera, fit.frame)?.rgba;
    let (given, truth) = posed_template(capture, fit.frame)?;
    // They were found when the view was loaded.
    let (Some(camera), Some(frame)) = (capture.cameras.get(fit.camera), capture.frames.get(fit.frame)) else {
        return Ok(Row { title: String::new(), pictures: vec![] });
    };
    let points = given.iter().chain(truth.iter().flatten()).copied();
    let window = window(camera, &rgba, points);
    let [_, _, width, height] = window;
    let cell = Cell::new(camera, &rgba, window, cell_size([width, height]));
    let cut = if [width, height] == [camera.width, camera.height] { "image" } else { "cut to" };
    let mut pictures = vec![(format!("{cut} {width} x {height}"), cell.image.clone())];
    let mut add = |name: &str, iou: Option<f64>, positions: &[DVec3]| {
        let value = iou.map_or("-".into(), |iou| format!("{iou:.3}"));
        match cell.with_template(renderer, &capture.hand_model, positions) {
            Ok(picture) => pictures.push((format!("{name} {value}"), picture)),
            // The sheet reports a template that is too far away to be drawn.
            Err(MeshError::Invalid { .. }) => pictures.push((format!("{name}: too far away"), cell.image.clone())),
            Err(error) => return Err(error),
        }
        Ok(())
    };
    match truth.filter(|_| true_pose(capture, fit.frame) != Some(&frame.pose)) {
        Some(truth) => {
            add("given", fit.iou_given, &given)?;
            add("true", fit.iou_true, &truth)?;
        }
        None if fit.iou_true.is_some() => add("given = true", fit.iou_given, &given)?,
        None => add("given", fit.iou_given, &given)?,
    }
    Ok(Row { title: format!("{number}  {}  {}  {}", view.split, camera.id, frame.id), pictures })
}

/// The largest size with a picture's aspect ratio that fits into a cell.
fn cell_size([width, height]: [u32; 2]) -> [u32; 2] {
    let [width, height] = [f64::from(width.max(1)), f64::from(height.max(1))];
    let scale = (f64::from(CELL[0]) / width).min(f64::from(CELL[1]) / height);
    [width * scale, height * scale].map(|size| (size.round() as u32).max(1))
}

fn laid_out(rows: &[Row]) -> RgbImage {
    let pictures = || rows.iter().flat_map(|row| &row.pictures);
    let cell_width = pictures().map(|(_, p)| p.width()).max().unwrap_or(CELL[0]);
    let cell_height = pictures().map(|(_, p)| p.height()).max().unwrap_or(CELL[1]);
    let columns = rows.iter().map(|row| row.pictures.len()).max().unwrap_or(1).max(1) as u32;
    let view_width = columns * (cell_width + GAP) - GAP;
    let view_height = 2 * LINE + cell_height;
    let across = ((SHEET_WIDTH / (view_width + MARGIN)).max(1)).min(rows.len().max(1) as u32);
    let down = (rows.len() as u32).div_ceil(across);
    let legend_width = legend(&mut RgbImage::new(1, 1), [0, 0]);
    let width = (across * (view_width + MARGIN)).max(legend_width + MARGIN) + MARGIN;
    let height = MARGIN + LINE + MARGIN + down * (view_height + MARGIN);
    let mut sheet = RgbImage::from_pixel(width, height, PAPER);
    legend(&mut sheet, [MARGIN, MARGIN]);
    for (i, row) in (0..).zip(rows) {
        let left = MARGIN + (i % across) * (view_width + MARGIN);
        let top = MARGIN + LINE + MARGIN + (i / across) * (view_height + MARGIN);
        write(&mut sheet, [left, top], view_width, INK, &row.title);
        for (k, (label, picture)) in (0..).zip(&row.pictures) {
            let x = left + k * (cell_width + GAP);
            write(&mut sheet, [x, top + LINE], cell_width, FAINT, label);
            image::imageops::replace(&mut sheet, picture, i64::from(x), i64::from(top + 2 * LINE));
        }
    }
    sheet
}

/// Writes the legend of the colours; returns its width, pixels.
fn legend(sheet: &mut RgbImage, [left, top]: [u32; 2]) -> u32 {
    let entries =
        [(ON_MASK, "template on the mask"), (OFF_MASK, "template off the mask"), (MISSED, "mask without template")];
    let mut x = left;
    for (color, text) in entries {
        for (dx, dy) in (0..LINE - 6).flat_map(|dx| (0..LINE - 6).map(move |dy| (dx, dy))) {
            if let Some(pixel) = sheet.get_pixel_mut_checked(x + dx, top + 2 + dy) {
                *pixel = color;
            }
        }
        x += LINE;
        let width = letter_width() * text.len() as u32;
        write(sheet, [x, top], width, FAINT, text);
        x += width + 2 * MARGIN;
    }
    x - left
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whole_images_are_scaled_to_a_cell() {
        assert_eq!(cell_size([334, 512]), [157, 240]);
        assert_eq!(cell_size([4096, 3000]), [320, 234]);
        assert_eq!(cell_size([100, 50]), [320, 160]);
        assert_eq!(cell_size([16384, 1]), [320, 1]);
        assert_eq!(cell_size([0, 0]), [240, 240]);
    }

    #[test]
    fn views_are_laid_out_in_rows_without_touching() {
        let picture = |color| (String::new(), RgbImage::from_pixel(150, 240, Rgb(color)));
        let view = || Row { title: String::new(), pictures: vec![picture([1, 0, 0]), picture([0, 1, 0])] };
        let rows: Vec<Row> = (0..7).map(|_| view()).collect();
        let sheet = laid_out(&rows);
        // Views of 304 pixels: five side by side, then one more row.
        let height = MARGIN + LINE + MARGIN + 2 * (2 * LINE + 240 + MARGIN);
        assert_eq!(sheet.dimensions(), (5 * (304 + MARGIN) + MARGIN, height));
        for color in [[1, 0, 0], [0, 1, 0]] {
            assert_eq!(sheet.pixels().filter(|p| p.0 == color).count(), 7 * 150 * 240);
        }
        assert!(laid_out(&[]).width() > 100, "no view at all");
    }
}
