//! An avatar as simple as its images allow (`simplify=auto`).
//!
//! Short trainings hold some frames out and are judged by the images of these. The first is as set; then one part after
//! the other is removed or made smaller, as long as that costs little.

use std::fmt;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

use ghand_capture::{Split, SplitView};
use ghand_core::Pose;
use ghand_hand_model::surface::sample_surface;
use ghand_render::Gpu;
use serde::{Deserialize, Serialize};

use super::stage::Stage;
use super::{CROP_MARGIN, Problem, Run, Watched};
use crate::checkpoint::Prepared;
use crate::memory_check;
use crate::settings::{Components, Model, SettingsError, TrainSettings, Unseen};
use crate::train_error::TrainError;
use ghand_fit::texels::frames::evenly;
use ghand_fit::texels::required::{largest_edges, required_texels};
use ghand_fit::views::TrainViews;
use ghand_measure::outline::bent_outline;

/// One in this many frames is held out, if there are enough.
const HOLD_OUT: usize = 4;
/// Fewer frames cannot be divided: the avatar is as set.
const LEAST_FRAMES: usize = 4;
/// Most images that trials are judged by.
const JUDGED_IMAGES: usize = 24;
/// A trial has this part of the run's iterations, within these bounds.
const PART_OF_RUN: u64 = 6;
const ITERATIONS: [u64; 2] = [40, 250];
/// Most that all removals together may cost in a trial, dB. Long runs have lost up to a quarter more.
const MOST_LOSS: f64 = 0.15;
/// Loose coverage with bent fingers, which the held-out images need not show: a trial is rejected if it has more than
/// `MOST_LOOSE`, and more than `MORE_LOOSE` times what the first one has.
const MOST_LOOSE: f64 = 2e-3;
const MORE_LOOSE: f64 = 1.2;
/// The part of a run's limited time after which no further trial begins.
const MOST_TIME: f64 = 0.4;
/// Coarser rasters are tried in steps of this factor, down to this one.
const COARSER: f64 = 0.85;
const COARSEST: u32 = 16;
/// Merged are the texels that no image shows, then these parts of those that images show, the smallest there first.
const MERGED: [f64; 3] = [0.25, 0.5, 0.75];
/// One in this many texels must be hidden to be worth a trial.
const LEAST_HIDDEN: usize = 50;

/// A short training.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Trial {
    /// What it has other than the settings, as `key=value`.
    pub changes: Vec<String>,
    /// Number of Gaussians.
    pub gaussians: usize,
    /// Mean PSNR of the held-out images, dB.
    pub psnr: f64,
    /// [Loose coverage](ghand_measure::outline) with bent fingers, relative to the hand; `None` if the model has no named poses.
    #[serde(default)]
    pub loose_share: Option<f64>,
    /// Median time of an iteration, milliseconds.
    pub iteration_ms: f64,
    /// Size of the avatar's file, bytes.
    pub bytes: usize,
}

impl fmt::Display for Trial {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let changes = if self.changes.is_empty() { "as set".into() } else { self.changes.join(", ") };
        let Trial { gaussians, psnr, iteration_ms, .. } = self;
        let loose = self.loose_share.map_or(String::new(), |share| format!("{:.2} % loose, ", 1e2 * share));
        write!(f, "{changes}: {gaussians} Gaussians, {psnr:.2} dB, {loose}{iteration_ms:.1} ms an iteration")
    }
}

/// What was tried, and what was taken of it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Simplification {
    /// Number of held-out frames.
    pub frames_left_out: usize,
    /// Number of their images by which the trials were judged.
    pub images: usize,
    /// Iterations of each trial.
    pub iterations: u64,
    /// The trials in their order; the first one is as set.
    pub trials: Vec<Trial>,
    /// Index of the one that was taken.
    pub taken: usize,
    /// Number of Gaussians that were removed after training because nothing shows them.
    #[serde(default)]
    pub never_shown: usize,
}

impl Simplification {
    /// The settings with what was taken.
    ///
    /// # Errors
    /// [`SettingsError`] if they are not those that were tried.
    pub fn apply(&self, settings: &TrainSettings) -> Result<TrainSettings, SettingsError> {
        let mut simplified = settings.clone();
        for change in self.trials.get(self.taken).map_or(&[][..], |trial| &trial.changes) {
            simplified.set(change)?;
        }
        Ok(simplified)
    }

    /// What was taken, and what that saves, in one line.
    pub fn summary(&self) -> String {
        let Some((taken, set)) = self.trials.get(self.taken).zip(self.trials.first()) else { return String::new() };
        let hidden = match self.never_shown {
            0 => String::new(),
            count => format!(" and without {count} that nothing shows"),
        };
        let what = if taken.changes.is_empty() { "as set".into() } else { taken.changes.join(", ") };
        format!(
            "as the images require: {what}; {} Gaussians instead of {}{hidden}, {:.1} ms an iteration instead of {:.1}, \
             {:.1} MB instead of {:.1}, {:+.2} dB in {} images of {} held-out frames",
            taken.gaussians,
            set.gaussians,
            taken.iteration_ms,
            set.iteration_ms,
            taken.bytes as f64 / 1e6,
            set.bytes as f64 / 1e6,
            taken.psnr - set.psnr,
            self.images,
            self.frames_left_out,
        )
    }
}

