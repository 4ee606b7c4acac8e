//! A training run: two stages over the views of a split.

mod gaussian_width;
mod light;
mod preview_sink;
mod run;
pub mod simplification;
mod stage;
mod view_order;

use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use ghand_avatar::{Avatar, AvatarLight, Provenance};
use ghand_capture::images::color_correction::ColorMap;
use ghand_capture::mask::AlignedHand;
use ghand_capture::{Capture, Split, SplitView};
use ghand_core::pose_offsets::TrackerOffsets;
use ghand_core::{Camera, HandModel, Pose};
use ghand_hand_model::surface;
use ghand_render::Gpu;
use ghand_render::image_loss::ImageLoss;
use glam::DVec3;

use crate::checkpoint::{Checkpoint, CheckpointError, CurvePoint, Prepared};
use crate::checkpoints::Checkpoints;
use crate::memory_check;
use crate::settings::{Align, Model, Simplify, TrainSettings};
use crate::train_error::TrainError;
use crate::visible_gaussians::visible_gaussians;
use gaussian_width::{gaussian_width, with_resolution};
use ghand_fit::alignment::pose_offsets::tracker_offsets;
use ghand_fit::alignment::{Alignment, AlignmentError, align};
use ghand_fit::exposure::ExposureFit;
use ghand_fit::light_fit::LightFit;
use ghand_fit::texels::colors::texel_colors;
use ghand_fit::texels::required::required_texels;
use ghand_fit::views::TrainViews;
use ghand_measure::lpips::Lpips;
use ghand_measure::protocol::{PosedView, mask_views};
use preview_sink::PreviewSink;
use run::Run;
use simplification::{Simplification, Trial};
use stage::Stage;

/// The progress of a run.
#[derive(Debug, Clone, Copy)]
pub struct TrainingProgress<'a> {
    /// Iterations done.
    pub iteration: u64,
    /// Total number of iterations.
    pub iterations: u64,
    /// 1 while poses are refined, then 2.
    pub stage: u32,
    /// L1 over the crops, as a mean over the last images, once there are enough.
    pub l1: Option<f64>,
    /// The curve so far.
    pub curve: &'a [CurvePoint],
    /// Pictures that were just taken of images held out: see [`Trainer::with_held_out`].
    pub previews: &'a [Preview],
    /// A trial of `simplify=auto` that has just ended. The iterations are those of the run before it.
    pub trial: Option<&'a Trial>,
}

/// A picture of an image that training does not see, cropped to the hand.
#[derive(Debug, Clone)]
pub struct Preview {
    /// Size, pixels.
    pub size: [u32; 2],
    /// The image.
    pub truth: Vec<[u8; 3]>,
    /// The avatar.
    pub render: Vec<[u8; 3]>,
}

/// The result of a run.
#[derive(Debug, Clone)]
pub struct Trained {
    /// The avatar.
    pub avatar: Avatar,
    /// Refined poses of the split's frames.
    pub poses: Vec<Pose>,
    /// The images of the watched split in poses by the protocol `masks`, for the avatar's template, where the capture has no
    /// exact poses and the training poses were aligned.
    pub held_out: Option<Vec<PosedView>>,
    /// The capture's cameras, as refined where the alignment found their calibration wrong.
    pub cameras: Vec<Camera>,
    /// What makes the colours of the cameras' images alike, where they differ.
    pub colors: BTreeMap<usize, ColorMap>,
    /// The hand that the masks were cut to, once the poses were aligned.
    pub masks_of: Option<Arc<AlignedHand>>,
    /// The alignment, with `align=contours`; its poses were used unless it was rejected.
    pub alignment: Option<Alignment>,
    /// Training images that are so blurred that they were taken less than half as often as others.
    pub blurred: usize,
    /// How the light was found, unless `light=off`.
    pub light: Option<LightFit>,
    /// What was found of the cameras' exposures, unless `exposure=off`.
    pub exposure: Option<ExposureFit>,
    /// The settings with what `simplify=auto` changed.
    pub settings: TrainSettings,
    /// What `simplify=auto` tried.
    pub simplification: Option<Simplification>,
    /// Iterations done, of both stages: fewer than in the settings if a stop was requested, or its time was over.
    pub iterations: u64,
    /// Whether a stop was requested.
    pub stopped: bool,
    /// Steps without a finite gradient, of both stages, which changed nothing.
    pub skipped_steps: u64,
    /// Wall-clock time of the run, seconds.
    pub seconds: f64,
    /// The loss, and the PSNR of images held out, over the run.
    pub curve: Vec<CurvePoint>,
    /// Pictures of these images at its end.
    pub previews: Vec<Preview>,
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
    problem: Problem,
    run: Run<'a>,
}

