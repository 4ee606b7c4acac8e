//! One training step on the device: pose, splat, loss, the backward pass and the update. Of most
//! steps only counters are read back; a model on the host reads gradients, too.

use std::sync::Arc;
use std::time::Instant;

use ghand_avatar::deform::{DeformationBackward, pose_stride};
use ghand_avatar::neighbors::neighbors;
use ghand_avatar::properties::state_part;
use ghand_avatar::{Avatar, PosedAvatar, PropertyRates, PropertyTables, Scene};
use ghand_core::Camera;
use ghand_render::image_loss::{ImageLoss, LossWeights};
use ghand_render::optimizer::{Adam, AdamTable, AdamUniforms, Grouping};
use ghand_render::penalty::Penalty;
use ghand_render::pipeline::compute_pass;
use ghand_render::roughness::Roughness;
use ghand_render::splat::{Image, Purpose, Splatter};
use ghand_render::{Gpu, RenderError, buffers};

use crate::checkpoint::SavedNumbers;
use crate::lpips_term::LpipsTerm;
use crate::offset_curvature::OffsetCurvature;
use crate::settings::TrainSettings;
use crate::smooth_gradients::SmoothGradients;
use ghand_fit::views::TrainView;
use ghand_measure::lpips::Lpips;

/// Differences of neighbouring colours (display values) beyond this count linearly: nails and creases keep their edges.
const COLOR_WIDTH: f32 = 0.03;
/// The same of offsets, metres.
const OFFSET_WIDTH: f32 = 0.002;

/// Weights of the mean absolute colour difference and of 1 - SSIM: the paper's.
const L1_WEIGHT: f64 = 0.8;
const SSIM_WEIGHT: f64 = 0.2;
/// Weight of the mean squared offset (square metres), and in stage 1 of the mean squared scale (square metres): the paper's.
const OFFSET_WEIGHT: f64 = 10.0;
const SCALE_WEIGHT: f64 = 1.0;
/// Weight of the roughness of the offsets (metres). Without, offsets that few pixels determine are noise: on the capture
/// `desk` 0.178 % instead of 0.098 % of coverage is loose. 1000 costs 0.1 dB.
const OFFSET_ROUGHNESS: f64 = 300.0;

/// Rates of logits, of which sizes and base colours need some units in some hundred iterations.
const RATE_SCALE: f64 = 1e-2;
const RATE_COLOR: f64 = 2e-2;
/// Rates of what changes with the pose: slower, as single poses say less.
const RATE_COMPONENTS: f64 = 5e-3;
const RATE_RESPONSE: f64 = 5e-3;
/// Rate of the translation where poses are refined, metres: a step at the fingertips of a hand of 0.1 m that turns by 0.01.
const RATE_TRANSLATION: f64 = 1e-3;

/// The device's buffers and pipelines for training steps.
pub struct Step {
    scene: Scene,
    loss: ImageLoss,
    backward: DeformationBackward,
    offset_penalty: Penalty,
    scale_penalty: Penalty,
    color_roughness: Roughness,
    offset_roughness: Roughness,
    offset_curvature: OffsetCurvature,
    smooth_gradients: SmoothGradients,
    poses: AdamTable,
    joints: AdamTable,
    lpips: Option<LpipsTerm>,
    count: usize,
    joint_count: usize,
}

/// The learning rates of one step, after the schedule.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rates {
    /// Number of the step, from 1.
    pub step: u64,
    /// Factor on all rates.
    pub tables: f64,
    /// Rate of the joint rotations (radians) where poses are refined, as in stage 1: then scales have a weight, offsets need
    /// not be smooth, and the pose response stays.
    pub pose: Option<f64>,
    /// Number of updates of this frame's pose, this one included.
    pub pose_step: u64,
    /// Whether LPIPS counts, where the step has it.
    pub lpips: bool,
}

/// Whether a step changed what is learned.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[must_use]
pub enum StepOutcome {
    /// It did.
    Updated,
    /// It did not: a gradient was infinite or not a number.
    Skipped,
}