/// Iterations of a trial in a run of `run` iterations.
fn trial_iterations(run: u64) -> u64 {
    (run / PART_OF_RUN).clamp(ITERATIONS[0], ITERATIONS[1])
}

impl Problem {
    /// Finds out how simple the avatar may be, and calls `ended` after each trial; `None` if there are too few frames to tell.
    pub(super) fn simplify(
        &self,
        gpu: &mut Gpu,
        run: &Run,
        ended: &mut dyn FnMut(&Trial),
    ) -> Result<Option<Simplification>, TrainError> {
        let Some(mut trials) = Trials::new(self, run.stop)? else {
            log::warn!("simplify=auto: there are too few frames to leave some out, so the avatar is as set");
            return Ok(None);
        };
        let set = &self.settings;
        trials.run(gpu, set, &[], ended)?;
        for (key, values) in self.simpler(gpu)? {
            for value in values {
                if set.max_seconds > 0.0 && run.seconds() > MOST_TIME * set.max_seconds {
                    break;
                }
                let mut changes = trials.taken().changes.clone();
                changes.retain(|change| !change.starts_with(&format!("{key}=")));
                changes.push(format!("{key}={value}"));
                if !trials.run(gpu, set, &changes, ended)? {
                    break;
                }
            }
        }
        Ok(Some(trials.finish()))
    }

    /// Settings with simpler and simpler values.
    fn simpler(&self, gpu: &Gpu) -> Result<Vec<(&'static str, Vec<String>)>, TrainError> {
        let TrainSettings { model, merge_below, components, color_components, shape_bases, uv_resolution, .. } =
            self.settings;
        let mut parts = vec![];
        if components == Components::Full {
            parts.push(("components", vec!["hgbs".to_owned()]));
        }
        if color_components > 0 {
            parts.push(("color_components", vec!["0".into()]));
        }
        if components != Components::Baseline {
            let halved = std::iter::successors(Some(shape_bases / 2), |bases| Some(bases / 2));
            parts.push(("shape_bases", halved.take_while(|bases| *bases > 0).map(|bases| bases.to_string()).collect()));
        }
        if model == Model::Direct && merge_below == 0.0 {
            parts.push(("merge_below", self.merging(gpu)?));
        }
        let coarser = std::iter::successors(Some(f64::from(uv_resolution) * COARSER), |side| Some(side * COARSER));
        let coarser = coarser.map(|side| side.round() as u32).take_while(|side| *side >= COARSEST);
        parts.push(("uv_resolution", coarser.map(|side| side.to_string()).collect()));
        Ok(parts)
    }

    /// Lengths of texels' edges, pixels, below which more and more texels are merged.
    fn merging(&self, gpu: &Gpu) -> Result<Vec<String>, TrainError> {
        let capture = &self.capture;
        let poses = &self.prepared.poses;
        let samples = sample_surface(&capture.template, self.settings.uv_resolution)?;
        let mut edges = largest_edges(gpu, capture, &self.split, poses, samples)?;
        let count = edges.len();
        edges.retain(|edge| *edge > 0.0);
        edges.sort_by(f64::total_cmp);
        // Below the smallest that images show are those that none shows, if there are some worth a trial.
        let below = |part: f64| edges.get((part * edges.len() as f64) as usize).map(|edge| format!("{edge:.2}"));
        let hidden = (count - edges.len() > count / LEAST_HIDDEN).then(|| below(0.0)).flatten();
        Ok(hidden.into_iter().chain(MERGED.into_iter().filter_map(below)).collect())
    }
}

/// Whether a trial may be taken instead of the first one. One whose PSNR is not a number may not.
fn is_good(trial: &Trial, set: &Trial) -> bool {
    let [loose, as_set] = [trial, set].map(|trial| trial.loose_share.unwrap_or(0.0));
    trial.psnr >= set.psnr - MOST_LOSS && loose <= MOST_LOOSE.max(MORE_LOOSE * as_set)
}

/// What trials are trained on, and those done.
struct Trials<'a> {
    problem: Problem,
    stop: Option<&'a AtomicBool>,
    frames_left_out: usize,
    iterations: u64,
    done: Vec<Trial>,
    /// Index of the simplest one that costs little.
    taken: usize,
}

