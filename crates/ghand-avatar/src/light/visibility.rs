//! From which directions light reaches the vertices of a mesh past the mesh itself.
//!
//! For each direction, a depth map of the faces that look away from the light: what a point's light must pass is the side
//! of something else that is turned to the point. Its own surface is not in the map, so that no offset along the normal
//! is needed, and things may touch.

use glam::{DVec3, Vec2, Vec3};
use rayon::prelude::*;

/// Size of a depth map's cells, metres, unless that needs more than [`MOST_CELLS`] of them.
const CELL: f32 = 0.002;
/// Most cells of a map's side.
const MOST_CELLS: usize = 128;
/// A face hides a point only if it is at least this much nearer to the light, metres: a map's depths are those of cell
/// centres, and near a terminator the own surface's far side is close.
const MARGIN: f32 = 0.002;

/// How much of the light from each direction `towards` (unit vectors) reaches each vertex, 0 to 1: one column of V numbers
/// per direction; empty for those not wanted.
pub fn of_vertices(
    faces: &[[u32; 3]],
    vertices: &[DVec3],
    normals: &[DVec3],
    towards: &[DVec3],
    wanted: &(dyn Fn(usize) -> bool + Sync),
) -> Vec<Vec<f32>> {
    // In f32 only relative to a near point.
    let origin = vertices.first().copied().unwrap_or_default();
    let vertices: Vec<Vec3> = vertices.iter().map(|v| (*v - origin).as_vec3()).collect();
    towards
        .par_iter()
        .enumerate()
        .map(|(k, d)| if wanted(k) { from_direction(*d, faces, &vertices, normals) } else { vec![] })
        .collect()
}

fn from_direction(direction: DVec3, faces: &[[u32; 3]], vertices: &[Vec3], normals: &[DVec3]) -> Vec<f32> {
    let across = direction.any_orthonormal_vector();
    let axes = [across, direction.cross(across), direction].map(|axis| axis.as_vec3());
    // Depth grows towards the light.
    let placed: Vec<Vec3> = vertices.iter().map(|v| Vec3::from(axes.map(|axis| axis.dot(*v)))).collect();
    let map = DepthMap::new(faces, &placed);
    let seen = |(point, normal): (&Vec3, &DVec3)| if normal.dot(direction) > 0.0 { map.seen(*point) } else { 0.0 };
    placed.iter().zip(normals).map(seen).collect()
}

/// Depths of the faces that look away from the light.
struct DepthMap {
    start: Vec2,
    cell: f32,
    size: [usize; 2],
    depths: Vec<f32>,
}

impl DepthMap {
    fn new(faces: &[[u32; 3]], points: &[Vec3]) -> DepthMap {
        let (mut low, mut high) = (Vec2::MAX, Vec2::MIN);
        for point in points {
            (low, high) = (low.min(point.truncate()), high.max(point.truncate()));
        }
        let extent = (high - low).max(Vec2::ZERO);
        let cell = CELL.max(extent.max_element() / (MOST_CELLS - 3) as f32);
        // A cell around the mesh stays empty, so that interpolation needs no special case.
        let size = (extent / cell).to_array().map(|cells| cells as usize + 3);
        let mut map =
            DepthMap { start: low - Vec2::splat(cell), cell, size, depths: vec![f32::NEG_INFINITY; size[0] * size[1]] };
        for face in faces {
            map.draw(face.map(|corner| points[corner as usize]));
        }
        map
    }

    /// Column and row of a point; whole numbers are the centres of cells.
    fn place(&self, point: Vec3) -> Vec2 {
        (point.truncate() - self.start) / self.cell - 0.5
    }

    fn draw(&mut self, triangle: [Vec3; 3]) {
        let [a, b, c] = triangle.map(|corner| self.place(corner));
        let area = (b - a).perp_dot(c - a);
        // Counter-clockwise triangles look towards the light.
        if area.is_nan() || area >= 0.0 {
            return;
        }
        // The map has a border: all of these are in it.
        let (first, last) = (a.min(b).min(c).ceil(), a.max(b).max(c).floor());
        for row in first.y as usize..=last.y as usize {
            for column in first.x as usize..=last.x as usize {
                let at = Vec2::new(column as f32, row as f32);
                let weights = [(c - b).perp_dot(at - b), (a - c).perp_dot(at - c), (b - a).perp_dot(at - a)];
                if weights.iter().all(|w| *w <= 0.0) {
                    let depth: f32 = weights.iter().zip(&triangle).map(|(w, corner)| w / area * corner.z).sum();
                    if let Some(slot) = self.depths.get_mut(row * self.size[0] + column) {
                        *slot = slot.max(depth);
                    }
                }
            }
        }
    }

