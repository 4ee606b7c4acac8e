//! A training run: two stages over the views of a split.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use ghand_avatar::neighbors::neighbors;
use ghand_avatar::{Avatar, AvatarLight, Provenance, Template};
use ghand_capture::{Capture, ColorCorrection, Split};
use ghand_core::Pose;
use ghand_hand_model::surface;
use ghand_render::deform::pose_stride;
use ghand_render::{Gpu, RenderError};
use glam::DVec3;
use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;

use crate::alignment::{Alignment, AlignmentError, align};
use crate::divergence::{Divergence, check_change, check_gaussians, check_hand, check_loss, remedy};
use crate::exposure::{ExposureFit, fit_exposure};
use crate::floor::{FloorError, texel_colors};
use crate::light_fit::{LightFit, fit_light_to};
use crate::lpips::Lpips;
use crate::memory_check;
use crate::metrics::moving_joints;
use crate::pose_prior::shrink;
use crate::settings::{Align, ExposureChoice, FrameGain, LightChoice, TrainSettings, Unseen};
use crate::step::{Rates, Step};
use crate::texel_frames::TexelFrames;
use crate::train_error::TrainError;
use crate::views::{TrainView, TrainViews};

/// The progress of a run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Progress {
    /// Iterations done.
    pub iteration: u64,
    /// Total number of iterations.
    pub iterations: u64,
    /// 1 while poses are refined, then 2.
    pub stage: u32,
    /// Running mean of L1 over the crops, once it has been read.
    pub l1: Option<f64>,
}

/// The result of a run.
#[derive(Debug, Clone)]
pub struct Trained {
    /// The avatar.
    pub avatar: Avatar,
    /// Refined poses of the split's frames.
    pub poses: Vec<Pose>,
    /// The alignment, with `align=contours`; its poses were used unless it was rejected.
    pub alignment: Option<Alignment>,
    /// How the light was found, unless `light=none`.
    pub light: Option<LightFit>,
    /// What was found of the cameras' exposures, unless `exposure=same`.
    pub exposure: Option<ExposureFit>,
    /// Iterations done, of both stages: fewer than in the settings if the run was told to stop.
    pub iterations: u64,
    /// Wall-clock time of the iterations, seconds.
    pub seconds: f64,
}

/// A run over one split of a capture.
///
/// ```no_run
/// use ghand_capture::Capture;
/// use ghand_render::{AdapterChoice, Gpu};
/// use ghand_train::{TrainSettings, Trainer};
///
/// let gpu = Gpu::new(&AdapterChoice::from_env())?;
/// let capture = Capture::open("captures/my-hand".as_ref())?;
/// let trained = Trainer::new(&gpu, &capture, "train", &TrainSettings::default())?.train(|_| ())?;
/// trained.avatar.save("avatar.ghand".as_ref())?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Trainer<'a> {
    gpu: &'a Gpu,
    /// The template is in the proportions of the hand once they are known.
    capture: Capture,
    split: Split,
    split_name: String,
    settings: TrainSettings,
    views: TrainViews,
    poses: Vec<Pose>,
    gaussians: usize,
    alignment: Option<Alignment>,
    light: Option<LightFit>,
    exposure: Option<ExposureFit>,
    stop: Option<&'a AtomicBool>,
    lpips: Option<Arc<Lpips>>,
}

/// Number of views on which the loss before and after a stage is compared.
const REFERENCE_VIEWS: usize = 8;
/// Iterations between two readings of the loss for the progress bar; reading waits for the device.
const LOSS_EVERY: u64 = 25;
/// Number of views decoded ahead of their use, if not all fit into memory.
const PREFETCHED: usize = 16;
/// Number of views that say how much training saw of each Gaussian.
const SEEN_VIEWS: usize = 60;
/// Number of views from which the initial texel colours are computed.
const COLOR_VIEWS: usize = 60;

/// A larger part of the hand's pixels that is burnt out or black is told.
const MOST_EXTREME: f64 = 0.1;
/// Frames whose brightness differs by more than this (standard deviation of the logarithm) are told.
const UNSTEADY: f64 = 0.06;

