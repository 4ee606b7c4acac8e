//! One training step on the device: pose, splat, loss, all the way back, Adam. Nothing but a counter is read back.

use ghand_avatar::direct::{DirectBackward, DirectBuffers};
use ghand_avatar::{Avatar, AvatarRenderer};
use ghand_render::image_loss::{ImageLoss, LossWeights};
use ghand_render::optimizer::{Adam, AdamTable, AdamUniforms, Grouping};
use ghand_render::pose::{PoseBackward, pose_stride};
use ghand_render::splat::{COUNTERS, Purpose};
use ghand_render::{Gpu, RenderError, buffers};

use crate::settings::TrainSettings;
use crate::views::TrainView;

/// Everything of a step that lives on the device.
pub struct Step {
    /// The avatar and its forward pipeline.
    pub renderer: AvatarRenderer,
    loss: ImageLoss,
    pose_backward: PoseBackward,
    direct_backward: DirectBackward,
    shape_basis: AdamTable,
    residual_weights: AdamTable,
    regressor: AdamTable,
    appearance: AdamTable,
    response: AdamTable,
    poses: AdamTable,
    joints: AdamTable,
    lengths: [usize; 6],
    count: usize,
    joint_count: usize,
}

/// The rates of one step, after the schedule.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rates {
    /// Number of the step, from 1.
    pub step: u64,
    /// Factor on all table rates.
    pub tables: f64,
    /// Factor on pose and translation; 0 keeps the pose.
    pub pose: f64,
    /// How often this frame's pose has been stepped, this time included.
    pub pose_step: u64,
    /// Weight of the scale term.
    pub scale_weight: f64,
}

impl Step {
    /// Puts an avatar and `frames` poses on the device. `mobility` is 1 for joints whose rotation may be refined.
    ///
    /// # Errors
    /// [`RenderError`] if the device has no room for it or was lost.
    pub fn new(
        gpu: &Gpu,
        avatar: &Avatar,
        frames: usize,
        max_size: [u32; 2],
        mobility: &[f32],
    ) -> Result<Step, RenderError> {
        let (template, config) = (&avatar.template, &avatar.config);
        let (count, joint_count) = (template.len(), template.joint_count());
        let renderer = AvatarRenderer::new(gpu, avatar, Purpose::Gradients, frames, max_size)?;
        let splatter = &renderer.splatter;
        let loss =
            ImageLoss::new(gpu, splatter.image(), splatter.d_image(), max_size[0] as usize * max_size[1] as usize)?;
        let what = format!("the gradients of an avatar of {count} Gaussians");
        let (gradients, pose_backward, direct_backward) = gpu.scoped(&what, || {
            let gradients = DirectBuffers::zeroed(gpu, count, joint_count, config);
            let pose_backward = PoseBackward::new(
                gpu,
                &renderer.pose,
                &renderer.tables.properties(),
                &gradients.property_gradients(),
                splatter.d_gaussians(),
                mobility,
            );
            let direct_backward = DirectBackward::new(
                gpu,
                &renderer.forward,
                &renderer.pose,
                &pose_backward,
                &renderer.tables,
                &gradients,
                [splatter.gaussians(), splatter.d_gaussians()],
                template,
                config,
            );
            (gradients, pose_backward, direct_backward)
        })?;
        let lengths = ghand_avatar::direct::table_lengths(count, joint_count, config);
        let adam = Adam::new(gpu)?;
        let table = |values: &wgpu::Buffer, gradient: &wgpu::Buffer, length: usize, slots: usize| {
            adam.table(gpu, values, gradient, splatter.counters(), length, slots, Grouping::Scalars)
        };
        let (t, g) = (&renderer.tables, &gradients);
        let pose_length = frames * pose_stride(joint_count);
        Ok(Step {
            shape_basis: table(&t.shape_basis, &g.shape_basis, lengths[0], 1)?,
            residual_weights: table(&t.residual_weights, &g.residual_weights, lengths[1], 1)?,
            regressor: table(&t.regressor, &g.regressor, lengths[2], 1)?,
            appearance: table(&t.appearance, &g.appearance, lengths[3], 3)?,
            response: table(&t.response, &g.response, lengths[4], 1)?,
            joints: table(&renderer.pose.joints, &pose_backward.d_joints, 3 * joint_count, 1)?,
            poses: adam.table(
                gpu,
                &renderer.pose.poses,
                &pose_backward.d_pose,
                splatter.counters(),
                pose_length,
                2,
                Grouping::Vectors,
            )?,
            renderer,
            loss,
            pose_backward,
            direct_backward,
            lengths,
            count,
            joint_count,
        })
    }

    /// Runs one step on one view. `value_count` is the number of values that the loss is a mean over (those of the whole
    /// image, so that crops of all sizes weigh the same).
    ///
    /// # Errors
    /// [`RenderError`] if the device failed or was lost, or the view needs more memory than it has.
    pub fn run(
        &mut self,
        gpu: &Gpu,
        view: &TrainView,
        value_count: f64,
        background: [f32; 3],
        settings: &TrainSettings,
        rates: &Rates,
    ) -> Result<(), RenderError> {
        self.aim(gpu, view, value_count, background, settings, rates.scale_weight)?;
        self.until_complete(gpu, |step, encoder| {
            step.renderer.encode_pose(encoder);
            step.renderer.splatter.forward(encoder);
            step.loss.encode(encoder);
            step.renderer.splatter.backward(encoder);
            let mut pass = encoder
                .begin_compute_pass(&wgpu::ComputePassDescriptor { label: Some("backward"), ..Default::default() });
            step.direct_backward.encode_appearance(&mut pass);
            step.pose_backward.encode_properties(&mut pass);
            step.direct_backward.encode_response(&mut pass);
            step.pose_backward.encode_pose(&mut pass);
            step.update(gpu, &mut pass, view.frame, settings, rates);
        })
    }

