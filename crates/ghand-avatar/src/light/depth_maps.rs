//! The depths of a mesh's far side, seen from four lights at once: what hides points from them.
//!
//! Most triangles of a hand cover less than four cells, so that the time goes into preparing triangles, not into cells. A
//! lane of the vectors here is a light, and a triangle is prepared for all of them; only the few cells are drawn one light
//! at a time.

use glam::Vec4;

/// Number of lights.
pub const LANES: usize = 4;
/// Size of a cell, metres, unless that needs more than [`MOST_CELLS`] of them.
const CELL: f32 = 0.002;
/// Most cells of a map's side.
const MOST_CELLS: usize = 128;
/// A face hides a point only if it is at least this much nearer to the light, metres: a map's depths are those of cell
/// centres, and near a terminator the own surface's far side is close.
const MARGIN: f32 = 0.002;
/// Cells of a row that are drawn at once.
const COLUMNS: usize = 4;

/// Where a point is, seen from each light: metres, in axes of which the last points to the light; on a map, columns and
/// rows, whole numbers at the centres of cells, and metres of depth.
#[derive(Debug, Clone, Copy)]
pub struct LightSpacePoint {
    /// Across the light.
    pub x: Vec4,
    /// Across the light and x.
    pub y: Vec4,
    /// Towards the light.
    pub depth: Vec4,
}

/// For each light, depths of the faces that look away from it.
pub struct DepthMaps {
    /// x and y of the map's corner, metres.
    start: [Vec4; 2],
    /// Size of a cell, metres.
    cell: Vec4,
    /// Last column and row that are not of the border.
    last: [Vec4; 2],
    /// Cells from one row to the next.
    stride: Vec4,
    /// The same as whole numbers.
    strides: [usize; LANES],
    /// Row by row; -infinity where there is no face.
    depths: [Vec<f32>; LANES],
}

impl DepthMaps {
    /// The maps of a mesh with vertices at these places, in metres. The places are then those on the maps.
    pub fn new(faces: &[[u32; 3]], places: &mut [LightSpacePoint]) -> DepthMaps {
        let (mut low, mut high) = ([Vec4::MAX; 2], [Vec4::MIN; 2]);
        for place in places.iter() {
            low = [low[0].min(place.x), low[1].min(place.y)];
            high = [high[0].max(place.x), high[1].max(place.y)];
        }
        let extent = [0, 1].map(|i| (high[i] - low[i]).max(Vec4::ZERO));
        let cell = (extent[0].max(extent[1]) / (MOST_CELLS - 3) as f32).max(Vec4::splat(CELL));
        // A cell around the mesh stays empty, so that interpolation needs no special case.
        let size = extent.map(|extent| (extent / cell).floor() + 3.0);
        // The columns drawn at once may reach beyond a row's last.
        let stride = size[0] + (COLUMNS - 1) as f32;
        let cells = (stride * size[1]).to_array();
        let maps = DepthMaps {
            start: low.map(|low| low - cell),
            cell,
            last: size.map(|size| size - 2.0),
            stride,
            strides: stride.to_array().map(|stride| usize::from(stride as u16)),
            depths: cells.map(|cells| vec![f32::NEG_INFINITY; usize::from(cells as u16)]),
        };
        places.iter_mut().for_each(|place| *place = maps.place(*place));
        maps.with(faces, places)
    }

    /// The place on the maps of a place in metres.
    fn place(&self, LightSpacePoint { x, y, depth }: LightSpacePoint) -> LightSpacePoint {
        let on = |i: usize, at: Vec4| (at - self.start[i]) / self.cell - 0.5;
        LightSpacePoint { x: on(0, x), y: on(1, y), depth }
    }