impl Rates {
    /// The property model's rates.
    fn of_properties(&self, settings: &TrainSettings) -> PropertyRates {
        let [residual_weights, regressor, shape_basis] = settings.component_rates();
        PropertyRates {
            step: self.step,
            shape_basis: shape_basis * self.tables,
            residual_weights: residual_weights * self.tables,
            regressor: regressor * self.tables,
            scale: RATE_SCALE * self.tables,
            color: RATE_COLOR * self.tables,
            color_components: RATE_COMPONENTS * self.tables,
            // What changes with the pose must be the pose where that is refined.
            response: if self.pose.is_some() { 0.0 } else { RATE_RESPONSE * self.tables },
            networks: settings.rate_networks * self.tables,
            feature_tensor: settings.rate_feature_tensor * self.tables,
        }
    }
}

impl Step {
    /// Puts an avatar and `frames` poses on the device, to be trained on `images` images. `mobility` is 1 for joints whose
    /// rotation is refined, else 0.
    ///
    /// # Errors
    /// [`RenderError`] if the device has too little memory or was lost.
    pub fn new(
        gpu: &Gpu,
        avatar: &Avatar,
        frames: usize,
        images: usize,
        max_size: [u32; 2],
        mobility: &[f32],
    ) -> Result<Step, RenderError> {
        let count = avatar.template.len();
        let joint_count = avatar.template.joint_count();
        let mut scene = Scene::new(gpu, &[avatar], Purpose::Gradients, frames, max_size)?;
        let (splatter, avatars) = scene.splatter_and_avatars_mut();
        let posed = &mut avatars[0];
        let loss =
            ImageLoss::new(gpu, splatter.image(), splatter.d_image(), max_size[0] as usize * max_size[1] as usize)?;
        let backward = posed.prepare_training(gpu, splatter.d_gaussians(), mobility)?;
        let deformation = &posed.deformation;
        let [offset_penalty, scale_penalty] = gpu.scoped("the penalties", || {
            let values = &deformation.properties().scale;
            let gradients = &backward.gradients().scale;
            [
                Penalty::new(gpu, deformation.offsets(), backward.d_offsets(), 3 * count),
                Penalty::new(gpu, values, gradients, count),
            ]
        })?;
        let neighbors = neighbors(&avatar.template);
        let (color_roughness, offset_roughness, offset_curvature) = gpu.scoped("the penalties on roughness", || {
            let colors = &deformation.properties().color;
            let gradients = &backward.gradients().color;
            let (offsets, d_offsets) = (deformation.offsets(), backward.d_offsets());
            (
                Roughness::new(gpu, colors, gradients, 3, &neighbors, count),
                Roughness::new(gpu, offsets, d_offsets, 3, &neighbors, count),
                OffsetCurvature::new(gpu, offsets, d_offsets, &avatar.template, &neighbors, images),
            )
        })?;
        let smooth_gradients = gpu.scoped("the smoothed gradients of the offsets", || {
            SmoothGradients::new(gpu, backward.d_offsets(), &avatar.template, &neighbors)
        })?;
        let adam = Adam::new(gpu)?;
        let joints =
            adam.table(gpu, deformation.joints(), backward.d_joints(), 3 * joint_count, 1, Grouping::Scalars)?;
        let pose_length = frames * pose_stride(joint_count);
        let poses = adam.table(gpu, deformation.poses(), backward.d_pose(), pose_length, 2, Grouping::Vectors)?;
        Ok(Step {
            scene,
            loss,
            backward,
            offset_penalty,
            scale_penalty,
            color_roughness,
            offset_roughness,
            offset_curvature,
            smooth_gradients,
            poses,
            joints,
            lpips: None,
            count,
            joint_count,
        })
    }

    /// Adds LPIPS to the loss, with the weight of the settings.
    pub fn use_lpips(&mut self, lpips: &Arc<Lpips>) {
        self.lpips = Some(LpipsTerm::new(lpips.clone()));
    }

