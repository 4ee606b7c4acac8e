//! Packs the two pieces of the glove into the unit square of the UV atlas.

use glam::DVec2;

use super::pattern::Pattern;

/// Cells of the collision bitmaps across a piece; a row is one `u128`.
const CELLS: usize = 96;
/// Number of rotations of the second piece that are tried.
const TURNS: usize = 24;
/// Number of directions in which extents are measured, a multiple of four.
const DIRECTIONS: usize = 72;
/// Free border of the atlas, as a part of its size: three texels at 512.
const GUTTER: f64 = 3.0 / 512.0;

/// UV points of the first piece and of its mirror image.
///
/// The second piece is mirrored, so that both are seen from outside. Of all its positions on a grid of rotations and
/// shifts that keep the pieces apart, the one with the smallest square around both is used.
pub(super) fn pack(pattern: &Pattern) -> [Vec<DVec2>; 2] {
    let first = pattern.points.clone();
    let mirrored: Vec<DVec2> = first.iter().map(|p| DVec2::new(p.x, -p.y)).collect();
    let corner = |f: fn(DVec2, DVec2) -> DVec2, start: DVec2| first.iter().fold(start, |a, p| f(a, *p));
    let diagonal = (corner(DVec2::max, DVec2::NEG_INFINITY) - corner(DVec2::min, DVec2::INFINITY)).length();
    // A piece fits into CELLS cells at any rotation; the cells around it are the gap.
    let cell = diagonal / CELLS as f64;
    let bitmap = Bitmap::draw(&first, &pattern.triangles, cell, 1);
    let directions = directions();
    let extents = extents(&first, &directions);
    // (side of the square, rotation of the second piece, its shift, rotation of both)
    let mut best = (f64::INFINITY, 0.0, DVec2::ZERO, 0);
    for turn in 0..TURNS {
        let angle = std::f64::consts::TAU * turn as f64 / TURNS as f64;
        let turned: Vec<DVec2> = mirrored.iter().map(|p| DVec2::from_angle(angle).rotate(*p)).collect();
        let other = Bitmap::draw(&turned, &pattern.triangles, cell, 0);
        let other_extents = self::extents(&turned, &directions);
        for dy in -(CELLS as i32)..=CELLS as i32 {
            for dx in -(CELLS as i32)..=CELLS as i32 {
                let shift = bitmap.origin - other.origin + DVec2::new(f64::from(dx), f64::from(dy)) * cell;
                let (side, both) = smallest_square(&extents, &other_extents, shift, &directions);
                if side < best.0 && !bitmap.collides(&other, dx, dy) {
                    best = (side, angle, shift, both);
                }
            }
        }
    }
    let (_, angle, shift, both) = best;
    let upright = DVec2::from_angle(-std::f64::consts::TAU * both as f64 / DIRECTIONS as f64);
    let mut pieces = [first, mirrored.iter().map(|p| DVec2::from_angle(angle).rotate(*p) + shift).collect()];
    let (mut low, mut high) = (DVec2::INFINITY, DVec2::NEG_INFINITY);
    for p in pieces.iter_mut().flatten() {
        *p = upright.rotate(*p);
        low = low.min(*p);
        high = high.max(*p);
    }
    let scale = (1.0 - 2.0 * GUTTER) / (high - low).max_element();
    for p in pieces.iter_mut().flatten() {
        *p = (*p - low) * scale + DVec2::splat(GUTTER);
    }
    pieces
}

fn directions() -> Vec<DVec2> {
    (0..DIRECTIONS).map(|k| DVec2::from_angle(std::f64::consts::TAU * k as f64 / DIRECTIONS as f64)).collect()
}

/// Extent of the points in each direction.
fn extents(points: &[DVec2], directions: &[DVec2]) -> Vec<f64> {
    directions.iter().map(|d| points.iter().map(|p| p.dot(*d)).fold(f64::NEG_INFINITY, f64::max)).collect()
}

/// Side and rotation (as the index of a direction) of the smallest square around two pieces.
fn smallest_square(first: &[f64], second: &[f64], shift: DVec2, directions: &[DVec2]) -> (f64, usize) {
    let reach = |k: usize| first[k].max(second[k] + shift.dot(directions[k]));
    let quarter = DIRECTIONS / 4;
    (0..quarter)
        .map(|k| ((reach(k) + reach(k + 2 * quarter)).max(reach(k + quarter) + reach(k + 3 * quarter)), k))
        .fold((f64::INFINITY, 0), |best, now| if now.0 < best.0 { now } else { best })
}

struct Bitmap {
    origin: DVec2,
    rows: Vec<u128>,
}

impl Bitmap {
    /// Marks every cell that a triangle may touch, and `margin` cells around it.
    fn draw(points: &[DVec2], triangles: &[[u32; 3]], cell: f64, margin: i32) -> Bitmap {
        let origin = points.iter().fold(DVec2::INFINITY, |low, p| low.min(*p)) - DVec2::splat(4.0 * cell);
        let mut rows = vec![0u128; 128];
        for t in triangles {
            let corners = t.map(|i| (points[i as usize] - origin) / cell);
            let low = corners[0].min(corners[1]).min(corners[2]).floor();
            let high = corners[0].max(corners[1]).max(corners[2]).floor();
            // Triangles are about a cell in size: their bounding boxes are close enough.
            for y in low.y as i32 - margin..=high.y as i32 + margin {
                for x in low.x as i32 - margin..=high.x as i32 + margin {
                    if let (Some(row), true) = (rows.get_mut(y.max(0) as usize), (0..128).contains(&x)) {
                        *row |= 1 << x;
                    }
                }
            }
        }
        Bitmap { origin, rows }
    }

    /// Whether `other`, shifted by whole cells, shares a cell with this one.
    fn collides(&self, other: &Bitmap, dx: i32, dy: i32) -> bool {
        let shifted = |row: u128| if dx >= 0 { row.checked_shl(dx as u32) } else { row.checked_shr(-dx as u32) };
        (0..other.rows.len() as i32).any(|y| {
            let Some(row) = usize::try_from(y + dy).ok().and_then(|y| self.rows.get(y)) else { return false };
            shifted(other.rows[y as usize]).unwrap_or(0) & row != 0
        })
    }
}
