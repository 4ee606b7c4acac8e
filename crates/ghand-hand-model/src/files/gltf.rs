//! Reads any rigged hand from a glTF or GLB file.
//!
//! A hand model differs from what glTF stores: joints are converted to the axes of the world, vertices that were split
//! at UV seams are welded, and for hands whose joints are siblings, as WebXR's, the hierarchy comes from the joints'
//! names. Morph targets become shape directions; joints follow them as the file says (`joint_shifts`), else as the skin
//! around them does. Of several hands one is read (`choice`), of a body a hand (`hands`, `cut`).

mod buffers;
mod choice;
mod cut;
mod hands;
mod joint_shifts;
mod morph_targets;
mod placement;
mod pose_correctives;
mod raw_mesh;
mod skeleton;
mod webxr;
mod weld;

use std::path::Path;

use ::gltf::json::validation::Checked;
use ::gltf::{Gltf, Semantic};
use ghand_core::{HandModel, Side};
use ghand_files::input_file;
use glam::DVec3;

use crate::HandModelError;
use crate::joints::names::JointRole;
use crate::joints::regressor::follow_skin;
use crate::side::{decide, side_of_shape};
use buffers::{Buffers, MAX_BYTES};
use choice::Choice;
use placement::Placement;
use raw_mesh::RawMesh;
use weld::Joints;

/// A hand model with remarks on its file.
#[derive(Debug, Clone, PartialEq)]
pub struct GltfFile {
    /// The hand.
    pub model: HandModel,
    /// Unusual properties of the file, one sentence each.
    pub warnings: Vec<String>,
}

/// Reads a rigged hand from a `.glb` file, or from a `.gltf` file with its buffers beside it. Of two hands it is the one
/// of the `wanted` side, else the right one; a file's only hand is read in any case.
///
/// All meshes of the hand's skeleton are read as one. The unit is that of glTF, metres, and the axes are those of the
/// world: nodes above the skeleton scale and turn the hand, but the origin stays that of the mesh. The rest pose is that
/// in which the hand was bound. The hand begins at the wrist: other parts of a body are not read.
///
/// Joints of a rig with WebXR names are ordered wrist, thumb, index, middle, ring, pinky, each from the palm to the tip,
/// whatever their order in the file; other rigs keep the file's order, except that parents precede their children. The
/// side is that of the shape, or else what names say.
///
/// The mesh's morph targets are the shape directions, with the names of its extras (`targetNames`), or `shape-0`,
/// `shape-1` and so on; weights that the file gives them are ignored. The skin's extras tell how they move the joints:
/// `"shape": [{"name": "finger-length", "joint_shift": [[x, y, z], ...]}, ...]` has one row per joint of the skin,
/// metres per unit of the target's weight. Without that, each joint follows the skin around it, which gives a warning.
/// Pose correctives are read as [`super::rigged_glb`] writes them.
///
/// # Errors
/// [`HandModelError::Io`] if a file cannot be read. [`HandModelError::Invalid`] names the file, the part and a remedy
/// if it is not glTF 2.0, has no skin, no UVs or unusable numbers, is compressed or quantized, is far larger than any
/// hand, or has buffers outside its folder.
pub fn read_gltf(path: &Path, wanted: Option<Side>) -> Result<GltfFile, HandModelError> {
    let name = path.display().to_string();
    let io = |error| HandModelError::Io { path: path.to_path_buf(), source: error };
    let Some(bytes) = input_file::read(path, MAX_BYTES).map_err(io)? else {
        let source = Source { name };
        return Err(source.invalid("size", format!("is more than {MAX_BYTES} bytes; export only the hand")));
    };
    read_hand(&name, &bytes, Some(path.parent().unwrap_or(Path::new(""))), wanted)
}

/// Reads the bytes of a file as [`read_gltf`] does. `name` is the file's, for messages and for the side. References to
/// other files are an error.
///
/// # Errors
/// As in [`read_gltf`].
pub fn read_gltf_bytes(name: &str, bytes: &[u8]) -> Result<GltfFile, HandModelError> {
    read_hand(name, bytes, None, None)
}

