//! Builds a hand model from the arrays of a MANO file.

use ghand_core::posing::regress_joints;
use ghand_core::{HandModel, PoseSpace, Side};
use ghand_files::npz::NumericArray;
use glam::DVec3;

use super::named_arrays::{Matrix, NamedArrays};
use super::{JOINT_NAMES, PARENTS, dvec3};
use crate::HandModelError;

/// How far the sum of a vertex's weights may be from 1: single precision, or text with a few decimals.
const WEIGHT_SUM_TOLERANCE: f64 = 1e-3;

/// Sums this close to 1 differ by rounding: 16 numbers of at most 1 add up with an error of at most 16 x 2^-53.
const WEIGHT_SUM_ROUNDING: f64 = 1e-12;

/// Negative weights down to this are rounding errors and become 0.
const NEGATIVE_WEIGHT: f64 = -1e-9;

/// Stored joints that differ from regressed ones by more than this, metres, get a warning.
const JOINT_TOLERANCE: f64 = 1e-5;

/// The model without texture coordinates; the side is not known yet.
pub(super) fn build(fields: &mut NamedArrays, warnings: &mut Vec<String>) -> Result<HandModel, HandModelError> {
    let vertices = vertices(fields)?;
    let v = vertices.len();
    let faces = faces(fields, v)?;
    let parents = parents(fields)?;
    let n = parents.len();
    let weights = weights(fields, v, n)?;
    let joint_regressor = joint_regressor(fields, v, n)?;
    let shape_directions = directions(fields, "shapedirs", v, None)?;
    let pose_directions = directions(fields, "posedirs", v, Some(9 * (n - 1)))?;
    let pose_space = pose_space(fields, n)?;
    // The same sum as in posing, so that shape 0 changes no bit.
    let joints = regress_joints(&joint_regressor, &vertices);
    check_joints(fields, &joints, warnings);
    for (key, usual) in [("bs_type", "lrotmin"), ("bs_style", "lbs")] {
        if let Some(found) = fields.text(key)
            && found != usual
        {
            warnings.push(format!("{key} is {found:?}, MANO has {usual:?}: poses may be misinterpreted"));
        }
    }
    let joint_names = if parents == PARENTS {
        JOINT_NAMES.map(String::from).to_vec()
    } else {
        (0..n).map(|k| format!("joint{k}")).collect()
    };
    Ok(HandModel {
        name: fields.origin.into(),
        side: Side::Right,
        joint_names,
        parents,
        joints,
        vertices,
        faces,
        uvs: vec![],
        face_uvs: vec![],
        weights,
        shape_directions,
        shape_names: vec![],
        pose_directions,
        joint_regressor,
        joint_directions: vec![],
        pose_space,
        source_vertices: vec![],
    })
}

fn wrong_shape(fields: &NamedArrays, key: &str, array: &NumericArray, expected: &str) -> HandModelError {
    fields
        .invalid(key, format!("has the shape {:?}, expected {expected}; pass a MANO model as downloaded", array.shape))
}

fn vertices(fields: &mut NamedArrays) -> Result<Vec<DVec3>, HandModelError> {
    let array = fields.numbers("v_template")?;
    match array.shape.as_slice() {
        &[v, 3] if (1..=u32::MAX as usize).contains(&v) => Ok(array.values.as_chunks().0.iter().map(dvec3).collect()),
        _ => Err(wrong_shape(fields, "v_template", &array, "(V, 3)")),
    }
}

fn faces(fields: &mut NamedArrays, v: usize) -> Result<Vec<[u32; 3]>, HandModelError> {
    let array = fields.numbers("f")?;
    if !matches!(array.shape.as_slice(), [1..=usize::MAX, 3]) {
        return Err(wrong_shape(fields, "f", &array, "(F, 3)"));
    }
    let range = 0.0..v as f64;
    if let Some(bad) = array.values.iter().find(|i| !range.contains(*i) || i.fract() != 0.0) {
        let problem = format!("refers to vertex {bad} of {v}; the file is damaged, copy or download it again");
        return Err(fields.invalid("f", problem));
    }
    Ok(array.values.as_chunks().0.iter().map(|face: &[f64; 3]| face.map(|i| i as u32)).collect())
}