impl<'a> Trials<'a> {
    /// `None` if there are too few frames with images.
    fn new(whole: &Problem, stop: Option<&'a AtomicBool>) -> Result<Option<Trials<'a>>, TrainError> {
        let mut frames: Vec<usize> = whole.split.views.iter().map(|view| view.position).collect();
        frames.sort_unstable();
        frames.dedup();
        if frames.len() < LEAST_FRAMES {
            return Ok(None);
        }
        let left_out: Vec<usize> = frames.iter().copied().skip(HOLD_OUT / 2).step_by(HOLD_OUT).collect();
        let (judged, trained): (Vec<SplitView>, Vec<SplitView>) =
            whole.split.views.iter().partition(|view| left_out.contains(&view.position));
        let judged = evenly(&judged, JUDGED_IMAGES, 0);
        let poses: Vec<Pose> = judged.iter().map(|view| whole.prepared.poses[view.position].clone()).collect();
        let views = |views| TrainViews::new(&whole.capture, &Split { views, ..whole.split.clone() }, CROP_MARGIN);
        let split = Split { views: trained.clone(), ..whole.split.clone() };
        let problem = Problem {
            capture: whole.capture.clone(),
            split,
            split_name: whole.split_name.clone(),
            settings: whole.settings.clone(),
            views: views(trained)?,
            gaussians: 0,
            training_set: 0,
            prepared: Prepared { alignment: None, ..whole.prepared.clone() },
            watched: Some(Watched {
                split: whole.split_name.clone(),
                shown: judged.clone(),
                views: views(judged)?,
                poses,
            }),
            lpips: None,
        };
        let iterations = trial_iterations(whole.settings.iterations);
        Ok(Some(Trials { problem, stop, frames_left_out: left_out.len(), iterations, done: vec![], taken: 0 }))
    }

    /// Tries the settings with some changes, and takes them if they cost little; whether they are taken.
    fn run(
        &mut self,
        gpu: &mut Gpu,
        set: &TrainSettings,
        changes: &[String],
        ended: &mut dyn FnMut(&Trial),
    ) -> Result<bool, TrainError> {
        let mut settings = TrainSettings { max_seconds: 0.0, unseen: Unseen::Off, ..set.clone() };
        changes.iter().try_for_each(|change| settings.set(change))?;
        settings.iterations = self.iterations;
        let TrainSettings { uv_resolution, merge_below, .. } = settings;
        let Problem { capture, split, prepared, .. } = &self.problem;
        let gaussians = required_texels(gpu, capture, split, &prepared.poses, uv_resolution, merge_below)?.len();
        memory_check::check(gaussians, self.problem.capture.template.joint_count(), &settings)?;
        let stage = Stage {
            number: 2,
            iterations: self.iterations,
            part_of_time: 1.0,
            done: 0,
            refine_poses: false,
            reduction: self.problem.reduction(gpu),
            previews: 0,
            settings: settings.clone(),
        };
        self.problem.settings = settings;
        let mut last = Instant::now();
        let mut times = vec![];
        let mut run = Run { stop: self.stop, ..Run::default() };
        let problem = &self.problem;
        let result = gpu.retry_on_device_loss("a trial", |gpu| {
            problem.run(gpu, &stage, &mut run, &mut |_| {
                times.push(1e3 * last.elapsed().as_secs_f64());
                last = Instant::now();
            })
        });
        let result = match result {
            // Simpler avatars may not be learned at the same rates.
            Err(TrainError::Diverged { fault, .. }) if !changes.is_empty() => {
                log::warn!("trial: {}: not taken: {fault}", changes.join(", "));
                return Ok(false);
            }
            result => result?,
        };
        if result.stopped {
            return Err(TrainError::Stopped { iteration: 0, iterations: set.iterations });
        }
        times.sort_by(f64::total_cmp);
        let loose_share = gpu.retry_on_device_loss("a trial's outline", |gpu| -> Result<Option<f64>, TrainError> {
            Ok(bent_outline(gpu, &result.avatar)?.loose_share)
        })?;
        let trial = Trial {
            changes: changes.to_vec(),
            gaussians,
            psnr: result.held_out_psnr.unwrap_or(f64::NAN),
            loose_share,
            iteration_ms: times.get(times.len() / 2).copied().unwrap_or(f64::NAN),
            bytes: result.avatar.file_size().unwrap_or_default(),
        };
        ended(&trial);
        let is_good = self.done.first().is_none_or(|set| is_good(&trial, set));
        self.done.push(trial);
        if is_good {
            self.taken = self.done.len() - 1;
        }
        Ok(is_good)
    }

    fn taken(&self) -> &Trial {
        &self.done[self.taken]
    }

    fn finish(self) -> Simplification {
        let images = self.problem.watched.as_ref().map_or(0, |watched| watched.views.len());
        let Trials { frames_left_out, iterations, done: trials, taken, .. } = self;
        Simplification { frames_left_out, images, iterations, trials, taken, never_shown: 0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn simpler_avatars_are_taken_unless_images_or_outlines_suffer() {
        let trial =
            |psnr, loose_share| Trial { changes: vec![], gaussians: 1, psnr, loose_share, iteration_ms: 1.0, bytes: 1 };
        let set = trial(30.0, Some(0.001));
        assert!(is_good(&trial(29.9, Some(0.0019)), &set) && is_good(&trial(29.9, None), &set));
        assert!(!is_good(&trial(29.8, Some(0.001)), &set) && !is_good(&trial(f64::NAN, Some(0.001)), &set));
        assert!(!is_good(&trial(30.1, Some(0.0021)), &set));
        // Where the avatar as set is loose, simpler ones may be so a little more.
        let loose = trial(30.0, Some(0.01));
        assert!(is_good(&trial(29.9, Some(0.0119)), &loose) && !is_good(&trial(29.9, Some(0.0121)), &loose));
    }
}