/// One stage of training.
struct Stage {
    number: u32,
    settings: TrainSettings,
    iterations: u64,
    /// Iterations of the previous stages.
    done: u64,
    refine_poses: bool,
    /// The images are this many times smaller than the capture's.
    reduction: u32,
    scale_weight: f64,
}

/// The result of a stage.
struct StageResult {
    avatar: Avatar,
    poses: Vec<Pose>,
    /// Iterations of this stage.
    iterations: u64,
}

/// Pose response, rest joints, poses.
type LearnedHand = (Vec<f32>, Vec<[f32; 3]>, Vec<Pose>);

impl<'a> Trainer<'a> {
    /// Loads the views of a split.
    ///
    /// # Errors
    /// [`TrainError`] if the settings, the capture or its hand model cannot be used.
    pub fn new(
        gpu: &'a Gpu,
        capture: &'a Capture,
        split_name: &str,
        settings: &TrainSettings,
    ) -> Result<Trainer<'a>, TrainError> {
        settings.check()?;
        let split: Split = capture.split(split_name)?.clone();
        let empty = [
            ("cameras", split.cameras.is_empty()),
            ("frames", split.frames.is_empty()),
            ("images", split.views.is_empty()),
        ];
        for (what, empty) in empty {
            if empty {
                let capture = capture.root.display().to_string();
                return Err(TrainError::Empty { capture, split: split_name.into(), what });
            }
        }
        let gaussians = surface::sample_surface(&capture.template, settings.uv_resolution)?.len();
        memory_check::check(gaussians, capture.template.joint_count(), settings)?;
        Ok(Trainer {
            gpu,
            views: TrainViews::new(capture, &split, settings.crop_margin)?,
            poses: split.frames.iter().map(|f| capture.frames[*f].pose.clone()).collect(),
            split,
            split_name: split_name.into(),
            capture: capture.clone(),
            settings: settings.clone(),
            gaussians,
            alignment: None,
            light: None,
            exposure: None,
            stop: None,
            lpips: None,
        })
    }

    /// Stops the run after the iteration in which `stop` becomes true. In stage 2 the run then returns the present
    /// avatar, before that [`TrainError::Stopped`].
    #[must_use]
    pub fn stop_when(self, stop: &'a AtomicBool) -> Trainer<'a> {
        Trainer { stop: Some(stop), ..self }
    }

    /// Adds LPIPS to the loss, with the weight of the settings.
    #[must_use]
    pub fn with_lpips(self, lpips: Option<Arc<Lpips>>) -> Trainer<'a> {
        Trainer { lpips, ..self }
    }

    /// Number of Gaussians of the avatar.
    pub fn gaussians(&self) -> usize {
        self.gaussians
    }

    /// Runs both stages and calls `progress` after each iteration.
    ///
    /// Stage 1 refines the poses with a simple avatar on smaller images: with little else to explain the images, the
    /// poses move to where they belong. Stage 2 starts a new avatar from the refined poses, which are then fixed.
    ///
    /// If the device is lost, the stage is repeated on a new one, with the same result; `progress` then starts again
    /// from the stage's first iteration.
    ///
    /// # Errors
    /// [`TrainError`] if the device failed, or was lost several times in one stage, or the avatar cannot be made;
    /// [`TrainError::Diverged`] if the loss at a stage's end is higher than at its start, or numbers became infinite.
    pub fn train(mut self, mut progress: impl FnMut(&Progress)) -> Result<Trained, TrainError> {
        let start = Instant::now();
        if self.settings.align == Align::Contours {
            self.align()?;
        }
        let mut gpu = self.gpu.clone();
        let pose_iterations = self.settings.pose_iterations();
        if pose_iterations > 0 {
            let stage = Stage {
                number: 1,
                settings: self.settings.pose_stage_settings(),
                iterations: pose_iterations,
                done: 0,
                refine_poses: true,
                reduction: self.settings.pose_image_reduction,
                scale_weight: self.settings.scale_weight,
            };
            let mut refined = gpu.retry_on_device_loss("stage 1", |gpu| self.run(gpu, &stage, &mut progress))?.poses;
            recenter(&mut refined, &self.poses);
            self.poses = refined;
        }
        self.find_light(&mut gpu)?;
        let stage = Stage {
            number: 2,
            settings: self.settings.clone(),
            iterations: self.settings.iterations - pose_iterations,
            done: pose_iterations,
            refine_poses: false,
            reduction: 1,
            scale_weight: 0.0,
        };
        let done = gpu.retry_on_device_loss("stage 2", |gpu| self.run(gpu, &stage, &mut progress))?;
        let iterations = stage.done + done.iterations;
        let mut avatar = done.avatar;
        avatar.limit_response(&self.seen_poses());
        if let Some((fit, trained)) = self.light.as_mut().zip(avatar.light.as_ref()) {
            fit.set_trained(trained);
        }
        let (poses, alignment, light, exposure) = (self.poses, self.alignment, self.light, self.exposure);
        let seconds = start.elapsed().as_secs_f64();
        Ok(Trained { avatar, poses, alignment, light, exposure, iterations, seconds })
    }

    /// Finds what the images say of exposures and light, and corrects the images accordingly.
    fn find_light(&mut self, gpu: &mut Gpu) -> Result<(), TrainError> {
        let TrainSettings { light, gloss, exposure, frame_gain, .. } = self.settings;
        if (light, exposure, frame_gain) == (LightChoice::None, ExposureChoice::Same, FrameGain::Same) {
            return Ok(());
        }
        let mut seen = gpu.retry_on_device_loss("the light", |gpu| -> Result<TexelFrames, TrainError> {
            Ok(TexelFrames::new(gpu, &self.capture, &self.split, &self.poses)?)
        })?;
        let [burnt, black] = seen.extremes();
        for (part, how) in [(burnt, "burnt out (white)"), (black, "black")] {
            if part > MOST_EXTREME {
                log::warn!(
                    "{:.0} % of what the images show of the hand is {how}: its colours there are not known",
                    1e2 * part
                );
            }
        }
        let mut correction = ColorCorrection::default();
        if exposure != ExposureChoice::Same {
            let fit = fit_exposure(&seen, exposure);
            if fit.corrected {
                correction.cameras.clone_from(&fit.maps);
                seen.correct(&correction);
            }
            self.exposure = Some(fit);
        }
        if light != LightChoice::None || frame_gain != FrameGain::Same {
            let template = self.capture.template.clone();
            let mut fit = fit_light_to(&seen, &template, &self.poses, light, gloss).map_err(FloorError::from)?;
            let differ = fit.frames_differ();
            if frame_gain == FrameGain::PerFrame {
                let even = seen.even_frames(&fit.frame_factors);
                seen.correct(&even);
                correction.frames = even.frames;
                let again = fit_light_to(&seen, &template, &self.poses, light, gloss).map_err(FloorError::from)?;
                fit = LightFit { frame_factors: fit.frame_factors, ..again };
            } else if differ > UNSTEADY {
                log::warn!(
                    "frames differ in brightness by {:.0} % (standard deviation) beyond what a fixed light explains: if \
                     the light changed, use --set frame_gain=per_frame",
                    1e2 * differ
                );
            }
            self.light = (light != LightChoice::None).then_some(fit);
        }
        if !correction.is_empty() {
            self.capture.color_correction = correction;
            self.views = TrainViews::new(&self.capture, &self.split, self.settings.crop_margin)?;
        }
        Ok(())
    }

    /// Aligns poses and proportions.
    fn align(&mut self) -> Result<(), TrainError> {
        let mut go_on = |_: &str, _: &[Pose]| self.stop.is_none_or(|stop| !stop.load(Ordering::Relaxed));
        let aligned = match align(&self.capture, &self.split, &mut go_on) {
            Err(AlignmentError::Stopped) => {
                return Err(TrainError::Stopped { iteration: 0, iterations: self.settings.iterations });
            }
            result => result?,
        };
        if let Some(rejection) = aligned.rejection {
            log::warn!("the given poses are used: {rejection}");
        } else if !aligned.kept.is_empty() {
            log::warn!(
                "{} of {} frames keep their given poses, which fit the masks better",
                aligned.kept.len(),
                self.poses.len()
            );
        }
        if let Some(texture) = &aligned.texture {
            log::info!(
                "texture refined {} of {} frames; {} keep the poses by contours, which explain images held out better",
                texture.refined.len(),
                self.poses.len(),
                texture.kept.len()
            );
        }
        self.poses.clone_from(&aligned.poses);
        self.capture.template = aligned.template.clone();
        self.alignment = Some(aligned);
        Ok(())
    }

    /// The poses of the frames with training images.
    fn seen_poses(&self) -> Vec<Pose> {
        let seen = |position: usize| self.split.views.iter().any(|view| view.position == position);
        self.poses.iter().enumerate().filter(|(position, _)| seen(*position)).map(|(_, pose)| pose.clone()).collect()
    }

    /// The initial avatar of a stage: the template's surface with mean texel colours.
    fn start(&self, gpu: &Gpu, settings: &TrainSettings) -> Result<Avatar, TrainError> {
        let mut avatar = Avatar::untrained_inset(
            &self.capture.template,
            &settings.avatar(),
            [0.5; 3],
            settings.start_inset,
            settings.seed,
        )?;
        if let Some((light, fit)) = self.light.as_ref().and_then(|fit| Some((fit.light.clone()?, fit))) {
            let samples = surface::sample_surface(&self.capture.template, settings.uv_resolution)?;
            let gloss = fit.gloss.as_ref().map(|fit| fit.gloss.clone());
            avatar.light = Some(AvatarLight::new(light, gloss, &samples));
        }
        let (capture, resolution) = (&self.capture, settings.uv_resolution);
        let colors =
            texel_colors(gpu, capture, &self.split, &self.poses, resolution, COLOR_VIEWS, avatar.light.as_ref())?;
        avatar.tables.set_base_colors(&colors.colors);
        avatar.provenance = Provenance {
            capture: self.capture.root.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default(),
            split: self.split_name.clone(),
            iterations: self.settings.iterations,
            seed: self.settings.seed,
            version: env!("CARGO_PKG_VERSION").into(),
        };
        Ok(avatar)
    }

    /// Runs one stage: one view per iteration, in shuffled passes over all views.
    fn run(&self, gpu: &Gpu, stage: &Stage, progress: &mut dyn FnMut(&Progress)) -> Result<StageResult, TrainError> {
        let settings = &stage.settings;
        let avatar = self.start(gpu, settings)?;
        let mobility: Vec<f32> = moving_joints(&self.poses).iter().map(|m| if *m { 1.0 } else { 0.0 }).collect();
        let largest = self.views.largest(stage.reduction);
        let mut step = Step::new(gpu, &avatar, self.poses.len(), largest, &mobility)?;
        if settings.rate_light > 0.0 {
            step.learn_light()?;
        }
        self.lpips.iter().for_each(|lpips| step.use_lpips(lpips));
        for (frame, pose) in self.poses.iter().enumerate() {
            step.set_pose(gpu, frame, pose)?;
        }
        let background = self.capture.background.map(|b| b as f32);
        // The loss is a mean over the whole image, so that crops of all sizes have the same weight per pixel.
        let value_count = |view: &TrainView| {
            let camera = &self.capture.cameras[view.camera_index];
            3.0 * f64::from(camera.width) * f64::from(camera.height) / f64::from(stage.reduction.pow(2))
        };
        let diverged = |fault: Divergence, done: u64| TrainError::Diverged {
            stage: stage.number,
            iteration: stage.done + done,
            iterations: self.settings.iterations,
            fault: fault.to_string(),
            remedy: remedy(&self.settings),
        };
        let loss_at_start = self.reference_loss(gpu, &mut step, stage, background)?;
        check_loss(loss_at_start).map_err(|fault| diverged(fault, 0))?;
        let mut done = 0;
        let mut rng = ChaCha8Rng::seed_from_u64(settings.seed);
        let mut order: Vec<usize> = Vec::new();
        let mut pose_steps = vec![0; self.poses.len()];
        let mut mean: Option<f64> = None;
        for iteration in 0..stage.iterations {
            if self.stop.is_some_and(|stop| stop.load(Ordering::Relaxed)) {
                // An avatar without a single iteration is not a result either.
                if stage.refine_poses || iteration == 0 {
                    let (iteration, iterations) = (stage.done + iteration, self.settings.iterations);
                    return Err(TrainError::Stopped { iteration, iterations });
                }
                break;
            }
            if order.is_empty() {
                order = (0..self.views.len()).collect();
                order.shuffle(&mut rng);
                order.iter().rev().take(PREFETCHED).for_each(|view| self.views.prefetch(*view));
            }
            let rounds = settings.pose_prior_rounds;
            if stage.refine_poses && is_prior_round(iteration, stage.iterations, rounds) {
                let (_, _, mut poses) = self.read_hand(gpu, &step)?;
                shrink(&mut poses);
                for (frame, pose) in poses.iter().enumerate() {
                    step.set_pose(gpu, frame, pose)?;
                }
            }
            let Some(index) = order.pop() else { break };
            if let Some(ahead) = order.len().checked_sub(PREFETCHED).and_then(|at| order.get(at)) {
                self.views.prefetch(*ahead);
            }
            let view = &self.views.get(index, stage.reduction)?;
            pose_steps[view.frame] += 1;
            let decay = settings.final_rate.powf(iteration as f64 / stage.iterations as f64);
            let rates = Rates {
                step: iteration + 1,
                tables: decay,
                pose: if stage.refine_poses { decay } else { 0.0 },
                pose_step: pose_steps[view.frame],
                scale_weight: stage.scale_weight,
            };
            step.run(gpu, view, value_count(view), background, settings, &rates)?;
            if (iteration + 1) % LOSS_EVERY == 0 {
                let [l1, _] = step.loss(gpu, view)?;
                // Gaussians at positions that are not finite are not drawn, so the loss would stay finite.
                let (response, joints, poses) = self.read_hand(gpu, &step)?;
                let checked = check_loss(l1).and_then(|()| check_hand(&response, &joints, &poses));
                checked.map_err(|fault| diverged(fault, iteration + 1))?;
                mean = Some(mean.map_or(l1, |m| 0.8 * m + 0.2 * l1));
            }
            done = iteration + 1;
            progress(&Progress {
                iteration: stage.done + iteration + 1,
                iterations: self.settings.iterations,
                stage: stage.number,
                l1: mean,
            });
        }
        let mut tables = step.tables(gpu)?;
        let (response, moved, poses) = self.read_hand(gpu, &step)?;
        let checked = check_hand(&response, &moved, &poses).and_then(|()| check_gaussians(&tables));
        checked.map_err(|fault| diverged(fault, done))?;
        let loss_at_end = self.reference_loss(gpu, &mut step, stage, background)?;
        let mut seen = None;
        if !stage.refine_poses {
            let weights = self.seen_weights(gpu, &mut step, stage, avatar.template.len())?;
            if settings.unseen == Unseen::Fill {
                tables.fill_unseen(&weights, &neighbors(&avatar.template));
            }
            seen = Some(weights);
        }
        check_change(loss_at_start, loss_at_end).map_err(|fault| diverged(fault, done))?;
        let moved = moved.iter().map(|j| DVec3::new(j[0].into(), j[1].into(), j[2].into())).collect();
        let avatar = Avatar { template: Template { joints: moved, ..avatar.template }, ..avatar };
        let provenance = Provenance { iterations: stage.done + done, ..avatar.provenance };
        let light = step.light()?.cloned();
        Ok(StageResult { avatar: Avatar { tables, seen, light, provenance, ..avatar }, poses, iterations: done })
    }

    /// Reads the numbers learned for the whole hand: the pose response, the rest joints and the poses.
    fn read_hand(&self, gpu: &Gpu, step: &Step) -> Result<LearnedHand, RenderError> {
        let numbers = step.hand_parameters(gpu, self.poses.len())?;
        let poses = poses_of(&numbers.poses, numbers.joints.len());
        Ok((numbers.response, numbers.joints, poses))
    }

    /// How much each Gaussian contributes to a view: the mean over an evenly spaced selection of the views.
    fn seen_weights(&self, gpu: &Gpu, step: &mut Step, stage: &Stage, count: usize) -> Result<Vec<f32>, TrainError> {
        let views = self.views.len().min(SEEN_VIEWS);
        let mut seen = vec![0.0; count];
        for k in 0..views {
            let view = self.views.get(k * self.views.len() / views, stage.reduction)?;
            step.add_seen(gpu, &view, &mut seen)?;
        }
        // A sum of blend weights is not negative, but rounding in its derivative could be.
        seen.iter_mut().for_each(|sum| *sum = (*sum / views.max(1) as f32).max(0.0));
        Ok(seen)
    }

    /// The mean loss over a fixed, evenly spaced selection of the views.
    fn reference_loss(
        &self,
        gpu: &Gpu,
        step: &mut Step,
        stage: &Stage,
        background: [f32; 3],
    ) -> Result<f64, TrainError> {
        let count = self.views.len().min(REFERENCE_VIEWS);
        let mut sum = 0.0;
        for k in 0..count {
            let view = self.views.get(k * self.views.len() / count, stage.reduction)?;
            sum += step.measure(gpu, &view, background, &stage.settings)?;
        }
        Ok(sum / count.max(1) as f64)
    }
}