/// What is trained on. The stages of a run leave it as it is.
struct Problem {
    /// The template is in the proportions of the hand, and the cameras where they are, once that is known.
    capture: Capture,
    split: Split,
    split_name: String,
    settings: TrainSettings,
    views: TrainViews,
    gaussians: usize,
    /// Says which images in which poses are trained on.
    training_set: u32,
    prepared: Prepared,
    watched: Option<Watched>,
    lpips: Option<Arc<Lpips>>,
}

/// Images of another split that a run is compared with.
struct Watched {
    /// Name of the split.
    split: String,
    /// Those of its images that are compared.
    shown: Vec<SplitView>,
    views: TrainViews,
    poses: Vec<Pose>,
}

impl Watched {
    /// Takes the poses of the compared images from these of the whole split.
    fn take_poses(&mut self, of_split: &[PosedView]) {
        for (view, pose) in self.shown.iter().zip(&mut self.poses) {
            let same = |other: &&PosedView| (other.camera, other.frame) == (view.camera, view.frame);
            if let Some(found) = of_split.iter().find(same) {
                pose.clone_from(&found.pose);
            }
        }
    }
}

/// The least integer fraction of a resolution with at most this many pixels.
fn least_reduction(size: [u32; 2], most_pixels: u64) -> u32 {
    let pixels = |reduction: u32| size.map(|edge| u64::from(edge / reduction)).iter().product::<u64>();
    let most = size[0].max(size[1]).max(1);
    (1..most).find(|reduction| pixels(*reduction) <= most_pixels).unwrap_or(most)
}

/// Number of those images.
const WATCHED_VIEWS: usize = 4;
/// How often they are taken while the avatar is trained.
const PREVIEWS: u32 = 10;

/// Pixels kept around the mask when an image is cropped to the hand: the window of SSIM (5) and blurred edges fit in.
const CROP_MARGIN: u32 = 16;

