//! The parts of an avatar as tensors.

use ghand_core::pose::LARGEST_TRANSLATION;
use ghand_core::pose_offsets::{PoseOffsets, TrackerOffsets};
use ghand_core::{HandModel, Side};
use ghand_hand_model::surface::sample_surface;
use glam::{DMat3, DQuat, DVec2, DVec3};
use safetensors::tensor::Dtype;

use super::metadata::ModelTag;
use super::{AvatarFileError, Reader, Tensors, light};
use crate::avatar::Avatar;
use crate::properties::PropertyTables;
use crate::properties::baked::BakedTables;
use crate::properties::baked::template::{BakedTemplateParts, template_parts};
use crate::properties::baked::tensors as baked;
use crate::properties::direct::DirectTables;
use crate::properties::network::NetworkTables;
use crate::template::{GaussianShape, Template};

/// Largest UV resolution of a network avatar: its atlas is sampled when the file is read.
const MAX_NETWORK_RESOLUTION: u32 = 2048;
/// Difference of a quaternion's squared length from 1 by rounding.
const ROUNDED_LENGTH: f64 = 1e-6;

fn flat3(v: &[DVec3]) -> Vec<f64> {
    v.iter().flat_map(|p| p.to_array()).collect()
}

/// All tensors of an avatar.
pub(super) fn write(avatar: &Avatar) -> Tensors {
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
        light::write(lit, &mut out);
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

impl Reader<'_> {
    /// The avatar of the file, validated completely.
    pub(super) fn avatar(&self) -> Result<Avatar, AvatarFileError> {
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

    /// The constant offsets of the tracker of a hand of `joints` joints.
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

    /// How much training saw each of `count` Gaussians.
    fn seen(&self, count: usize) -> Result<Vec<f32>, AvatarFileError> {
        let seen = self.floats("seen", &[Some(count)])?;
        match seen.iter().position(|weight| *weight < 0.0) {
            Some(i) => Err(self.invalid("seen", format!("value {i} is negative; train the avatar again"))),
            None => Ok(seen),
        }
    }
}
