//! An avatar on the device that is posed but not drawn: its Gaussians as numbers.

use crate::deform::{Properties, TablePlace};
use ghand_core::Pose;
use ghand_render::splat::{Shape, SplatModel};
use ghand_render::{Gpu, RenderError, buffers};

use crate::avatar::Avatar;
use crate::posed_avatar::PosedAvatar;
use crate::reference::{TwinError, pose_avatar};
use crate::scene::splat_model;
use crate::scene_files::{Antialiasing, SplatScene};
use crate::template::GaussianShape;

/// An avatar in one pose at a time, without a splatter.
pub struct PosedHand {
    avatar: PosedAvatar,
    model: SplatModel,
    count: usize,
    /// The table of its Gaussians, `[rows][N]`.
    gaussians: wgpu::Buffer,
}

impl PosedHand {
    /// Puts an avatar on the device.
    ///
    /// # Errors
    /// [`RenderError`] if the device has too little memory or was lost.
    pub fn new(gpu: &Gpu, avatar: &Avatar) -> Result<PosedHand, RenderError> {
        let model = splat_model(&[avatar])?;
        let count = avatar.template.len();
        gpu.scoped(&format!("an avatar of {count} Gaussians"), || {
            let gaussians = buffers::zeroed(gpu, "gaussians", model.rows() * count);
            let place = TablePlace { columns: count, first: 0, shape: model.shape };
            let avatar = PosedAvatar::new(gpu, avatar, 1, &gaussians, place)?;
            Ok(PosedHand { avatar, model, count, gaussians })
        })?
    }

    /// Poses it, without waiting.
    ///
    /// # Errors
    /// [`RenderError::Invalid`] if the pose has the wrong number of joints; [`RenderError`] if the property model fails.
    pub fn set_pose(&mut self, gpu: &Gpu, pose: &Pose) -> Result<(), RenderError> {
        self.avatar.set_pose(gpu, 0, pose)?;
        self.avatar.set_frame(gpu, 0);
        let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        self.avatar.encode(gpu, &mut encoder, None)?;
        gpu.queue.submit([encoder.finish()]);
        Ok(())
    }

    /// The splatter's table of the pose without gloss, which depends on the view, `[rows][N]`.
    ///
    /// # Errors
    /// [`RenderError`] if the device failed or was lost.
    pub fn table(&self, gpu: &Gpu) -> Result<Vec<f32>, RenderError> {
        buffers::read(gpu, &self.gaussians, self.model.rows() * self.count)
    }

    /// The Gaussians of the pose, without gloss: see [`SplatScene::of_hand`].
    ///
    /// # Errors
    /// As [`PosedHand::table`].
    pub fn splats(&self, gpu: &Gpu) -> Result<SplatScene, RenderError> {
        let SplatModel { shape, antialias, narrow, .. } = self.model;
        let antialias = Antialiasing::of(antialias, narrow);
        Ok(SplatScene { antialias, ..SplatScene::of_hand(&self.table(gpu)?, shape) })
    }

    /// As [`PosedHand::splats`] of an avatar in a pose, computed in f64 without a device; the numbers differ by rounding.
    ///
    /// # Errors
    /// [`TwinError`] if the pose does not fit the avatar.
    pub fn splats_on_host(avatar: &Avatar, pose: &Pose) -> Result<SplatScene, TwinError> {
        let table: Vec<f32> = pose_avatar(avatar, pose)?.table().into_iter().map(|value| value as f32).collect();
        let config = &avatar.config;
        let shape = if config.gaussians == GaussianShape::Flat { Shape::Flat } else { Shape::Isotropic };
        let antialias = Antialiasing::of(config.antialias, config.narrow_blur);
        Ok(SplatScene { antialias, ..SplatScene::of_hand(&table, shape) })
    }

    /// Its properties in the pose.
    pub fn properties(&self) -> &Properties {
        self.avatar.deformation.properties()
    }

    /// Number of its Gaussians.
    pub fn count(&self) -> usize {
        self.count
    }
}
