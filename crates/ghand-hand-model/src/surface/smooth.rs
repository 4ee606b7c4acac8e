//! A finer mesh of the same hand, whose outlines are round where the model's are polygons.

use std::collections::HashMap;

use ghand_core::HandModel;
use glam::DVec3;

use super::SurfaceSamples;

/// A mesh with each of its triangles divided into four. The mesh's own vertices come first, then the middles of its edges.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Division {
    /// The vertices at the ends of each edge.
    pub ends: Vec<[u32; 2]>,
    /// Triangles, four for each, in its order.
    pub faces: Vec<[u32; 3]>,
}

impl Division {
    /// Of a mesh with so many vertices.
    pub fn new(faces: &[[u32; 3]], vertices: usize) -> Division {
        let mut ends = vec![];
        let mut numbers = HashMap::new();
        let faces = split(faces, |a, b| {
            let edge = [a.min(b), a.max(b)];
            *numbers.entry(edge).or_insert_with(|| {
                ends.push(edge);
                (vertices + ends.len() - 1) as u32
            })
        });
        Division { ends, faces }
    }

    /// What `middle` makes of the values at both ends of each edge, in the order of the edges.
    pub fn middles<'a, T, U>(
        &'a self,
        values: &'a [T],
        middle: impl Fn(&T, &T) -> U + 'a,
    ) -> impl Iterator<Item = U> + 'a {
        self.ends.iter().map(move |[a, b]| middle(&values[*a as usize], &values[*b as usize]))
    }

    /// All vertices of a mesh, from its own and their normals (unit vectors): the middles lie on the curved triangles that
    /// these span (A. Vlachos et al., Curved PN Triangles, 2001).
    pub fn positions(&self, vertices: &[DVec3], normals: &[DVec3]) -> Vec<DVec3> {
        let middle = |[a, b]: &[u32; 2]| {
            let [a, b] = [*a, *b].map(|end| (vertices[end as usize], normals[end as usize]));
            let along = b.0 - a.0;
            0.5 * (a.0 + b.0) - (along.dot(a.1) * a.1 - along.dot(b.1) * b.1) / 8.0
        };
        vertices.iter().copied().chain(self.ends.iter().map(middle)).collect()
    }
}

/// The hand with each triangle divided into four, as [`Division`] says. All but positions of what belongs to the middle of
/// an edge is the mean of its ends.
pub fn smoothed(model: &HandModel) -> HandModel {
    let count = model.vertices.len();
    let division = Division::new(&model.faces, count);
    let uvs = Division::new(&model.face_uvs, model.uvs.len());
    let mean = |a: &DVec3, b: &DVec3| 0.5 * (*a + *b);
    let with_means = |rows: &[DVec3]| -> Vec<DVec3> {
        let row = |row: &'_ [DVec3]| row.iter().copied().chain(division.middles(row, mean)).collect::<Vec<_>>();
        rows.chunks_exact(count.max(1)).flat_map(row).collect()
    };
    let mean_weights = |[a, b]: &[u32; 2]| -> Vec<f64> {
        let [a, b] = [*a, *b].map(|end| model.vertex_weights(end as usize));
        a.iter().zip(b).map(|(x, y)| 0.5 * (x + y)).collect()
    };
    HandModel {
        vertices: division.positions(&model.vertices, &model.vertex_normals(&model.vertices)),
        uvs: model.uvs.iter().copied().chain(uvs.middles(&model.uvs, |a, b| 0.5 * (*a + *b))).collect(),
        weights: [model.weights.clone(), division.ends.iter().flat_map(mean_weights).collect()].concat(),
        shape_directions: with_means(&model.shape_directions),
        pose_directions: with_means(&model.pose_directions),
        faces: division.faces,
        face_uvs: uvs.faces,
        ..model.clone()
    }
}

