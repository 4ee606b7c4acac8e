//! One stage of a run: one view per iteration.

use ghand_avatar::deform::pose_stride;
use ghand_avatar::neighbors::neighbors;
use ghand_avatar::{Avatar, Provenance, Template};
use ghand_core::Pose;
use ghand_render::{Gpu, RenderError};
use glam::DVec3;

use super::view_order::ViewOrder;
use super::{Preview, Problem, Run, TrainingProgress};
use crate::checkpoint::{CurvePoint, Losses, SkippedSteps, StageState};
use crate::divergence::{Divergence, check_change, check_gaussians, check_hand, check_loss, remedy};
use crate::lpips_term::LpipsTerm;
use crate::pose_prior::shrink;
use crate::settings::{TrainSettings, Unseen};
use crate::step::{Rates, Step, StepOutcome};
use crate::train_error::TrainError;
use ghand_core::pose_error::moving_joints;
use ghand_fit::views::TrainView;
use ghand_measure::error_bands::squared_error;
use ghand_measure::metrics::{psnr_of, quantize};

/// Number of views on which the loss before and after a stage is compared.
const REFERENCE_VIEWS: usize = 8;
/// Iterations whose mean loss is a point of the curve. After as many the learned numbers are checked.
const LOSS_EVERY: u64 = 25;
/// Number of views that say how much training saw of each Gaussian.
const SEEN_VIEWS: usize = 60;

/// How deep below the template's surface Gaussians start, in their standard deviations, but no deeper than a third of the
/// hand's thickness: too thin is better than too thick, as nothing outside the hand must be unlearned. On the demo 1 has
/// 0.5 dB more than 0, and as much as 1.5.
const INSET: f64 = 1.0;
/// The same in stage 1, whose Gaussians are round.
const POSE_STAGE_INSET: f64 = 3.0;

/// One stage of training.
pub(super) struct Stage {
    pub number: u32,
    pub settings: TrainSettings,
    pub iterations: u64,
    /// The part of the remaining time that it may take, if time is limited.
    pub part_of_time: f64,
    /// Iterations of the previous stages.
    pub done: u64,
    pub refine_poses: bool,
    /// The images are this many times smaller than the capture's.
    pub reduction: u32,
    /// How often the watched images are taken, evenly over the stage, and at its end once more.
    pub previews: u32,
}

/// The result of a stage.
pub(super) struct StageResult {
    pub avatar: Avatar,
    pub poses: Vec<Pose>,
    /// Iterations of this stage.
    pub iterations: u64,
    /// Whether a stop was requested.
    pub stopped: bool,
    /// Its steps without a finite gradient, which changed nothing.
    pub skipped_steps: u64,
    /// The watched images at its end, and their mean PSNR.
    pub previews: Vec<Preview>,
    /// See `previews`.
    pub held_out_psnr: Option<f64>,
}

/// Pose response, rest joints, poses.
type LearnedHand = (Vec<f32>, Vec<[f32; 3]>, Vec<Pose>);

