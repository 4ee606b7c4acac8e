//! Finds chessboards: whole, because a part does not tell which one it is.

use calib_targets_chessboard::{
    ChessboardDetection, ChessboardDetector, ChessboardParams, GrayImageView, detect_corners,
};
use glam::DVec2;

use super::{Sight, corner_search, pixel};
use crate::{BoardKind, SeenCorner};

pub(super) struct ChessboardFinder {
    corners: [usize; 2],
    detector: Option<ChessboardDetector>,
}

impl ChessboardFinder {
    pub(super) fn new(kind: &BoardKind) -> ChessboardFinder {
        // No parameters are refused.
        ChessboardFinder {
            corners: kind.corners(),
            detector: ChessboardDetector::new(ChessboardParams::default()).ok(),
        }
    }

    pub(super) fn find(&self, image: &GrayImageView) -> Sight {
        let found = detect_corners(image, &corner_search());
        let Some(grid) = self.detector.as_ref().and_then(|detector| detector.detect(&found)) else {
            return Sight::Nothing;
        };
        let found = extent(&grid);
        let Some(places) = whole_grid(&grid, found) else { return Sight::Other(found) };
        match numbered(&places, found, self.corners, image) {
            Some(pixels) => {
                let corner = |(number, pixel): (usize, DVec2)| SeenCorner { number, pixel };
                Sight::Board(pixels.into_iter().enumerate().map(corner).collect())
            }
            None => Sight::Other(found),
        }
    }
}

/// Corners of a grid across and down.
pub(super) fn extent(grid: &ChessboardDetection) -> [usize; 2] {
    let most = |at: &dyn Fn(&calib_targets_chessboard::ChessboardCorner) -> i32| {
        let (low, high) = (grid.corners.iter().map(at)).fold((i32::MAX, i32::MIN), |(l, h), v| (l.min(v), h.max(v)));
        usize::try_from(i64::from(high) - i64::from(low) + 1).unwrap_or(0)
    };
    [most(&|corner| corner.grid.u), most(&|corner| corner.grid.v)]
}

/// Pixels of all corners of a grid, row by row; `None` if one is missing.
fn whole_grid(grid: &ChessboardDetection, [columns, rows]: [usize; 2]) -> Option<Vec<DVec2>> {
    let first = [grid.corners.iter().map(|c| c.grid.u).min()?, grid.corners.iter().map(|c| c.grid.v).min()?];
    let mut pixels = vec![None; columns * rows];
    for corner in &grid.corners {
        let [x, y] = [corner.grid.u - first[0], corner.grid.v - first[1]].map(|v| usize::try_from(v).ok());
        *pixels.get_mut(y? * columns + x?)? = Some(pixel(corner.position));
    }
    pixels.into_iter().collect()
}

/// The corners of the board by number, if a found grid is the board in some turn. Of several turns, the first one in which
/// the square at the top left is black.
fn numbered(found: &[DVec2], size: [usize; 2], wanted: [usize; 2], image: &GrayImageView) -> Option<Vec<DVec2>> {
    let [columns, rows] = wanted;
    let at = |x: usize, y: usize| found[y * size[0] + x];
    let turned: [&dyn Fn(usize, usize) -> DVec2; 4] =
        [&|x, y| at(x, y), &|x, y| at(columns - 1 - x, rows - 1 - y), &|x, y| at(rows - 1 - y, x), &|x, y| {
            at(y, columns - 1 - x)
        }];
    let is_straight = size == wanted;
    let is_across = size == [rows, columns];
    let usable = turned.iter().enumerate().filter(|(k, _)| if *k < 2 { is_straight } else { is_across });
    let all: Vec<Vec<DVec2>> = usable
        .map(|(_, turn)| (0..columns * rows).map(|number| turn(number % columns, number / columns)).collect())
        .filter(|pixels: &Vec<DVec2>| !is_mirrored(pixels, columns))
        .collect();
    let begins_black = all.iter().position(|pixels| begins_black(pixels, columns, image));
    all.into_iter().nth(begins_black.unwrap_or(0))
}

/// Whether rows follow each other against the sense in which columns do: no board looks so.
fn is_mirrored(pixels: &[DVec2], columns: usize) -> bool {
    let right = pixels[columns - 1] - pixels[0];
    let down = pixels[pixels.len() - columns] - pixels[0];
    right.perp_dot(down) <= 0.0
}

/// Whether the square right below corner 0, and all others of its colour, are black rather than white.
fn begins_black(pixels: &[DVec2], columns: usize, image: &GrayImageView) -> bool {
    let rows = pixels.len() / columns;
    let mut sums = [[0.0; 2]; 2];
    for (x, y) in (0..rows - 1).flat_map(|y| (0..columns - 1).map(move |x| (x, y))) {
        let first = y * columns + x;
        let middle = (pixels[first] + pixels[first + 1] + pixels[first + columns] + pixels[first + columns + 1]) / 4.0;
        let place = middle.y.max(0.0) as usize * image.width + middle.x.max(0.0) as usize;
        if let Some(value) = image.data.get(place) {
            let [sum, count] = &mut sums[(x + y) % 2];
            *sum += f64::from(*value);
            *count += 1.0;
        }
    }
    sums[0][0] * sums[1][1] < sums[1][0] * sums[0][1]
}