    /// Draws faces.
    fn with(mut self, faces: &[[u32; 3]], places: &[LightSpacePoint]) -> DepthMaps {
        for face in faces {
            let [a, b, c] = face.map(|corner| places[corner as usize]);
            let area = (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
            // Counter-clockwise triangles look towards the light.
            let away = area.cmplt(Vec4::ZERO);
            if !away.any() {
                continue;
            }
            let left = a.x.min(b.x).min(c.x).ceil();
            let top = a.y.min(b.y).min(c.y).ceil();
            let columns = a.x.max(b.x).max(c.x).min(self.last[0]).floor() - left;
            let rows = a.y.max(b.y).max(c.y).min(self.last[1]).floor() - top;
            let drawn = away & columns.min(rows).cmpge(Vec4::ZERO);
            if !drawn.any() {
                continue;
            }
            // Twice the areas of the triangles of the first cell's centre and two corners, and how they change.
            let [ax, bx, cx] = [a, b, c].map(|corner| corner.x - left);
            let [ay, by, cy] = [a, b, c].map(|corner| corner.y - top);
            let weights = [
                Plane::of_edge([bx, by], [cx, cy]),
                Plane::of_edge([cx, cy], [ax, ay]),
                Plane::of_edge([ax, ay], [bx, by]),
            ];
            let depth = Plane::mixed(&weights, [a.depth / area, b.depth / area, c.depth / area]);
            let triangle = Triangle {
                planes: [weights[0].to_lanes(), weights[1].to_lanes(), weights[2].to_lanes(), depth.to_lanes()],
                first: (top * self.stride + left).to_array(),
                columns: columns.to_array(),
                rows: rows.to_array(),
            };
            let mut drawn = drawn.bitmask();
            while drawn != 0 {
                let lane = drawn.trailing_zeros() as usize % LANES;
                triangle.draw(lane, self.strides[lane], &mut self.depths[lane]);
                drawn &= drawn - 1;
            }
        }
        self
    }

    /// From each light, the part of the four cells around a place on the maps that do not hide it, by their distance.
    pub fn seen(&self, place: &LightSpacePoint) -> Vec4 {
        let (x, y) = (place.x.min(self.last[0]).max(Vec4::ZERO), place.y.min(self.last[1]).max(Vec4::ZERO));
        let (column, row) = (x.floor(), y.floor());
        let first = (row * self.stride + column).to_array();
        let mut depths = [[f32::NEG_INFINITY; LANES]; 4];
        for lane in 0..LANES {
            let map = &self.depths[lane];
            let above = usize::from(first[lane] as u16);
            let below = above + self.strides[lane];
            if let (Some([a, b]), Some([c, d])) = (map.get(above..above + 2), map.get(below..below + 2)) {
                [depths[0][lane], depths[1][lane], depths[2][lane], depths[3][lane]] = [*a, *b, *c, *d];
            }
        }
        let (x, y) = (x - column, y - row);
        let nearest = place.depth + MARGIN;
        let lit =
            |depths: [f32; LANES], part: Vec4| Vec4::select(Vec4::from_array(depths).cmpgt(nearest), Vec4::ZERO, part);
        let [a, b, c, d] = depths;
        (lit(a, 1.0 - x) + lit(b, x)) * (1.0 - y) + (lit(c, 1.0 - x) + lit(d, x)) * y
    }
}

/// A linear function of column and row, for each light.
struct Plane {
    /// Its value at the first cell.
    at: Vec4,
    /// Its change from one column to the next.
    right: Vec4,
    /// Its change from one row to the next.
    down: Vec4,
}

impl Plane {
    /// Twice the area of the triangle of a cell's centre and an edge; the first cell is at the origin.
    #[inline]
    fn of_edge([x, y]: [Vec4; 2], [to_x, to_y]: [Vec4; 2]) -> Plane {
        let (right, down) = (y - to_y, to_x - x);
        Plane { at: -(right * x + down * y), right, down }
    }

    /// A weighted sum.
    #[inline]
    fn mixed([a, b, c]: &[Plane; 3], [of_a, of_b, of_c]: [Vec4; 3]) -> Plane {
        Plane {
            at: a.at * of_a + b.at * of_b + c.at * of_c,
            right: a.right * of_a + b.right * of_b + c.right * of_c,
            down: a.down * of_a + b.down * of_b + c.down * of_c,
        }
    }

