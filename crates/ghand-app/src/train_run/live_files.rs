//! The files that show how a run goes while it goes: the loss, and pictures of images held out.

use std::path::Path;

use anyhow::Context;
use ghand_files::atomic_file::write_atomically;
use ghand_pictures::plot::{DataSeries, LinePlot};
use ghand_train::{CurvePoint, Preview};
use image::{Rgb, RgbImage};

use crate::run_files::{CURVES_PLOT, CURVES_TABLE, PREVIEW};

use ghand_pictures::write_png;

/// Gap between pictures, pixels.
const GAP: u32 = 4;
const PAPER: Rgb<u8> = Rgb([40, 40, 44]);

/// Writes all files in a folder.
///
/// # Errors
/// An error that names the file that cannot be written.
pub fn write_live_files(folder: &Path, curve: &[CurvePoint], previews: &[Preview]) -> anyhow::Result<()> {
    let table = folder.join(CURVES_TABLE);
    write_atomically(&table, csv(curve).as_bytes()).with_context(|| format!("{}: cannot write", table.display()))?;
    write_png(&folder.join(CURVES_PLOT), &stacked(&curve_plots(curve)?))?;
    if !previews.is_empty() {
        write_png(&folder.join(PREVIEW), &preview(previews))?;
    }
    Ok(())
}

fn csv(curve: &[CurvePoint]) -> String {
    let number = |value: Option<f64>| value.map_or(String::new(), |value| format!("{value:.6}"));
    let line = |p: &CurvePoint| {
        format!("{},{},{:.1},{},{}\n", p.iteration, p.stage, p.seconds, number(p.l1), number(p.held_out_psnr))
    };
    curve.iter().map(line).fold("iteration,stage,seconds,l1,held_out_psnr\n".into(), |text, line| text + &line)
}

/// The plots of a curve: the loss and, if images were held out, their PSNR.
pub fn line_plots(curve: &[CurvePoint]) -> Vec<LinePlot> {
    let plot = |title: &str, unit: &str, value: fn(&CurvePoint) -> Option<f64>| {
        let of_stage = |stage: u32| {
            let points = curve.iter().filter(|p| p.stage == stage);
            let points = points.filter_map(|p| Some((p.iteration as f64, value(p)?))).collect();
            DataSeries { name: format!("stage {stage}"), points }
        };
        let series: Vec<DataSeries> =
            [1, 2].map(of_stage).into_iter().filter(|series| series.points.len() > 1).collect();
        LinePlot { title: title.into(), axes: ["iterations".into(), unit.into()], series }
    };
    let plots = [
        plot("Loss on training images", "L1 over the crop", |p| p.l1),
        plot("Images held out", "PSNR, dB", |p| p.held_out_psnr),
    ];
    plots.into_iter().filter(|plot| !plot.series.is_empty()).collect()
}

fn curve_plots(curve: &[CurvePoint]) -> anyhow::Result<Vec<RgbImage>> {
    line_plots(curve).iter().map(|plot| Ok(plot.to_image()?)).collect()
}

/// Pictures one below the other.
fn stacked(pictures: &[RgbImage]) -> RgbImage {
    let width = pictures.iter().map(RgbImage::width).max().unwrap_or(1);
    let mut sheet =
        RgbImage::from_pixel(width, pictures.iter().map(RgbImage::height).sum::<u32>().max(1), Rgb([255; 3]));
    let mut top = 0;
    for picture in pictures {
        image::imageops::replace(&mut sheet, picture, 0, i64::from(top));
        top += picture.height();
    }
    sheet
}

/// Images above, the avatar below.
fn preview(previews: &[Preview]) -> RgbImage {
    let width = previews.iter().map(|p| p.size[0] + GAP).sum::<u32>().saturating_sub(GAP).max(1);
    let height = previews.iter().map(|p| p.size[1]).max().unwrap_or(1);
    let mut sheet = RgbImage::from_pixel(width, 2 * height + GAP, PAPER);
    let mut left = 0;
    for Preview { size: [columns, rows], truth, render } in previews {
        for (k, pixels) in [truth, render].into_iter().enumerate() {
            let picture = RgbImage::from_raw(*columns, *rows, pixels.as_flattened().to_vec()).unwrap_or_default();
            image::imageops::replace(&mut sheet, &picture, i64::from(left), k as i64 * i64::from(height + GAP));
        }
        left += columns + GAP;
    }
    sheet
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_files_have_what_was_measured() {
        let folder = tempfile::tempdir().unwrap();
        let point = |iteration: u64, held_out_psnr| CurvePoint {
            iteration,
            stage: 2,
            seconds: 0.5 * iteration as f64,
            l1: Some(1.0 / iteration as f64),
            held_out_psnr,
        };
        let curve = [point(25, None), point(50, Some(20.5)), point(75, None), point(100, Some(21.0))];
        let small = Preview { size: [3, 2], truth: vec![[255, 0, 0]; 6], render: vec![[0, 255, 0]; 6] };
        let large = Preview { size: [5, 4], truth: vec![[9; 3]; 20], render: vec![[7; 3]; 20] };
        write_live_files(folder.path(), &curve, &[small, large]).unwrap();
        let table = std::fs::read_to_string(folder.path().join(CURVES_TABLE)).unwrap();
        assert!(table.contains("\n50,2,25.0,0.020000,20.500000\n"), "{table}");
        let preview = image::open(folder.path().join(PREVIEW)).unwrap().to_rgb8();
        assert_eq!((preview.width(), preview.height()), (12, 12));
        assert_eq!((preview.get_pixel(0, 0).0, preview.get_pixel(2, 9).0), ([255, 0, 0], [0, 255, 0]));
        let plot = image::open(folder.path().join(CURVES_PLOT)).unwrap();
        assert_eq!(plot.height(), 2 * ghand_pictures::plot::SIZE[1]);
        // A run without anything measured yet.
        write_live_files(folder.path(), &[], &[]).unwrap();
    }
}
