//! An avatar on the device, which writes its posed Gaussians to its part of a splatter's table.

use crate::deform::{
    BakedTemplate, DeformTemplate, Deformation, DeformationBackward, LitSurface, TablePlace, pose_stride,
};
use ghand_core::residual_skeleton::ResidualSkeleton;
use ghand_core::skinning::ResidualWeights;
use ghand_core::{InvalidHandModel, Pose};
use ghand_render::{Gpu, RenderError};
use glam::{DMat3, DVec3};

use crate::avatar::Avatar;
use crate::light::lit_hand::LitHand;
use crate::light::{Light, LitMesh};
use crate::neighbors::neighbors;
use crate::properties::{DeviceModel, PropertyTables};

/// An avatar on the device.
pub struct PosedAvatar {
    /// Its deformation: poses, joints, properties.
    pub deformation: Deformation,
    /// The property model, which fills the properties.
    pub model: DeviceModel,
    lit: Option<LitHand>,
    /// Rest position of the root joint, metres.
    root: DVec3,
    /// Rotation about the origin and shift of the whole avatar.
    placement: Option<(DMat3, DVec3)>,
    joint_count: usize,
    frames: usize,
    /// The frame whose pose later submissions use.
    frame: usize,
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
        let template = &avatar.template;
        let config = &avatar.config;
        let joints: Vec<f32> = template.joints.iter().flat_map(|j| j.as_vec3().to_array()).collect();
        let parents: Vec<i32> = template.parents.iter().map(|p| p.map_or(-1, |p| p as i32)).collect();
        let frames = frames.max(1);
        let lit = avatar.light.as_ref().map(|light| (light, LitMesh::new(light, &avatar.model)));
        let corners = lit.as_ref().map(|(light, mesh)| light.corners(mesh));
        let lit_surface = lit.as_ref().zip(corners.as_ref()).map(|((light, mesh), corners)| LitSurface {
            vertex_count: mesh.vertex_count(),
            corners,
            barycentric: &light.barycentric,
            glossy: light.gloss.is_some(),
        });
        if let PropertyTables::Baked(tables) = &avatar.tables {
            let template = BakedTemplate { joints: &joints, parents: &parents, frames, lit_surface };
            let deformation = Deformation::baked(gpu, &template, tables, gaussians, place);
            let lit = lit.map(|(light, mesh)| LitHand::new(light, mesh, frames));
            return PosedAvatar::with(gpu, avatar, deformation, lit, frames);
        }
        let deform_template = DeformTemplate {
            neighbors: &neighbors(template),
            normals: template.normals.as_deref(),
            rest: &template.rest,
            weights: &template.weights,
            joints: &joints,
            parents: &parents,
            basis_count: config.shape_bases,
            coefficients: config.coefficients,
            frames,
            plain_skinning: config.plain_skinning,
            anchored: config.residual_skeleton == ResidualSkeleton::Anchored,
            zero_sum: config.residual_weights == ResidualWeights::ZeroSum,
            lit_surface,
        };
        let deformation = Deformation::new(gpu, &deform_template, gaussians, place);
        let lit = lit.map(|(light, mesh)| LitHand::new(light, mesh, frames));
        PosedAvatar::with(gpu, avatar, deformation, lit, frames)
    }

    /// With the deformation and the light of this avatar.
    fn with(
        gpu: &Gpu,
        avatar: &Avatar,
        deformation: Deformation,
        lit: Option<LitHand>,
        frames: usize,
    ) -> Result<PosedAvatar, RenderError> {
        let template = &avatar.template;
        let config = &avatar.config;
        let model = avatar.tables.on_device(gpu, &avatar.model, template, config, &deformation)?;
        let root = template.joints.first().copied().unwrap_or_default();
        let joint_count = template.joint_count();
        Ok(PosedAvatar { deformation, model, lit, root, placement: None, joint_count, frames, frame: 0 })
    }

    /// Puts the avatar into another light, for poses set later; nothing changes if light is part of its colours.
    pub fn set_light(&mut self, light: &Light) {
        if let Some(lit) = &mut self.lit {
            lit.set_light(light);
        }
    }

    /// Moves the whole avatar, in poses set later: see [`crate::Scene::set_placement`].
    pub fn set_placement(&mut self, rotation: DMat3, translation: DVec3) {
        self.placement = Some((rotation, translation));
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
        let placed = self.placement.map(|(rotation, shift)| pose.moved(&rotation, shift, self.root));
        let pose = placed.as_ref().unwrap_or(pose);
        let vectors = pose.rotations.iter().chain(std::iter::once(&pose.translation));
        let values: Vec<f32> = vectors.flat_map(|v| v.as_vec3().to_array()).collect();
        let offset = frame * pose_stride(self.joint_count) * size_of::<f32>();
        gpu.queue.write_buffer(self.deformation.poses(), offset as u64, bytemuck::cast_slice(&values));
        if let Some(lit) = &mut self.lit {
            let shades = lit.set_pose(frame, pose).map_err(invalid)?;
            self.deformation.set_shades(gpu, frame, &shades)?;
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
        if let Some(lit) = &mut self.lit {
            let gloss = lit.missing_gloss(self.frame, eye.unwrap_or(DVec3::NAN)).map_err(invalid)?;
            gloss.map_or(Ok(()), |gloss| self.deformation.set_gloss(gpu, &gloss))?;
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
    /// [`RenderError`] if the device has too little memory or was lost; [`RenderError::Invalid`] if the avatar is baked.
    pub fn prepare_training(
        &mut self,
        gpu: &Gpu,
        d_gaussians: &wgpu::Buffer,
        mobility: &[f32],
    ) -> Result<DeformationBackward, RenderError> {
        let model = self.model.trainable_mut()?;
        let backward = gpu.scoped("the gradients of an avatar", || {
            DeformationBackward::new(gpu, &self.deformation, d_gaussians, mobility)
        })?;
        model.prepare_training(gpu, &self.deformation, &backward)?;
        Ok(backward)
    }
}

fn invalid(error: InvalidHandModel) -> RenderError {
    RenderError::Invalid(error.to_string())
}