/// Number of views from which the initial texel colours are computed.
const COLOR_VIEWS: usize = 60;

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
        settings.check_build()?;
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
        let settings = with_resolution(capture, &split, settings)?;
        let gaussians = surface::sample_surface(&capture.template, settings.uv_resolution)?.len();
        memory_check::check(gaussians, capture.template.joint_count(), &settings)?;
        let problem = Problem {
            views: TrainViews::new(capture, &split, CROP_MARGIN)?,
            training_set: training_set(capture, &split),
            prepared: Prepared {
                poses: split.frames.iter().map(|f| capture.frames[*f].pose.clone()).collect(),
                ..Prepared::default()
            },
            split,
            split_name: split_name.into(),
            capture: capture.clone(),
            settings,
            gaussians,
            watched: None,
            lpips: None,
        };
        Ok(Trainer { gpu, problem, run: Run::default() })
    }

    /// Images are trained on at this integer fraction of their resolution: 1, unless the device takes no larger ones. What is
    /// measured on images is measured at their full resolution.
    pub fn reduction(&self) -> u32 {
        self.problem.reduction(self.gpu)
    }

    /// Stops the run after the iteration in which `stop` becomes true. In stage 2 the run then returns the present
    /// avatar, before that [`TrainError::Stopped`].
    #[must_use]
    pub fn stop_when(self, stop: &'a AtomicBool) -> Trainer<'a> {
        Trainer { run: Run { stop: Some(stop), ..self.run }, ..self }
    }

    /// Compares the avatar with some images of another split ten times in a run. What is learned stays the same. The
    /// split may have no images. Their poses are the capture's; where the capture has no exact poses and the training poses
    /// are aligned, those by the protocol `masks` ([`Trained::held_out`]).
    ///
    /// # Errors
    /// [`TrainError`] if the split does not exist or one of its images is unusable.
    pub fn with_held_out(mut self, split_name: &str) -> Result<Trainer<'a>, TrainError> {
        let split = self.problem.capture.split(split_name)?;
        let count = split.views.len().min(WATCHED_VIEWS);
        // Evenly over the frames, a different camera each time.
        let at = |k: usize| (k * split.views.len() / count + k % split.cameras.len().max(1)).min(split.views.len() - 1);
        let chosen: Vec<_> = (0..count).map(|k| split.views[at(k)]).collect();
        if chosen.is_empty() {
            return Ok(self);
        }
        let split = Split { views: chosen, ..split.clone() };
        let views = TrainViews::new(&self.problem.capture, &split, CROP_MARGIN)?;
        let poses = split.views.iter().map(|view| self.problem.capture.frames[view.frame].pose.clone()).collect();
        let mut watched = Watched { split: split_name.into(), shown: split.views, views, poses };
        if let Some(held_out) = &self.problem.prepared.held_out {
            watched.take_poses(held_out);
        }
        self.problem.watched = Some(watched);
        Ok(self)
    }

    /// Shows the avatar as it is, at the beginning of a stage and then `every` so often. Training waits while `show` runs.
    /// What is learned stays the same.
    #[must_use]
    pub fn with_preview(self, every: Duration, show: impl FnMut(Avatar) + 'a) -> Trainer<'a> {
        Trainer { run: Run { preview: Some(PreviewSink::new(every, show)), ..self.run }, ..self }
    }

    /// Saves checkpoints while it runs: when one is due, when a stop is requested, and at its end.
    #[must_use]
    pub fn with_checkpoints(self, checkpoints: Checkpoints) -> Trainer<'a> {
        Trainer { run: Run { checkpoints: Some(checkpoints), ..self.run }, ..self }
    }

    /// Goes on from a checkpoint of the same run. On the same device the result is the same, bit for bit, as without the
    /// interruption, unless time is limited.
    ///
    /// # Errors
    /// [`CheckpointError::Mismatch`] if settings, images or poses are not those of the checkpoint, with the setting that
    /// differs.
    pub fn resume(mut self, checkpoint: Checkpoint) -> Result<Trainer<'a>, TrainError> {
        let problem = &mut self.problem;
        let mismatch = |problem: String| CheckpointError::Mismatch { problem };
        if let Some((key, then, now)) = checkpoint.settings.first_difference(&problem.settings) {
            let what = format!("`{key}` was {then} when the run began, and is {now} now; set it as before");
            return Err(mismatch(what).into());
        }
        let Checkpoint { mut prepared, stage, .. } = checkpoint;
        let frames = problem.prepared.poses.len();
        if checkpoint.training_set != problem.training_set || prepared.poses.len() != frames {
            let what = "the capture, its split or its poses have changed since the run began";
            return Err(mismatch(format!("{what}; train anew, without --resume")).into());
        }
        if let Some(alignment) = &mut prepared.alignment {
            let directions = &problem.capture.template.pose_directions;
            alignment.templates_mut().for_each(|template| template.pose_directions.clone_from(directions));
            let fits = alignment.template.joint_count() == problem.capture.template.joint_count();
            alignment.template.validate().map_err(|error| mismatch(error.to_string()))?;
            if !fits {
                return Err(mismatch("its template has other joints".into()).into());
            }
            problem.capture.template = alignment.template.clone();
            if let Some(calibration) = &alignment.calibration {
                problem.capture.cameras = calibration.applied_to(&problem.capture.cameras);
            }
            let found = (alignment.rejection.is_none()).then(|| (alignment.template.clone(), alignment.poses.clone()));
            if let Some((template, poses)) = found {
                problem.align_masks(&template, &poses, prepared.held_out.as_deref())?;
            }
        }
        if !prepared.correction.is_empty() {
            problem.capture.color_correction = prepared.correction.clone();
            problem.views = TrainViews::new(&problem.capture, &problem.split, CROP_MARGIN)?;
        }
        if let Some(exposure) = prepared.exposure.as_mut().filter(|fit| fit.corrected) {
            exposure.maps.clone_from(&prepared.correction.cameras);
        }
        problem.prepared = prepared;
        self.run.curve = checkpoint.curve;
        self.run.state = Some(stage);
        self.run.earlier = checkpoint.seconds;
        Ok(self)
    }

    /// Iterations of an earlier run that this one continues.
    pub fn resume_iteration(&self) -> Option<u64> {
        self.run.state.as_ref().map(|state| state.iterations_done)
    }

    /// Adds LPIPS to the loss, with the weight of the settings.
    #[must_use]
    pub fn with_lpips(mut self, lpips: Option<Arc<Lpips>>) -> Trainer<'a> {
        self.problem.lpips = lpips;
        self
    }

    /// Number of Gaussians of the avatar, unless `simplify=auto` or `merge_below` make them fewer.
    pub fn gaussians(&self) -> usize {
        self.problem.gaussians
    }

    /// Resolution of the UV raster: that of the settings, or the one that suits the images.
    pub fn uv_resolution(&self) -> u32 {
        self.problem.settings.uv_resolution
    }

    /// How wide a Gaussian is in the training images, pixels: the median over images of what a texel's edge covers at the
    /// hand's distance, seen face on.
    ///
    /// # Errors
    /// [`TrainError`] if the hand model has no usable atlas.
    pub fn gaussian_width(&self) -> Result<f64, TrainError> {
        let Problem { capture, split, settings, .. } = &self.problem;
        Ok(gaussian_width(capture, split, settings.uv_resolution)?)
    }

    /// Runs both stages and calls `progress` after each iteration and each trial.
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
    pub fn train(self, mut progress: impl FnMut(&TrainingProgress)) -> Result<Trained, TrainError> {
        let Trainer { gpu, mut problem, mut run } = self;
        run.started = Instant::now();
        let reached = run.state.as_ref().map_or(0, |state| state.number);
        if reached == 0 && problem.settings.align == Align::Contours {
            problem.align(run.stop)?;
        }
        let mut gpu = gpu.clone();
        let uv_resolution = problem.settings.uv_resolution;
        let name_setting = |error: TrainError| error.with_memory_setting(uv_resolution);
        let pose_iterations = problem.settings.pose_iterations();
        if pose_iterations > 0 && reached < 2 {
            let stage = Stage {
                number: 1,
                settings: problem.settings.pose_stage_settings(),
                iterations: pose_iterations,
                part_of_time: problem.settings.pose_stage().part,
                done: 0,
                refine_poses: true,
                reduction: problem.settings.pose_stage().image_reduction.max(problem.reduction(&gpu)),
                previews: 0,
            };
            let first = gpu
                .retry_on_device_loss("stage 1", |gpu| problem.run(gpu, &stage, &mut run, &mut progress))
                .map_err(name_setting)?;
            problem.prepared.skipped_steps = first.skipped_steps;
            let mut refined = first.poses;
            recenter(&mut refined, &problem.prepared.poses);
            problem.prepared.poses = refined;
        }
        if reached < 2 {
            problem.find_light(&mut gpu)?;
        }
        if reached < 2 && problem.settings.simplify == Simplify::Auto {
            let curve = run.curve.clone();
            let iterations = problem.settings.iterations;
            let mut ended = |trial: &Trial| {
                progress(&TrainingProgress {
                    iteration: pose_iterations,
                    iterations,
                    stage: 2,
                    l1: None,
                    curve: &curve,
                    previews: &[],
                    trial: Some(trial),
                });
            };
            problem.prepared.simplification = problem.simplify(&mut gpu, &run, &mut ended).map_err(name_setting)?;
        }
        let simplification = &problem.prepared.simplification;
        let settings = simplification.as_ref().map_or(Ok(problem.settings.clone()), |s| s.apply(&problem.settings))?;
        let stage = Stage {
            number: 2,
            settings: settings.clone(),
            iterations: problem.settings.iterations - pose_iterations,
            part_of_time: 1.0,
            done: pose_iterations,
            refine_poses: false,
            reduction: problem.reduction(&gpu),
            previews: PREVIEWS,
        };
        let done = gpu
            .retry_on_device_loss("stage 2", |gpu| problem.run(gpu, &stage, &mut run, &mut progress))
            .map_err(name_setting)?;
        let iterations = stage.done + done.iterations;
        let stopped = done.stopped;
        let mut avatar = done.avatar;
        avatar.limit_response(&problem.seen_poses());
        avatar.tracker = problem.tracker();
        let may_leave_out = !stopped && problem.settings.model == Model::Direct;
        if let Some(simplification) = problem.prepared.simplification.as_mut().filter(|_| may_leave_out) {
            let views = &problem.views;
            let poses = &problem.prepared.poses;
            let reduction = stage.reduction;
            let visible = gpu.retry_on_device_loss("what nothing shows", |gpu| {
                let images = (0..views.len()).map(|k| views.get(k, reduction).map(|view| (view.frame, view.camera)));
                visible_gaussians(gpu, &avatar, poses, images, views.largest(reduction))
            })?;
            if let Some(kept) = avatar.retain(&visible) {
                simplification.never_shown = avatar.template.len() - kept.template.len();
                avatar = kept;
            }
        }
        let seconds = run.seconds();
        let Prepared { poses, held_out, alignment, light, exposure, skipped_steps, simplification, .. } =
            problem.prepared;
        let skipped_steps = skipped_steps + done.skipped_steps;
        let curve = run.curve;
        let previews = done.previews;
        Ok(Trained {
            avatar,
            poses,
            held_out,
            cameras: problem.capture.cameras.clone(),
            colors: problem.capture.color_correction.cameras.clone(),
            masks_of: problem.capture.images.aligned.clone(),
            blurred: problem.views.blurred()?,
            alignment,
            light,
            exposure,
            settings,
            simplification,
            iterations,
            stopped,
            skipped_steps,
            seconds,
            curve,
            previews,
        })
    }
}

