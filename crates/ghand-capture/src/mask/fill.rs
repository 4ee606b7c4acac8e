//! The filled outline of a mesh.

use std::ops::Range;

use ghand_core::Camera;
use glam::{DVec2, DVec3};

/// Triangles with a corner nearer than this are skipped, metres: points at or behind the camera have no image.
const NEAR: f64 = 1e-3;
/// Width and height of a cell of pixels.
const CELL: usize = 8;

/// Whether each pixel's centre, row-major, is inside the image of a triangle, edges included. `faces` are indices into
/// `points` (world, metres); a triangle with an index beyond them is skipped.
pub fn covered_pixels(camera: &Camera, points: &[DVec3], faces: &[[u32; 3]]) -> Vec<bool> {
    let size = [camera.width, camera.height].map(|pixels| pixels as usize);
    let mut open = vec![true; size[0] * size[1]];
    cover(size, &projected(camera, points), faces, &mut open, |_, _| true);
    open.into_iter().map(|is_open| !is_open).collect()
}

/// The pixels at which points (world, metres) are seen; `None` at or behind the camera.
pub fn projected(camera: &Camera, points: &[DVec3]) -> Vec<Option<DVec2>> {
    let pixel = |point: &DVec3| {
        let (pixel, depth) = camera.project(*point);
        (depth > NEAR && pixel.is_finite()).then_some(pixel)
    };
    points.iter().map(pixel).collect()
}

/// As [`covered_pixels`], the other way round and of some pixels only, which is faster: whether each pixel of an image of
/// this size is one of `pixels` (row-major numbers; those beyond the image are skipped) that no triangle between
/// `corners`, which are [`projected`] points, covers.
pub fn open_pixels(
    [width, height]: [usize; 2],
    corners: &[Option<DVec2>],
    faces: &[[u32; 3]],
    pixels: impl IntoIterator<Item = usize>,
) -> Vec<bool> {
    let mut open = vec![false; width * height];
    // Most triangles are in cells without any of the pixels.
    let columns = width.div_ceil(CELL);
    let mut cells = vec![false; columns * height.div_ceil(CELL)];
    for pixel in pixels.into_iter().filter(|pixel| *pixel < width * height) {
        open[pixel] = true;
        cells[pixel / width / CELL * columns + pixel % width / CELL] = true;
    }
    let may_be_open = |across: &Range<usize>, down: &Range<usize>| {
        let [across, down] = [across, down].map(|range| range.start / CELL..(range.end - 1) / CELL + 1);
        down.into_iter().any(|row| cells[row * columns..][across.clone()].contains(&true))
    };
    cover([width, height], corners, faces, &mut open, may_be_open);
    open
}

