//! The picture of an alignment: the template's outline over some images, in given and in aligned poses.

use ghand_capture::mask::covered_pixels;
use ghand_capture::{Capture, Split, SplitView};
use ghand_core::posing::pose_hand;
use ghand_core::{Camera, HandModel, Pose};
use image::{Rgb, RgbImage};

use crate::alignment::{Alignment, AlignmentError};
use ghand_pictures::draw_text::{LINE, write};

/// Images shown, each from another camera and frame.
const VIEWS: usize = 4;
/// Pixels of the image around the hand.
const BORDER: u32 = 24;
/// A hand lower than this is enlarged, pixels.
const LEAST_HEIGHT: u32 = 320;
/// Space around the pictures, pixels.
const MARGIN: u32 = 12;
const PAPER: Rgb<u8> = Rgb([40, 40, 44]);
const INK: Rgb<u8> = Rgb([235, 235, 235]);
/// Colours of the outlines: given and aligned.
const OUTLINES: [Rgb<u8>; 2] = [Rgb([255, 90, 60]), Rgb([60, 235, 110])];

/// A part of an image with two outlines.
struct Panel {
    title: String,
    /// With the outline in the given and in the aligned pose.
    pictures: [RgbImage; 2],
}

/// One row per view, evenly over frames and cameras: the outline of the capture's template in the given pose at the left,
/// that of the fitted template in the aligned pose, seen by the refined camera, at the right, also if the alignment was
/// rejected. `split` is the one that was aligned.
///
/// # Errors
/// [`AlignmentError`] if an image is unusable or a pose does not fit the template.
pub fn alignment_picture(capture: &Capture, split: &Split, alignment: &Alignment) -> Result<RgbImage, AlignmentError> {
    let refined = alignment.calibration.as_ref().map(|calibration| calibration.applied_to(&capture.cameras));
    let cameras = refined.as_ref().unwrap_or(&capture.cameras);
    let count = VIEWS.min(split.frames.len());
    let mut panels = vec![];
    for row in 0..count {
        let position = (2 * row + 1) * split.frames.len() / (2 * count);
        let views: Vec<&SplitView> = split.views.iter().filter(|view| view.position == position).collect();
        let Some(view) = views.get((2 * row + 1) * views.len() / (2 * count)) else { continue };
        let camera = &capture.cameras[view.camera];
        let loaded = capture.load_view(view.camera, view.frame)?;
        let image = RgbImage::from_fn(loaded.width, loaded.height, |x, y| {
            let [r, g, b, _] = loaded.rgba[(y * loaded.width + x) as usize];
            Rgb([r, g, b])
        });
        let given = silhouette(&capture.template, &capture.frames[view.frame].pose, camera)?;
        let (poses, template) = match alignment.rejected.as_deref() {
            Some((poses, template)) => (poses, template),
            None => (&alignment.poses, &alignment.template),
        };
        let aligned = silhouette(template, &poses[position], &cameras[view.camera])?;
        let mask = loaded.rgba.iter().map(|pixel| pixel[3] >= 128);
        let shown: Vec<bool> = given.iter().zip(&aligned).zip(mask).map(|((a, b), mask)| *a || *b || mask).collect();
        let part = bounds(&shown, loaded.width);
        panels.push(Panel {
            title: format!("camera {}  frame {}", camera.id, capture.frames[view.frame].id),
            pictures: [(&given, OUTLINES[0]), (&aligned, OUTLINES[1])]
                .map(|(silhouette, color)| with_outline(&image, silhouette, color, part)),
        });
    }
    Ok(sheet(&panels, alignment))
}

fn silhouette(template: &HandModel, pose: &Pose, camera: &Camera) -> Result<Vec<bool>, AlignmentError> {
    let positions = pose_hand(template, &[], pose)?.vertices;
    Ok(covered_pixels(camera, &positions, &template.faces))
}

/// Left, top, width and height of the part of an image that has these pixels, with a border; of the whole image if there
/// are none.
fn bounds(pixels: &[bool], width: u32) -> [u32; 4] {
    let height = pixels.len() as u32 / width;
    let used = (0..).zip(pixels).filter(|(_, used)| **used).map(|(i, _): (u32, _)| [i % width, i / width]);
    let mut range = [[u32::MAX, 0]; 2];
    for at in used {
        range = [0, 1].map(|axis| [range[axis][0].min(at[axis]), range[axis][1].max(at[axis])]);
    }
    if range[0][0] > range[0][1] {
        return [0, 0, width, height];
    }
    let [[left, right], [top, bottom]] = range;
    let left = left.saturating_sub(BORDER);
    let top = top.saturating_sub(BORDER);
    [left, top, (right + BORDER + 1).min(width) - left, (bottom + BORDER + 1).min(height) - top]
}

