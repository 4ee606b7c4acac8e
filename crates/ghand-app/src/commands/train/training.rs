//! The training of a run of `train`, as its user sees it.

use std::path::Path;
use std::time::{Duration, Instant};

use ghand_render::Gpu;
use ghand_train::{Align, Checkpoints, Simplify, TrainError, Trained, Trainer, TrainingProgress};
use indicatif::{ProgressBar, ProgressStyle};

use super::TrainArgs;
use super::inputs::Inputs;
use super::plan::Plan;
use crate::cli::Stopped;
use crate::say;
use crate::train_run::interruption::Interruption;
use crate::train_run::live_files::write_live_files;
use crate::train_run::live_viewer::LiveViewer;

/// Lines of progress that a run prints without a terminal for a progress bar.
const PROGRESS_LINES: u64 = 20;
/// Longest time between two lines.
const LONGEST_SILENCE: Duration = Duration::from_secs(30);

/// Least time between two writings of the files that show how the run goes.
const LIVE_EVERY: Duration = Duration::from_secs(10);
/// Gaussians wider than this, pixels, blur what the images show.
const WIDE: f64 = 4.0;

/// Trains, from the last checkpoint on if the run is resumed, and prints the outcome. `watch` sees the progress instead
/// of the terminal.
pub(super) fn train(
    args: &TrainArgs,
    plan: &Plan,
    inputs: &Inputs,
    gpu: &Gpu,
    interruption: &Interruption,
    watch: Option<&mut dyn FnMut(&TrainingProgress)>,
) -> anyhow::Result<Trained> {
    let Plan { folder, record, .. } = plan;
    let settings = &record.settings;
    let mut trainer = Trainer::new(gpu, &inputs.start, &record.split, settings)?.with_lpips(Some(inputs.lpips.clone()));
    let gaussians = match settings.simplify {
        Simplify::Off => format!("{} Gaussians (uv_resolution={})", trainer.gaussians(), trainer.uv_resolution()),
        Simplify::Auto => "as many Gaussians as they require".into(),
    };
    say!(
        "training: {} cameras, {} frames, {} images, {gaussians}, {} iterations",
        inputs.train_split.cameras.len(),
        inputs.train_split.frames.len(),
        inputs.train_split.views.len(),
        settings.iterations
    );
    let width = trainer.gaussian_width()?;
    if settings.simplify == Simplify::Off && settings.uv_resolution > 0 && width > WIDE {
        say!(
            "a Gaussian is {width:.0} pixels wide in these images: without uv_resolution={} there are as many as they \
             require, which takes more time",
            settings.uv_resolution
        );
    }
    if plan.resumed
        && let Some(checkpoint) = Checkpoints::latest(&folder.checkpoints())?
    {
        trainer = trainer.resume(checkpoint)?;
    }
    if inputs.capture.splits.contains_key(plan.test_split()) {
        trainer = trainer.with_held_out(plan.test_split())?;
    }
    if trainer.reduction() > 1 {
        log::warn!(
            "images are trained on at 1/{} of their size, because this graphics device takes no larger ones; they are \
             compared at full size",
            trainer.reduction()
        );
    }
    match trainer.resume_iteration() {
        Some(iteration) => say!("going on after {iteration} iterations"),
        None => {
            folder.end(false);
            record.save(&folder.record())?;
            if settings.align == Align::Contours {
                say!("aligning poses and the template's proportions with the masks first");
            }
        }
    }
    interruption.stop_first();
    let checkpoints = Checkpoints::new(&folder.checkpoints(), plan.checkpoint_every, plan.keep_checkpoints);
    let trainer = trainer.stop_when(interruption.stop()).with_checkpoints(checkpoints);
    let viewer = if args.viewer { LiveViewer::open(folder.path(), &folder.checkpoints()) } else { None };
    let trained = match watch {
        Some(watch) => trainer.train(watch).map_err(ended),
        None => train_visibly(trainer, settings.iterations, &folder.checkpoints(), viewer),
    };
    let trained = trained.map_err(|error| {
        if matches!(error.downcast_ref(), Some(TrainError::Diverged { .. })) {
            folder.end(false);
        }
        match (error.downcast::<Stopped>(), folder.how_to_resume()) {
            (Ok(Stopped(line)), Some(hint)) => Stopped(format!("{line}; {hint}")).into(),
            (Ok(stopped), None) => stopped.into(),
            (Err(error), _) => error,
        }
    })?;
    if trained.stopped {
        let progress = plan.progress(trained.iterations);
        // A host that stops a run does not wait for figures.
        let what = if interruption.ends() { "saving" } else { "saving and evaluating" };
        say!("stopped early, after {progress}; {what} the avatar as it is");
    }
    if let Some(simplification) = &trained.simplification {
        say!("{}", simplification.summary());
    }
    if trained.skipped_steps > 0 {
        say!("{} steps were skipped, because a gradient in them was not finite", trained.skipped_steps);
    }
    Ok(trained)
}

/// Trains with a progress bar or, without a terminal, with lines, keeps the files in `live` up to date, and shows the avatar in
/// the viewer, if there is one.
fn train_visibly(
    trainer: Trainer,
    iterations: u64,
    live: &Path,
    viewer: Option<LiveViewer>,
) -> anyhow::Result<Trained> {
    let bar = ProgressBar::new(iterations).with_position(trainer.resume_iteration().unwrap_or(0));
    bar.reset_eta();
    bar.set_style(ProgressStyle::with_template("{bar:30} {pos}/{len} {msg} {per_sec} {elapsed} (left {eta})")?);
    let start = Instant::now();
    let (mut last_line, mut last_stage, mut last_written) = (start, 0, start);
    let mut previews = vec![];
    let trainer = match viewer {
        Some(viewer) => trainer.with_preview(LIVE_EVERY, move |avatar| viewer.show(avatar)),
        None => trainer,
    };
    let trained = trainer.train(|p| {
        if let Some(trial) = p.trial {
            bar.suspend(|| say!("trial, {trial}"));
            return;
        }
        let loss = p.l1.map_or(String::new(), |l1| format!(" L1 {l1:.4}"));
        let held_out = p.curve.iter().rev().find_map(|point| point.held_out_psnr);
        let held_out = held_out.map_or(String::new(), |psnr| format!(" held out {psnr:.2} dB"));
        let message = format!("stage {}{loss}{held_out}", p.stage);
        if !p.previews.is_empty() {
            previews = p.previews.to_vec();
        }
        if last_written.elapsed() > LIVE_EVERY {
            last_written = Instant::now();
            // They are only for looking at.
            write_live_files(live, p.curve, &previews).unwrap_or_else(|error| log::debug!("{error}"));
        }
        let due = p.iteration % (iterations / PROGRESS_LINES).max(1) == 0 || last_line.elapsed() > LONGEST_SILENCE;
        if bar.is_hidden() && (due || p.stage != last_stage) {
            say!("{}/{iterations} {message} {:.0} s", p.iteration, start.elapsed().as_secs_f64());
            last_stage = p.stage;
            last_line = Instant::now();
        }
        bar.set_position(p.iteration);
        bar.set_message(message);
    });
    bar.finish_and_clear();
    trained.map_err(ended)
}

/// The error of a training as that of the program.
fn ended(error: TrainError) -> anyhow::Error {
    match error {
        TrainError::Stopped { .. } => Stopped(error.to_string()).into(),
        error => error.into(),
    }
}
