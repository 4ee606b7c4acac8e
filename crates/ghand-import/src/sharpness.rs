//! How sharp the image of a hand is.

use glam::DVec2;

use crate::rig::LANDMARKS;
use crate::rig::lengths::BONES;

/// Of the palm, the image is looked at between fewer pairs of landmarks than [`BONES`] has.
const SKIPPED: [(usize, usize); 4] = [(0, 1), (0, 9), (0, 13), (5, 17)];
/// Half the length of the lines across fingers, relative to the palm's length.
const REACH: f64 = 0.22;
/// Places along each pair.
const PLACES: usize = 5;
/// Steps across.
const ACROSS: i32 = 24;

/// The steepest step of brightness along lines across the fingers, per pixel, relative to the contrast along that line: the
/// mean of the upper half of all lines. About 1 / (width of an edge, pixels); 0 without contrast.
pub fn sharpness(rgb: &[u8], width: usize, height: usize, pixels: &[DVec2; LANDMARKS]) -> f64 {
    let palm = pixels[0].distance(pixels[9]).max(pixels[5].distance(pixels[17]));
    let reach = (REACH * palm).max(2.0);
    let grey = |at: DVec2| {
        let [x, y] = [at.x.floor(), at.y.floor()];
        if !(x >= 0.0 && y >= 0.0 && x < width as f64 && y < height as f64) {
            return None;
        }
        let at = 3 * (y as usize * width + x as usize);
        let pixel = rgb.get(at..at + 3)?;
        Some(pixel.iter().map(|value| f64::from(*value)).sum::<f64>() / 3.0)
    };
    let mut values = vec![];
    for (from, to) in BONES.into_iter().filter(|pair| !SKIPPED.contains(pair)) {
        let along = pixels[to] - pixels[from];
        let Some(across) = along.perp().try_normalize() else { continue };
        for place in 0..PLACES {
            let middle = pixels[from] + along * ((place as f64 + 0.5) / PLACES as f64);
            let step = 2.0 * reach / f64::from(ACROSS);
            let line: Option<Vec<f64>> =
                (0..=ACROSS).map(|k| grey(middle + across * (f64::from(k) * step - reach))).collect();
            let Some(line) = line else { continue };
            let range = line.iter().copied().fold(f64::MIN, f64::max) - line.iter().copied().fold(f64::MAX, f64::min);
            let steepest = line.windows(2).map(|pair| (pair[1] - pair[0]).abs()).fold(0.0, f64::max);
            // Flat lines have only noise.
            if range > 24.0 {
                values.push(steepest / range / step);
            }
        }
    }
    values.sort_by(f64::total_cmp);
    let upper = &values[values.len() / 2..];
    if upper.is_empty() { 0.0 } else { upper.iter().sum::<f64>() / upper.len() as f64 }
}
