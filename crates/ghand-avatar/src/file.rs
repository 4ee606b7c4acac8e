//! The avatar file `*.ghand`: a safetensors file with a JSON block in its metadata.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use bytemuck::Pod;
use ghand_core::light::DIRECTION_COUNT;
use ghand_core::pose::LARGEST_TRANSLATION;
use ghand_core::pose_offsets::{PoseOffsets, TrackerOffsets};
use ghand_core::{HandModel, Side};
use ghand_files::atomic_file::write_atomically;
use ghand_files::input_file;
use ghand_files::json_error::plain_json_error;
use ghand_hand_model::surface::sample_surface;
use glam::{DMat3, DQuat, DVec2, DVec3};
use safetensors::tensor::{Dtype, TensorView};
use safetensors::{SafeTensors, serialize};
use serde::{Deserialize, Serialize};

use crate::avatar::{Avatar, Provenance};
use crate::gaussian_glb::avatar_in;
use crate::light::{AvatarLight, Gloss, Lamp, Lamps, Light, LightKind, MOST_INTERREFLECTION, Trust};
use crate::properties::PropertyTables;
use crate::properties::baked::BakedTables;
use crate::properties::baked::template::{BakedTemplateParts, template_parts};
use crate::properties::baked::tensors::{self as baked, BakedMetadata};
use crate::properties::direct::DirectTables;
use crate::properties::network::NetworkTables;
use crate::template::{AvatarConfig, GaussianShape, Template};

/// The newest version that this program writes and reads: that of avatars with lamps near the hand or light that skin
/// throws on skin.
const NEWEST_VERSION: u32 = 6;
/// Version of avatars with plain skinning, which have no tables of residual terms.
const PLAIN_VERSION: u32 = 5;
/// Version of baked avatars.
const BAKED_VERSION: u32 = 4;
/// Version of avatars in a light. Version 1 had no `response_limits`, and its response
/// depended on the root's rotation; version 2 had no light.
const LIT_VERSION: u32 = 3;
/// Version of avatars without light, which other programs may read.
const UNLIT_VERSION: u32 = 2;
/// Maximum file size, bytes; the largest avatars have a few hundred million.
const LARGEST_FILE: u64 = 1 << 32;
/// Largest UV resolution of a network avatar: its atlas is sampled when the file is read.
const MAX_NETWORK_RESOLUTION: u32 = 2048;
/// Difference of a quaternion's squared length from 1 by rounding.
const ROUNDED_LENGTH: f64 = 1e-6;
/// Numbers of a lamp: its offset, its radius, its radiance.
const LAMP_NUMBERS: usize = 7;
/// Key of the JSON block in the file's metadata.
const METADATA_KEY: &str = "ghand";

/// Why an avatar file could not be read or written.
#[derive(Debug, thiserror::Error)]
pub enum AvatarFileError {
    /// Reading or writing failed.
    #[error("{path}: cannot {action} the avatar: {source}")]
    Io {
        /// The file.
        path: PathBuf,
        /// "read" or "write".
        action: &'static str,
        /// The cause.
        source: std::io::Error,
    },
    /// The avatar was not written, because [`Avatar::load`] would reject it.
    #[error("{path}: not written, because it would not be readable: {field} {problem}")]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// The part of the avatar that is wrong.
        field: String,
        /// What is wrong.
        problem: String,
    },
    /// The contents are unusable.
    #[error("{path}: {field}: {problem}")]
    Invalid {
        /// The file.
        path: PathBuf,
        /// The part that is wrong.
        field: String,
        /// What is wrong and what to do.
        problem: String,
    },
}

#[derive(Serialize, Deserialize)]
struct Metadata {
    format: String,
    version: u32,
    units: String,
    model: ModelMetadata,
    config: AvatarConfig,
    /// The property model, which determines the tensors. Omitted for the first model, `direct`.
    #[serde(default, skip_serializing_if = "ModelTag::is_first")]
    property_model: ModelTag,
    /// The kind of light, if light is apart from skin.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    light: Option<LightKind>,
    /// What the tensors of a baked avatar do not say.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    baked: Option<BakedMetadata>,
    provenance: Provenance,
}