/// Whether the pose prior is applied before an iteration (from 0): `rounds` times, evenly over a stage's iterations
/// from the first one on, or before every iteration if there are fewer than `rounds`.
fn is_prior_round(iteration: u64, iterations: u64, rounds: u64) -> bool {
    if rounds == 0 {
        return false;
    }
    let between = (iterations / rounds).max(1);
    iteration.is_multiple_of(between) && iteration / between < rounds
}

/// Subtracts the mean correction from the translations.
///
/// Moving all points and joints of the rest hand one way and all translations the opposite way changes no image, so
/// refinement can drift; other poses, such as those of a test split, would then be off by the drift. The given
/// translations have errors in single frames, but hardly in their mean.
fn recenter(refined: &mut [Pose], given: &[Pose]) {
    let drift = refined.iter().zip(given).map(|(r, g)| r.translation - g.translation).sum::<DVec3>();
    let drift = drift / refined.len().max(1) as f64;
    refined.iter_mut().for_each(|p| p.translation -= drift);
}

/// The poses in a table of `[frames][n_b * 3 + 3]` numbers.
fn poses_of(table: &[f32], joints: usize) -> Vec<Pose> {
    let pose = |frame: &[f32]| {
        let mut vectors: Vec<DVec3> =
            frame.chunks_exact(3).map(|v| DVec3::new(v[0].into(), v[1].into(), v[2].into())).collect();
        let translation = vectors.pop().unwrap_or(DVec3::ZERO);
        Pose { rotations: vectors, translation }
    };
    table.chunks_exact(pose_stride(joints)).map(pose).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_prior_is_applied_as_often_as_set() {
        for (iterations, rounds) in [(1400, 3), (1402, 3), (1, 1), (186, 3), (7, 7), (1000, 1), (100, 0)] {
            let acts: Vec<u64> = (0..iterations).filter(|i| is_prior_round(*i, iterations, rounds)).collect();
            assert_eq!(acts.len() as u64, rounds, "{iterations} iterations: {acts:?}");
            // Enough iterations follow each round.
            assert!(acts.iter().all(|i| *i == 0 || iterations - i >= iterations / rounds), "{iterations}: {acts:?}");
        }
        assert_eq!((0..2).filter(|i| is_prior_round(*i, 2, 5)).count(), 2, "fewer iterations than rounds");
    }

    #[test]
    fn recentring_keeps_single_corrections_and_removes_their_mean() {
        let pose = |x: f64| Pose { rotations: vec![], translation: DVec3::new(x, 0.0, 1.0) };
        let given = [pose(0.0), pose(1.0)];
        let mut refined = [pose(0.5), pose(1.3)];
        recenter(&mut refined, &given);
        let moved: Vec<f64> = refined.iter().zip(&given).map(|(r, g)| r.translation.x - g.translation.x).collect();
        assert!((moved[0] - 0.1).abs() < 1e-12 && (moved[1] + 0.1).abs() < 1e-12, "{moved:?}");
    }
}
