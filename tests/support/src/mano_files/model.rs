//! Hand models as files with MANO's keys.

use std::path::Path;

use ghand_core::HandModel;
use glam::DVec3;

use super::hands::{Entries, as_npz};
use super::python::{Py, array};

/// Writes a hand model whose joints follow its skin as an `.npz` archive: everything except its name, its texture
/// coordinates and its side. Readers take the side from the file's name, which should therefore contain `right` or
/// `left`.
pub fn write_mano(path: &Path, model: &HandModel) {
    let (v, n) = (model.vertices.len(), model.joint_count());
    let width = 3 * (n - 1);
    let mut regressor = vec![0.0; n * v];
    for (row, entries) in regressor.chunks_exact_mut(v).zip(&model.joint_regressor) {
        entries.iter().for_each(|&(vertex, weight)| row[vertex as usize] += weight);
    }
    // The root's parent is stored as the largest value of an unsigned integer.
    let parents = model.parents.iter().map(|p| p.map_or(f64::from(u32::MAX), |p| p as f64));
    let tree: Vec<f64> = parents.chain((0..n).map(|k| k as f64)).collect();
    let faces: Vec<f64> = model.faces.iter().flatten().map(|&i| f64::from(i)).collect();
    let (mean, components) = match &model.pose_space {
        Some(space) => (numbers(&space.mean), numbers(&space.components)),
        None => (vec![0.0; width], vec![]),
    };
    let shapes = model.shape_count();
    let correctives = model.pose_directions.len() / v;
    let arrays = [
        ("v_template", vec![v, 3], numbers(&model.vertices)),
        ("f", vec![model.faces.len(), 3], faces),
        ("weights", vec![v, n], model.weights.clone()),
        ("kintree_table", vec![2, n], tree),
        ("J_regressor", vec![n, v], regressor),
        ("J", vec![n, 3], numbers(&model.joints)),
        ("shapedirs", vec![v, 3, shapes], of_vertices(&model.shape_directions, v)),
        ("posedirs", vec![v, 3, correctives], of_vertices(&model.pose_directions, v)),
        ("hands_mean", vec![width], mean),
        ("hands_components", vec![components.len() / width.max(1), width], components),
    ];
    let entries: Entries =
        arrays.into_iter().map(|(key, shape, values)| (key, Py::Array(array("<f8", &shape, false, &values)))).collect();
    std::fs::write(path, as_npz(&entries, true)).unwrap();
}

fn numbers(vectors: &[DVec3]) -> Vec<f64> {
    vectors.iter().flat_map(DVec3::to_array).collect()
}

/// Blend shapes from `[count][V]` to `(V, 3, count)`.
fn of_vertices(directions: &[DVec3], v: usize) -> Vec<f64> {
    let count = directions.len() / v;
    let at = |vertex: usize, axis: usize| (0..count).map(move |k| directions[k * v + vertex][axis]);
    (0..v).flat_map(|vertex| (0..3).flat_map(move |axis| at(vertex, axis))).collect()
}
