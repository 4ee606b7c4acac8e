//! An avatar on the device, which writes its posed Gaussians to its part of a splatter's table.

use std::collections::BTreeMap;

use ghand_core::residual_skeleton::ResidualSkeleton;
use ghand_core::skinning::ResidualWeights;
use ghand_core::{HandModel, Pose};
use ghand_render::deform::{DeformTemplate, Deformation, DeformationBackward, LitSurface, TablePlace, pose_stride};
use ghand_render::{Gpu, RenderError};
use glam::DVec3;

use crate::avatar::Avatar;
use crate::light::gloss;
use crate::light::{AvatarLight, Light, LightKind, Parts};
use crate::properties::PropertyModel;

/// An avatar on the device.
pub struct PosedAvatar {
    /// Its deformation: poses, joints, properties.
    pub deformation: Deformation,
    /// The property model, which fills the properties.
    pub model: Box<dyn PropertyModel>,
    lit: Option<LitHand>,
    joint_count: usize,
    frames: usize,
    /// The frame whose pose later submissions use.
    frame: usize,
}

/// The light, and the mesh on which it falls.
struct LitHand {
    light: Light,
    model: HandModel,
    gloss: Option<VertexGloss>,
}

/// Frames whose parts of the light are kept: half a megabyte each.
const MOST_KEPT: usize = 512;

/// What the mesh mirrors.
struct VertexGloss {
    roughness: f64,
    strengths: Vec<[f32; 3]>,
    /// The light and pose of each frame.
    poses: Vec<Option<(Light, Pose)>>,
    /// Frames' parts of their light.
    parts: BTreeMap<usize, Parts>,
    /// The frame and eye whose gloss the device has.
    current: Option<(usize, DVec3)>,
}

impl LitHand {
    fn new(lit: &AvatarLight, model: &HandModel, frames: usize) -> LitHand {
        let gloss = lit.gloss.as_ref().map(|gloss| VertexGloss {
            roughness: gloss.roughness,
            strengths: gloss.vertex_strengths(model),
            poses: vec![None; frames],
            parts: BTreeMap::new(),
            current: None,
        });
        LitHand { light: lit.light.clone(), model: model.clone(), gloss }
    }
}

impl VertexGloss {
    fn set_pose(&mut self, frame: usize, light: &Light, pose: &Pose, parts: Parts) {
        self.poses[frame] = Some((light.clone(), pose.clone()));
        self.keep(frame, parts);
        self.current = None;
    }

    fn keep(&mut self, frame: usize, parts: Parts) {
        if self.parts.len() >= MOST_KEPT {
            self.parts.pop_first();
        }
        self.parts.insert(frame, parts);
    }

    /// The gloss that the device should have and has not, for an eye; none from nowhere.
    fn update(&mut self, model: &HandModel, frame: usize, eye: Option<DVec3>) -> Option<Vec<[f32; 3]>> {
        // A NaN is never equal: then it is computed each time.
        let eye = eye.unwrap_or(DVec3::NAN);
        if self.current == Some((frame, eye)) {
            return None;
        }
        self.current = Some((frame, eye));
        let none = || vec![[0.0; 3]; self.strengths.len()];
        let usable = |(light, _): &&(Light, Pose)| eye.is_finite() && light.kind == LightKind::Transfer;
        let Some((light, pose)) = self.poses[frame].as_ref().filter(usable) else { return Some(none()) };
        let light = light.clone();
        if !self.parts.contains_key(&frame) {
            // The pose fitted the hand when it was set.
            let parts = light.parts(model, pose).ok()?;
            self.keep(frame, parts);
        }
        let (light, parts) = (&light, self.parts.get(&frame)?);
        let mut values = gloss::of_vertices(light, parts, self.roughness, eye);
        gloss::scale(&mut values, &self.strengths);
        Some(values)
    }
}