/// The property model of an avatar.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum ModelTag {
    #[default]
    Direct,
    Network,
    Baked,
}

impl ModelTag {
    fn of(tables: &PropertyTables) -> ModelTag {
        match tables {
            PropertyTables::Direct(_) => ModelTag::Direct,
            PropertyTables::Network(_) => ModelTag::Network,
            PropertyTables::Baked(_) => ModelTag::Baked,
        }
    }

    fn is_first(&self) -> bool {
        *self == ModelTag::default()
    }
}

#[derive(Serialize, Deserialize)]
struct ModelMetadata {
    name: String,
    side: String,
    joint_names: Vec<String>,
    parents: Vec<Option<usize>>,
}

/// Tensors to be written to a file.
#[derive(Default)]
pub(crate) struct Tensors {
    names: Vec<(String, Dtype, Vec<usize>, Vec<u8>)>,
}

impl Tensors {
    pub(crate) fn add<T: Pod>(&mut self, name: &str, dtype: Dtype, shape: &[usize], values: &[T]) {
        self.names.push((name.into(), dtype, shape.to_vec(), bytemuck::cast_slice(values).to_vec()));
    }
}

fn flat3(v: &[DVec3]) -> Vec<f64> {
    v.iter().flat_map(|p| p.to_array()).collect()
}

fn tensors(avatar: &Avatar) -> Tensors {
    let (t, m) = (&avatar.template, &avatar.model);
    let count = t.len();
    let joints = t.joint_count();
    let mut out = Tensors::default();
    out.add("joints", Dtype::F64, &[joints, 3], &flat3(&t.joints));
    let is_baked = matches!(avatar.tables, PropertyTables::Baked(_));
    if !is_baked {
        out.add("rest", Dtype::F32, &[3, count], &t.rest);
        out.add("weights", Dtype::F32, &[joints, count], &t.weights);
        out.add("spacings", Dtype::F32, &[count], &t.spacings);
        if let Some(normals) = &t.normals {
            out.add("normals", Dtype::F32, &[3, count], normals);
        }
    }
    match &avatar.tables {
        PropertyTables::Baked(tables) => baked::write(tables, &mut out),
        PropertyTables::Direct(tables) => tables.write(t, &avatar.config, &mut out),
        PropertyTables::Network(tables) => tables.write(&mut out),
    }
    if let Some(lit) = &avatar.light {
        let light = &lit.light;
        out.add("light.coefficients", Dtype::F32, &[light.coefficients.len(), 3], light.coefficients.as_flattened());
        out.add("light.turn", Dtype::F64, &[4], &light.turn.to_array());
        out.add("light.faces", Dtype::U32, &[lit.faces.len()], &lit.faces);
        out.add("light.barycentric", Dtype::F32, &[lit.barycentric.len(), 3], lit.barycentric.as_flattened());
        if let Some(trust) = &light.trust {
            out.add("light.trust", Dtype::F32, &[trust.values().len(), 2], trust.values().as_flattened());
        }
        if let Some(lamps) = &light.lamps {
            let row = |lamp: &Lamp| {
                let radiance = lamp.radiance.map(f64::from);
                [&lamp.offset.to_array()[..], &[lamp.radius], &radiance].concat()
            };
            let rows: Vec<f64> = lamps.lamps.iter().flat_map(row).collect();
            out.add("light.lamps", Dtype::F64, &[lamps.lamps.len(), LAMP_NUMBERS], &rows);
            let [x, y, z] = lamps.place.to_array();
            out.add("light.place", Dtype::F64, &[4], &[x, y, z, lamps.reach]);
        }
        if lit.interreflection != [0.0; 3] {
            out.add("light.interreflection", Dtype::F32, &[3], &lit.interreflection);
        }
        if let Some(gloss) = &lit.gloss {
            out.add("light.roughness", Dtype::F64, &[1], &[gloss.roughness]);
            out.add("light.gloss", Dtype::F32, &[gloss.strengths.len(), 3], gloss.strengths.as_flattened());
        }
    }
    if let Some(seen) = &avatar.seen {
        out.add("seen", Dtype::F32, &[seen.len()], seen);
    }
    if let Some(TrackerOffsets { offsets, errors, frames }) = &avatar.tracker {
        let turns: Vec<f64> = offsets.turns.iter().flat_map(|turn| DQuat::from_mat3(turn).to_array()).collect();
        out.add("tracker.turns", Dtype::F64, &[offsets.turns.len(), 4], &turns);
        out.add("tracker.errors", Dtype::F64, &[errors.len()], errors);
        out.add("tracker.shifts", Dtype::F64, &[2, 3], &flat3(&[offsets.shift, offsets.root_shift]));
        out.add("tracker.frames", Dtype::U32, &[1], &[*frames]);
    }
    // Of a baked avatar the mesh is only looked at.
    let mut numbers = |name: &str, shape: &[usize], values: &[f64]| match is_baked {
        true => out.add(name, Dtype::F32, shape, &values.iter().map(|v| *v as f32).collect::<Vec<_>>()),
        false => out.add(name, Dtype::F64, shape, values),
    };
    numbers("mesh.vertices", &[m.vertices.len(), 3], &flat3(&m.vertices));
    numbers("mesh.uvs", &[m.uvs.len(), 2], &m.uvs.iter().flat_map(|u| u.to_array()).collect::<Vec<_>>());
    numbers("mesh.weights", &[m.vertices.len(), joints], &m.weights);
    out.add("mesh.faces", Dtype::U32, &[m.faces.len(), 3], m.faces.as_flattened());
    out.add("mesh.face_uvs", Dtype::U32, &[m.face_uvs.len(), 3], m.face_uvs.as_flattened());
    out
}