/// Parents, each before its children. The root's is stored as -1, in an unsigned integer of 4 or 8 bytes.
fn parents(fields: &mut NamedArrays) -> Result<Vec<Option<usize>>, HandModelError> {
    const ROOT: [f64; 3] = [-1.0, u32::MAX as f64, u64::MAX as f64];
    let array = fields.numbers("kintree_table")?;
    let &[2, n @ 1..=usize::MAX] = array.shape.as_slice() else {
        return Err(wrong_shape(fields, "kintree_table", &array, "(2, n_b)"));
    };
    let (parent_row, joint_row) = array.values.split_at(n);
    if let Some(k) = joint_row.iter().enumerate().position(|(k, joint)| *joint != k as f64) {
        let problem = format!("numbers joint {k} as {}; joints must be numbered in order", joint_row[k]);
        return Err(fields.invalid("kintree_table", problem));
    }
    let parent = |(k, &parent): (usize, &f64)| match k {
        0 if ROOT.contains(&parent) => Ok(None),
        1.. if parent.fract() == 0.0 && (0.0..k as f64).contains(&parent) => Ok(Some(parent as usize)),
        _ => {
            let problem = format!(
                "gives joint {k} the parent {parent}; only joint 0 is a root (-1), and a parent must come before its \
                 children"
            );
            Err(fields.invalid("kintree_table", problem))
        }
    };
    parent_row.iter().enumerate().map(parent).collect()
}

fn weights(fields: &mut NamedArrays, v: usize, n: usize) -> Result<Vec<f64>, HandModelError> {
    let mut array = fields.numbers("weights")?;
    if array.shape != [v, n] {
        return Err(wrong_shape(fields, "weights", &array, &format!("({v}, {n})")));
    }
    for (vertex, row) in array.values.chunks_exact_mut(n).enumerate() {
        let remedy = "bind every vertex with weights that sum to 1, or download the file again";
        if let Some(bad) = row.iter().find(|w| **w < NEGATIVE_WEIGHT) {
            return Err(fields.invalid("weights", format!("vertex {vertex} has the weight {bad}; {remedy}")));
        }
        row.iter_mut().filter(|w| **w < 0.0).for_each(|w| *w = 0.0);
        let sum: f64 = row.iter().sum();
        if (sum - 1.0).abs() > WEIGHT_SUM_TOLERANCE {
            return Err(fields.invalid("weights", format!("those of vertex {vertex} sum to {sum}; {remedy}")));
        }
        if (sum - 1.0).abs() > WEIGHT_SUM_ROUNDING {
            row.iter_mut().for_each(|w| *w /= sum);
        }
    }
    Ok(array.values)
}

fn joint_regressor(fields: &mut NamedArrays, v: usize, n: usize) -> Result<Vec<Vec<(u32, f64)>>, HandModelError> {
    let fail = |fields: &NamedArrays, shape: &[usize]| {
        let problem = format!("has the shape {shape:?}, expected ({n}, {v}); pass a MANO model as downloaded");
        Err(fields.invalid("J_regressor", problem))
    };
    let mut rows = vec![Vec::new(); n];
    match fields.matrix("J_regressor")? {
        Matrix::Dense(array) => {
            if array.shape != [n, v] {
                return fail(fields, &array.shape);
            }
            for (row, values) in rows.iter_mut().zip(array.values.chunks_exact(v)) {
                let entries = (0..).zip(values).filter(|(_, value)| **value != 0.0);
                row.extend(entries.map(|(vertex, value)| (vertex, *value)));
            }
        }
        Matrix::Sparse(sparse) => {
            if [sparse.rows, sparse.columns] != [n, v] {
                return fail(fields, &[sparse.rows, sparse.columns]);
            }
            for (joint, vertex, value) in sparse.entries {
                rows[joint].push((vertex as u32, value));
            }
            // Terms are added in the order of the vertices, independent of their order in the file.
            rows.iter_mut().for_each(|row| row.sort_by_key(|(vertex, _)| *vertex));
        }
    }
    if let Some(joint) = rows.iter().position(Vec::is_empty) {
        let problem = format!("has no entry for joint {joint}; pass a MANO model as downloaded");
        return Err(fields.invalid("J_regressor", problem));
    }
    Ok(rows)
}

