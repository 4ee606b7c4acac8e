//! From which directions light reaches the vertices of a mesh past the mesh itself.
//!
//! For each direction, a depth map of the faces that look away from the light: what a point's light must pass is the side
//! of something else that is turned to the point. Its own surface is not in the map, so that no offset along the normal
//! is needed, and things may touch.

use ghand_core::light::cosine_transfer;
use glam::{DVec3, Vec3, Vec4};
use rayon::prelude::*;

use super::depth_maps::{DepthMaps, LANES, LightSpacePoint};

/// The transfer of each vertex from each direction `towards` (unit vectors): `ghand_core::light::cosine_transfer` times how
/// much of the light reaches the vertex past the mesh, 0 to 1. One column of V numbers per direction.
pub fn vertex_transfers(faces: &[[u32; 3]], vertices: &[DVec3], normals: &[DVec3], towards: &[DVec3]) -> Vec<Vec<f32>> {
    // In f32 only relative to a near point.
    let origin = vertices.first().copied().unwrap_or_default();
    let vertices: Vec<[Vec3; 2]> =
        vertices.iter().zip(normals).map(|(v, n)| [(*v - origin).as_vec3(), n.as_vec3()]).collect();
    let groups = groups_of_neighbors(towards, (0..towards.len()).collect());
    let transfers = |group: &Vec<usize>| {
        // The last group may have fewer than the lanes.
        from_directions(std::array::from_fn(|lane| towards[group[lane % group.len()]]), faces, &vertices)
    };
    let found: Vec<[Vec<f32>; LANES]> = groups.par_iter().map(transfers).collect();
    let mut columns = vec![vec![]; towards.len()];
    for (k, column) in groups.iter().zip(found).flat_map(|(group, found)| group.iter().zip(found)) {
        columns[*k] = column;
    }
    columns
}

/// Groups of directions that are close to each other, of [`LANES`] but for the last: mostly the same faces look away from
/// them.
fn groups_of_neighbors(towards: &[DVec3], mut rest: Vec<usize>) -> Vec<Vec<usize>> {
    let mut groups = vec![];
    while let Some(first) = rest.last().map(|k| towards[*k]) {
        rest.sort_by(|a, b| towards[*a].dot(first).total_cmp(&towards[*b].dot(first)));
        groups.push(rest.split_off(rest.len().saturating_sub(LANES)));
    }
    groups
}

/// The transfers of vertices, given with their normals, from each of these directions.
fn from_directions(directions: [DVec3; LANES], faces: &[[u32; 3]], vertices: &[[Vec3; 2]]) -> [Vec<f32>; LANES] {
    let axes = light_axes(directions);
    let place = |v: Vec3| LightSpacePoint { x: axes[0].dot(v), y: axes[1].dot(v), depth: axes[2].dot(v) };
    received(faces, vertices, &place, &|[_, normal]| axes[2].dot(normal))
}

/// Largest factor on the strength of a lamp where it is nearer to a vertex than to the place where it has its strength.
const MOST_NEARER: f32 = 9.0;
/// Nothing is nearer to a lamp, along its axis, than this part of its distance: what is beside or behind it is no hand.
const LEAST_ALONG: f32 = 0.1;

/// As [`vertex_transfers`], from the points of one lamp on average (metres, world axes). It is as strong as a direction is
/// at a distance of `unit` metres.
pub(super) fn lamp_transfers(
    faces: &[[u32; 3]],
    vertices: &[DVec3],
    normals: &[DVec3],
    lamp: &[DVec3],
    unit: f64,
) -> Vec<f32> {
    let origin = vertices.iter().sum::<DVec3>() / vertices.len().max(1) as f64;
    let vertices: Vec<[Vec3; 2]> =
        vertices.iter().zip(normals).map(|(v, n)| [(*v - origin).as_vec3(), n.as_vec3()]).collect();
    let groups: Vec<&[DVec3]> = lamp.chunks(LANES).collect();
    let from_points = |group: &&[DVec3]| {
        // The last group may have fewer than the lanes.
        let points: [DVec3; LANES] = std::array::from_fn(|lane| group[lane % group.len()] - origin);
        from_points(points, unit, faces, &vertices)
    };
    let found: Vec<[Vec<f32>; LANES]> = groups.par_iter().map(from_points).collect();
    let mut column = vec![0.0; vertices.len()];
    for of_point in groups.iter().zip(&found).flat_map(|(group, found)| found.iter().take(group.len())) {
        column.iter_mut().zip(of_point).for_each(|(sum, transfer)| *sum += transfer / lamp.len() as f32);
    }
    column
}