impl PosedAvatar {
    /// Puts an avatar on the device, with space for `frames` poses (at least one). Its Gaussians go to `place` in the
    /// table `gaussians`.
    ///
    /// # Errors
    /// As [`crate::PropertyTables::on_device`].
    pub(crate) fn new(
        gpu: &Gpu,
        avatar: &Avatar,
        frames: usize,
        gaussians: &wgpu::Buffer,
        place: TablePlace,
    ) -> Result<PosedAvatar, RenderError> {
        let (template, config) = (&avatar.template, &avatar.config);
        let joints: Vec<f32> = template.joints.iter().flat_map(|j| j.as_vec3().to_array()).collect();
        let parents: Vec<i32> = template.parents.iter().map(|p| p.map_or(-1, |p| p as i32)).collect();
        let frames = frames.max(1);
        let corners = avatar.light.as_ref().map(|light| light.corners(&avatar.model));
        let lit_surface = avatar.light.as_ref().zip(corners.as_ref()).map(|(light, corners)| LitSurface {
            vertex_count: avatar.model.vertices.len(),
            corners,
            barycentric: &light.barycentric,
            glossy: light.gloss.is_some(),
        });
        let deform_template = DeformTemplate {
            normals: template.normals.as_deref(),
            rest: &template.rest,
            weights: &template.weights,
            joints: &joints,
            parents: &parents,
            basis_count: config.shape_bases,
            coefficients: config.coefficients,
            frames,
            anchored: config.residual_skeleton == ResidualSkeleton::Anchored,
            zero_sum: config.residual_weights == ResidualWeights::ZeroSum,
            lit_surface,
        };
        let deformation = Deformation::new(gpu, &deform_template, gaussians, place);
        let model = avatar.tables.on_device(gpu, &avatar.model, template, config, &deformation)?;
        let lit = avatar.light.as_ref().map(|light| LitHand::new(light, &avatar.model, frames));
        Ok(PosedAvatar { deformation, model, lit, joint_count: template.joint_count(), frames, frame: 0 })
    }

    /// Puts the avatar into another light, for poses set later; nothing changes if light is part of its colours.
    pub fn set_light(&mut self, light: &Light) {
        if let Some(lit) = &mut self.lit {
            lit.light.clone_from(light);
        }
    }

    /// Sets the frame whose pose later submissions use.
    pub fn set_frame(&mut self, gpu: &Gpu, frame: usize) {
        self.frame = frame;
        self.deformation.set_frame(gpu, frame);
    }

    /// Sets the pose of frame number `frame`.
    ///
    /// # Errors
    /// [`RenderError::Invalid`] if the pose does not have the avatar's number of joints, or the frame does not exist.
    pub fn set_pose(&mut self, gpu: &Gpu, frame: usize, pose: &Pose) -> Result<(), RenderError> {
        if pose.rotations.len() != self.joint_count {
            return Err(RenderError::Invalid(format!(
                "a pose of {} joints for an avatar of {}",
                pose.rotations.len(),
                self.joint_count
            )));
        }
        if frame >= self.frames {
            return Err(RenderError::Invalid(format!("frame {frame}, but there are only {} poses", self.frames)));
        }
        let vectors = pose.rotations.iter().chain(std::iter::once(&pose.translation));
        let values: Vec<f32> = vectors.flat_map(|v| v.as_vec3().to_array()).collect();
        let offset = frame * pose_stride(self.joint_count) * size_of::<f32>();
        gpu.queue.write_buffer(self.deformation.poses(), offset as u64, bytemuck::cast_slice(&values));
        if let Some(lit) = &mut self.lit {
            let parts = lit.light.parts(&lit.model, pose).map_err(|e| RenderError::Invalid(e.to_string()))?;
            self.deformation.set_shades(gpu, frame, &lit.light.shades(&parts))?;
            if let Some(gloss) = &mut lit.gloss {
                gloss.set_pose(frame, &lit.light, pose, parts);
            }
        }
        Ok(())
    }

    /// Encodes the posing of the current frame, which fills the avatar's part of the table. What its skin mirrors is what
    /// the eye sees (metres, world axes); nothing if there is none.
    ///
    /// # Errors
    /// [`RenderError`] if the property model fails.
    pub fn encode(
        &mut self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        eye: Option<DVec3>,
    ) -> Result<(), RenderError> {
        let lit = self.lit.as_mut().and_then(|lit| Some((&lit.model, lit.gloss.as_mut()?)));
        if let Some(gloss) = lit.and_then(|(model, gloss)| gloss.update(model, self.frame, eye)) {
            self.deformation.set_gloss(gpu, &gloss)?;
        }
        self.deformation.encode_skeleton(encoder);
        self.model.forward(gpu, encoder, &self.deformation)?;
        self.deformation.encode_skin(encoder);
        Ok(())
    }

    /// Makes the backward pass: gradients of deformation and property model. `d_gaussians` is the gradient of the
    /// table; `mobility` is 1 for each joint whose rotation gets a gradient, else 0.
    ///
    /// # Errors
    /// [`RenderError`] if the device has too little memory or was lost.
    pub fn prepare_training(
        &mut self,
        gpu: &Gpu,
        d_gaussians: &wgpu::Buffer,
        mobility: &[f32],
    ) -> Result<DeformationBackward, RenderError> {
        let backward = gpu.scoped("the gradients of an avatar", || {
            DeformationBackward::new(gpu, &self.deformation, d_gaussians, mobility)
        })?;
        self.model.prepare_training(gpu, &self.deformation, &backward)?;
        Ok(backward)
    }
}