/// Blend shapes from `(V, 3, count)` to `[count][V]`.
fn directions(
    fields: &mut NamedArrays,
    key: &str,
    v: usize,
    count: Option<usize>,
) -> Result<Vec<DVec3>, HandModelError> {
    let array = fields.numbers(key)?;
    match array.shape.as_slice() {
        &[rows, 3, found] if rows == v && count.is_none_or(|count| count == found) => {
            let at = |vertex: usize, axis: usize, k: usize| array.values[(3 * vertex + axis) * found + k];
            let direction = |k, vertex| DVec3::new(at(vertex, 0, k), at(vertex, 1, k), at(vertex, 2, k));
            Ok((0..found).flat_map(|k| (0..v).map(move |vertex| (k, vertex))).map(|(k, i)| direction(k, i)).collect())
        }
        _ => {
            let count = count.map_or("n_s".into(), |count| count.to_string());
            Err(wrong_shape(fields, key, &array, &format!("({v}, 3, {count})")))
        }
    }
}

/// Mean and components of poses; `None` for a rig without them.
fn pose_space(fields: &mut NamedArrays, n: usize) -> Result<Option<PoseSpace>, HandModelError> {
    let width = 3 * (n - 1);
    let vectors = |values: &[f64]| values.as_chunks().0.iter().map(dvec3).collect::<Vec<DVec3>>();
    let mut mean = None;
    if fields.contains("hands_mean") {
        let array = fields.numbers("hands_mean")?;
        // Either one axis or a single row.
        if !matches!(array.shape.as_slice(), &[w] | &[1, w] if w == width) {
            return Err(wrong_shape(fields, "hands_mean", &array, &format!("({width})")));
        }
        mean = Some(vectors(&array.values));
    }
    let mut components = None;
    if fields.contains("hands_components") {
        let array = fields.numbers("hands_components")?;
        if !matches!(array.shape.as_slice(), &[_, w] if w == width) {
            return Err(wrong_shape(fields, "hands_components", &array, &format!("(c, {width})")));
        }
        components = Some(vectors(&array.values));
    }
    if mean.is_none() && components.is_none() {
        return Ok(None);
    }
    Ok(Some(PoseSpace {
        mean: mean.unwrap_or_else(|| vec![DVec3::ZERO; n - 1]),
        components: components.unwrap_or_default(),
    }))
}

/// The joints stored beside the regressor are not used, but show whether the file is consistent.
fn check_joints(fields: &mut NamedArrays, joints: &[DVec3], warnings: &mut Vec<String>) {
    if !fields.contains("J") {
        return;
    }
    let Ok(array) = fields.numbers("J") else {
        warnings.push("J cannot be read; it is not needed, because the joints are regressed from the vertices".into());
        return;
    };
    if array.shape != [joints.len(), 3] {
        warnings.push(format!("J has the shape {:?}, expected ({}, 3); it is not used", array.shape, joints.len()));
        return;
    }
    let distances = array.values.as_chunks().0.iter().zip(joints).map(|(j, joint)| dvec3(j).distance(*joint));
    let worst = distances.fold(0.0, f64::max);
    if worst > JOINT_TOLERANCE {
        warnings.push(format!(
            "J is up to {:.3} mm from the joints that J_regressor gives; the latter are used",
            1000.0 * worst
        ));
    }
}
