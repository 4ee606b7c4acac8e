//! A finer mesh of the same hand, whose outlines are round where the model's are polygons.

use std::collections::HashMap;

use ghand_core::HandModel;
use glam::{DVec2, DVec3};

/// The hand with each triangle divided into four. Its own vertices come first and stay; those in the middles of edges lie on
/// the curved triangles that its vertex normals span (A. Vlachos et al., Curved PN Triangles, 2001). All else that belongs
/// to vertices is the mean of the edge's ends.
pub fn smoothed(model: &HandModel) -> HandModel {
    let normals = model.vertex_normals(&model.vertices);
    let mut edges = Middles::after(model.vertices.len());
    let faces = split(&model.faces, |a, b| edges.number(a, b));
    let mut uv_edges = Middles::after(model.uvs.len());
    let face_uvs = split(&model.face_uvs, |a, b| uv_edges.number(a, b));
    let middle = |[a, b]: &[usize; 2]| {
        let along = model.vertices[*b] - model.vertices[*a];
        let sink = along.dot(normals[*a]) * normals[*a] - along.dot(normals[*b]) * normals[*b];
        0.5 * (model.vertices[*a] + model.vertices[*b]) - sink / 8.0
    };
    let uv_middle = |[a, b]: &[usize; 2]| -> DVec2 { 0.5 * (model.uvs[*a] + model.uvs[*b]) };
    let with_means = |rows: &[DVec3]| -> Vec<DVec3> {
        let count = model.vertices.len().max(1);
        let mut fine = Vec::with_capacity(rows.len() / count * (count + edges.ends.len()));
        for row in rows.chunks_exact(count) {
            fine.extend_from_slice(row);
            fine.extend(edges.ends.iter().map(|[a, b]| 0.5 * (row[*a] + row[*b])));
        }
        fine
    };
    let mean_weights = |[a, b]: &[usize; 2]| -> Vec<f64> {
        model.vertex_weights(*a).iter().zip(model.vertex_weights(*b)).map(|(x, y)| 0.5 * (x + y)).collect()
    };
    HandModel {
        vertices: [model.vertices.clone(), edges.ends.iter().map(middle).collect()].concat(),
        uvs: [model.uvs.clone(), uv_edges.ends.iter().map(uv_middle).collect()].concat(),
        weights: [model.weights.clone(), edges.ends.iter().flat_map(mean_weights).collect()].concat(),
        shape_directions: with_means(&model.shape_directions),
        pose_directions: with_means(&model.pose_directions),
        faces,
        face_uvs,
        ..model.clone()
    }
}

/// Divides each triangle into four, with the corners that `middle` names for the middles of its edges.
pub fn split(faces: &[[u32; 3]], mut middle: impl FnMut(u32, u32) -> u32) -> Vec<[u32; 3]> {
    let mut fine = Vec::with_capacity(4 * faces.len());
    for &[a, b, c] in faces {
        let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
        fine.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
    }
    fine
}

/// Numbers for the middles of edges, in the order in which they are asked for.
struct Middles {
    first: usize,
    ends: Vec<[usize; 2]>,
    numbers: HashMap<[u32; 2], u32>,
}

impl Middles {
    fn after(corners: usize) -> Middles {
        Middles { first: corners, ends: vec![], numbers: HashMap::new() }
    }

    fn number(&mut self, a: u32, b: u32) -> u32 {
        let ends = [a.min(b), a.max(b)];
        *self.numbers.entry(ends).or_insert_with(|| {
            self.ends.push(ends.map(|end| end as usize));
            (self.first + self.ends.len() - 1) as u32
        })
    }
}

#[cfg(test)]
mod tests {
    use ghand_core::Pose;
    use ghand_core::posing::pose_hand;
    use ghand_test_support::procedural_hand::ProceduralHand;

    use super::*;

    #[test]
    fn the_finer_hand_is_the_same_hand_in_any_pose() {
        let model = ProceduralHand::default().build().unwrap();
        let fine = smoothed(&model);
        let edges = model.faces.len() * 3 / 2;
        assert_eq!(fine.faces.len(), 4 * model.faces.len());
        assert!(
            fine.vertices.len().abs_diff(model.vertices.len() + edges) < edges / 10,
            "seams of a welded mesh are few"
        );
        assert_eq!(fine.validate(), Ok(()));
        let mut pose = Pose::rest(model.joint_count());
        pose.rotations.iter_mut().for_each(|rotation| *rotation = DVec3::new(0.1, -0.2, 0.3));
        let [own, finer] = [&model, &fine].map(|model| pose_hand(model, &[], &pose).unwrap());
        assert_eq!(own.vertices[..], finer.vertices[..model.vertices.len()]);
        assert_eq!(own.joints, finer.joints);
    }

    #[test]
    fn an_octahedron_becomes_rounder() {
        let mut model = ProceduralHand::default().build().unwrap();
        model.vertices = vec![DVec3::X, DVec3::Y, DVec3::Z, -DVec3::X, -DVec3::Y, -DVec3::Z];
        let half = [[0, 1, 2], [1, 3, 2], [3, 4, 2], [4, 0, 2]];
        model.faces = half.into_iter().flat_map(|[a, b, c]| [[a, b, c], [b, a, 5]]).collect();
        model.face_uvs = vec![[0; 3]; model.faces.len()];
        model.weights = vec![1.0 / model.joint_count() as f64; 6 * model.joint_count()];
        (model.shape_directions, model.pose_directions) = (vec![], vec![]);
        let fine = smoothed(&model);
        assert_eq!((fine.vertices.len(), fine.faces.len()), (6 + 12, 32));
        // Two quarter arcs of a cubic curve end in the middle of each edge: 5/8 of both ends, where a sphere has 0.71.
        for v in &fine.vertices[6..] {
            assert!((v.length() - 0.625 * 2.0_f64.sqrt()).abs() < 1e-12, "{v}");
        }
    }
}