impl Problem {
    /// Runs a stage, from its last state on if there is one.
    pub(super) fn run(
        &self,
        gpu: &Gpu,
        stage: &Stage,
        run: &mut Run,
        progress: &mut dyn FnMut(&TrainingProgress),
    ) -> Result<StageResult, TrainError> {
        let settings = &stage.settings;
        let pose_stage = self.settings.pose_stage();
        let before = run.state.clone().filter(|state| state.number == stage.number);
        let avatar = self.start(gpu, settings, if stage.refine_poses { POSE_STAGE_INSET } else { INSET })?;
        let mut step = self.step(gpu, stage, &avatar, before.as_ref())?;
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
        let loss_at_start = match &before {
            Some(state) => state.loss_at_start,
            None => self.reference_loss(gpu, &mut step, stage, background)?,
        };
        check_loss(loss_at_start).map_err(|fault| diverged(fault, 0))?;
        let began = before.as_ref().map_or_else(|| run.seconds(), |state| state.began);
        let mut losses = before.as_ref().map_or_else(Losses::default, |state| state.losses.clone());
        let mut skipped = before.as_ref().map_or_else(SkippedSteps::default, |state| state.skipped);
        let mut done = before.as_ref().map_or(0, |state| state.iteration);
        // After the loss of a device, what came after the last state comes again.
        run.curve.retain(|point| point.iteration <= stage.done + done);
        let weights = self.views.weights()?.to_vec();
        let mut order = ViewOrder::new(&self.views, weights, settings.seed, settings.images_per_step, done);
        let mut saved = before.as_ref().map(|state| state.iteration);
        let mut stop_requested = false;
        let state_after = |step: &Step, done: u64, losses: &Losses, skipped: SkippedSteps| -> Result<_, RenderError> {
            let numbers = step.state(gpu, self.prepared.poses.len())?;
            let iterations_done = stage.done + done;
            let number = stage.number;
            let losses = losses.clone();
            let iteration = done;
            Ok(StageState { number, iteration, iterations_done, began, loss_at_start, losses, skipped, numbers })
        };
        while done < stage.iterations {
            let fraction = self.fraction(stage, done, began, run.seconds());
            if fraction >= 1.0 && done > 0 {
                break;
            }
            stop_requested = run.stop_requested();
            if saved != Some(done) && (stop_requested || run.checkpoint_due()) && run.checkpoints.is_some() {
                run.save(self, state_after(&step, done, &losses, skipped)?);
                saved = Some(done);
            }
            // An avatar without a single iteration is not a result either.
            if stop_requested && (stage.refine_poses || done == 0) {
                let iteration = stage.done + done;
                let iterations = self.settings.iterations;
                return Err(TrainError::Stopped { iteration, iterations });
            }
            if stop_requested {
                break;
            }
            self.show_preview(gpu, run, &step, &avatar, stage.done + done)?;
            let rounds = pose_stage.prior_rounds;
            if stage.refine_poses && is_prior_round(done, stage.iterations, rounds) {
                let (_, _, mut poses) = self.read_hand(gpu, &step)?;
                shrink(&mut poses);
                for (frame, pose) in poses.iter().enumerate() {
                    step.set_pose(gpu, frame, pose)?;
                }
            }
            let (indices, pose_step) = order.take();
            let decay = settings.final_rate.powf(fraction);
            let pose = stage.refine_poses.then_some(pose_stage.rate);
            let lpips = LpipsTerm::counts(fraction);
            let rates = Rates { step: done + 1, tables: decay, pose, pose_step, lpips };
            let mut last = None;
            for index in indices {
                let view = self.views.get(index, stage.reduction)?;
                let outcome = step.add_gradients(gpu, &view, value_count(&view), background, settings, &rates)?;
                losses.add(step.loss(gpu, &view)?[0]);
                last = Some(view);
                if outcome == StepOutcome::Skipped {
                    last = None;
                    break;
                }
            }
            let outcome = match &last {
                Some(view) => step.update(gpu, view, settings, &rates)?,
                None => StepOutcome::Skipped,
            };
            done += 1;
            if skipped.count(outcome == StepOutcome::Skipped) {
                return Err(diverged(Divergence::NotFinite("the gradients of ten steps in a row"), done));
            }
            if done.is_multiple_of(LOSS_EVERY) {
                // Gaussians at positions that are not finite are not drawn, so the loss would stay finite.
                let (response, joints, poses) = self.read_hand(gpu, &step)?;
                let checked = losses.end_window().map_or(Ok(()), check_loss);
                let checked = checked.and_then(|()| check_hand(&response, &joints, &poses));
                checked.map_err(|fault| diverged(fault, done))?;
            }
            let mut previews = vec![];
            let mut held_out_psnr = None;
            let passed = |fraction: f64| (fraction * f64::from(stage.previews)).floor();
            if !stage.refine_poses && passed(self.fraction(stage, done, began, run.seconds())) > passed(fraction) {
                (held_out_psnr, previews) = self.previews(gpu, &mut step, background)?;
            }
            let l1 = losses.mean.filter(|_| done.is_multiple_of(LOSS_EVERY));
            if l1.is_some() || held_out_psnr.is_some() {
                let iteration = stage.done + done;
                let stage = stage.number;
                let seconds = run.seconds();
                run.curve.push(CurvePoint { iteration, stage, seconds, l1, held_out_psnr });
            }
            progress(&TrainingProgress {
                iteration: stage.done + done,
                iterations: self.settings.iterations,
                stage: stage.number,
                l1: losses.mean,
                curve: &run.curve,
                previews: &previews,
                trial: None,
            });
        }
        // So that a run which is killed while it is evaluated need not repeat its last iterations.
        if !stage.refine_poses && saved != Some(done) && run.checkpoints.is_some() {
            run.save(self, state_after(&step, done, &losses, skipped)?);
        }
        let mut tables = step.tables(gpu)?;
        let (response, moved, poses) = self.read_hand(gpu, &step)?;
        let checked = check_hand(&response, &moved, &poses).and_then(|()| check_gaussians(&tables));
        checked.map_err(|fault| diverged(fault, done))?;
        let loss_at_end = self.reference_loss(gpu, &mut step, stage, background)?;
        let mut seen = None;
        let mut held_out_psnr = None;
        let mut previews = vec![];
        if !stage.refine_poses {
            (held_out_psnr, previews) = self.previews(gpu, &mut step, background)?;
            let weights = self.seen_weights(gpu, &mut step, stage, avatar.template.len())?;
            if settings.unseen == Unseen::Fill {
                tables.fill_unseen(&weights, &neighbors(&avatar.template), self.split.cameras.len());
            }
            seen = Some(weights);
        }
        // Where a stop was requested, the loss may still rise before it falls.
        if !stop_requested {
            check_change(loss_at_start, loss_at_end).map_err(|fault| diverged(fault, done))?;
        }
        let moved = moved.iter().map(|j| DVec3::new(j[0].into(), j[1].into(), j[2].into())).collect();
        let avatar = Avatar { template: Template { joints: moved, ..avatar.template }, ..avatar };
        let provenance = Provenance { iterations: stage.done + done, ..avatar.provenance };
        let avatar = Avatar { tables, seen, provenance, ..avatar };
        let skipped_steps = skipped.total;
        Ok(StageResult {
            avatar,
            poses,
            iterations: done,
            stopped: stop_requested,
            skipped_steps,
            previews,
            held_out_psnr,
        })
    }

