//! Writes a rigged hand as a binary glTF 2.0 file, which [`super::gltf`] and other programs read: mesh, skeleton,
//! skinning weights and shape directions, and in the skin's extras what glTF has no place for.
//!
//! - Morph targets displace the skin; `skins[0].extras.shape[k]` says how they move the joints: `{"name": ..,
//!   "joint_shift": [[x, y, z], ...]}`, metres per unit, one row per joint of the skin.
//! - `skins[0].extras.pose_correctives` lists joints whose rotation displaces the skin before skinning:
//!   `{"joint": name, "vertices": accessor, "directions": accessor}`. The first accessor has the `m` vertices that
//!   move, the second `9 x m` displacements, metres: those of all vertices per entry of `R - I`, row by row, `R` being
//!   the joint's rotation in the axes of the model.

mod motion;
mod skin;

use ghand_core::mesh::RenderMesh;
use ghand_core::posing::regress_joints;
use ghand_core::{HandModel, Pose, Side};
use glam::DVec3;
use serde_json::{Value, json};

use super::export;
use super::glb_document::GlbDocument;
use crate::HandModelError;
pub use motion::{CorrectiveKey, Motion};
pub use skin::{Gloss, Skin};

/// Pose correctives that move a vertex by less than this at an entry of 1 of `R - I` are not written, metres.
const NO_EFFECT: f64 = 1e-6;
/// Entries of a rotation.
const FEATURES: usize = 9;

/// What a file of a rigged hand has beside mesh, skeleton and shapes.
#[derive(Debug, Clone, Copy, Default)]
pub struct RiggedHand<'a> {
    /// The look of the skin; without, programs show a white one.
    pub skin: Option<&'a Skin>,
    /// Names of the joints in place of the model's, one for each.
    pub joint_names: Option<&'a [String]>,
    /// The pose of the skeleton when the file is opened; the bind pose is always that of rest.
    pub pose: Option<&'a Pose>,
    /// Animations.
    pub motions: &'a [Motion<'a>],
    /// Displacements of the vertices before skinning, `[K][V]`, metres: morph targets behind those of the shapes.
    pub correctives: &'a [DVec3],
    /// Their weights when the file is opened, K; 0 if there are none.
    pub corrective_weights: &'a [f64],
}

impl RiggedHand<'_> {
    /// A file with the model in its scene, in shape 0, to which more may be added. Node 0 is the root of the joints,
    /// mesh and skin 0 are the hand's. Reading it gives the same model in single precision, except that regressed joints
    /// get shape directions of their own, and that a model has no pose space in glTF.
    ///
    /// The nodes of the joints form the hierarchy and have no rotation at rest: rotations are about the axes of the model.
    ///
    /// # Errors
    /// [`HandModelError::Invalid`] if the model breaks its invariants, a number is too large for single precision, or a
    /// pose or the names do not fit the model.
    pub fn document<'m>(&self, model: &'m HandModel) -> Result<GlbDocument<'m>, HandModelError> {
        export::check(model, &model.vertices)?;
        let names = self.joint_names.unwrap_or(&model.joint_names);
        if names.len() != model.joint_count() {
            let problem = format!("{} of them, the model has {} joints", names.len(), model.joint_count());
            return Err(HandModelError::invalid(model.name.clone(), "joint names", problem));
        }
        let mesh = in_order_of_vertices(RenderMesh::from_model(model));
        let mut document = GlbDocument::new(model);
        let directions = [&model.shape_directions[..], self.correctives].concat();
        let mut primitive = document.primitive(&mesh, &model.vertices, &directions)?;
        for (name, accessor) in joints_and_weights(&mut document, model, &mesh) {
            primitive["attributes"][name] = accessor.into();
        }
        if let Some(skin) = self.skin {
            primitive["material"] = skin.add(&mut document).into();
        }
        let inverse_bind_matrices = document.translations(model.joints.iter().map(|j| -j.as_vec3()));
        let mut extras = json!({});
        if model.shape_count() > 0 {
            extras["shape"] = joint_shifts(model);
        }
        if !model.pose_directions.is_empty() {
            extras["pose_correctives"] = pose_correctives(&mut document, model, &mesh)?;
        }
        let joints = model.joint_count();
        document.push(
            "skins",
            json!({
                "joints": (0..joints).collect::<Vec<_>>(), "skeleton": 0, "inverseBindMatrices": inverse_bind_matrices,
                "extras": extras
            }),
        );
        let mut nodes = joint_nodes(model, names);
        if let Some(pose) = self.pose {
            motion::pose_nodes(&mut nodes, model, pose)?;
        }
        // Readers recognise the side by the name.
        let name = match model.side {
            Side::Right => "right_hand",
            Side::Left => "left_hand",
        };
        nodes.push(json!({"name": name, "mesh": 0, "skin": 0}));
        for node in nodes {
            document.push("nodes", node);
        }
        document.push("scenes", json!({"nodes": [0, joints]}));
        let count = self.correctives.len() / model.vertices.len().max(1);
        let mut weights = vec![0.0; model.shape_count()];
        weights.extend((0..count).map(|k| self.corrective_weights.get(k).copied().unwrap_or_default()));
        let mut names = model.shape_names.clone();
        names.resize_with(model.shape_count(), || "shape".to_owned());
        names.extend((1..=count).map(|k| format!("pose-corrective-{k}")));
        // A model whose shapes have no names keeps its mesh without any.
        let names = if count == 0 { &model.shape_names } else { &names };
        let mesh = document.mesh(primitive, &weights, names);
        document.push("meshes", mesh);
        for motion in self.motions {
            motion.add(&mut document, model, count)?;
        }
        Ok(document)
    }
}

