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
/// much of the light reaches the vertex past the mesh, 0 to 1. One column of V numbers per direction; empty for those not
/// wanted.
pub fn vertex_transfers(
    faces: &[[u32; 3]],
    vertices: &[DVec3],
    normals: &[DVec3],
    towards: &[DVec3],
    wanted: &(dyn Fn(usize) -> bool + Sync),
) -> Vec<Vec<f32>> {
    // In f32 only relative to a near point.
    let origin = vertices.first().copied().unwrap_or_default();
    let vertices: Vec<[Vec3; 2]> =
        vertices.iter().zip(normals).map(|(v, n)| [(*v - origin).as_vec3(), n.as_vec3()]).collect();
    let groups = groups_of_neighbors(towards, (0..towards.len()).filter(|k| wanted(*k)).collect());
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
    let across = directions.map(DVec3::any_orthonormal_vector);
    let other: [DVec3; LANES] = std::array::from_fn(|lane| directions[lane].cross(across[lane]));
    // Depth grows towards the light.
    let axes = [across, other, directions].map(Lanes::new);
    let mut places: Vec<LightSpacePoint> = vertices
        .iter()
        .map(|[v, _]| LightSpacePoint { x: axes[0].dot(*v), y: axes[1].dot(*v), depth: axes[2].dot(*v) })
        .collect();
    let maps = DepthMaps::new(faces, &mut places);
    let unshadowed = cosine_transfer(DVec3::Z, DVec3::Z) as f32;
    let mut columns = [const { vec![] }; LANES].map(|_: Vec<f32>| vec![0.0; vertices.len()]);
    for (v, (place, [_, normal])) in places.iter().zip(vertices).enumerate() {
        let cosines = axes[2].dot(*normal).max(Vec4::ZERO);
        if cosines != Vec4::ZERO {
            let transfers = cosines * unshadowed * maps.seen(place);
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
}

#[cfg(test)]
mod tests {
    use ghand_core::light::directions;
    use ghand_hand_model::builtin::builtin_hand;
    use ghand_hand_model::named_poses::named_pose;

    use super::*;

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
            let columns = vertex_transfers(&model.faces, &vertices, &normals, &directions(), &|k| chosen.contains(&k));
            let mut agree = 0.0;
            let mut count = 0.0;
            let mut hidden = 0.0;
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