fn read_hand(
    name: &str,
    bytes: &[u8],
    folder: Option<&Path>,
    wanted: Option<Side>,
) -> Result<GltfFile, HandModelError> {
    let source = Source { name: name.into() };
    let file = parse(bytes, &source)?;
    let buffers = Buffers::new(&file, folder, &source);
    let mut warnings = Vec::new();
    let choice = Choice::of(&file, wanted, &buffers, &source, &mut warnings)?;
    let Choice { skeleton, hand, parts, is_only_hand } = &choice;
    let placement = Placement::of(skeleton, hand, parts, &source, &mut warnings)?;
    let n_b = hand.joints.len();
    let mut raw = RawMesh::default();
    let mut ends = vec![];
    for part in parts {
        let binding = placement.binding(part.skin.index());
        let mut primitives: Vec<_> = part.mesh.primitives().collect();
        morph_targets::require_equal_counts(&primitives, &source)?;
        let targets = primitives.first().map_or(0, |primitive| primitive.morph_targets().len());
        let names = morph_targets::names_in_file(part.mesh.extras().as_deref(), targets);
        primitives.retain(|primitive| binding.may_move(primitive, &buffers));
        for primitive in primitives {
            raw.append(&primitive, &names, n_b, binding, &buffers, &source)?;
        }
        ends.push(raw.positions.len());
    }
    let name_of_joint = |joint: usize| skeleton.names[joint].clone();
    let kept = cut::cut(&mut raw, &placement.joints, *is_only_hand, name_of_joint, &mut warnings);
    let is_whole = !kept.contains(&false);
    if !is_whole {
        morph_targets::drop_idle(&mut raw.targets, &mut warnings);
    }
    if raw.triangles.is_empty() {
        return Err(
            source.invalid("mesh", "has no triangle that follows the hand's joints; export it with its weights".into())
        );
    }
    warnings.extend(choice.told_of_parts(&ends, &kept));
    let names = hand.names(skeleton);
    let shape = side_of_shape(&JointRole::of_joints(&names), &placement.joints);
    let telling = choice.telling_names(&file, Path::new(name));
    let side = decide(shape, telling.iter().map(String::as_str), &mut warnings);
    let target_names: Vec<Option<String>> = raw.targets.iter().map(|target| target.name.clone()).collect();
    let Some(first) = parts.first() else { return Err(no_skin(&source)) };
    let binding = placement.binding(first.skin.index());
    let extras = first.skin.extras().as_deref();
    let joint_directions = joint_shifts::joint_directions(extras, &target_names, binding, n_b, &source, &mut warnings)?;
    let joints = Joints { names, parents: hand.parents.clone(), positions: placement.joints.clone() };
    let mut model = weld::weld(raw, joints, side, &source, &mut warnings)?;
    model.shape_names = morph_targets::unique_names(target_names);
    match joint_directions {
        Some(directions) => model.joint_directions = directions,
        None if model.shape_directions.is_empty() => {}
        None => {
            follow_skin(&mut model);
            warnings.push(
                "the file does not say how its shapes move the joints; each joint follows the skin around it".into(),
            );
        }
    }
    model.pose_directions = pose_correctives::pose_directions(extras, &model, &file, &buffers, &source)?;
    if !model.pose_directions.is_empty() && (binding.model_from_mesh.is_some() || !is_whole) {
        model.pose_directions.clear();
        warnings.push(
            "its pose correctives are for the hand before it was cut, scaled or turned, and are not used; export the hand \
             alone, with its scale and rotation applied"
                .into(),
        );
    }
    model.validate()?;
    Ok(GltfFile { model, warnings })
}

fn no_skin(source: &Source) -> HandModelError {
    source.invalid("skin", "no mesh has one; export the hand with its armature".into())
}

/// Parses and validates the JSON part.
fn parse(bytes: &[u8], source: &Source) -> Result<Gltf, HandModelError> {
    let unusable =
        |error: ::gltf::Error| source.invalid("glTF", format!("{error}; export the hand again as glTF 2.0 (.glb)"));
    // The validation of gltf-json 1.4.1 looks up POSITION accessors before it has checked that they exist, and panics.
    // Its reader of GLB headers subtracts their own 12 bytes from the length that they state.
    if let Some(&[a, b, c, d]) = bytes.strip_prefix(b"glTF").and_then(|header| header.get(4..8))
        && u32::from_le_bytes([a, b, c, d]) < 12
    {
        return Err(source.invalid("glTF", "the GLB header is damaged; copy or export the hand again".into()));
    }
    let json =
        if bytes.starts_with(b"glTF") { ::gltf::Glb::from_slice(bytes).map_err(unusable)?.json } else { bytes.into() };
    let root = ::gltf::json::Root::from_slice(&json).map_err(|error| unusable(error.into()))?;
    for name in &root.extensions_required {
        let remedy = match name.as_str() {
            "KHR_draco_mesh_compression" | "EXT_meshopt_compression" | "KHR_meshopt_compression" => {
                "export without mesh compression"
            }
            "KHR_mesh_quantization" => "export without quantization",
            _ => continue,
        };
        return Err(source.invalid("extensionsRequired", format!("lists {name}, which is not supported; {remedy}")));
    }
    let positions = Checked::Valid(Semantic::Positions);
    let primitives = root.meshes.iter().flat_map(|mesh| &mesh.primitives);
    for accessor in primitives.filter_map(|primitive| primitive.attributes.get(&positions)) {
        if accessor.value() >= root.accessors.len() {
            let problem =
                format!("refers to accessor {} of {}; export the hand again", accessor.value(), root.accessors.len());
            return Err(source.invalid("POSITION", problem));
        }
    }
    Gltf::from_slice(bytes).map_err(unusable)
}

/// The file, for messages.
struct Source {
    name: String,
}

impl Source {
    fn invalid(&self, field: &str, problem: String) -> HandModelError {
        HandModelError::invalid(self.name.clone(), field, problem)
    }
}

fn dvec3(v: [f32; 3]) -> DVec3 {
    DVec3::from_array(v.map(f64::from))
}

#[cfg(test)]
mod tests;
