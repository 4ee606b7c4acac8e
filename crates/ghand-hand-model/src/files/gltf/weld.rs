//! Undoes the splitting of vertices at UV seams.

use std::collections::HashMap;

use ghand_core::{HandModel, Side};
use glam::DVec3;

use super::Source;
use super::raw_mesh::{RawMesh, RawTarget};
use crate::HandModelError;

/// Distance between the displacements of two copies of a vertex that is not rounding, metres per unit of a shape.
const APART: f64 = 1e-6;

/// The joints of the model.
pub(super) struct Joints {
    pub names: Vec<String>,
    pub parents: Vec<Option<usize>>,
    /// Rest positions, metres.
    pub positions: Vec<DVec3>,
}

/// Welds vertices with exactly the same position. Their weights and displacements are averaged where they differ; every
/// file vertex keeps its UV point. Triangles that lose their area are dropped.
pub(super) fn weld(
    raw: RawMesh,
    joints: Joints,
    side: Side,
    source: &Source,
    warnings: &mut Vec<String>,
) -> Result<HandModel, HandModelError> {
    let n_b = joints.names.len();
    let mut index: HashMap<[u32; 3], u32> = HashMap::new();
    let mut vertices: Vec<DVec3> = Vec::new();
    let mut copies: Vec<f64> = Vec::new();
    let mut weights: Vec<f64> = Vec::new();
    let mut welded_from_raw = Vec::with_capacity(raw.positions.len());
    for (position, row) in raw.positions.iter().zip(raw.weights.chunks_exact(n_b)) {
        // Adding 0 turns -0 into 0, which is the same position.
        let key = position.as_vec3().to_array().map(|v| (v + 0.0).to_bits());
        let welded = *index.entry(key).or_insert_with(|| {
            vertices.push(*position);
            copies.push(0.0);
            weights.extend(std::iter::repeat_n(0.0, n_b));
            vertices.len() as u32 - 1
        });
        let at = welded as usize;
        copies[at] += 1.0;
        for (sum, w) in weights[at * n_b..(at + 1) * n_b].iter_mut().zip(row) {
            *sum += w;
        }
        welded_from_raw.push(welded);
    }
    for (row, copies) in weights.chunks_exact_mut(n_b).zip(&copies) {
        row.iter_mut().for_each(|w| *w /= copies);
    }
    let shape_directions = weld_targets(&raw.targets, &welded_from_raw, &copies, warnings);
    let mut faces = Vec::new();
    let mut face_uvs = Vec::new();
    for triangle in raw.triangles {
        let face = triangle.map(|i| welded_from_raw[i as usize]);
        let [a, b, c] = face.map(|i| vertices[i as usize]);
        if (b - a).cross(c - a).length_squared() > 0.0 {
            faces.push(face);
            face_uvs.push(triangle);
        }
    }
    if faces.is_empty() {
        return Err(source.invalid("mesh", "has only triangles without area; export the hand again".into()));
    }
    Ok(HandModel {
        name: source.name.clone(),
        side,
        joint_names: joints.names,
        parents: joints.parents,
        joints: joints.positions,
        vertices,
        faces,
        uvs: raw.uvs,
        face_uvs,
        weights,
        shape_directions,
        shape_names: vec![],
        pose_directions: vec![],
        joint_regressor: vec![],
        joint_directions: vec![],
        pose_space: None,
        source_vertices: welded_from_raw,
    })
}

/// Displacements `[n_s][V]` of the welded vertices.
fn weld_targets(
    targets: &[RawTarget],
    welded_from_raw: &[u32],
    copies: &[f64],
    warnings: &mut Vec<String>,
) -> Vec<DVec3> {
    let mut directions = vec![DVec3::ZERO; targets.len() * copies.len()];
    let mut torn = vec![false; copies.len()];
    for (target, direction) in targets.iter().zip(directions.chunks_exact_mut(copies.len())) {
        let moved = || target.displacements.iter().copied().zip(welded_from_raw.iter().map(|&at| at as usize));
        moved().for_each(|(d, at)| direction[at] += d / copies[at]);
        for (d, at) in moved() {
            torn[at] |= d.distance(direction[at]) > 0.5 * APART;
        }
    }
    let torn = torn.iter().filter(|torn| **torn).count();
    if torn > 0 {
        warnings.push(format!(
            "{torn} vertices have copies at UV seams or in several meshes that morph targets move apart; the copies move \
             together, by the mean"
        ));
    }
    directions
}
