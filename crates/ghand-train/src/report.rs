//! The report picture: truth, render, error and floor of several test views.

use image::{Rgb, RgbImage};

use crate::evaluate::EvaluatedView;

/// Gap between pictures, pixels.
const GAP: u32 = 4;
/// Factor on the error column.
const ERROR_GAIN: u32 = 4;
/// Grey of the sheet.
const PAPER: Rgb<u8> = Rgb([40, 40, 44]);

/// One row a view: truth, render, absolute error times four, floor.
pub fn report(views: &[EvaluatedView]) -> RgbImage {
    let width = views.iter().map(|v| v.size[0]).max().unwrap_or(1);
    let height: u32 = views.iter().map(|v| v.size[1] + GAP).sum();
    let mut sheet = RgbImage::from_pixel(4 * (width + GAP) + GAP, height + GAP, PAPER);
    let mut top = GAP;
    for view in views {
        let mut place = |column: u32, color: &dyn Fn(usize) -> [u8; 3]| {
            for y in 0..view.size[1] {
                for x in 0..view.size[0] {
                    let at = (y * view.size[0] + x) as usize;
                    sheet.put_pixel(GAP + column * (width + GAP) + x, top + y, Rgb(color(at)));
                }
            }
        };
        let truth = |i: usize| [view.truth[i][0], view.truth[i][1], view.truth[i][2]];
        place(0, &truth);
        place(1, &|i| view.render[i]);
        place(2, &|i| {
            let (t, r) = (truth(i), view.render[i]);
            [0, 1, 2].map(|c| (u32::from(t[c].abs_diff(r[c])) * ERROR_GAIN).min(255) as u8)
        });
        place(3, &|i| view.floor[i]);
        top += view.size[1] + GAP;
    }
    sheet
}
