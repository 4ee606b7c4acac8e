//! Reads any rigged hand from a glTF or GLB file.
//!
//! A hand model differs from what glTF stores: joints are converted to the mesh's own axes, vertices that were split at
//! UV seams are welded, and for WebXR hands, whose joints are siblings, the hierarchy comes from the joints' names.
//! Morph targets become shape directions; joints follow them as the file says (`joint_shifts`), else as the skin around
//! them does.

mod buffers;
mod joint_shifts;
mod joints;
mod morph_targets;
mod pose_correctives;
mod weld;

use std::path::Path;

use ::gltf::json::validation::Checked;
use ::gltf::mesh::{Mode, Primitive};
use ::gltf::{Gltf, Node, Semantic};
use ghand_core::{HandModel, Side};
use ghand_files::input_file;
use glam::{DVec2, DVec3};

use crate::HandModelError;
use crate::joint_regressor::follow_skin;
use buffers::{Buffers, MAX_BYTES};
use joints::Rig;

/// Most weights (vertices x joints), half a gigabyte: a million vertices with 64 joints.
const MAX_WEIGHTS: usize = 1 << 26;
/// Most triangles.
const MAX_TRIANGLES: usize = 1 << 24;
/// Most sets of four joints that a vertex may be bound to.
const MAX_SETS: u32 = 64;

/// A hand model with remarks on its file.
#[derive(Debug, Clone, PartialEq)]
pub struct GltfFile {
    /// The hand.
    pub model: HandModel,
    /// Unusual properties of the file, one sentence each.
    pub warnings: Vec<String>,
}

/// Reads a rigged hand; see [`read_gltf_with_warnings`].
///
/// # Errors
/// As in [`read_gltf_with_warnings`].
pub fn read_gltf(path: &Path) -> Result<HandModel, HandModelError> {
    Ok(read_gltf_with_warnings(path)?.model)
}

/// Reads the first skinned mesh of a `.glb` file, or of a `.gltf` file with its buffers beside it.
///
/// The model's axes are the mesh's (node transforms of a skinned mesh have no effect). The unit is that of glTF,
/// metres. Joints of a rig with WebXR names are ordered wrist, thumb, index, middle, ring, pinky, each from the palm to
/// the tip, whatever their order in the file; other rigs keep the file's order, except that parents precede their
/// children. It is a left hand if the names of the file or its nodes say so.
///
/// The mesh's morph targets are the shape directions, with the names of its extras (`targetNames`), or `shape-0`,
/// `shape-1` and so on; weights that the file gives them are ignored. The skin's extras tell how they move the joints:
/// `"shape": [{"name": "finger-length", "joint_shift": [[x, y, z], ...]}, ...]` has one row per joint of the skin,
/// metres per unit of the target's weight. Without that, each joint follows the skin around it, which gives a warning.
/// Pose correctives are read as [`crate::rigged_glb`] writes them.
///
/// # Errors
/// [`HandModelError::Io`] if a file cannot be read. [`HandModelError::Invalid`] names the file, the part and a remedy
/// if it is not glTF 2.0, has no skin, no UVs or unusable numbers, is compressed or quantized, is far larger than any
/// hand, or has buffers outside its folder.
pub fn read_gltf_with_warnings(path: &Path) -> Result<GltfFile, HandModelError> {
    let name = path.display().to_string();
    let io = |error| HandModelError::Io { path: path.to_path_buf(), source: error };
    let Some(bytes) = input_file::read(path, MAX_BYTES).map_err(io)? else {
        let source = Source { name };
        return Err(source.invalid("size", format!("is more than {MAX_BYTES} bytes; export only the hand")));
    };
    read_gltf_bytes(&name, &bytes, Some(path.parent().unwrap_or(Path::new(""))))
}