    /// The loss of one view, as a mean over its crop; nothing is learned from it.
    ///
    /// # Errors
    /// As [`Step::run`].
    pub fn measure(
        &mut self,
        gpu: &Gpu,
        view: &TrainView,
        background: [f32; 3],
        settings: &TrainSettings,
    ) -> Result<f64, RenderError> {
        self.aim(gpu, view, 3.0 * view.pixels.len() as f64, background, settings, 0.0)?;
        self.until_complete(gpu, |step, encoder| {
            step.renderer.encode_pose(encoder);
            step.renderer.splatter.forward(encoder);
            step.loss.encode(encoder);
        })?;
        let [l1, ssim] = self.loss(gpu, view)?;
        Ok(settings.l1_weight * l1 + settings.ssim_weight * ssim)
    }

    /// Makes a view the one that is worked on.
    fn aim(
        &mut self,
        gpu: &Gpu,
        view: &TrainView,
        value_count: f64,
        background: [f32; 3],
        settings: &TrainSettings,
        scale_weight: f64,
    ) -> Result<(), RenderError> {
        let weights =
            LossWeights { l1: settings.l1_weight as f32, ssim: settings.ssim_weight as f32, ..Default::default() };
        self.loss.set_target(gpu, view.size, &view.pixels, weights, value_count)?;
        // Gradient of weight * mean |Delta|^2 and weight * mean sigma^2.
        let per_gaussian = |weight: f64| (2.0 * weight / self.count as f64) as f32;
        self.renderer.pose.set_frame(gpu, view.frame, per_gaussian(settings.offset_weight), per_gaussian(scale_weight));
        self.renderer.set_view(gpu, &view.camera, background)
    }

    /// Submits what `encode` encodes, and again with more room for intersections until none was left out.
    fn until_complete(
        &mut self,
        gpu: &Gpu,
        encode: impl Fn(&Step, &mut wgpu::CommandEncoder),
    ) -> Result<(), RenderError> {
        loop {
            let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
            encode(self, &mut encoder);
            gpu.queue.submit([encoder.finish()]);
            // An incomplete frame has changed nothing (Adam checks the counters too): grow and repeat.
            let counters: Vec<u32> = buffers::read(gpu, self.renderer.splatter.counters(), COUNTERS)?;
            if self.renderer.splatter.complete_for(gpu, &counters)? {
                return Ok(());
            }
        }
    }

    fn update(
        &self,
        gpu: &Gpu,
        pass: &mut wgpu::ComputePass<'_>,
        frame: usize,
        settings: &TrainSettings,
        rates: &Rates,
    ) {
        let n = self.count;
        let whole = [
            (&self.shape_basis, 0, 0..self.lengths[0], settings.rate_shape_basis),
            (&self.residual_weights, 0, 0..self.lengths[1], settings.rate_residual_weights),
            (&self.regressor, 0, 0..self.lengths[2], settings.rate_regressor),
            // Rows of the appearance table: scale, base colour (3), components.
            (&self.appearance, 0, 0..n, settings.rate_scale),
            (&self.appearance, 1, n..4 * n, settings.rate_color),
            (&self.appearance, 2, 4 * n..self.lengths[3], settings.rate_components),
            (&self.response, 0, 0..self.lengths[4], settings.rate_response),
            (&self.joints, 0, 0..3 * self.joint_count, settings.rate_joints),
        ];
        for (table, slot, range, rate) in whole {
            if rate > 0.0 && !range.is_empty() {
                let start = range.start;
                table.encode(gpu, pass, slot, &AdamUniforms::new(range, start, rate * rates.tables, rates.step));
            }
        }
        if rates.pose > 0.0 {
            let start = frame * pose_stride(self.joint_count);
            let middle = start + 3 * self.joint_count;
            let rotations = AdamUniforms::new(start..middle, 0, settings.rate_pose * rates.pose, rates.pose_step);
            let translation = AdamUniforms::new(
                middle..middle + 3,
                3 * self.joint_count,
                settings.rate_translation * rates.pose,
                rates.pose_step,
            );
            self.poses.encode(gpu, pass, 0, &rotations);
            self.poses.encode(gpu, pass, 1, &translation);
        }
    }

    /// L1 and 1 - SSIM of the last step's view, as means over its crop.
    ///
    /// # Errors
    /// [`RenderError`] if the device failed or was lost.
    pub fn loss(&self, gpu: &Gpu, view: &TrainView) -> Result<[f64; 2], RenderError> {
        let value = self.loss.value(gpu)?;
        let count = 3.0 * view.pixels.len() as f64;
        Ok([value.l1_sum / count, 1.0 - value.ssim_sum / count])
    }
}