impl Avatar {
    /// Writes the avatar to a file, atomically. The bytes are first read back with the reader of [`Avatar::load`], so
    /// that it accepts every written file.
    ///
    /// # Errors
    /// [`AvatarFileError::Unreadable`] if [`Avatar::load`] would reject the avatar, [`AvatarFileError::Io`] if the file
    /// cannot be written. An existing file is then unchanged.
    pub fn save(&self, path: &Path) -> Result<(), AvatarFileError> {
        let bytes = self.to_bytes(path).and_then(|bytes| from_bytes(path, &bytes).map(|_| bytes));
        let bytes = bytes.map_err(|error| match error {
            AvatarFileError::Invalid { path, field, problem } => AvatarFileError::Unreadable { path, field, problem },
            other => other,
        })?;
        write_atomically(path, &bytes).map_err(|source| AvatarFileError::Io {
            path: path.into(),
            action: "write",
            source,
        })
    }

    /// Size of the avatar's file, bytes.
    ///
    /// # Errors
    /// [`AvatarFileError::Invalid`] if its parts do not fit into a file.
    pub fn file_size(&self) -> Result<usize, AvatarFileError> {
        self.to_bytes(Path::new("avatar")).map(|bytes| bytes.len())
    }

    /// The bytes of the avatar's file.
    pub(crate) fn to_bytes(&self, path: &Path) -> Result<Vec<u8>, AvatarFileError> {
        let invalid = |problem: String| AvatarFileError::Invalid { path: path.into(), field: "avatar".into(), problem };
        let metadata = Metadata {
            format: "ghand-avatar".into(),
            version: match (&self.tables, &self.light) {
                (_, Some(lit)) if lit.light.lamps.is_some() || lit.interreflection != [0.0; 3] => NEWEST_VERSION,
                (PropertyTables::Baked(_), _) => BAKED_VERSION,
                _ if self.config.plain_skinning => PLAIN_VERSION,
                (_, Some(_)) => LIT_VERSION,
                (_, None) => UNLIT_VERSION,
            },
            units: "metre".into(),
            model: ModelMetadata {
                name: self.template.name.clone(),
                side: if self.template.side == Side::Left { "left" } else { "right" }.into(),
                joint_names: self.template.joint_names.clone(),
                parents: self.template.parents.clone(),
            },
            config: self.config.clone(),
            property_model: ModelTag::of(&self.tables),
            light: self.light.as_ref().map(|lit| lit.light.kind),
            baked: match &self.tables {
                PropertyTables::Baked(tables) => Some(baked::metadata(tables)),
                _ => None,
            },
            provenance: self.provenance.clone(),
        };
        let metadata = serde_json::to_string(&metadata).map_err(|e| invalid(e.to_string()))?;
        let tensors = tensors(self);
        let mut views = Vec::new();
        for (name, dtype, shape, bytes) in &tensors.names {
            let view = TensorView::new(*dtype, shape.clone(), bytes).map_err(|e| invalid(e.to_string()))?;
            views.push((name.as_str(), view));
        }
        let block = HashMap::from([(METADATA_KEY.to_owned(), metadata)]);
        serialize(views, Some(block)).map_err(|e| invalid(e.to_string()))
    }