    /// The part of the four cells around a point that do not hide it, by their distance.
    fn seen(&self, point: Vec3) -> f32 {
        let at = self.place(point).max(Vec2::ZERO);
        let (column, row) = (at.x as usize, at.y as usize);
        let (x, y) = (at.x.fract(), at.y.fract());
        let lit = |dx: usize, dy: usize| {
            let (column, row) = ((column + dx).min(self.size[0] - 1), (row + dy).min(self.size[1] - 1));
            let hidden = self.depths[row * self.size[0] + column] > point.z + MARGIN;
            if hidden { 0.0 } else { 1.0 }
        };
        (1.0 - y) * ((1.0 - x) * lit(0, 0) + x * lit(1, 0)) + y * ((1.0 - x) * lit(0, 1) + x * lit(1, 1))
    }
}

#[cfg(test)]
mod tests {
    use ghand_core::light::directions;
    use ghand_hand_model::builtin::builtin_hand;
    use ghand_hand_model::named_poses::named_pose;

    use super::*;

    /// A square of two triangles across the light from above, looking up or down.
    fn square(half: f64, z: f64, up: bool) -> ([DVec3; 4], [[u32; 3]; 2]) {
        let corners = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
        let faces = if up { [[0, 1, 2], [0, 2, 3]] } else { [[0, 2, 1], [0, 3, 2]] };
        (corners.map(|[x, y]| DVec3::new(half * x, half * y, z)), faces)
    }

    #[test]
    fn only_sides_that_look_away_from_the_light_hide_what_is_below_them() {
        for (underside, expected) in [(true, 0.0), (false, 1.0)] {
            // A plate above a point, and a lower one far to the side of the light.
            let (mut points, mut faces) = (vec![], vec![]);
            for (vertices, triangles) in [square(0.02, 0.03, !underside), square(0.05, 0.0, true)] {
                let first = points.len() as u32;
                faces.extend(triangles.map(|t| t.map(|corner| corner + first)));
                points.extend(vertices.map(|v| v.as_vec3()));
            }
            let map = DepthMap::new(&faces, &points);
            assert_eq!(map.seen(Vec3::new(0.0, 0.0, 0.0)), expected);
            assert_eq!(map.seen(Vec3::new(0.0, 0.0, 0.0295)), 1.0, "nearer than the margin");
            assert_eq!(map.seen(Vec3::new(0.03, 0.0, 0.0)), 1.0);
            assert_eq!(map.seen(Vec3::new(0.0, 0.0, 0.04)), 1.0, "above");
            let edge = map.seen(Vec3::new(0.02, 0.0, 0.0));
            assert!(!underside || (0.0..1.0).contains(&edge), "{edge}");
        }
    }

    /// Whether a ray meets a triangle in front of its start, by Cramer's rule.
    fn meets(from: DVec3, along: DVec3, [a, b, c]: [DVec3; 3]) -> bool {
        let (p, q) = (b - a, c - a);
        let normal = along.cross(q);
        let determinant = p.dot(normal);
        let start = from - a;
        let u = start.dot(normal) / determinant;
        let other = start.cross(p);
        let v = along.dot(other) / determinant;
        u >= 0.0 && v >= 0.0 && u + v <= 1.0 && q.dot(other) / determinant > 0.0
    }

    #[test]
    fn vertices_of_a_hand_see_what_rays_from_them_see() {
        let model = builtin_hand(ghand_core::Side::Right).unwrap();
        for name in ["open", "fist", "pinch"] {
            let pose = named_pose(name, &model).unwrap();
            let vertices = ghand_core::posing::pose_hand(&model, &[], &pose).unwrap().vertices;
            let normals = model.vertex_normals(&vertices);
            let chosen = [3, 20, 41, 60];
            let columns = of_vertices(&model.faces, &vertices, &normals, &directions(), &|k| chosen.contains(&k));
            let (mut agree, mut count, mut hidden) = (0.0, 0.0, 0.0);
            for (k, column) in columns.iter().enumerate() {
                assert_eq!(column.len(), if chosen.contains(&k) { vertices.len() } else { 0 });
            }
            for k in chosen {
                let d = directions()[k];
                for v in (0..vertices.len()).step_by(17) {
                    let cosine = normals[v].dot(d);
                    if cosine <= 0.2 {
                        continue;
                    }
                    let from = vertices[v] + normals[v] * 0.002;
                    let triangle = |face: &[u32; 3]| face.map(|corner| vertices[corner as usize]);
                    let lit = !model.faces.iter().any(|face| meets(from, d, triangle(face)));
                    count += 1.0;
                    hidden += if lit { 0.0 } else { 1.0 };
                    agree += 1.0 - (f64::from(columns[k][v]) - if lit { 1.0 } else { 0.0 }).abs();
                }
            }
            println!("{name}: {:.3} agree, {:.3} hidden", agree / count, hidden / count);
            // Edges of shadows are soft, and in a fist skin lies on skin.
            let least = if name == "fist" { 0.88 } else { 0.95 };
            assert!(agree / count > least, "{name}: {}", agree / count);
            assert!(name == "open" || hidden / count > 0.1, "{name}: {}", hidden / count);
        }
    }
}