impl Problem {
    /// See [`Trainer::reduction`].
    fn reduction(&self, gpu: &Gpu) -> u32 {
        let watched = self.watched.as_ref().map_or([1; 2], |watched| watched.views.largest(1));
        let largest = self.views.largest(1);
        least_reduction([0, 1].map(|axis| largest[axis].max(watched[axis])), ImageLoss::most_pixels(gpu))
    }

    /// Aligns poses and proportions.
    fn align(&mut self, stop: Option<&AtomicBool>) -> Result<(), TrainError> {
        let mut go_on = |_: &str, _: &[Pose]| stop.is_none_or(|stop| !stop.load(Ordering::Relaxed));
        // Where exact poses are known, the given test poses are judged as they are.
        let watched = self.watched.as_ref().filter(|_| self.capture.truth.is_none());
        let held_out = watched.map(|watched| self.capture.split(&watched.split)).transpose()?.cloned();
        let aligned = match align(&self.capture, &self.split, held_out.as_ref(), &mut go_on) {
            Err(AlignmentError::Stopped) => {
                return Err(TrainError::Stopped { iteration: 0, iterations: self.settings.iterations });
            }
            result => result?,
        };
        if let Some(rejection) = &aligned.rejection {
            log::warn!("the given poses are used: {rejection}");
        } else if !aligned.kept.is_empty() {
            log::warn!(
                "{} of {} frames keep their given poses, which fit the masks better",
                aligned.kept.len(),
                self.prepared.poses.len()
            );
        }
        if let Some(texture) = &aligned.texture {
            log::info!(
                "texture refined {} of {} frames; {} keep the poses by contours, which explain images held out better",
                texture.refined.len(),
                self.prepared.poses.len(),
                texture.kept.len()
            );
        }
        for odd in &aligned.odd_cameras {
            log::warn!("{odd}");
        }
        for offset in &aligned.time_offsets {
            log::warn!("{offset}");
        }
        if let Some(calibration) = &aligned.calibration {
            log::info!("{}", calibration.summary());
            self.capture.cameras = calibration.applied_to(&self.capture.cameras);
        }
        self.prepared.poses.clone_from(&aligned.poses);
        self.capture.template = aligned.template.clone();
        if let (Some(split), Some(known), Some(watched)) = (held_out, &aligned.knowledge, &mut self.watched) {
            let held_out = mask_views(&self.capture, &self.split, &split, &aligned.template, &aligned.held_out, known)?;
            watched.take_poses(&held_out);
            self.prepared.held_out = Some(held_out);
        }
        if aligned.rejection.is_none() {
            let held_out = self.prepared.held_out.take();
            self.align_masks(&aligned.template, &aligned.poses, held_out.as_deref())?;
            self.prepared.held_out = held_out;
        }
        self.prepared.alignment = Some(aligned);
        Ok(())
    }

