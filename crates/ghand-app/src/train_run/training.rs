//! The training of a run as its user sees it.

use std::path::Path;
use std::time::{Duration, Instant};

use ghand_train::{TrainError, Trained, Trainer};
use indicatif::{ProgressBar, ProgressStyle};

use crate::cli::Stopped;
use crate::say;
use crate::train_run::live_files::write_live_files;
use crate::train_run::live_viewer::LiveViewer;

/// Lines of progress that a run prints without a terminal for a progress bar.
const PROGRESS_LINES: u64 = 20;
/// Longest time between two lines.
const LONGEST_SILENCE: Duration = Duration::from_secs(30);

/// Least time between two writings of the files that show how the run goes.
const LIVE_EVERY: Duration = Duration::from_secs(10);

/// Trains with a progress bar or, without a terminal, with lines, keeps the files in `live` up to date, and shows the avatar in
/// the viewer, if there is one.
///
/// # Errors
/// [`Stopped`] if the run was stopped before there was an avatar; the trainer's errors.
pub fn train(trainer: Trainer, iterations: u64, live: &Path, viewer: Option<LiveViewer>) -> anyhow::Result<Trained> {
    let bar = ProgressBar::new(iterations).with_position(trainer.resumed_at().unwrap_or(0));
    bar.reset_eta();
    bar.set_style(ProgressStyle::with_template("{bar:30} {pos}/{len} {msg} {per_sec} {elapsed} (left {eta})")?);
    let start = Instant::now();
    let (mut last_line, mut last_stage, mut last_written) = (start, 0, start);
    let mut previews = vec![];
    let trainer = match viewer {
        Some(viewer) => trainer.show_to(LIVE_EVERY, move |avatar| viewer.show(avatar)),
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
    trained.map_err(|error| match error {
        TrainError::Stopped { .. } => Stopped(error.to_string()).into(),
        error => error.into(),
    })
}
