//! Writes hand models with MANO's keys.

use std::path::Path;

use ghand_core::HandModel;
use ghand_files::npz::{NamedNumbers, npz_bytes};
use glam::DVec3;

use crate::HandModelError;
use crate::files::export;

/// Writes a hand model as an `.npz` archive with MANO's keys, which [`super::read_mano`] and other programs for MANO
/// read: everything except its name, its texture coordinates and its side. Readers take the side from the file's name,
/// which should therefore contain `right` or `left`.
///
/// # Errors
/// [`HandModelError::Invalid`] if the joints do not follow the skin, which MANO's files cannot express;
/// [`HandModelError::Write`] if the file cannot be written; it is then unchanged.
pub fn write_mano(path: &Path, model: &HandModel) -> Result<(), HandModelError> {
    model.validate()?;
    if model.joint_regressor.is_empty() {
        let problem = "is missing; only models whose joints are sums over their vertices can be written as MANO's";
        return Err(HandModelError::invalid(model.name.clone(), "J_regressor", problem));
    }
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
    let named: Vec<NamedNumbers> =
        arrays.iter().map(|(name, shape, values)| NamedNumbers { name, shape, values }).collect();
    let bytes = npz_bytes(&named).map_err(|source| HandModelError::Write { path: path.to_path_buf(), source })?;
    export::write(path, &bytes)
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

#[cfg(test)]
mod tests {
    use super::super::{ManoOptions, read_mano_with_warnings};
    use super::*;
    use ghand_core::{PoseSpace, Side};
    use ghand_test_support::procedural_hand::ProceduralHand;

    #[test]
    fn a_written_model_is_read_back_to_the_last_bit() {
        let folder = tempfile::tempdir().unwrap();
        for (left, name) in [(false, "right.npz"), (true, "left.npz")] {
            let mut model = ProceduralHand { detail: 1, left, ..Default::default() }.build().unwrap();
            if left {
                let mean = (0..15).map(|k| DVec3::new(0.01 * f64::from(k), -0.02, 0.3)).collect();
                let components = (0..30).map(|k| DVec3::new(0.1, 0.2, f64::from(k))).collect();
                model.pose_space = Some(PoseSpace { mean, components });
            }
            let path = folder.path().join(name);
            write_mano(&path, &model).unwrap();
            let found = read_mano_with_warnings(&path, &ManoOptions::default()).unwrap();
            assert_eq!(found.warnings, Vec::<String>::new());
            let space = PoseSpace { mean: vec![DVec3::ZERO; 15], components: vec![] };
            let expected = HandModel {
                name: found.model.name.clone(),
                uvs: found.model.uvs.clone(),
                face_uvs: found.model.face_uvs.clone(),
                // MANO's directions have no names.
                shape_names: vec![],
                pose_space: model.pose_space.clone().or(Some(space)),
                ..model
            };
            assert!(found.model == expected, "{name}");
            assert_eq!(found.model.side == Side::Left, left);
        }
    }

    #[test]
    fn a_model_without_a_regressor_is_rejected_and_leaves_no_file() {
        let folder = tempfile::tempdir().unwrap();
        let mut model = ProceduralHand { detail: 1, ..Default::default() }.build().unwrap();
        model.joint_regressor.clear();
        let error = write_mano(&folder.path().join("right.npz"), &model).unwrap_err().to_string();
        assert!(error.contains("J_regressor"), "{error}");
        model = ProceduralHand { detail: 1, ..Default::default() }.build().unwrap();
        write_mano(folder.path(), &model).unwrap_err();
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    }
}
