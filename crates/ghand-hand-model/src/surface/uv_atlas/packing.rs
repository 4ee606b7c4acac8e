//! Packs charts into the unit square, as closely as their outlines allow.

use glam::DVec2;

use super::charts::Chart;
use super::raster::touched_cells;

/// Cells of the grid that charts are packed on; one of the first is two texels of an atlas of 512. Finer grids are for
/// surfaces with so many charts that the gutters alone would fill a coarser one.
const GRIDS: [usize; 5] = [256, 512, 1024, 2048, 4096];
/// Free cells around each chart: a bilinear lookup at a chart's border reads half a texel beyond it, and the next level
/// of a mip chain twice that.
const GUTTER: usize = 1;
/// Halvings of the interval of scales: about 2% of the size at the end.
const HALVINGS: usize = 5;
/// Number of rotations within a quarter turn that are tried to align a chart.
const TURNS: usize = 16;
/// Charts beyond this number, the smallest ones, start their search at the place of the previous one.
const THOROUGH: usize = 100;

/// UV points of the charts, one for each of their points; `None` if the charts do not all fit.
pub(super) fn pack(charts: &[Chart]) -> Option<Vec<Vec<DVec2>>> {
    let mut upright: Vec<(usize, Vec<DVec2>)> =
        charts.iter().map(|chart| stand_up(&chart.points)).enumerate().collect();
    let area = |chart: &Chart| -> f64 {
        let doubled = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|i| chart.points[i as usize]);
            (b - a).perp_dot(c - a)
        };
        chart.triangles.iter().map(doubled).sum::<f64>() * 0.5
    };
    let areas: Vec<f64> = charts.iter().map(area).collect();
    upright.sort_by(|a, b| areas[b.0].total_cmp(&areas[a.0]).then(a.0.cmp(&b.0)));
    let total: f64 = areas.iter().sum();
    let longest = upright.iter().map(|(_, points)| longest_side(points)).fold(0.0, f64::max);
    for grid in GRIDS {
        // Cells per unit: the scale at which the charts' areas alone would fill the grid is too large, and so is that
        // at which the longest of them reaches from end to end. Slivers have length but almost no area.
        let mut fits = 0.0;
        let mut high = grid as f64 / total.sqrt().max(longest);
        let mut best = None;
        for _ in 0..HALVINGS {
            let scale = if best.is_none() { 0.5 * high } else { 0.5 * (fits + high) };
            match place_all(charts, &upright, scale, grid) {
                Some(places) => {
                    fits = scale;
                    best = Some(places);
                }
                None => high = scale,
            }
        }
        if best.is_some() {
            return best;
        }
    }
    None
}

/// The points, rotated so that the box around them is smallest.
fn stand_up(points: &[DVec2]) -> Vec<DVec2> {
    let turned = |turn: usize| {
        let rotation = DVec2::from_angle(std::f64::consts::FRAC_PI_2 * turn as f64 / TURNS as f64);
        points.iter().map(move |p| rotation.rotate(*p))
    };
    let box_area = |turn: usize| {
        let (low, high) = bounds(turned(turn));
        (high - low).element_product()
    };
    let best = (0..TURNS).min_by(|&a, &b| box_area(a).total_cmp(&box_area(b))).unwrap_or(0);
    turned(best).collect()
}

fn longest_side(points: &[DVec2]) -> f64 {
    let (low, high) = bounds(points.iter().copied());
    (high - low).max_element()
}

fn bounds(points: impl Iterator<Item = DVec2>) -> (DVec2, DVec2) {
    points.fold((DVec2::INFINITY, DVec2::NEG_INFINITY), |(low, high), p| (low.min(p), high.max(p)))
}

/// Places the charts one after the other, each where it raises the top least; `None` if one does not fit.
fn place_all(charts: &[Chart], upright: &[(usize, Vec<DVec2>)], scale: f64, grid: usize) -> Option<Vec<Vec<DVec2>>> {
    let mut taken = Bitmap::new(grid, grid);
    let mut places = vec![vec![]; charts.len()];
    let mut first_row = GUTTER;
    for (rank, (chart, points)) in upright.iter().enumerate() {
        let turns = if rank < THOROUGH { 4 } else { 1 };
        let mut best: Option<(usize, usize, usize, Bitmap, Vec<DVec2>)> = None;
        for turn in 0..turns {
            let (points, bitmap) = draw(points, &charts[*chart].triangles, scale, turn);
            if bitmap.rows + 2 * GUTTER > grid || bitmap.columns + 2 * GUTTER > grid {
                continue;
            }
            let start = if rank < THOROUGH { GUTTER } else { first_row };
            let highest = best.as_ref().map_or(usize::MAX, |(top, ..)| *top);
            let mut rows = start..=grid - GUTTER - bitmap.rows;
            let place = rows.by_ref().take_while(|row| row + bitmap.rows < highest).find_map(|row| {
                let mut column = GUTTER;
                while column <= grid - GUTTER - bitmap.columns {
                    match taken.collision(&bitmap, row, column) {
                        0 => return Some((row, column)),
                        columns => column += columns,
                    }
                }
                None
            });
            if let Some((row, column)) = place {
                best = Some((row + bitmap.rows, row, column, bitmap, points));
            }
        }
        let (_, row, column, bitmap, points) = best?;
        first_row = row;
        taken.add_widened(&bitmap, row, column);
        let corner = DVec2::new(column as f64, row as f64);
        places[*chart] = points.iter().map(|p| (*p + corner) / grid as f64).collect();
    }
    Some(places)
}