    #[inline]
    fn to_lanes(&self) -> [[f32; LANES]; 3] {
        [self.at.to_array(), self.right.to_array(), self.down.to_array()]
    }
}

/// A triangle on the maps. All values are per light, in arrays, because a vector's lanes are slow to read one by one.
struct Triangle {
    /// The weights of its corners, none of which is positive inside, and its depth: each in the first cell, and its change
    /// from one column and from one row to the next.
    planes: [[[f32; LANES]; 3]; 4],
    /// The first cell in the map's list.
    first: [f32; LANES],
    /// Columns after the first.
    columns: [f32; LANES],
    /// Rows after the first.
    rows: [f32; LANES],
}

impl Triangle {
    /// Draws it on the map of one light.
    #[inline]
    fn draw(&self, lane: usize, stride: usize, depths: &mut [f32]) {
        let first = self.first[lane] as u16;
        let columns = self.columns[lane] as u8;
        let rows = self.rows[lane] as u8;
        let splat = |plane: usize, part: usize| Vec4::splat(self.planes[plane][part][lane]);
        let downs = [splat(0, 2), splat(1, 2), splat(2, 2), splat(3, 2)];
        let mut column = 0;
        while column <= columns {
            let at = Vec4::new(0.0, 1.0, 2.0, 3.0) + f32::from(column);
            let value = |plane: usize| splat(plane, 0) + splat(plane, 1) * at;
            let mut values = [value(0), value(1), value(2), value(3)];
            let mut rest = depths.get_mut(usize::from(first) + usize::from(column)..).unwrap_or_default();
            let mut row = 0;
            while let Some(cells) = rest.first_chunk_mut::<COLUMNS>() {
                let inside = values[0].max(values[1]).max(values[2]).cmple(Vec4::ZERO);
                let before = Vec4::from_array(*cells);
                *cells = Vec4::select(inside, values[3].max(before), before).to_array();
                if row == rows {
                    break;
                }
                row += 1;
                for (value, down) in values.iter_mut().zip(downs) {
                    *value += down;
                }
                rest = rest.get_mut(stride..).unwrap_or_default();
            }
            column += COLUMNS as u8;
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;

    /// The place of a point, the same from all lights.
    fn place(point: Vec3) -> LightSpacePoint {
        let [x, y, depth] = point.to_array().map(Vec4::splat);
        LightSpacePoint { x, y, depth }
    }

    /// A square of two triangles across the light from above, looking up or down.
    fn square(half: f32, z: f32, up: bool) -> ([Vec3; 4], [[u32; 3]; 2]) {
        let corners = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
        let faces = if up { [[0, 1, 2], [0, 2, 3]] } else { [[0, 2, 1], [0, 3, 2]] };
        (corners.map(|[x, y]| Vec3::new(half * x, half * y, z)), faces)
    }

    #[test]
    fn only_sides_that_look_away_from_the_light_hide_what_is_below_them() {
        for (underside, expected) in [(true, 0.0), (false, 1.0)] {
            // A plate above a point, and a lower one far to the side of the light.
            let mut places = vec![];
            let mut faces = vec![];
            for (vertices, triangles) in [square(0.02, 0.03, !underside), square(0.05, 0.0, true)] {
                let first = places.len() as u32;
                faces.extend(triangles.map(|t| t.map(|corner| corner + first)));
                places.extend(vertices.map(place));
            }
            let maps = DepthMaps::new(&faces, &mut places);
            let seen = |x, y, z| maps.seen(&maps.place(place(Vec3::new(x, y, z))));
            assert_eq!(seen(0.0, 0.0, 0.0), Vec4::splat(expected));
            assert_eq!(seen(0.0, 0.0, 0.0295), Vec4::ONE, "nearer than the margin");
            assert_eq!(seen(0.03, 0.0, 0.0), Vec4::ONE);
            assert_eq!(seen(0.0, 0.0, 0.04), Vec4::ONE, "above");
            let edge = seen(0.02, 0.0, 0.0).x;
            assert!(!underside || (0.0..1.0).contains(&edge), "{edge}");
        }
    }

    #[test]
    fn a_cell_has_the_nearest_depth_at_its_centre() {
        // Two leaning triangles, one above the other in places, in a size per light; cells of 2 mm.
        let sizes = [0.003, 0.011, 0.04, 0.2];
        let corners =
            [[0.0, 0.0, 0.0], [0.3, 1.0, 0.2], [1.0, 0.1, -0.1], [0.2, -0.1, -0.3], [0.1, 0.8, 0.4], [0.8, 0.9, 0.1]];
        let sized = |corner: f32| Vec4::from_array(sizes) * corner;
        let mut places = corners.map(|[x, y, z]| LightSpacePoint { x: sized(x), y: sized(y), depth: sized(z) });
        let faces = [[0, 1, 2], [3, 4, 5]];
        let maps = DepthMaps::new(&faces, &mut places);
        for (lane, size) in sizes.into_iter().enumerate() {
            let stride = maps.strides[lane];
            let mut covered = 0;
            for (i, depth) in maps.depths[lane].iter().enumerate() {
                // Weights of the corners at the centre, and the plane's depth there.
                let at = Vec3::new((i % stride) as f32, (i / stride) as f32, 0.0);
                let at_center = |face: &[u32; 3]| {
                    let [a, b, c] = face.map(|corner| {
                        let corner = places[corner as usize];
                        Vec3::new(corner.x[lane], corner.y[lane], corner.depth[lane])
                    });
                    let weight = |p: Vec3, q: Vec3| ((q - p).truncate()).perp_dot((at - p).truncate());
                    let weights = [weight(b, c), weight(c, a), weight(a, b)];
                    let depth = weights[0] * a.z + weights[1] * b.z + weights[2] * c.z;
                    (weights, depth / weights.iter().sum::<f32>())
                };
                let found = faces.each_ref().map(at_center);
                if found.iter().flat_map(|(weights, _)| weights).any(|weight| weight.abs() < 1e-3) {
                    // On an edge, rounding decides.
                    continue;
                }
                let inside = |(weights, _): &&([f32; 3], f32)| weights.iter().all(|weight| *weight < 0.0);
                let nearest = found.iter().filter(inside).map(|(_, depth)| *depth).reduce(f32::max);
                covered += usize::from(nearest.is_some());
                let nearest = nearest.unwrap_or(f32::NEG_INFINITY);
                let equal = *depth == nearest || (depth - nearest).abs() < 1e-6;
                assert!(equal, "{size} m, {i}: {depth} instead of {nearest}");
            }
            let expected = 0.4 * (size / 0.002).powi(2);
            assert!(covered as f32 > 0.5 * expected, "{size} m: {covered} cells instead of about {expected}");
        }
    }

    #[test]
    fn what_is_not_finite_is_no_endless_loop() {
        let (vertices, faces) = square(0.02, 0.03, false);
        for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 1e30] {
            for corner in 0..4 {
                let mut places = vertices.map(place);
                places[corner].y.z = bad;
                let maps = DepthMaps::new(&faces, &mut places);
                for place in &places {
                    let seen = maps.seen(place);
                    assert!(seen.cmpge(Vec4::ZERO).all() && seen.cmple(Vec4::ONE).all(), "{bad}: {seen}");
                }
            }
        }
    }
}