impl SurfaceSamples {
    /// The same texels on the finer mesh of the hand that was sampled, [`smoothed`].
    #[must_use]
    pub fn on_smoothed(&self, model: &HandModel, smoothed: &HandModel) -> SurfaceSamples {
        let (faces, barycentric): (Vec<u32>, Vec<[f64; 3]>) =
            self.faces.iter().zip(&self.barycentric).map(|(face, b)| place(*face, *b)).unzip();
        let area = |of: &HandModel, face: u32| {
            let [a, b, c] = of.faces[face as usize].map(|v| of.vertices[v as usize]);
            (b - a).cross(c - a).length()
        };
        let vertex_normals = smoothed.vertex_normals(&smoothed.vertices);
        let at = |values: &[DVec3], point: usize| -> DVec3 {
            let corners = smoothed.faces[faces[point] as usize];
            barycentric[point].iter().zip(corners).map(|(b, corner)| *b * values[corner as usize]).sum()
        };
        let points = || 0..self.len();
        let spacing = |point: usize| {
            let [own, part] = [area(model, self.faces[point]), area(smoothed, faces[point])];
            let grown = 4.0 * part / own;
            self.spacings[point] * if grown.is_finite() { grown.sqrt() } else { 1.0 }
        };
        SurfaceSamples {
            positions: points().map(|point| at(&smoothed.vertices, point)).collect(),
            normals: points().map(|point| at(&vertex_normals, point).normalize_or(self.normals[point])).collect(),
            spacings: points().map(spacing).collect(),
            faces: faces.clone(),
            barycentric: barycentric.clone(),
            ..self.clone()
        }
    }
}

/// The triangle of the finer mesh on which a point of a triangle lies, and its barycentric coordinates there.
pub fn place(face: u32, [x, y, z]: [f64; 3]) -> (u32, [f64; 3]) {
    let (part, within) = if x >= 0.5 {
        (0, [2.0 * x - 1.0, 2.0 * y, 2.0 * z])
    } else if y >= 0.5 {
        (1, [2.0 * x, 2.0 * y - 1.0, 2.0 * z])
    } else if z >= 0.5 {
        (2, [2.0 * x, 2.0 * y, 2.0 * z - 1.0])
    } else {
        (3, [1.0 - 2.0 * z, 1.0 - 2.0 * x, 1.0 - 2.0 * y])
    };
    (4 * face + part, within)
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

#[cfg(test)]
mod tests {
    use ghand_core::Pose;
    use ghand_core::posing::pose_hand;
    use ghand_test_support::procedural_hand::ProceduralHand;

    use super::*;
    use crate::surface::sample_surface;

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
    fn a_point_has_its_place_on_one_of_the_four_parts() {
        let corners = [DVec3::ZERO, DVec3::X, DVec3::Y];
        let division = Division::new(&[[0, 1, 2]], 3);
        let vertices = division.positions(&corners, &[DVec3::Z; 3]);
        let mut parts = [0; 4];
        for (i, j) in (0..=8).flat_map(|i| (0..=8 - i).map(move |j| (i, j))) {
            let b = [f64::from(i) / 8.0, f64::from(j) / 8.0, f64::from(8 - i - j) / 8.0];
            let (face, within) = place(0, b);
            let at =
                |b: [f64; 3], corners: [DVec3; 3]| b.iter().zip(corners).map(|(b, corner)| *b * corner).sum::<DVec3>();
            assert!(within.iter().all(|b| *b >= 0.0), "{within:?}");
            assert_eq!(at(b, corners), at(within, division.faces[face as usize].map(|v| vertices[v as usize])));
            parts[face as usize] += 1;
        }
        assert_eq!(parts, [15, 14, 13, 3]);
    }

    #[test]
    fn points_of_the_finer_mesh_are_the_same_texels_near_the_same_places() {
        let model = ProceduralHand::default().build().unwrap();
        let own = sample_surface(&model, 160).unwrap();
        let fine = own.on_smoothed(&model, &smoothed(&model));
        assert!(own.faces.iter().zip(&fine.faces).all(|(own, fine)| *own == fine / 4));
        let moved: Vec<f64> = own.positions.iter().zip(&fine.positions).map(|(a, b)| a.distance(*b)).collect();
        let most = moved.iter().copied().fold(0.0, f64::max);
        assert!(most > 1e-5 && most < 1e-3, "{most}");
        assert!(own.normals.iter().zip(&fine.normals).all(|(a, b)| a.dot(*b) > 0.7));
        // Sampled anew, they are the same but for texels on edges.
        let anew = sample_surface(&smoothed(&model), 160).unwrap();
        assert_eq!((&own.texels, &own.weights.len()), (&anew.texels, &anew.weights.len()));
        assert!(own.weights.iter().zip(&anew.weights).all(|(a, b)| (a - b).abs() < 1e-12), "linear on each triangle");
        assert!(fine.positions.iter().zip(&anew.positions).all(|(a, b)| a.distance(*b) < 1e-12));
        assert!(fine.normals.iter().zip(&anew.normals).all(|(a, b)| a.distance(*b) < 1e-9));
        let same = fine.spacings.iter().zip(&anew.spacings).filter(|(a, b)| (*a - *b).abs() < 1e-12).count();
        assert!(same * 100 > 99 * own.len(), "{same} of {}", own.len());
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