/// A part of an image, enlarged if it is small, with the outline of a silhouette one pixel wide.
fn with_outline(
    image: &RgbImage,
    silhouette: &[bool],
    color: Rgb<u8>,
    [left, top, width, height]: [u32; 4],
) -> RgbImage {
    let factor = LEAST_HEIGHT.div_ceil(height);
    let inside = |x: u32, y: u32| silhouette[(y * image.width() + x) as usize];
    RgbImage::from_fn(width * factor, height * factor, |x, y| {
        let (at_x, at_y) = (left + x / factor, top + y / factor);
        // At the inner edge of the silhouette, on the enlarged pixels.
        let (step_x, step_y) = (x % factor, y % factor);
        let free = |condition: bool, dx: i64, dy: i64| {
            let (nx, ny) = (i64::from(at_x) + dx, i64::from(at_y) + dy);
            let is_in_image = nx >= 0 && ny >= 0 && nx < i64::from(image.width()) && ny < i64::from(image.height());
            condition && is_in_image && !inside(nx as u32, ny as u32)
        };
        let is_edge = inside(at_x, at_y)
            && (free(step_x == 0, -1, 0)
                || free(step_x == factor - 1, 1, 0)
                || free(step_y == 0, 0, -1)
                || free(step_y == factor - 1, 0, 1));
        if is_edge { color } else { *image.get_pixel(at_x, at_y) }
    })
}

fn sheet(panels: &[Panel], alignment: &Alignment) -> RgbImage {
    let found = if alignment.rejection.is_some() { "found, rejected" } else { "aligned" };
    let heads = ["given", found]
        .into_iter()
        .zip(alignment.fit)
        .map(|(head, fit)| format!("{head}: contours {:.1} px off, overlap {:.3}", fit.contours[0], fit.overlap));
    let heads: Vec<String> = heads.collect();
    let widest =
        heads.iter().map(|head| head.len() as u32 * ghand_pictures::draw_text::letter_width()).max().unwrap_or(0);
    let column = panels.iter().map(|panel| panel.pictures[0].width()).max().unwrap_or(0).max(widest);
    let height: u32 = panels.iter().map(|panel| panel.pictures[0].height() + LINE + MARGIN).sum();
    let mut sheet = RgbImage::from_pixel(2 * column + 3 * MARGIN, height + 2 * MARGIN + LINE, PAPER);
    let left = |k: usize| MARGIN + k as u32 * (column + MARGIN);
    for (k, head) in heads.iter().enumerate() {
        write(&mut sheet, [left(k), MARGIN], column, OUTLINES[k], head);
    }
    let mut top = MARGIN + LINE;
    for panel in panels {
        write(&mut sheet, [MARGIN, top], 2 * column + MARGIN, INK, &panel.title);
        top += LINE;
        for (k, picture) in panel.pictures.iter().enumerate() {
            image::imageops::replace(&mut sheet, picture, i64::from(left(k)), i64::from(top));
        }
        top += panel.pictures[0].height() + MARGIN;
    }
    sheet
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_outline_runs_along_the_inner_edge_of_a_silhouette() {
        let image = RgbImage::from_pixel(100, 100, Rgb([9, 9, 9]));
        let silhouette: Vec<bool> =
            (0..10_000).map(|i| (40..60).contains(&(i % 100)) && (30..70).contains(&(i / 100))).collect();
        let part = bounds(&silhouette, 100);
        assert_eq!(part, [16, 6, 68, 88]);
        let drawn = with_outline(&image, &silhouette, OUTLINES[0], part);
        // Four times as large: 320 pixels at least.
        assert_eq!(drawn.dimensions(), (4 * 68, 4 * 88));
        let count = drawn.pixels().filter(|pixel| **pixel == OUTLINES[0]).count();
        assert_eq!(count, 2 * (80 + 160) - 4, "a rectangle of 80 x 160 pixels has so many along its edge");
        assert_eq!(*drawn.get_pixel(4 * 24, 4 * 24), OUTLINES[0]);
        assert_eq!(bounds(&[false; 12], 4), [0, 0, 4, 3]);
    }
}