/// Reads the bytes of a file as [`read_gltf_with_warnings`] does. `name` is the file's, for messages and for the side;
/// `folder` contains the other files that it refers to; without a folder, such a reference is an error.
///
/// # Errors
/// As in [`read_gltf_with_warnings`].
pub fn read_gltf_bytes(name: &str, bytes: &[u8], folder: Option<&Path>) -> Result<GltfFile, HandModelError> {
    let source = Source { name: name.into() };
    let file = parse(bytes, &source)?;
    let buffers = Buffers::new(&file, folder, &source);
    let (node, mesh, skin) = file
        .nodes()
        .find_map(|node| Some((node.clone(), node.mesh()?, node.skin()?)))
        .ok_or_else(|| source.invalid("skin", "no mesh has one; export the hand with its armature".into()))?;
    let rig = Rig::read(&file, &skin, &buffers, &source)?;
    let mut raw = RawMesh::default();
    for primitive in mesh.primitives() {
        raw.append(&primitive, &rig, &buffers, &source)?;
    }
    let side = side(Path::new(name), &node, &rig);
    let mut warnings = Vec::new();
    let target_names = morph_targets::names_in_file(mesh.extras().as_deref(), raw.targets.len());
    let joint_directions = joint_shifts::joint_directions(
        skin.extras().as_deref(),
        &target_names,
        &rig.model_from_skin,
        &source,
        &mut warnings,
    )?;
    let mut model = weld::weld(raw, rig, side, &source, &mut warnings)?;
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
    model.pose_directions =
        pose_correctives::pose_directions(skin.extras().as_deref(), &model, &file, &buffers, &source)?;
    model.validate()?;
    Ok(GltfFile { model, warnings })
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

/// The mesh as stored in the file, with vertices split at seams.
#[derive(Default)]
struct RawMesh {
    positions: Vec<[f32; 3]>,
    uvs: Vec<DVec2>,
    /// `[V][n_b]`, in the model's order of joints.
    weights: Vec<f64>,
    triangles: Vec<[u32; 3]>,
    /// Displacements `[n_s][V]` by the morph targets, metres.
    targets: Vec<Vec<[f32; 3]>>,
}

impl RawMesh {
    fn append(
        &mut self,
        primitive: &Primitive,
        rig: &Rig,
        buffers: &Buffers,
        source: &Source,
    ) -> Result<(), HandModelError> {
        if primitive.mode() != Mode::Triangles {
            return Err(source.invalid("mesh", format!("is of {:?}; export plain triangles", primitive.mode())));
        }
        let accessor = |semantic: &Semantic, remedy: &str| {
            primitive.get(semantic).ok_or_else(|| source.invalid(&format!("{semantic:?}"), remedy.into()))
        };
        let positions = buffers.floats::<3>(&accessor(&Semantic::Positions, "is missing")?, "POSITION")?;
        let uvs = accessor(&Semantic::TexCoords(0), "is missing; unwrap the mesh (one UV atlas) and export UVs")?;
        let uvs = buffers.floats::<2>(&uvs, "TEXCOORD_0")?;
        let count = positions.len();
        let first = self.positions.len();
        let mismatch = |field: &str, found: usize| {
            source.invalid(field, format!("has {found} entries for {count} positions; export the hand again"))
        };
        if uvs.len() != count {
            return Err(mismatch("TEXCOORD_0", uvs.len()));
        }
        let n_b = rig.names.len();
        if (first + count).saturating_mul(n_b) > MAX_WEIGHTS {
            let problem = format!("has {} vertices for {n_b} joints, too many; decimate the mesh", first + count);
            return Err(source.invalid("mesh", problem));
        }
        let mut weights = vec![0.0; count * n_b];
        let mut set = 0;
        while let Some(indices) = primitive.get(&Semantic::Joints(set)) {
            let field = format!("WEIGHTS_{set}");
            let parts = primitive.get(&Semantic::Weights(set)).ok_or_else(|| {
                source.invalid(&field, format!("is missing beside JOINTS_{set}; export skin weights"))
            })?;
            let indices = buffers.integers::<4>(&indices, &format!("JOINTS_{set}"))?;
            let parts = buffers.floats::<4>(&parts, &field)?;
            if indices.len() != count || parts.len() != count {
                return Err(mismatch(&field, indices.len().min(parts.len())));
            }
            for (row, (joints, parts)) in weights.chunks_exact_mut(n_b).zip(indices.iter().zip(&parts)) {
                for (joint, &part) in joints.iter().zip(parts) {
                    let part = f64::from(part);
                    if !(part >= 0.0 && part.is_finite()) {
                        return Err(source.invalid(&field, format!("has {part}; weights must be 0 or more")));
                    }
                    // Unused entries may name any joint.
                    if part > 0.0 {
                        let Some(&to) = rig.model_from_skin.get(*joint as usize) else {
                            let problem = format!("refers to joint {joint} of {}", rig.model_from_skin.len());
                            return Err(source.invalid(&format!("JOINTS_{set}"), problem));
                        };
                        let Some(to) = to else {
                            let problem = format!(
                                "skin joint {joint} moves vertices but is not a joint of a WebXR hand; remove its \
                                 weights"
                            );
                            return Err(source.invalid(&format!("JOINTS_{set}"), problem));
                        };
                        row[to] += part;
                    }
                }
            }
            set += 1;
            if set > MAX_SETS {
                return Err(source.invalid("JOINTS_n", format!("more than {MAX_SETS} sets; bind to fewer joints")));
            }
        }
        if set == 0 {
            return Err(source.invalid("JOINTS_0", "is missing; export the mesh with its skin weights".into()));
        }
        for (k, row) in weights.chunks_exact_mut(n_b).enumerate() {
            let sum: f64 = row.iter().sum();
            if sum <= 0.0 {
                return Err(
                    source.invalid("WEIGHTS_0", format!("vertex {k} is not bound to any joint; bind every vertex"))
                );
            }
            row.iter_mut().for_each(|w| *w /= sum);
        }
        let corners: Vec<u32> = match primitive.indices() {
            Some(accessor) => buffers.integers::<1>(&accessor, "indices")?.into_iter().map(|[i]| i).collect(),
            None => (0..count as u32).collect(),
        };
        if let Some(bad) = corners.iter().find(|&&i| i as usize >= count) {
            return Err(source.invalid("indices", format!("refer to vertex {bad} of {count}; export the hand again")));
        }
        if self.triangles.len() + corners.len() / 3 > MAX_TRIANGLES {
            return Err(source.invalid("mesh", format!("has more than {MAX_TRIANGLES} triangles; decimate the mesh")));
        }
        let targets = morph_targets::displacements(primitive, count, first, buffers, source)?;
        if first == 0 {
            self.targets = vec![vec![]; targets.len()];
        }
        if targets.len() != self.targets.len() {
            let problem = format!(
                "primitive {} has {} morph targets, the first has {}; export the hand again",
                primitive.index(),
                targets.len(),
                self.targets.len()
            );
            return Err(source.invalid("targets", problem));
        }
        self.targets.iter_mut().zip(targets).for_each(|(all, own)| all.extend(own));
        self.positions.extend(positions);
        self.uvs.extend(uvs.iter().map(|uv| DVec2::new(f64::from(uv[0]), f64::from(uv[1]))));
        self.weights.extend(weights);
        self.triangles.extend(corners.chunks_exact(3).map(|t| [t[0], t[1], t[2]].map(|i| i + first as u32)));
        Ok(())
    }
}

/// Whether the name of the file, the mesh node or the joints says that this is a left hand.
fn side(path: &Path, node: &Node, rig: &Rig) -> Side {
    let file = path.file_stem().map(|stem| stem.to_string_lossy().to_lowercase()).unwrap_or_default();
    let node_name = node.name().unwrap_or_default().to_lowercase();
    let is_left = |name: &str| {
        let name = name.to_lowercase();
        name.contains("left") || name.starts_with("l_") || name.ends_with("_l") || name.ends_with(".l")
    };
    // Names in the rig are more reliable than the file's name, which may be anything.
    let is_right = |name: &str| {
        let name = name.to_lowercase();
        name.contains("right") || name.starts_with("r_") || name.ends_with("_r") || name.ends_with(".r")
    };
    let names: Vec<&str> = rig.names.iter().map(String::as_str).chain([node_name.as_str(), file.as_str()]).collect();
    for name in names {
        if is_left(name) {
            return Side::Left;
        }
        if is_right(name) {
            return Side::Right;
        }
    }
    Side::Right
}

fn dvec3(v: [f32; 3]) -> DVec3 {
    DVec3::from_array(v.map(f64::from))
}

#[cfg(test)]
mod tests;