    /// Takes the masks from the aligned hand on: of the training frames in these poses, and of the images held out.
    fn align_masks(
        &mut self,
        template: &HandModel,
        poses: &[Pose],
        held_out: Option<&[PosedView]>,
    ) -> Result<(), TrainError> {
        let mut frames = self.split.frames.clone();
        let mut poses = poses.to_vec();
        for view in held_out.unwrap_or_default() {
            frames.push(view.frame);
            poses.push(view.pose.clone());
        }
        self.capture.align_masks(template, &frames, &poses);
        self.views = TrainViews::new(&self.capture, &self.split, CROP_MARGIN)?;
        if let Some(watched) = &mut self.watched {
            let split = Split { views: watched.shown.clone(), ..self.capture.split(&watched.split)?.clone() };
            watched.views = TrainViews::new(&self.capture, &split, CROP_MARGIN)?;
        }
        Ok(())
    }

    /// How the tracker that gave the capture's poses is off, where training refined them.
    fn tracker(&self) -> Option<TrackerOffsets> {
        let given: Vec<Pose> = self.split.frames.iter().map(|frame| self.capture.frames[*frame].pose.clone()).collect();
        tracker_offsets(&given, &self.prepared.poses, &self.capture.template.parents)
    }

    /// The poses of the frames with training images.
    fn seen_poses(&self) -> Vec<Pose> {
        let seen = |position: usize| self.split.views.iter().any(|view| view.position == position);
        let poses = self.prepared.poses.iter().enumerate().filter(|(position, _)| seen(*position));
        poses.map(|(_, pose)| pose.clone()).collect()
    }