    /// Shows the avatar that a step has learned so far, if there is a preview and the last one is old. `start` is the
    /// stage's first avatar.
    fn show_preview(
        &self,
        gpu: &Gpu,
        run: &mut Run,
        step: &Step,
        start: &Avatar,
        iterations: u64,
    ) -> Result<(), RenderError> {
        let Some(preview) = run.preview.as_mut().filter(|preview| preview.is_due()) else { return Ok(()) };
        let (_, joints, _) = self.read_hand(gpu, step)?;
        let joints = joints.iter().map(|j| DVec3::new(j[0].into(), j[1].into(), j[2].into())).collect();
        let mut avatar = Avatar {
            template: Template { joints, ..start.template.clone() },
            tables: step.tables(gpu)?,
            provenance: Provenance { iterations, ..start.provenance.clone() },
            ..start.clone()
        };
        avatar.limit_response(&self.seen_poses());
        preview.show(avatar);
        Ok(())
    }

    /// The device's part of a stage.
    fn step(
        &self,
        gpu: &Gpu,
        stage: &Stage,
        avatar: &Avatar,
        before: Option<&StageState>,
    ) -> Result<Step, RenderError> {
        let poses = &self.prepared.poses;
        let mobility: Vec<f32> = moving_joints(poses).iter().map(|m| if *m { 1.0 } else { 0.0 }).collect();
        let watched = self.watched.as_ref().filter(|_| !stage.refine_poses);
        let sizes = [
            self.views.largest(stage.reduction),
            watched.map_or([1; 2], |watched| watched.views.largest(stage.reduction)),
        ];
        let largest = [0, 1].map(|axis| sizes[0][axis].max(sizes[1][axis]));
        // Behind the frames that are trained on.
        let others: &[Pose] = watched.map_or(&[], |watched| &watched.poses);
        let mut step = Step::new(gpu, avatar, poses.len() + others.len(), self.views.len(), largest, &mobility)?;
        self.lpips.iter().for_each(|lpips| step.use_lpips(lpips));
        for (frame, pose) in poses.iter().chain(others).enumerate() {
            step.set_pose(gpu, frame, pose)?;
        }
        before.map_or(Ok(()), |state| step.set_numbers(gpu, poses.len(), &state.numbers))?;
        Ok(step)
    }

    /// The mean PSNR of the watched images, as of whole images, and their pictures.
    fn previews(
        &self,
        gpu: &Gpu,
        step: &mut Step,
        background: [f32; 3],
    ) -> Result<(Option<f64>, Vec<Preview>), TrainError> {
        let Some(watched) = &self.watched else { return Ok((None, vec![])) };
        let mut previews = vec![];
        let mut psnr = 0.0;
        let reduction = self.reduction(gpu);
        for k in 0..watched.views.len() {
            let view = watched.views.get(k, reduction)?;
            let drawn = step.picture(gpu, self.prepared.poses.len() + k, &view.camera, background)?;
            let render: Vec<[u8; 3]> = drawn.rgba.iter().map(|p| quantize([p[0], p[1], p[2]])).collect();
            let errors = render.iter().zip(&view.pixels).map(|(a, b)| squared_error(*a, *b));
            let camera = &self.capture.cameras[view.camera_index];
            // The hand is inside the crop, and the background is known.
            let whole = [camera.width, camera.height].map(|edge| (edge / reduction) as usize);
            psnr += psnr_of(errors.sum(), 3 * whole[0] * whole[1]);
            let truth = view.pixels.iter().map(|&[r, g, b, _]| [r, g, b]).collect();
            previews.push(Preview { size: view.size, truth, render });
        }
        Ok((Some(psnr / previews.len().max(1) as f64), previews))
    }

    /// How much of a stage is done, 0..1, by iterations or by time (the run's at the stage's start and now, seconds), whichever
    /// is more.
    fn fraction(&self, stage: &Stage, done: u64, began: f64, seconds: f64) -> f64 {
        let by_iterations = done as f64 / stage.iterations as f64;
        if self.settings.max_seconds == 0.0 {
            return by_iterations;
        }
        let available = stage.part_of_time * (self.settings.max_seconds - began).max(f64::MIN_POSITIVE);
        by_iterations.max((seconds - began) / available)
    }

    /// Reads the numbers learned for the whole hand: the pose response, the rest joints and the poses.
    pub(super) fn read_hand(&self, gpu: &Gpu, step: &Step) -> Result<LearnedHand, RenderError> {
        let numbers = step.hand_parameters(gpu, self.prepared.poses.len())?;
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
}