    /// Reads an avatar from a file and validates it completely: a `.ghand` file, or a glTF file that has one
    /// ([`crate::gaussian_glb`]).
    ///
    /// # Errors
    /// [`AvatarFileError`] names the file, the field and what is wrong with it.
    pub fn load(path: &Path) -> Result<Avatar, AvatarFileError> {
        let io = |source| AvatarFileError::Io { path: path.into(), action: "read", source };
        let bytes = input_file::read(path, LARGEST_FILE).map_err(io)?.ok_or_else(|| too_large(path))?;
        from_bytes(path, &bytes)
    }

    /// Reads an avatar from the bytes of its file, as [`Avatar::load`] does. `name` is for messages.
    ///
    /// # Errors
    /// As [`Avatar::load`].
    pub fn from_bytes(name: &Path, bytes: &[u8]) -> Result<Avatar, AvatarFileError> {
        from_bytes(name, bytes)
    }
}

fn too_large(path: &Path) -> AvatarFileError {
    let problem = format!("is larger than {} GiB, the limit for avatars", LARGEST_FILE >> 30);
    AvatarFileError::Invalid { path: path.into(), field: "file".into(), problem }
}

/// Parses and validates the bytes of an avatar file.
fn from_bytes(path: &Path, bytes: &[u8]) -> Result<Avatar, AvatarFileError> {
    if bytes.len() as u64 > LARGEST_FILE {
        return Err(too_large(path));
    }
    let bytes = match avatar_in(bytes) {
        Some(inside) => {
            inside.map_err(|(field, problem)| AvatarFileError::Invalid { path: path.into(), field, problem })?
        }
        None => bytes,
    };
    Reader::new(path, bytes)?.avatar()
}

/// An avatar file that is being read.
pub(crate) struct Reader<'a> {
    path: &'a Path,
    tensors: SafeTensors<'a>,
    metadata: Metadata,
}