/// A chart in cells from its own corner, rotated by quarter turns and with y down, and the cells that it touches.
fn draw(points: &[DVec2], triangles: &[[u32; 3]], scale: f64, turn: usize) -> (Vec<DVec2>, Bitmap) {
    let turned = points.iter().map(|p| {
        let p = (0..turn).fold(*p, |p, _| p.perp());
        DVec2::new(p.x, -p.y) * scale
    });
    let (low, high) = bounds(turned.clone());
    let points: Vec<DVec2> = turned.map(|p| p - low).collect();
    let size = high - low;
    let mut bitmap = Bitmap::new(size.y as usize + 2, size.x as usize + 2);
    for t in triangles {
        for (row, columns) in touched_cells(t.map(|i| points[i as usize])) {
            bitmap.set(row, *columns.start(), *columns.end());
        }
    }
    (points, bitmap)
}

/// Cells of a grid, 64 per word.
struct Bitmap {
    rows: usize,
    columns: usize,
    /// Words per row.
    width: usize,
    words: Vec<u64>,
}

impl Bitmap {
    fn new(rows: usize, columns: usize) -> Bitmap {
        // One extra word, so that a shifted row never ends beyond it.
        let width = columns / 64 + 2;
        Bitmap { rows, columns, width, words: vec![0; rows * width] }
    }

    fn row(&self, row: usize) -> &[u64] {
        &self.words[row * self.width..(row + 1) * self.width]
    }

    fn set(&mut self, row: usize, first: usize, last: usize) {
        for column in first..=last.min(self.columns - 1) {
            self.words[row * self.width + column / 64] |= 1 << (column % 64);
        }
    }

    /// The words of one row, shifted by columns, with their indices.
    fn shifted(&self, row: usize, column: usize) -> impl Iterator<Item = (usize, u64)> {
        let skip = column / 64;
        let shift = column % 64;
        let words = self.row(row);
        let below = std::iter::once(0).chain(words.iter().copied());
        words.iter().zip(below).enumerate().map(move |(k, (word, below))| {
            let carried = if shift == 0 { 0 } else { below >> (64 - shift) };
            (skip + k, (word << shift) | carried)
        })
    }

    /// By how many columns `other`, with its corner at that row and column, must at least move to the right not to share a
    /// cell with this one that it shares now; 0 if it shares none.
    fn collision(&self, other: &Bitmap, row: usize, column: usize) -> usize {
        // Wide parts collide first; they tend to be in the middle.
        let middle = other.rows / 2;
        let shared = (middle..other.rows).chain(0..middle).find_map(|k| {
            let taken = self.row(row + k);
            let words = other.shifted(k, column).map(|(at, word)| (at, if word == 0 { 0 } else { taken[at] & word }));
            let (at, word) = words.filter(|(_, word)| *word != 0).last()?;
            Some((k, 64 * at + 63 - word.leading_zeros() as usize - column))
        });
        shared.map_or(0, |(k, cell)| other.run_before(k, cell))
    }

    /// Length of the run of set cells of a row that ends with a set one.
    fn run_before(&self, row: usize, last: usize) -> usize {
        let words = self.row(row);
        let mut run = 0;
        loop {
            let at = last - run;
            let ones = (words[at / 64] << (63 - at % 64)).leading_ones() as usize;
            run += ones;
            if ones <= at % 64 || at < 64 {
                return run;
            }
        }
    }

    /// Occupies the cells of `other`, with its corner at that row and column, and those within the gutter around them.
    fn add_widened(&mut self, other: &Bitmap, row: usize, column: usize) {
        for k in 0..other.rows {
            for to in row + k - GUTTER..=row + k + GUTTER {
                for shift in column - GUTTER..=column + GUTTER {
                    for (at, word) in other.shifted(k, shift) {
                        if word != 0 {
                            self.words[to * self.width + at] |= word;
                        }
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A grid and its cells, set where a hash of their number is below a part of 16.
    fn drawn(rows: usize, columns: usize, part: u64, seed: u64) -> (Bitmap, Vec<Vec<bool>>) {
        let mut bitmap = Bitmap::new(rows, columns);
        let hash = |i: u64| (i + seed).wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 60;
        let cells: Vec<Vec<bool>> =
            (0..rows).map(|y| (0..columns).map(|x| hash((y * columns + x) as u64) < part).collect()).collect();
        for (y, row) in cells.iter().enumerate() {
            (0..columns).filter(|x| row[*x]).for_each(|x| bitmap.set(y, x, x));
        }
        (bitmap, cells)
    }

    #[test]
    fn a_collision_passes_over_columns_that_collide_and_no_others() {
        for seed in 0..20 {
            // Charts of one to three words, sparse and dense, over sparse cells.
            let (chart, chart_cells) = drawn(5, 40 + 8 * seed as usize, 4 + 12 * (seed % 2), 1000 * seed);
            let (taken, taken_cells) = drawn(20, 400, seed % 3, 77 * seed);
            let collides = |row: usize, column: usize| {
                let mut cells = (0..chart.rows).flat_map(|y| (0..chart.columns).map(move |x| (y, x)));
                cells.any(|(y, x)| chart_cells[y][x] && taken_cells[row + y][column + x])
            };
            for row in 0..15 {
                for column in 0..400 - chart.columns {
                    let advance = taken.collision(&chart, row, column);
                    assert_eq!(advance > 0, collides(row, column), "{seed} {row} {column}");
                    let passed = column..(column + advance).min(400 - chart.columns);
                    assert!(passed.into_iter().all(|column| collides(row, column)), "{seed} {row} {column}");
                }
            }
        }
    }
}
