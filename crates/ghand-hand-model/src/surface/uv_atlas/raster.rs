//! Which cells of a grid a triangle touches.

use std::ops::RangeInclusive;

use glam::DVec2;

/// A cell that a triangle misses by less than this fraction of a cell counts as touched: far more than rounding errors.
const SLACK: f64 = 1e-9;

/// The cells (of size 1, the first from 0 to 1 in both axes) that a triangle with positive coordinates touches: for
/// each row, the columns from the first to the last one.
pub(super) fn touched_cells(corners: [DVec2; 3]) -> impl Iterator<Item = (usize, RangeInclusive<usize>)> {
    let low = corners.iter().map(|p| p.y).fold(f64::INFINITY, f64::min);
    let high = corners.iter().map(|p| p.y).fold(f64::NEG_INFINITY, f64::max);
    (cell(low - SLACK)..=cell(high + SLACK)).map(move |row| {
        let (bottom, top) = (row as f64 - SLACK, row as f64 + 1.0 + SLACK);
        let (mut left, mut right) = (f64::INFINITY, f64::NEG_INFINITY);
        for (a, b) in [(0, 1), (1, 2), (2, 0)] {
            let (a, b) = (corners[a], corners[b]);
            // The ends of the edge's part within the row.
            let at = |y: f64| if a.y == b.y { 0.0 } else { ((y - a.y) / (b.y - a.y)).clamp(0.0, 1.0) };
            if a.y.max(b.y) < bottom || a.y.min(b.y) > top {
                continue;
            }
            let ends = if a.y == b.y { [0.0, 1.0] } else { [at(bottom), at(top)] };
            for x in ends.map(|t| a.x + t * (b.x - a.x)) {
                left = left.min(x);
                right = right.max(x);
            }
        }
        (row, cell(left - SLACK)..=cell(right + SLACK))
    })
}

/// The cell of a coordinate; one below 0 belongs to the first.
fn cell(coordinate: f64) -> usize {
    coordinate.max(0.0) as usize
}