/// The transfers of vertices, given with their normals, from each of these points.
fn from_points(points: [DVec3; LANES], unit: f64, faces: &[[u32; 3]], vertices: &[[Vec3; 2]]) -> [Vec<f32>; LANES] {
    let axes = light_axes(points.map(|point| point.try_normalize().unwrap_or(DVec3::Z)));
    let points = Lanes::new(points);
    let far = axes[2].dot_lanes(&points.0);
    // Divided by the distance along the axis, rays from a point are parallel, and planes stay planes. At the origin lengths
    // stay metres.
    let place = |v: Vec3| {
        let to = points.from(v);
        let scale = far / axes[2].dot_lanes(&to).max(LEAST_ALONG * far);
        let across = |axis: &Lanes| -axis.dot_lanes(&to) * scale;
        LightSpacePoint { x: across(&axes[0]), y: across(&axes[1]), depth: far * scale }
    };
    let unit = Vec4::splat((unit * unit) as f32);
    received(faces, vertices, &place, &|[vertex, normal]| {
        let to = points.from(vertex);
        let squared = to[0] * to[0] + to[1] * to[1] + to[2] * to[2];
        let distance = Vec4::from_array(squared.to_array().map(f32::sqrt)).max(Vec4::splat(f32::MIN_POSITIVE));
        let cosine = (to[0] * normal.x + to[1] * normal.y + to[2] * normal.z) / distance;
        cosine * (unit / squared.max(Vec4::splat(f32::MIN_POSITIVE))).min(Vec4::splat(MOST_NEARER))
    })
}

/// Axes across each of these directions, across both, and along it: depth grows towards the light.
fn light_axes(directions: [DVec3; LANES]) -> [Lanes; 3] {
    let across = directions.map(DVec3::any_orthonormal_vector);
    let other: [DVec3; LANES] = std::array::from_fn(|lane| directions[lane].cross(across[lane]));
    [across, other, directions].map(Lanes::new)
}

/// What vertices, given with their normals, get of light: what one that nothing hides gets, and the part that is not
/// hidden where light sees it.
fn received(
    faces: &[[u32; 3]],
    vertices: &[[Vec3; 2]],
    place: &dyn Fn(Vec3) -> LightSpacePoint,
    open: &dyn Fn([Vec3; 2]) -> Vec4,
) -> [Vec<f32>; LANES] {
    let mut places: Vec<LightSpacePoint> = vertices.iter().map(|[v, _]| place(*v)).collect();
    let maps = DepthMaps::new(faces, &mut places);
    let unshadowed = cosine_transfer(DVec3::Z, DVec3::Z) as f32;
    let mut columns = [const { vec![] }; LANES].map(|_: Vec<f32>| vec![0.0; vertices.len()]);
    for (v, (place, vertex)) in places.iter().zip(vertices).enumerate() {
        let open = open(*vertex).max(Vec4::ZERO);
        if open != Vec4::ZERO {
            let transfers = open * unshadowed * maps.seen(place);
            for (column, transfer) in columns.iter_mut().zip(transfers.to_array()) {
                column[v] = transfer;
            }
        }
    }
    columns
}

/// A vector per direction.
struct Lanes([Vec4; 3]);

impl Lanes {
    fn new(vectors: [DVec3; LANES]) -> Lanes {
        Lanes([0, 1, 2].map(|i| Vec4::from_array(vectors.map(|vector| vector[i] as f32))))
    }

    /// Its products with one vector.
    fn dot(&self, other: Vec3) -> Vec4 {
        self.0[0] * other.x + self.0[1] * other.y + self.0[2] * other.z
    }

    /// Its products with others, one each.
    fn dot_lanes(&self, other: &[Vec4; 3]) -> Vec4 {
        self.0[0] * other[0] + self.0[1] * other[1] + self.0[2] * other[2]
    }

    /// From a point to each of these.
    fn from(&self, point: Vec3) -> [Vec4; 3] {
        [self.0[0] - point.x, self.0[1] - point.y, self.0[2] - point.z]
    }
}

#[cfg(test)]
pub(super) mod tests {
    use ghand_core::light::directions;
    use ghand_hand_model::builtin::builtin_hand;
    use ghand_hand_model::named_poses::named_pose;

    use super::*;

    /// Whether a ray meets a triangle in front of its start, by Cramer's rule.
    pub fn meets(from: DVec3, along: DVec3, [a, b, c]: [DVec3; 3]) -> bool {
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
            let columns = vertex_transfers(&model.faces, &vertices, &normals, &directions());
            let mut agree = 0.0;
            let mut count = 0.0;
            let mut hidden = 0.0;
            assert!(columns.len() == 64 && columns.iter().all(|column| column.len() == vertices.len()));
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
                    let seen = f64::from(columns[k][v]) / cosine_transfer(normals[v], d);
                    agree += 1.0 - (seen - if lit { 1.0 } else { 0.0 }).abs();
                }
            }
            println!("{name}: {:.3} agree, {:.3} hidden", agree / count, hidden / count);
            // Edges of shadows are soft, and in a fist skin lies on skin: 0.833 agree there.
            let least = if name == "fist" { 0.82 } else { 0.95 };
            assert!(agree / count > least, "{name}: {}", agree / count);
            assert!(name == "open" || hidden / count > 0.1, "{name}: {}", hidden / count);
        }
    }
}