impl<'a> Reader<'a> {
    fn new(path: &'a Path, bytes: &'a [u8]) -> Result<Reader<'a>, AvatarFileError> {
        let invalid =
            |field: &str, problem: String| AvatarFileError::Invalid { path: path.into(), field: field.into(), problem };
        let broken = |e: &dyn std::fmt::Display| {
            invalid("file", format!("is not an avatar, or is truncated ({e}); export it again"))
        };
        let (_, header) = SafeTensors::read_metadata(bytes).map_err(|e| broken(&e))?;
        let block = header.metadata().as_ref().and_then(|m| m.get(METADATA_KEY));
        let block = block
            .ok_or_else(|| invalid("metadata", "has no `ghand` block: a safetensors file, but not an avatar".into()))?;
        // The version comes first: an unknown version may have other fields.
        let fields: serde_json::Value = serde_json::from_str(block).map_err(|e| broken(&e))?;
        match fields.get("version").and_then(serde_json::Value::as_u64) {
            Some(v) if (u64::from(UNLIT_VERSION)..=u64::from(NEWEST_VERSION)).contains(&v) => {}
            Some(v) if v < u64::from(UNLIT_VERSION) => {
                let problem = format!("is {v}, this program reads version {NEWEST_VERSION}; train the avatar again");
                return Err(invalid("version", problem));
            }
            other => {
                let found = other.map_or("none".to_owned(), |v| v.to_string());
                return Err(invalid(
                    "version",
                    format!("is {found}, this program reads version {NEWEST_VERSION}; use the ghand that wrote it"),
                ));
            }
        }
        if fields.pointer("/config/residual_support").is_some() {
            let problem = "was removed in 0.2; train the avatar again, or use ghand 0.1";
            return Err(invalid("residual_support", problem.into()));
        }
        let metadata: Metadata = serde_json::from_str(block).map_err(|e| invalid("metadata", plain_json_error(&e)))?;
        let tensors = SafeTensors::deserialize(bytes).map_err(|e| broken(&e))?;
        Ok(Reader { path, tensors, metadata })
    }

    pub(crate) fn invalid(&self, field: &str, problem: impl Into<String>) -> AvatarFileError {
        AvatarFileError::Invalid { path: self.path.into(), field: field.into(), problem: problem.into() }
    }

    /// A tensor of this type; `shape` has `None` for dimensions of any size.
    fn tensor<T: Pod + Default>(
        &self,
        name: &str,
        dtype: Dtype,
        shape: &[Option<usize>],
    ) -> Result<(Vec<usize>, Vec<T>), AvatarFileError> {
        let view = self.tensors.tensor(name).map_err(|_| self.invalid(name, "is missing; export the avatar again"))?;
        let fits =
            view.shape().len() == shape.len() && view.shape().iter().zip(shape).all(|(a, b)| b.is_none_or(|b| b == *a));
        if view.dtype() != dtype || !fits {
            return Err(self.invalid(
                name,
                format!(
                    "is {:?} {:?}, expected {dtype:?} {shape:?}; the parts of the file do not match",
                    view.dtype(),
                    view.shape()
                ),
            ));
        }
        let mut values = vec![T::default(); view.data().len() / size_of::<T>()];
        bytemuck::cast_slice_mut::<T, u8>(&mut values).copy_from_slice(view.data());
        Ok((view.shape().to_vec(), values))
    }

    fn has(&self, name: &str) -> bool {
        self.tensors.tensor(name).is_ok()
    }

    /// An f32 tensor; `shape` has `None` for dimensions of any size.
    pub(crate) fn floats(&self, name: &str, shape: &[Option<usize>]) -> Result<Vec<f32>, AvatarFileError> {
        let (_, values) = self.tensor::<f32>(name, Dtype::F32, shape)?;
        match values.iter().position(|v| !v.is_finite()) {
            Some(i) => Err(self.invalid(name, format!("value {i} is not finite"))),
            None => Ok(values),
        }
    }

    /// A u32 tensor; `shape` has `None` for dimensions of any size.
    pub(crate) fn words(&self, name: &str, shape: &[Option<usize>]) -> Result<Vec<u32>, AvatarFileError> {
        Ok(self.tensor::<u32>(name, Dtype::U32, shape)?.1)
    }

    /// An f64 tensor, which is f32 in a baked avatar.
    fn mesh_numbers(&self, name: &str, shape: &[Option<usize>]) -> Result<Vec<f64>, AvatarFileError> {
        match self.metadata.property_model {
            ModelTag::Baked => Ok(self.floats(name, shape)?.into_iter().map(f64::from).collect()),
            _ => self.doubles(name, shape),
        }
    }

    fn doubles(&self, name: &str, shape: &[Option<usize>]) -> Result<Vec<f64>, AvatarFileError> {
        let (_, values) = self.tensor::<f64>(name, Dtype::F64, shape)?;
        match values.iter().position(|v| !v.is_finite()) {
            Some(i) => Err(self.invalid(name, format!("value {i} is not finite"))),
            None => Ok(values),
        }
    }

    fn avatar(&self) -> Result<Avatar, AvatarFileError> {
        let meta = &self.metadata;
        let model = &meta.model;
        let config = &meta.config;
        let joints = model.joint_names.len();
        let side = match model.side.as_str() {
            "right" => Side::Right,
            "left" => Side::Left,
            other => return Err(self.invalid("side", format!("is `{other}`, expected `right` or `left`"))),
        };
        let vec3 = |v: Vec<f64>| v.chunks_exact(3).map(DVec3::from_slice).collect::<Vec<_>>();
        let joint_positions = vec3(self.doubles("joints", &[Some(joints), Some(3)])?);
        if config.plain_skinning && meta.property_model != ModelTag::Direct {
            return Err(self.invalid("config", "only `direct` avatars have plain skinning; train it again"));
        }
        if config.shape_bases > 64 || config.color_components > 64 {
            return Err(self.invalid("config", "more than 64 bases or colour components"));
        }
        let baked = self.baked(joints)?;
        let BakedTemplateParts { rest, weights, spacings, normals } = match &baked {
            Some(tables) => template_parts(tables),
            None => self.template_parts(joints)?,
        };
        let count = spacings.len();
        let template = Template {
            name: model.name.clone(),
            side,
            joint_names: model.joint_names.clone(),
            parents: model.parents.clone(),
            joints: joint_positions.clone(),
            rest,
            weights,
            spacings,
            normals,
        };
        let tables = match (meta.property_model, &config.network) {
            (ModelTag::Baked, _) => {
                PropertyTables::Baked(baked.ok_or_else(|| self.invalid("baked", "is missing; bake the avatar again"))?)
            }
            (ModelTag::Direct, None) => PropertyTables::Direct(DirectTables::read(self, &template, config)?),
            (ModelTag::Network, Some(sizes)) => {
                PropertyTables::Network(NetworkTables::read(self, &template, config, sizes)?)
            }
            (ModelTag::Direct, Some(_)) => {
                return Err(self.invalid("config", "has sizes of networks, but the avatar has none"));
            }
            (ModelTag::Network, None) => {
                return Err(self.invalid("config", "has no sizes of the avatar's networks; train it again"));
            }
        };
        let vertices = vec3(self.mesh_numbers("mesh.vertices", &[None, Some(3)])?);
        let triples = |v: Vec<u32>| v.as_chunks::<3>().0.to_vec();
        let model = HandModel {
            name: model.name.clone(),
            side,
            joint_names: model.joint_names.clone(),
            parents: model.parents.clone(),
            joints: joint_positions,
            faces: triples(self.tensor("mesh.faces", Dtype::U32, &[None, Some(3)])?.1),
            uvs: self.mesh_numbers("mesh.uvs", &[None, Some(2)])?.chunks_exact(2).map(DVec2::from_slice).collect(),
            face_uvs: triples(self.tensor("mesh.face_uvs", Dtype::U32, &[None, Some(3)])?.1),
            weights: self.mesh_numbers("mesh.weights", &[Some(vertices.len()), Some(joints)])?,
            vertices,
            shape_directions: vec![],
            shape_names: vec![],
            pose_directions: vec![],
            joint_regressor: vec![],
            joint_directions: vec![],
            pose_space: None,
            source_vertices: vec![],
        };
        model.validate().map_err(|e| self.invalid("mesh", e.to_string()))?;
        if config.network.is_some() {
            self.check_atlas(&model, config.uv_resolution, count)?;
        }
        let light = meta.light.map(|kind| self.light(kind, count, model.faces.len(), joints)).transpose()?;
        let seen = self.has("seen").then(|| self.seen(count)).transpose()?;
        let tracker = self.has("tracker.turns").then(|| self.tracker(joints)).transpose()?;
        let config = config.clone();
        let provenance = meta.provenance.clone();
        Ok(Avatar { template, model, config, tables, light, seen, tracker, provenance })
    }

    /// The tables of a baked avatar; `None` if it is none.
    fn baked(&self, joints: usize) -> Result<Option<BakedTables>, AvatarFileError> {
        match (self.metadata.property_model, self.metadata.baked) {
            (ModelTag::Baked, Some(metadata)) => {
                let normals = self.metadata.config.gaussians == GaussianShape::Flat;
                baked::read(self, metadata, joints, normals).map(Some)
            }
            _ => Ok(None),
        }
    }

    /// The template's parts of an avatar of `joints` joints.
    fn template_parts(&self, joints: usize) -> Result<BakedTemplateParts, AvatarFileError> {
        let spacings = self.floats("spacings", &[None])?;
        let count = spacings.len();
        if count == 0 {
            return Err(self.invalid("spacings", "is empty: the avatar has no Gaussians"));
        }
        Ok(BakedTemplateParts {
            rest: self.floats("rest", &[Some(3), Some(count)])?,
            weights: self.floats("weights", &[Some(joints), Some(count)])?,
            normals: match self.metadata.config.gaussians {
                GaussianShape::Round => None,
                GaussianShape::Flat => Some(self.floats("normals", &[Some(3), Some(count)])?),
            },
            spacings,
        })
    }

    /// Fails unless the atlas of a mesh has a texel for each of `count` Gaussians, where networks find their features.
    fn check_atlas(&self, model: &HandModel, resolution: u32, count: usize) -> Result<(), AvatarFileError> {
        if resolution > MAX_NETWORK_RESOLUTION {
            let problem = format!("uv_resolution is {resolution}, the limit for networks is {MAX_NETWORK_RESOLUTION}");
            return Err(self.invalid("config", problem));
        }
        let texels = sample_surface(model, resolution).map_err(|e| self.invalid("mesh", e.to_string()))?.len();
        if texels == count {
            return Ok(());
        }
        let problem = format!("has {texels} texels on the hand at uv_resolution {resolution}, but {count} Gaussians");
        Err(self.invalid("mesh", format!("{problem}; train the avatar again")))
    }

    /// How much training saw each of `count` Gaussians.
    fn tracker(&self, joints: usize) -> Result<TrackerOffsets, AvatarFileError> {
        let wrong = |field: &str, what: &str| self.invalid(field, format!("{what}; train the avatar again"));
        let mut turns = vec![];
        for turn in self.doubles("tracker.turns", &[Some(joints), Some(4)])?.chunks_exact(4) {
            let turn = DQuat::from_slice(turn);
            if (turn.length_squared() - 1.0).abs() > ROUNDED_LENGTH {
                return Err(wrong("tracker.turns", "has a quaternion of another length than 1"));
            }
            turns.push(DMat3::from_quat(turn.normalize()));
        }
        let shifts = self.doubles("tracker.shifts", &[Some(2), Some(3)])?;
        if shifts.iter().any(|shift| shift.abs() > LARGEST_TRANSLATION) {
            return Err(wrong("tracker.shifts", "has a shift that is no hand's"));
        }
        let errors = self.doubles("tracker.errors", &[Some(joints)])?;
        if errors.iter().any(|error| *error < 0.0) {
            return Err(wrong("tracker.errors", "has a negative number"));
        }
        let [shift, root_shift] = [0, 3].map(|k| DVec3::from_slice(&shifts[k..k + 3]));
        let frames = self.words("tracker.frames", &[Some(1)])?[0];
        Ok(TrackerOffsets { offsets: PoseOffsets { turns, shift, root_shift }, errors, frames })
    }

    fn seen(&self, count: usize) -> Result<Vec<f32>, AvatarFileError> {
        let seen = self.floats("seen", &[Some(count)])?;
        match seen.iter().position(|weight| *weight < 0.0) {
            Some(i) => Err(self.invalid("seen", format!("value {i} is negative; train the avatar again"))),
            None => Ok(seen),
        }
    }

    /// A light on `count` Gaussians on a mesh of `faces` faces, of a hand of `joints` joints.
    fn light(
        &self,
        kind: LightKind,
        count: usize,
        faces: usize,
        joints: usize,
    ) -> Result<AvatarLight, AvatarFileError> {
        let coefficients = self.floats("light.coefficients", &[Some(kind.len()), Some(3)])?;
        let coefficients = coefficients.as_chunks::<3>().0.to_vec();
        if kind == LightKind::Transfer && coefficients.iter().flatten().any(|radiance| *radiance < 0.0) {
            return Err(self.invalid("light.coefficients", "a radiance is negative; train the avatar again"));
        }
        // The first files of version 3 had no turn.
        let turn = match self.has("light.turn") {
            true => DQuat::from_slice(&self.doubles("light.turn", &[Some(4)])?),
            false => DQuat::IDENTITY,
        };
        if !turn.is_normalized() {
            return Err(self.invalid("light.turn", "is not a unit quaternion; train the avatar again"));
        }
        let (_, on) = self.tensor::<u32>("light.faces", Dtype::U32, &[Some(count)])?;
        if let Some(face) = on.iter().find(|face| **face as usize >= faces) {
            return Err(self.invalid("light.faces", format!("names face {face} of {faces}; train the avatar again")));
        }
        let barycentric = self.floats("light.barycentric", &[Some(count), Some(3)])?.as_chunks::<3>().0.to_vec();
        let gloss = self.gloss(joints)?;
        let light = Light { kind, turn, coefficients, lamps: self.lamps(kind)?, trust: self.trust()? };
        Ok(AvatarLight { light, faces: on, barycentric, gloss, interreflection: self.interreflection(kind)? })
    }

    /// The lamps near the hand; files before version 6 have none.
    fn lamps(&self, kind: LightKind) -> Result<Option<Lamps>, AvatarFileError> {
        if !self.has("light.lamps") {
            return Ok(None);
        }
        let wrong = |field: &str, problem: &str| self.invalid(field, format!("{problem}; train the avatar again"));
        let rows = self.doubles("light.lamps", &[None, Some(LAMP_NUMBERS)])?;
        let lamp = |row: &[f64; LAMP_NUMBERS]| {
            let [x, y, z, radius, r, g, b] = *row;
            Lamp { offset: DVec3::new(x, y, z), radius, radiance: [r, g, b].map(|c| c as f32) }
        };
        let lamps: Vec<Lamp> = rows.as_chunks::<LAMP_NUMBERS>().0.iter().map(lamp).collect();
        if lamps.iter().any(|lamp| lamp.radius < 0.0 || lamp.radiance.iter().any(|c| *c < 0.0 || !c.is_finite())) {
            return Err(wrong("light.lamps", "has a negative or infinite radius or radiance"));
        }
        let place = self.doubles("light.place", &[Some(4)])?;
        let (reach, place) = (place[3], DVec3::from_slice(&place));
        if reach < 0.0 {
            return Err(wrong("light.place", "has a negative reach"));
        }
        if lamps.iter().any(|lamp| lamp.offset.length() <= reach) {
            return Err(wrong("light.lamps", "has a lamp where the hand is"));
        }
        if kind != LightKind::Transfer {
            return Err(wrong("light.lamps", "needs a light from directions"));
        }
        Ok(Some(Lamps { place, reach, lamps }))
    }

    /// Light that skin throws on skin; files before version 6 have none.
    fn interreflection(&self, kind: LightKind) -> Result<[f32; 3], AvatarFileError> {
        if !self.has("light.interreflection") {
            return Ok([0.0; 3]);
        }
        let parts = self.floats("light.interreflection", &[Some(3)])?;
        let valid = |(part, most): (&f32, f32)| (0.0..=most).contains(part);
        match <[f32; 3]>::try_from(parts) {
            Ok(parts) if kind == LightKind::Transfer && parts.iter().zip(MOST_INTERREFLECTION).all(valid) => Ok(parts),
            _ => Err(self.invalid(
                "light.interreflection",
                format!(
                    "is not between 0 and {MOST_INTERREFLECTION:?}, or light does not come from directions; train the \
                     avatar again"
                ),
            )),
        }
    }

    /// How far the light may be trusted; in files without it, everywhere.
    fn trust(&self) -> Result<Option<Trust>, AvatarFileError> {
        if !self.has("light.trust") {
            return Ok(None);
        }
        let trust =
            Trust::new(self.floats("light.trust", &[Some(DIRECTION_COUNT), Some(2)])?.as_chunks::<2>().0.to_vec());
        let problem = || {
            self.invalid(
                "light.trust",
                "is not between 0 and 1, or says that images show nothing; train the avatar again",
            )
        };
        trust.ok_or_else(problem).map(Some)
    }

    /// The gloss of a hand of `joints` joints; earlier files have none.
    fn gloss(&self, joints: usize) -> Result<Option<Gloss>, AvatarFileError> {
        if self.tensors.tensor("light.gloss").is_err() {
            return Ok(None);
        }
        let strengths = self.floats("light.gloss", &[Some(joints), Some(3)])?.as_chunks::<3>().0.to_vec();
        let roughness = self.doubles("light.roughness", &[Some(1)])?[0];
        if !(roughness > 0.0 && roughness <= 1.0) {
            let problem = format!("is {roughness}, it must be above 0 and at most 1; train the avatar again");
            return Err(self.invalid("light.roughness", problem));
        }
        if strengths.iter().flatten().any(|strength| *strength < 0.0) {
            return Err(self.invalid("light.gloss", "a strength is negative; train the avatar again"));
        }
        Ok(Some(Gloss { roughness, strengths }))
    }
}

#[cfg(test)]
mod tests;
