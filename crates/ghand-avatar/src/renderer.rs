//! Playing an avatar: pose and camera in, picture out, all on the device.

use ghand_core::{Camera, Pose};
use ghand_render::pose::{PosePipeline, Template as PoseTemplate, pose_stride};
use ghand_render::splat::{Image, Purpose, SplatOptions, Splatter, View};
use ghand_render::{Gpu, RenderError, buffers};

use ghand_core::residual_skeleton::ResidualSkeleton;
use ghand_core::skinning::ResidualWeights;

use crate::avatar::Avatar;
use crate::direct::{DirectBuffers, DirectForward};
use crate::ply::SplatScene;

/// Opacity of every Gaussian; fixed, as in the paper.
pub const OPACITY: f32 = 1.0;

/// An avatar on the device, ready to be posed and rendered.
pub struct AvatarRenderer {
    /// The splatter; its image is the picture.
    pub splatter: Splatter,
    /// The pose pipeline.
    pub pose: PosePipeline,
    /// The learned tables on the device.
    pub tables: DirectBuffers,
    /// The property model's stages.
    pub forward: DirectForward,
    joint_count: usize,
}

impl AvatarRenderer {
    /// Puts an avatar on the device, with room for `frames` poses and images of at most `max_size` pixels. What is only
    /// looked at needs no gradients, and far less memory.
    ///
    /// # Errors
    /// [`RenderError`] if the device has no room for it or was lost.
    pub fn new(
        gpu: &Gpu,
        avatar: &Avatar,
        purpose: Purpose,
        frames: usize,
        max_size: [u32; 2],
    ) -> Result<AvatarRenderer, RenderError> {
        let options = SplatOptions { purpose, ..Default::default() };
        let splatter = Splatter::new(gpu, options, avatar.template.len(), max_size)?;
        let what = format!("an avatar of {} Gaussians with {frames} poses", avatar.template.len());
        gpu.scoped(&what, || AvatarRenderer::make(gpu, avatar, splatter, frames))
    }

    fn make(gpu: &Gpu, avatar: &Avatar, splatter: Splatter, frames: usize) -> AvatarRenderer {
        let (template, config) = (&avatar.template, &avatar.config);
        let tables = DirectBuffers::upload(gpu, &avatar.tables, template.len(), config);
        let joints: Vec<f32> = template.joints.iter().flat_map(|j| j.as_vec3().to_array()).collect();
        let parents: Vec<i32> = template.parents.iter().map(|p| p.map_or(-1, |p| p as i32)).collect();
        let pose_template = PoseTemplate {
            rest: &template.rest,
            weights: &template.weights,
            joints: &joints,
            parents: &parents,
            basis_count: config.shape_bases,
            frames: frames.max(1),
            anchored: config.residual_skeleton == ResidualSkeleton::Anchored,
            zero_sum: config.residual_weights == ResidualWeights::ZeroSum,
        };
        let pose = PosePipeline::new(gpu, &pose_template, &tables.properties(), splatter.gaussians());
        let forward = DirectForward::new(gpu, &pose, &tables, splatter.gaussians(), template, config);
        AvatarRenderer { splatter, pose, tables, forward, joint_count: template.joint_count() }
    }

    /// Stores a pose as frame number `frame`.
    ///
    /// # Errors
    /// [`RenderError::Invalid`] if the pose has another number of joints than the avatar.
    pub fn set_pose(&self, gpu: &Gpu, frame: usize, pose: &Pose) -> Result<(), RenderError> {
        if pose.rotations.len() != self.joint_count {
            return Err(RenderError::Invalid(format!(
                "a pose of {} joints for an avatar of {}",
                pose.rotations.len(),
                self.joint_count
            )));
        }
        let vectors = pose.rotations.iter().chain(std::iter::once(&pose.translation));
        let values: Vec<f32> = vectors.flat_map(|v| v.as_vec3().to_array()).collect();
        let offset = frame * pose_stride(self.joint_count) * size_of::<f32>();
        gpu.queue.write_buffer(&self.pose.poses, offset as u64, bytemuck::cast_slice(&values));
        Ok(())
    }

    /// Encodes the posing of the current frame: after it the splatter's table of Gaussians is that of the pose.
    pub fn encode_pose(&self, encoder: &mut wgpu::CommandEncoder) {
        let mut pass =
            encoder.begin_compute_pass(&wgpu::ComputePassDescriptor { label: Some("pose"), ..Default::default() });
        self.pose.encode_skeleton(&mut pass);
        self.forward.encode(&mut pass);
        self.pose.encode_skin(&mut pass);
    }

    /// Chooses the view of what is encoded from now on.
    ///
    /// # Errors
    /// [`RenderError::Invalid`] if the image is too large.
    pub fn set_view(&mut self, gpu: &Gpu, camera: &Camera, background: [f32; 3]) -> Result<(), RenderError> {
        self.splatter.set_view(gpu, View::new(camera, self.splatter.count(), background, OPACITY))
    }

    /// Renders stored frame `frame` from a camera and waits for the picture.
    ///
    /// # Errors
    /// [`RenderError`] if the device failed or was lost, or the image is too large.
    pub fn render(
        &mut self,
        gpu: &Gpu,
        frame: usize,
        camera: &Camera,
        background: [f32; 3],
    ) -> Result<Image, RenderError> {
        self.set_view(gpu, camera, background)?;
        self.put_in_pose(gpu, frame);
        self.splatter.render(gpu)
    }

    /// As [`AvatarRenderer::render`] for a picture of any height, in bands that the renderer holds: see
    /// [`Splatter::render_bands`].
    ///
    /// # Errors
    /// [`RenderError`] if the device failed or was lost, or the image is too wide.
    pub fn render_bands(
        &mut self,
        gpu: &Gpu,
        frame: usize,
        camera: &Camera,
        background: [f32; 3],
        sink: impl FnMut(u32, &Image),
    ) -> Result<(), RenderError> {
        self.put_in_pose(gpu, frame);
        self.splatter.render_bands(gpu, View::new(camera, self.splatter.count(), background, OPACITY), sink)
    }

    /// Leaves the Gaussians of stored frame `frame` in the splatter's table.
    fn put_in_pose(&mut self, gpu: &Gpu, frame: usize) {
        self.pose.set_frame(gpu, frame, 0.0, 0.0);
        let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        self.encode_pose(&mut encoder);
        gpu.queue.submit([encoder.finish()]);
    }

    /// The Gaussians of stored frame `frame` as a scene: see [`SplatScene::of_hand`].
    ///
    /// # Errors
    /// [`RenderError`] if the device failed or was lost.
    pub fn posed_scene(&mut self, gpu: &Gpu, frame: usize) -> Result<SplatScene, RenderError> {
        self.put_in_pose(gpu, frame);
        let model = self.splatter.options().model;
        let table: Vec<f32> = buffers::read(gpu, self.splatter.gaussians(), model.rows() * self.splatter.count())?;
        Ok(SplatScene::of_hand(&table))
    }
}
