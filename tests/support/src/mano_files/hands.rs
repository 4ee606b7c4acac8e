//! Hands with synthetic numbers, to be written to MANO files.

use ghand_hand_model::files::mano::PARENTS;
use glam::DVec3;

use super::python::{Array, Py, array, chumpy_selection, dictionary, npy, pickle, sparse_columns, string, zip};
use crate::procedural_hand::ProceduralHand;

/// The content of a MANO file. The arrays are row-major, with the axes of the file.
#[derive(Clone)]
pub struct Hand {
    pub vertices: Vec<f64>,
    pub faces: Vec<f64>,
    pub parents: Vec<Option<usize>>,
    pub weights: Vec<f64>,
    pub regressor: Vec<Vec<(u32, f64)>>,
    /// Number of shape directions, and of those that are selected in the published layout.
    pub shapes: (usize, usize),
    pub shape_directions: Vec<f64>,
    pub pose_directions: Vec<f64>,
    pub mean: Vec<f64>,
    pub components: Vec<f64>,
}

/// Keys and values of a file.
pub type Entries = Vec<(&'static str, Py)>;

/// A number between -1 and 1 with a full mantissa, different for each `k`.
pub fn number(k: usize) -> f64 {
    let mut bits = (k as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    bits = (bits ^ (bits >> 29)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    ((bits ^ (bits >> 32)) >> 11) as f64 / (1u64 << 52) as f64 - 1.0
}

impl Hand {
    /// Three joints in a row and five vertices.
    pub fn small() -> Hand {
        let vertices: Vec<f64> = [[0., 0., 0.], [2., 0., 0.], [2., 1., 0.], [0., 1., 0.], [1., 1., 1.]].concat();
        let weights = [[1., 0., 0.], [0.25, 0.75, 0.], [0., 1., 0.], [0., 0.5, 0.5], [0., 0., 1.]].concat();
        let regressor = vec![vec![(0, 0.5), (3, 0.5)], vec![(1, 0.25), (4, 0.75)], vec![(2, 1.0)]];
        let faces = [[0., 2., 1.], [0., 3., 2.], [0., 1., 4.]].concat();
        Hand::of(vertices, faces, vec![None, Some(0), Some(1)], weights, regressor, (3, 2))
    }

    /// A hand with MANO's joints and this many vertices, spread over the built-in hand; the triangles between them are
    /// arbitrary unless all vertices are requested.
    pub fn procedural(count: usize, shapes: (usize, usize)) -> Hand {
        let model = ProceduralHand { detail: 1, ..Default::default() }.build().unwrap();
        let chosen: Vec<usize> = (0..count).map(|k| k * model.vertices.len() / count).collect();
        let vertices: Vec<DVec3> = chosen.iter().map(|i| model.vertices[*i]).collect();
        let weights = chosen.iter().flat_map(|i| model.vertex_weights(*i).to_vec()).collect();
        let faces = if count == model.vertices.len() {
            model.faces.iter().flatten().map(|i| f64::from(*i)).collect()
        } else {
            (0..2 * count - 4).flat_map(|k| [k, k + 1, k + 2].map(|i| (i % count) as f64)).collect()
        };
        // The mean of the vertices around a joint is near it; a regressor of MANO has about as many.
        let regressor = model.joints.iter().map(|joint| {
            let mut near: Vec<u32> = (0..count as u32).collect();
            near.sort_by(|a, b| {
                let distance = |i: &u32| vertices[*i as usize].distance_squared(*joint);
                distance(a).total_cmp(&distance(b))
            });
            near.truncate(10);
            near.sort_unstable();
            near.into_iter().map(|i| (i, 0.1 + 1e-9 * number(i as usize))).collect()
        });
        let regressor = regressor.collect();
        let vertices = vertices.iter().flat_map(DVec3::to_array).collect();
        Hand::of(vertices, faces, PARENTS.to_vec(), weights, regressor, shapes)
    }

    fn of(
        vertices: Vec<f64>,
        faces: Vec<f64>,
        parents: Vec<Option<usize>>,
        weights: Vec<f64>,
        regressor: Vec<Vec<(u32, f64)>>,
        shapes: (usize, usize),
    ) -> Hand {
        let n = vertices.len();
        let bones = parents.len() - 1;
        // The first direction is growth along all axes, which distinguishes left from right; the others are small.
        let growth = |at: usize| match at % shapes.0 {
            0 => 0.1 * vertices[at / shapes.0] + 1e-4 * number(at),
            _ => 1e-4 * number(at),
        };
        Hand {
            faces,
            parents,
            weights,
            regressor,
            shapes,
            shape_directions: (0..n * shapes.0).map(growth).collect(),
            pose_directions: (0..n * 9 * bones).map(|k| 1e-3 * number(k + 7)).collect(),
            mean: (0..3 * bones).map(|k| 0.3 * number(k + 77)).collect(),
            components: (0..9 * bones * bones).map(|k| number(k + 777)).collect(),
            vertices,
        }
    }

    pub fn vertex_count(&self) -> usize {
        self.vertices.len() / 3
    }

    /// The mirror image in x, with flipped triangles.
    pub fn mirrored(&self) -> Hand {
        let mut hand = self.clone();
        let flip = |values: &mut Vec<f64>, width: usize| {
            values.chunks_mut(3 * width).flat_map(|row| row.iter_mut().take(width)).for_each(|x| *x = -*x);
        };
        flip(&mut hand.vertices, 1);
        flip(&mut hand.shape_directions, self.shapes.0);
        flip(&mut hand.pose_directions, 9 * (self.parents.len() - 1));
        hand.faces.chunks_mut(3).for_each(|face| face.swap(1, 2));
        hand
    }

    /// The selected shape directions, `(V, 3, n_s)`.
    pub fn selected_shapes(&self) -> Vec<f64> {
        let (all, used) = self.shapes;
        self.shape_directions.chunks(all).flat_map(|row| row[..used].to_vec()).collect()
    }

    /// Joints as stored in the file, `(n_b, 3)`.
    fn joints(&self) -> Vec<f64> {
        let joint =
            |row: &Vec<(u32, f64)>, axis| row.iter().map(|(i, w)| self.vertices[3 * *i as usize + axis] * w).sum();
        self.regressor.iter().flat_map(|row| [0, 1, 2].map(|axis| joint(row, axis))).collect()
    }

    fn arrays(&self) -> Vec<(&'static str, Array)> {
        let (v, n) = (self.vertex_count(), self.parents.len());
        let tree =
            self.parents.iter().map(|p| p.map_or(f64::from(u32::MAX), |p| p as f64)).chain((0..n).map(|k| k as f64));
        let bones = n - 1;
        vec![
            ("hands_components", array("<f8", &[3 * bones, 3 * bones], false, &self.components)),
            ("f", array("<u4", &[self.faces.len() / 3, 3], false, &self.faces)),
            ("kintree_table", array("<u4", &[2, n], false, &tree.collect::<Vec<f64>>())),
            ("J", array("<f8", &[n, 3], false, &self.joints())),
            ("weights", array("<f8", &[v, n], true, &self.weights)),
            ("posedirs", array("<f8", &[v, 3, 9 * bones], true, &self.pose_directions)),
            ("hands_mean", array("<f8", &[3 * bones], false, &self.mean)),
            ("v_template", array("<f8", &[v, 3], true, &self.vertices)),
        ]
    }

    /// The layout of the published files: chumpy's wrappers, a sparse regressor, arrays of both orders.
    pub fn published(&self) -> Entries {
        let mut entries: Entries = self.arrays().into_iter().map(|(key, array)| (key, Py::Array(array))).collect();
        let shapes = array("<f8", &[self.vertex_count(), 3, self.shapes.0], false, &self.shape_directions);
        entries.push(("shapedirs", chumpy_selection(shapes, self.shapes.1)));
        entries.push(("J_regressor", sparse_columns(self.vertex_count(), &self.regressor)));
        entries.push(("bs_style", string("lbs")));
        entries.push(("bs_type", string("lrotmin")));
        entries
    }

    /// Only NumPy arrays.
    pub fn plain(&self) -> Entries {
        let (v, n) = (self.vertex_count(), self.parents.len());
        let mut regressor = vec![0.0; n * v];
        for (joint, row) in self.regressor.iter().enumerate() {
            row.iter().for_each(|(vertex, weight)| regressor[joint * v + *vertex as usize] = *weight);
        }
        let shapes = array("<f8", &[v, 3, self.shapes.1], false, &self.selected_shapes());
        let mut entries = self.published();
        set(&mut entries, "shapedirs", Py::Array(shapes));
        set(&mut entries, "J_regressor", Py::Array(array("<f8", &[n, v], false, &regressor)));
        entries
    }
}

/// Changes one entry.
pub fn set(entries: &mut Entries, key: &str, value: Py) {
    entries.iter_mut().find(|(name, _)| *name == key).unwrap().1 = value;
}

pub fn as_pickle(entries: &Entries) -> Vec<u8> {
    pickle(&dictionary(entries.clone()))
}

pub fn as_npz(entries: &Entries, deflate: bool) -> Vec<u8> {
    let files: Vec<_> = entries.iter().map(|(key, value)| (format!("{key}.npy"), npy(value))).collect();
    zip(&files, deflate)
}