    /// The initial avatar of a stage: the template's surface with mean texel colours, `inset` standard deviations deep. It
    /// lies on a finer mesh, whose outlines are round, and light falls on that.
    fn start(&self, gpu: &Gpu, settings: &TrainSettings, inset: f64) -> Result<Avatar, TrainError> {
        let poses = &self.prepared.poses;
        let (resolution, merge_below) = (settings.uv_resolution, settings.merge_below);
        let template = &self.capture.template;
        let samples = required_texels(gpu, &self.capture, &self.split, poses, resolution, merge_below)?;
        let capture = Capture { template: surface::smooth::smoothed(template), ..self.capture.clone() };
        let samples = samples.on_smoothed(template, &capture.template);
        let mut avatar =
            Avatar::untrained_at(&capture.template, &samples, &settings.avatar(), [0.5; 3], inset, settings.seed)?;
        avatar.model = template.without_blend_shapes();
        if let Some((light, fit)) = self.prepared.light.as_ref().and_then(|fit| Some((fit.light.clone()?, fit))) {
            let gloss = fit.gloss.as_ref().map(|fit| fit.gloss.clone());
            let lit = AvatarLight::new(light, gloss, &samples);
            avatar.light = Some(AvatarLight { divided: true, interreflection: fit.interreflection, ..lit });
        }
        let lit = avatar.light.as_ref().map(|light| (light, &avatar.model));
        let colors = texel_colors(gpu, &capture, &self.split, poses, samples, COLOR_VIEWS, lit)?;
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
}

/// A number that identifies the training images and their poses.
fn training_set(capture: &Capture, split: &Split) -> u32 {
    let poses: Vec<&Pose> = split.frames.iter().map(|frame| &capture.frames[*frame].pose).collect();
    crc32fast::hash(format!("{:?} {:?} {poses:?}", split.views, capture.cameras).as_bytes())
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn images_are_reduced_only_as_far_as_the_device_requires() {
        assert_eq!(least_reduction([334, 512], 2_796_202), 1);
        assert_eq!(least_reduction([2000, 1000], 2_000_000), 1);
        assert_eq!(least_reduction([2001, 1000], 2_000_000), 2);
        assert_eq!(least_reduction([4000, 3000], 2_796_202), 3);
        assert_eq!(least_reduction([1, 1], 0), 1);
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