/// Closes the open pixels that triangles cover. `may_be_open` may tell for pixels between columns and rows, at least one of
/// each, that none is open.
fn cover(
    [width, height]: [usize; 2],
    corners: &[Option<DVec2>],
    faces: &[[u32; 3]],
    open: &mut [bool],
    may_be_open: impl Fn(&Range<usize>, &Range<usize>) -> bool,
) {
    let corner = |i: u32| corners.get(i as usize).copied().flatten();
    for [a, b, c] in faces {
        let (Some(a), Some(b), Some(c)) = (corner(*a), corner(*b), corner(*c)) else { continue };
        let (low, high) = (a.min(b).min(c), a.max(b).max(c));
        // Pixels whose centres, at half-integers, are between: from the first that is not below, to the last that is not above.
        let range = |low: f64, high: f64, size: usize| {
            let bound = |v: f64| v.clamp(0.0, size as f64);
            let (low, end) = (bound(low - 0.5), bound(high + 0.5));
            let first = low as usize;
            first + usize::from((first as f64) < low)..end as usize
        };
        let columns = range(low.x, high.x, width);
        let rows = range(low.y, high.y, height);
        let area = (b - a).perp_dot(c - a);
        // Of a triangle without area, the neighbours share the edges.
        if columns.is_empty() || rows.is_empty() || area == 0.0 || !may_be_open(&columns, &rows) {
            continue;
        }
        for y in rows {
            let Some(row) = open.get_mut(y * width + columns.start..y * width + columns.end) else { continue };
            if !row.contains(&true) {
                continue;
            }
            for (x, is_open) in columns.clone().zip(row).filter(|(_, is_open)| **is_open) {
                let p = DVec2::new(x as f64 + 0.5, y as f64 + 0.5);
                let side = |from: DVec2, to: DVec2| (to - from).perp_dot(p - from) * area >= 0.0;
                *is_open = !(side(a, b) && side(b, c) && side(c, a));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A camera that maps (x, y, 1) to pixel (x, y).
    fn camera(width: u32, height: u32) -> Camera {
        let camera = Camera::look_at(DVec3::ZERO, DVec3::Z, DVec3::NEG_Y, 1.0, width, height);
        Camera { focal: DVec2::ONE, principal: DVec2::ZERO, ..camera }
    }

    fn filled(points: &[[f64; 3]], faces: &[[u32; 3]]) -> Vec<String> {
        let points: Vec<DVec3> = points.iter().map(|p| DVec3::from(*p)).collect();
        let mask = covered_pixels(&camera(6, 4), &points, faces);
        let some = (0..24).step_by(3).chain([99]);
        let open = open_pixels([6, 4], &projected(&camera(6, 4), &points), faces, some);
        assert!((0..24).all(|pixel| open[pixel] == (pixel.is_multiple_of(3) && !mask[pixel])));
        mask.chunks(6).map(|row| row.iter().map(|i| if *i { '#' } else { '.' }).collect()).collect()
    }

    #[test]
    fn centres_on_an_edge_are_inside_and_either_orientation_is_filled() {
        let square = [[1.5, 0.5, 1.0], [4.5, 0.5, 1.0], [4.5, 2.5, 1.0], [1.5, 2.5, 1.0]];
        let expected = [".####.", ".####.", ".####.", "......"];
        assert_eq!(filled(&square, &[[0, 1, 2], [0, 2, 3]]), expected);
        assert_eq!(filled(&square, &[[0, 1, 2], [0, 3, 2]]), expected);
    }

    #[test]
    fn open_pixels_are_those_that_are_not_covered_in_any_cell() {
        let (width, height) = (43, 29);
        let part = |i: usize, size: f64| (i as f64 * 0.618).fract() * 1.4 * size - 0.2 * size;
        // Triangles from the size of the image to some pixels, some of them beyond it.
        let points: Vec<DVec3> = (0..90)
            .map(|i| {
                let triangle = i / 3;
                let middle = DVec3::new(part(7 * triangle, 43.0), part(5 * triangle, 29.0), 1.0);
                let (sin, cos) = (2.0 * i as f64 + triangle as f64).sin_cos();
                middle + DVec3::new(cos, sin, 0.0) * 40.0 / (1 + triangle) as f64
            })
            .collect();
        let faces: Vec<[u32; 3]> = (0..30).map(|k| [3 * k, 3 * k + 1, 3 * k + 2]).collect();
        let camera = camera(width, height);
        let covered = covered_pixels(&camera, &points, &faces);
        let all = covered.len();
        let count = covered.iter().filter(|is| **is).count();
        assert!((all / 8..all * 7 / 8).contains(&count), "{count} of {all}");
        let corners = projected(&camera, &points);
        for step in [1, 3, 97] {
            let open = open_pixels([width as usize, height as usize], &corners, &faces, (0..all).step_by(step));
            assert!((0..all).all(|pixel| open[pixel] == (pixel % step == 0 && !covered[pixel])), "{step}");
        }
    }

    #[test]
    fn triangles_without_an_image_are_skipped_and_others_clipped() {
        let far = [[-1e9, -1e3, 1.0], [1e9, -1e3, 1.0], [2.0, 2.0, 1.0], [0.0, 0.0, -1.0], [f64::NAN, 0.0, 1.0]];
        assert_eq!(filled(&far, &[[0, 1, 2]]), ["######", "######", "......", "......"]);
        for broken in [[0, 1, 3], [0, 1, 4], [0, 1, 99], [0, 1, 1]] {
            assert!(filled(&far, &[broken]).iter().all(|row| row == "......"), "{broken:?}");
        }
    }
}