    /// Sets the pose of frame number `frame`.
    ///
    /// # Errors
    /// [`RenderError::Invalid`] if the pose does not fit the avatar.
    pub fn set_pose(&mut self, gpu: &Gpu, frame: usize, pose: &ghand_core::Pose) -> Result<(), RenderError> {
        self.scene.set_pose(gpu, 0, frame, pose)
    }

    /// The avatar on the device, the scene's only one.
    fn avatar(&self) -> &PosedAvatar {
        &self.scene.avatars()[0]
    }

    fn avatar_mut(&mut self) -> &mut PosedAvatar {
        &mut self.scene.avatars_mut()[0]
    }

    /// The scene that is trained on.
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// Reads back the learned tables of the property model.
    ///
    /// # Errors
    /// [`RenderError`] if the device failed or was lost.
    pub fn tables(&self, gpu: &Gpu) -> Result<PropertyTables, RenderError> {
        self.avatar().model.trainable()?.tables(gpu)
    }

    /// Reads back the numbers learned for the whole hand.
    ///
    /// # Errors
    /// [`RenderError`] if the device failed or was lost.
    pub fn hand_parameters(&self, gpu: &Gpu, frames: usize) -> Result<HandParameters, RenderError> {
        let avatar = self.avatar();
        Ok(HandParameters {
            response: avatar.model.trainable()?.pose_parameters(gpu)?,
            joints: buffers::read(gpu, avatar.deformation.joints(), self.joint_count)?,
            poses: buffers::read(gpu, avatar.deformation.poses(), frames * pose_stride(self.joint_count))?,
        })
    }

    /// Reads back all that training changes: the model's numbers, rest joints, poses and their moments.
    ///
    /// # Errors
    /// [`RenderError`] if the device failed or was lost.
    pub fn state(&self, gpu: &Gpu, frames: usize) -> Result<Vec<SavedNumbers>, RenderError> {
        let avatar = self.avatar();
        let mut numbers = avatar.model.trainable()?.training_state(gpu)?;
        for (name, buffer, length) in self.hand_tables(avatar, frames) {
            numbers.push((name.into(), buffers::read(gpu, buffer, length)?));
        }
        let named =
            |(name, values): (String, Vec<f32>)| SavedNumbers { name, values: bytemuck::cast_slice(&values).to_vec() };
        Ok(numbers.into_iter().map(named).collect())
    }

    /// Goes on from the numbers of [`Step::state`].
    ///
    /// # Errors
    /// [`RenderError::Invalid`] if they are those of another avatar.
    pub fn set_numbers(&mut self, gpu: &Gpu, frames: usize, numbers: &[SavedNumbers]) -> Result<(), RenderError> {
        let values = |part: &SavedNumbers| bytemuck::pod_collect_to_vec(&part.values);
        let state = numbers.iter().map(|part| (part.name.clone(), values(part))).collect();
        self.avatar_mut().model.trainable_mut()?.set_training_state(gpu, &state)?;
        for (name, buffer, length) in self.hand_tables(self.avatar(), frames) {
            let values = state_part(&state, name, length)?;
            gpu.queue.write_buffer(buffer, 0, bytemuck::cast_slice(values));
        }
        Ok(())
    }