/// The mesh with its vertices in the order of the model's, so that a reader who welds them finds that order.
fn in_order_of_vertices(mesh: RenderMesh) -> RenderMesh {
    let mut order: Vec<usize> = (0..mesh.uvs.len()).collect();
    order.sort_by_key(|&k| mesh.source_vertices[k]);
    let mut place = vec![0; order.len()];
    for (to, &from) in order.iter().enumerate() {
        place[from] = to as u32;
    }
    RenderMesh {
        source_vertices: order.iter().map(|&k| mesh.source_vertices[k]).collect(),
        uvs: order.iter().map(|&k| mesh.uvs[k]).collect(),
        triangles: mesh.triangles.iter().map(|triangle| triangle.map(|i| place[i as usize])).collect(),
    }
}

/// Names and accessors of as many sets of four joints and weights as the vertex with the most joints needs, the largest
/// weights first.
fn joints_and_weights(document: &mut GlbDocument, model: &HandModel, mesh: &RenderMesh) -> Vec<(String, usize)> {
    let bound = |&vertex: &u32| {
        let weights = model.vertex_weights(vertex as usize).iter().enumerate();
        let mut bound: Vec<(u16, f32)> =
            weights.map(|(joint, &w)| (joint as u16, w as f32)).filter(|(_, w)| *w > 0.0).collect();
        bound.sort_by(|a, b| b.1.total_cmp(&a.1));
        bound
    };
    let bound: Vec<Vec<(u16, f32)>> = mesh.source_vertices.iter().map(bound).collect();
    let sets = bound.iter().map(Vec::len).max().unwrap_or(0).div_ceil(4);
    let mut attributes = vec![];
    for set in 0..sets {
        let entry = |row: &Vec<(u16, f32)>, k: usize| row.get(4 * set + k).copied().unwrap_or_default();
        let joints: Vec<[u16; 4]> = bound.iter().map(|row| std::array::from_fn(|k| entry(row, k).0)).collect();
        let weights: Vec<[f32; 4]> = bound.iter().map(|row| std::array::from_fn(|k| entry(row, k).1)).collect();
        let [joints, weights] = document.joints_and_weights(&joints, &weights);
        attributes.extend([(format!("JOINTS_{set}"), joints), (format!("WEIGHTS_{set}"), weights)]);
    }
    attributes
}

/// The tree of the joints, each relative to its parent.
fn joint_nodes(model: &HandModel, names: &[String]) -> Vec<Value> {
    let node = |(joint, at): (usize, &DVec3)| {
        let parent = model.parents[joint].map_or(DVec3::ZERO, |parent| model.joints[parent]);
        let children: Vec<usize> =
            (0..model.joint_count()).filter(|&child| model.parents[child] == Some(joint)).collect();
        let mut node = json!({"name": names[joint], "translation": (*at - parent).as_vec3().to_array()});
        if !children.is_empty() {
            node["children"] = children.into();
        }
        node
    };
    model.joints.iter().enumerate().map(node).collect()
}

/// How each shape direction moves the joints.
fn joint_shifts(model: &HandModel) -> Value {
    let shapes = model.shape_directions.chunks_exact(model.vertices.len()).enumerate();
    let shift = |(k, direction): (usize, &[DVec3])| {
        let joints = model.joint_count();
        let own = model.joint_directions.get(k * joints..(k + 1) * joints).map(<[DVec3]>::to_vec);
        let regressed = (!model.joint_regressor.is_empty()).then(|| regress_joints(&model.joint_regressor, direction));
        let rows = own.or(regressed).unwrap_or_else(|| vec![DVec3::ZERO; joints]);
        let name = model.shape_names.get(k).cloned().unwrap_or_else(|| format!("shape-{k}"));
        json!({"name": name, "joint_shift": rows.iter().map(DVec3::to_array).collect::<Vec<_>>()})
    };
    shapes.map(shift).collect()
}

/// The pose directions of the vertices that each joint moves.
fn pose_correctives(document: &mut GlbDocument, model: &HandModel, mesh: &RenderMesh) -> Result<Value, HandModelError> {
    let count = model.vertices.len();
    let mut correctives = vec![];
    for (k, directions) in model.pose_directions.chunks_exact(FEATURES * count).enumerate() {
        let moves =
            |vertex: u32| directions.iter().skip(vertex as usize).step_by(count).any(|d| d.length() > NO_EFFECT);
        let moving: Vec<bool> = (0..count as u32).map(moves).collect();
        let vertices: Vec<u32> =
            (0..).zip(&mesh.source_vertices).filter(|(_, source)| moving[**source as usize]).map(|(i, _)| i).collect();
        if vertices.is_empty() {
            continue;
        }
        let of_vertices = |direction: &[DVec3]| -> Vec<DVec3> {
            vertices.iter().map(|&i| direction[mesh.source_vertices[i as usize] as usize]).collect()
        };
        let directions: Vec<DVec3> = directions.chunks_exact(count).flat_map(of_vertices).collect();
        correctives.push(json!({
            "joint": model.joint_names[1 + k],
            "vertices": document.plain_indices(&vertices),
            "directions": document.plain_vectors(&directions, "pose directions")?,
        }));
    }
    Ok(correctives.into())
}

#[cfg(test)]
mod tests;
