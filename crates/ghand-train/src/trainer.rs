//! A training run: two stages over the views of a split.

use std::time::Instant;

use ghand_avatar::{Avatar, Provenance};
use ghand_core::{HandModelError, Pose};
use ghand_data::{Capture, CaptureError, Split};
use ghand_render::pose::pose_stride;
use ghand_render::{Gpu, RenderError, buffers};
use glam::DVec3;
use rand::seq::SliceRandom;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use crate::evaluate::EvaluateError;
use crate::floor::{FloorError, texel_colors};
use crate::settings::{SettingsError, TrainSettings};
use crate::step::{Rates, Step};
use crate::views::{TrainView, load_views};

/// Why training failed.
#[derive(Debug, thiserror::Error)]
pub enum TrainError {
    /// The capture or one of its images is unusable.
    #[error(transparent)]
    Capture(#[from] CaptureError),
    /// The hand model is unusable.
    #[error(transparent)]
    HandModel(#[from] HandModelError),
    /// The device failed.
    #[error(transparent)]
    Render(#[from] RenderError),
    /// A setting is out of range.
    #[error(transparent)]
    Settings(#[from] SettingsError),
    /// The floor could not be made.
    #[error(transparent)]
    Floor(#[from] FloorError),
    /// The evaluation failed.
    #[error(transparent)]
    Evaluate(#[from] EvaluateError),
    /// The split has nothing to train on.
    #[error("{capture}: split `{split}` has no {what}; add some or choose another split with --split")]
    Empty {
        /// The capture.
        capture: String,
        /// The split.
        split: String,
        /// "cameras" or "frames".
        what: &'static str,
    },
}

/// How far a run is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Progress {
    /// Iterations done.
    pub iteration: u64,
    /// Iterations in all.
    pub iterations: u64,
    /// 1 while poses are refined, then 2.
    pub stage: u32,
    /// Running mean of L1 over the crops, where it has been read.
    pub l1: Option<f64>,
}

/// The result of a run.
#[derive(Debug, Clone)]
pub struct Trained {
    /// The avatar.
    pub avatar: Avatar,
    /// Refined poses of the split's frames.
    pub poses: Vec<Pose>,
    /// Wall-clock time of the iterations, seconds.
    pub seconds: f64,
}

/// A run that can be stepped.
pub struct Trainer<'a> {
    gpu: &'a Gpu,
    settings: TrainSettings,
    avatar: Avatar,
    step: Step,
    views: Vec<TrainView>,
    order: Vec<usize>,
    rng: ChaCha8Rng,
    value_counts: Vec<f64>,
    background: [f32; 3],
    pose_steps: Vec<u64>,
    iteration: u64,
    frames: usize,
}

/// How often the loss is read for the progress bar; reading waits for the device.
const LOSS_EVERY: u64 = 25;
/// Views that the first texel colours are taken from.
const COLOR_VIEWS: usize = 60;

/// The joints that the capture moves at all: where every pose of it has exactly 0, the capture says that the joint does
/// not move, and refinement leaves it.
pub fn moving_joints(poses: &[Pose]) -> Vec<bool> {
    let joints = poses.first().map_or(0, |p| p.rotations.len());
    (0..joints).map(|k| poses.iter().any(|p| p.rotations.get(k).is_some_and(|r| *r != DVec3::ZERO))).collect()
}

impl<'a> Trainer<'a> {
    /// Loads the views of a split and prepares the avatar: the template's surface with mean texel colours.
    ///
    /// # Errors
    /// [`TrainError`] names what cannot be used.
    pub fn new(
        gpu: &'a Gpu,
        capture: &Capture,
        split_name: &str,
        settings: &TrainSettings,
    ) -> Result<Trainer<'a>, TrainError> {
        settings.check()?;
        let split: Split = capture.split(split_name)?.clone();
        for (what, empty) in [("cameras", split.cameras.is_empty()), ("frames", split.frames.is_empty())] {
            if empty {
                let capture = capture.root.display().to_string();
                return Err(TrainError::Empty { capture, split: split_name.into(), what });
            }
        }
        let poses: Vec<Pose> = split.frames.iter().map(|f| capture.frames[*f].pose.clone()).collect();
        let views = load_views(capture, &split, settings.crop_margin)?;
        let mut avatar = Avatar::untrained(&capture.hand_model, &settings.avatar(), [0.5; 3], settings.seed)?;
        let colors = texel_colors(gpu, capture, &split, &poses, settings.uv_resolution, COLOR_VIEWS)?;
        avatar.tables.set_base_colors(&colors.colors);
        avatar.provenance = Provenance {
            capture: capture.root.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default(),
            split: split_name.into(),
            iterations: settings.iterations,
            seed: settings.seed,
            version: env!("CARGO_PKG_VERSION").into(),
        };
        let largest = |axis: usize| views.iter().map(|v| v.size[axis]).max().unwrap_or(1);
        let mobility: Vec<f32> = moving_joints(&poses).iter().map(|m| if *m { 1.0 } else { 0.0 }).collect();
        let step = Step::new(gpu, &avatar, poses.len(), [largest(0), largest(1)], &mobility)?;
        for (frame, pose) in poses.iter().enumerate() {
            step.renderer.set_pose(gpu, frame, pose)?;
        }
        let value_counts =
            capture.cameras.iter().map(|c| 3.0 * f64::from(c.width) * f64::from(c.height)).collect();
        Ok(Trainer {
            gpu,
            settings: settings.clone(),
            avatar,
            step,
            order: Vec::new(),
            rng: ChaCha8Rng::seed_from_u64(settings.seed),
            value_counts,
            background: capture.background.map(|b| b as f32),
            pose_steps: vec![0; poses.len()],
            iteration: 0,
            frames: poses.len(),
            views,
        })
    }

    /// Number of Gaussians.
    pub fn gaussians(&self) -> usize {
        self.avatar.template.len()
    }

    /// Runs one iteration: the next view of a shuffled pass over all views.
    ///
    /// # Errors
    /// [`TrainError::Render`] if the device failed.
    pub fn advance(&mut self) -> Result<(), TrainError> {
        if self.order.is_empty() {
            self.order = (0..self.views.len()).collect();
            self.order.shuffle(&mut self.rng);
        }
        let Some(index) = self.order.pop() else { return Ok(()) };
        let view = &self.views[index];
        let pose_iterations = self.settings.pose_iterations();
        let first_stage = self.iteration < pose_iterations;
        let decay = |part: f64| self.settings.final_rate.powf(part);
        if first_stage {
            self.pose_steps[view.frame] += 1;
        }
        let rates = Rates {
            step: self.iteration + 1,
            tables: decay(self.iteration as f64 / self.settings.iterations.max(1) as f64),
            pose: if first_stage { decay(self.iteration as f64 / pose_iterations as f64) } else { 0.0 },
            pose_step: self.pose_steps[view.frame],
            scale_weight: if first_stage { self.settings.scale_weight } else { 0.0 },
        };
        let value_count = self.value_counts[view.camera_index];
        self.step.run(self.gpu, view, value_count, self.background, &self.settings, &rates)?;
        self.iteration += 1;
        Ok(())
    }

    /// Runs all iterations, telling `progress` after each.
    ///
    /// # Errors
    /// [`TrainError::Render`] if the device failed.
    pub fn train(mut self, mut progress: impl FnMut(&Progress)) -> Result<Trained, TrainError> {
        let start = Instant::now();
        let mut mean: Option<f64> = None;
        while self.iteration < self.settings.iterations {
            let next = self.order.last().copied();
            self.advance()?;
            if let (0, Some(index)) = (self.iteration % LOSS_EVERY, next) {
                let [l1, _] = self.step.loss(self.gpu, &self.views[index])?;
                mean = Some(mean.map_or(l1, |m| 0.8 * m + 0.2 * l1));
            }
            progress(&Progress {
                iteration: self.iteration,
                iterations: self.settings.iterations,
                stage: if self.iteration <= self.settings.pose_iterations() { 1 } else { 2 },
                l1: mean,
            });
        }
        let seconds = start.elapsed().as_secs_f64();
        let poses = self.poses()?;
        let template = &self.avatar.template;
        let (count, joints) = (template.len(), template.joint_count());
        let tables = self.step.renderer.tables.download(self.gpu, count, joints, &self.avatar.config)?;
        Ok(Trained { avatar: Avatar { tables, ..self.avatar }, poses, seconds })
    }

    /// The poses as refined so far.
    ///
    /// # Errors
    /// [`TrainError::Render`] if the device failed.
    pub fn poses(&self) -> Result<Vec<Pose>, TrainError> {
        let stride = pose_stride(self.avatar.template.joint_count());
        let values: Vec<f32> = buffers::read(self.gpu, &self.step.renderer.pose.poses, self.frames * stride)?;
        let pose = |frame: &[f32]| {
            let mut vectors: Vec<DVec3> =
                frame.chunks_exact(3).map(|v| DVec3::new(v[0].into(), v[1].into(), v[2].into())).collect();
            let translation = vectors.pop().unwrap_or(DVec3::ZERO);
            Pose { rotations: vectors, translation }
        };
        Ok(values.chunks_exact(stride).map(pose).collect())
    }
}