    /// The tables of the hand with their names in a state and lengths.
    fn hand_tables<'a>(
        &'a self,
        avatar: &'a PosedAvatar,
        frames: usize,
    ) -> [(&'static str, &'a wgpu::Buffer, usize); 4] {
        let joints = 3 * self.joint_count;
        let poses = frames * pose_stride(self.joint_count);
        [
            ("hand.joints", avatar.deformation.joints(), joints),
            ("hand.joints.moments", &self.joints.moments, 2 * joints),
            ("hand.poses", avatar.deformation.poses(), poses),
            ("hand.poses.moments", &self.poses.moments, 2 * poses),
        ]
    }

    /// Runs one step on one view. The loss is a mean over `value_count` values: those of the whole image, so that crops
    /// of all sizes have the same weight per pixel.
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
    ) -> Result<StepOutcome, RenderError> {
        match self.add_gradients(gpu, view, value_count, background, settings, rates)? {
            StepOutcome::Updated => self.update(gpu, view, settings, rates),
            StepOutcome::Skipped => Ok(StepOutcome::Skipped),
        }
    }

    /// The part of a step before the updates, for one view. More views of the same frame can be added before
    /// [`Step::update`] if the property model adds its gradients up, as `network` does. Those of the rest joints and
    /// the pose are the last view's alone. If a gradient is not finite, the step is [`StepOutcome::Skipped`]: all
    /// gradients are discarded, and there is no update.
    ///
    /// # Errors
    /// As [`Step::run`].
    pub fn add_gradients(
        &mut self,
        gpu: &Gpu,
        view: &TrainView,
        value_count: f64,
        background: [f32; 3],
        settings: &TrainSettings,
        rates: &Rates,
    ) -> Result<StepOutcome, RenderError> {
        self.set_view_and_loss(gpu, view, value_count, background, settings, rates.pose.is_some())?;
        let Step { scene, loss, backward, offset_penalty, scale_penalty, color_roughness, .. } = self;
        let Step { offset_roughness, offset_curvature, smooth_gradients, .. } = self;
        let encode_backward = |splatter: &Splatter, encoder: &mut wgpu::CommandEncoder| {
            splatter.backward(encoder);
            backward.encode_point_gradients(encoder);
            offset_penalty.encode(encoder);
            scale_penalty.encode(encoder);
            color_roughness.encode(encoder);
            offset_roughness.encode(encoder);
            offset_curvature.encode(encoder);
            smooth_gradients.encode(encoder);
            backward.encode_property_gradients(encoder);
        };
        let counters = match self.lpips.as_ref().filter(|_| rates.lpips && settings.lpips_weight > 0.0) {
            None => scene.run_frame(gpu, |splatter, encoder| {
                loss.encode(encoder);
                encode_backward(splatter, encoder);
            })?,
            // The host adds to the image's gradient once the frame is complete; only then does the rest run.
            Some(lpips) => {
                scene.run_frame(gpu, |_, encoder| loss.encode(encoder))?;
                lpips.add_gradient(gpu, scene.splatter(), view, settings.lpips_weight, value_count, rates.step)?;
                let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
                encode_backward(scene.splatter(), &mut encoder);
                gpu.queue.submit([encoder.finish()]);
                scene.splatter().read_counters(gpu)?
            }
        };
        let model = self.avatar_mut().model.trainable_mut()?;
        if counters.bad_gradients > 0 {
            model.discard_gradients();
            return Ok(StepOutcome::Skipped);
        }
        let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        model.backward(gpu, &mut encoder)?;
        gpu.queue.submit([encoder.finish()]);
        Ok(StepOutcome::Updated)
    }

    /// All updates, after the gradients of one view or more. `view` is the last one.
    ///
    /// # Errors
    /// As [`Step::run`].
    pub fn update(
        &mut self,
        gpu: &Gpu,
        view: &TrainView,
        settings: &TrainSettings,
        rates: &Rates,
    ) -> Result<StepOutcome, RenderError> {
        let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        self.backward.encode_pose_gradient(&mut encoder);
        let model = self.avatar_mut().model.trainable_mut()?;
        if !model.update(gpu, &mut encoder, &rates.of_properties(settings))? {
            return Ok(StepOutcome::Skipped);
        }
        self.update_hand(gpu, &mut encoder, view.frame, settings, rates);
        gpu.queue.submit([encoder.finish()]);
        Ok(StepOutcome::Updated)
    }

    /// A picture of the avatar in the pose of a frame.
    ///
    /// # Errors
    /// As [`Step::run`].
    pub fn picture(
        &mut self,
        gpu: &Gpu,
        frame: usize,
        camera: &Camera,
        background: [f32; 3],
    ) -> Result<Image, RenderError> {
        self.scene.set_frame(gpu, frame);
        self.scene.set_view(gpu, camera, background)?;
        run_alone(&mut self.scene, gpu, |_, _| ())?;
        self.scene.splatter().read_image(gpu)
    }

    /// Adds how much each Gaussian contributes to one view to `seen`, N: the sum of its blend weights over the pixels.
    ///
    /// # Errors
    /// As [`Step::run`].
    pub fn add_seen(&mut self, gpu: &Gpu, view: &TrainView, seen: &mut [f32]) -> Result<(), RenderError> {
        self.scene.set_frame(gpu, view.frame);
        self.scene.set_view(gpu, &view.camera, [0.0; 3])?;
        // The derivative of the sum of all pixels' red.
        let one = vec![[1.0f32, 0.0, 0.0, 0.0]; view.pixels.len()];
        gpu.queue.write_buffer(self.scene.splatter().d_image(), 0, bytemuck::cast_slice(&one));
        run_alone(&mut self.scene, gpu, |splatter, encoder| splatter.backward(encoder))?;
        let splatter = self.scene.splatter();
        let columns = splatter.count();
        let row = splatter.options().model.color_row();
        let weights: Vec<f32> = buffers::read_from(gpu, splatter.d_gaussians(), row * columns, columns)?;
        seen.iter_mut().zip(&weights).for_each(|(sum, weight)| *sum += weight);
        Ok(())
    }

    /// The colours' loss of one view without LPIPS, as a mean over its crop, without an update.
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
        self.set_view_and_loss(gpu, view, 3.0 * view.pixels.len() as f64, background, settings, false)?;
        let loss = &self.loss;
        run_alone(&mut self.scene, gpu, |_, encoder| loss.encode(encoder))?;
        let [l1, ssim] = self.loss(gpu, view)?;
        Ok(L1_WEIGHT * l1 + SSIM_WEIGHT * ssim)
    }

    /// Sets the view for the next frame.
    fn set_view_and_loss(
        &mut self,
        gpu: &Gpu,
        view: &TrainView,
        value_count: f64,
        background: [f32; 3],
        settings: &TrainSettings,
        refine_poses: bool,
    ) -> Result<(), RenderError> {
        let weights = LossWeights { l1: L1_WEIGHT as f32, ssim: SSIM_WEIGHT as f32 };
        self.loss.set_target(gpu, view.size, &view.pixels, weights, value_count)?;
        // Gradient of weight * mean |Delta|^2 and weight * mean sigma^2.
        let per_gaussian = |weight: f64| (2.0 * weight / self.count as f64) as f32;
        self.offset_penalty.set_weight(gpu, per_gaussian(OFFSET_WEIGHT));
        let (scale_weight, offset_roughness) = if refine_poses { (SCALE_WEIGHT, 0.0) } else { (0.0, OFFSET_ROUGHNESS) };
        self.offset_curvature.set_on(!refine_poses);
        self.smooth_gradients.set_on(!refine_poses);
        self.scale_penalty.set_weight(gpu, per_gaussian(scale_weight));
        self.color_roughness.set_weight(gpu, per_gaussian(settings.color_roughness), COLOR_WIDTH);
        self.offset_roughness.set_weight(gpu, per_gaussian(offset_roughness), OFFSET_WIDTH);
        self.scene.set_frame(gpu, view.frame);
        self.scene.set_view(gpu, &view.camera, background)
    }

    /// Updates the rest joints and the frame's pose.
    fn update_hand(
        &self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        frame: usize,
        settings: &TrainSettings,
        rates: &Rates,
    ) {
        let pass = &mut compute_pass(encoder, "update hand");
        if settings.rate_joints > 0.0 {
            let uniforms =
                AdamUniforms::new(0..3 * self.joint_count, 0, settings.rate_joints * rates.tables, rates.step);
            self.joints.encode(gpu, pass, 0, &uniforms);
        }
        if let Some(rate) = rates.pose {
            let start = frame * pose_stride(self.joint_count);
            let middle = start + 3 * self.joint_count;
            let rotations = AdamUniforms::new(start..middle, 0, rate * rates.tables, rates.pose_step);
            let translation = AdamUniforms::new(
                middle..middle + 3,
                3 * self.joint_count,
                RATE_TRANSLATION * rates.tables,
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

/// Seconds of the parts of a step.
pub type StepTimes = Vec<(&'static str, f64)>;

impl Step {
    /// Runs one step with up to several views of a frame and says how long its parts take, each on its own and waited
    /// for. That is more than they take together.
    ///
    /// # Errors
    /// As [`Step::run`].
    pub fn time_parts(
        &mut self,
        gpu: &Gpu,
        views: &[TrainView],
        value_count: f64,
        settings: &TrainSettings,
        rates: &Rates,
    ) -> Result<StepTimes, RenderError> {
        let Some(view) = views.last() else { return Ok(vec![]) };
        let background = [0.0; 3];
        let start = Instant::now();
        let host = self.avatar().model.trainable()?.host_seconds();
        for view in views {
            let _ = self.add_gradients(gpu, view, value_count, background, settings, rates)?;
        }
        gpu.wait()?;
        let gradients = start.elapsed().as_secs_f64();
        let now = Instant::now();
        let _ = self.update(gpu, view, settings, rates)?;
        gpu.wait()?;
        let update = now.elapsed().as_secs_f64();
        let of_host = self.avatar().model.trainable()?.host_seconds();
        let model: StepTimes =
            of_host.into_iter().zip(host).map(|((name, after), (_, before))| (name, after - before)).collect();
        let on_host: f64 = model.iter().map(|(_, seconds)| seconds).sum();

        // The rest again, up to each part.
        let mut up_to =
            |behind: &dyn Fn(&ImageLoss, &Splatter, &mut wgpu::CommandEncoder)| -> Result<f64, RenderError> {
                self.set_view_and_loss(gpu, view, value_count, background, settings, rates.pose.is_some())?;
                let before: f64 =
                    self.avatar().model.trainable()?.host_seconds().iter().map(|(_, seconds)| seconds).sum();
                let now = Instant::now();
                let loss = &self.loss;
                run_alone(&mut self.scene, gpu, |splatter, encoder| behind(loss, splatter, encoder))?;
                gpu.wait()?;
                let after: f64 =
                    self.avatar().model.trainable()?.host_seconds().iter().map(|(_, seconds)| seconds).sum();
                Ok(now.elapsed().as_secs_f64() - (after - before))
            };
        let frame = up_to(&|_, _, _| ())?;
        let with_loss = up_to(&|loss, _, encoder| loss.encode(encoder))?;
        let with_splats = up_to(&|loss, splatter, encoder| {
            loss.encode(encoder);
            splatter.backward(encoder);
        })?;
        let splat: f64 = self.scene.splatter().time_stages(gpu)?.iter().map(|(_, ms)| 1e-3 * ms).sum();
        let backward = (with_splats - with_loss).max(0.0);
        let mut times = vec![("step", gradients + update)];
        times.extend(model);
        times.extend([
            ("deformation", (frame - (splat - backward).max(0.0)).max(0.0)),
            ("splat forward", (splat - backward).max(0.0)),
            ("losses", (with_loss - frame).max(0.0)),
            ("splat backward", backward),
            ("the rest", (gradients + update - on_host - with_splats).max(0.0)),
        ]);
        Ok(times)
    }
}

/// The numbers learned for the whole hand.
#[derive(Debug, Clone)]
pub struct HandParameters {
    /// The pose response, shared by all Gaussians.
    pub response: Vec<f32>,
    /// Rest joints, metres.
    pub joints: Vec<[f32; 3]>,
    /// Poses, `[frames][n_b * 3 + 3]`.
    pub poses: Vec<f32>,
}

/// Runs a frame that the property model's backward pass does not follow.
fn run_alone(
    scene: &mut Scene,
    gpu: &Gpu,
    behind: impl Fn(&Splatter, &mut wgpu::CommandEncoder),
) -> Result<(), RenderError> {
    let expect = |scene: &mut Scene, expected| {
        let models = scene.avatars_mut().iter_mut().filter_map(|avatar| avatar.model.trainable_mut().ok());
        models.for_each(|model| model.expect_backward(expected));
    };
    expect(scene, false);
    let result = scene.run_frame(gpu, behind);
    expect(scene, true);
    result.map(|_| ())
}
