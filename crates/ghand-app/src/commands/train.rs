//! `train`: trains an avatar from a capture.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use anyhow::{Context, anyhow};
use clap::Args;
use ghand_train::alignment_picture::alignment_picture;
use ghand_train::evaluate::Metrics;
use ghand_train::light_fit::LightFit;
use ghand_train::protocol::given_views;
use ghand_train::report::report;
use ghand_train::{Align, Protocol, TrainError, TrainSettings, Trained, Trainer};
use indicatif::{ProgressBar, ProgressStyle};

use crate::capture_args::CaptureArgs;
use crate::capture_preflight::check_before_training;
use crate::cli::{AdapterArgs, Stopped};
use crate::commands::render::write_png;
use crate::lpips_args::{LpipsArgs, check_image_sizes};
use crate::say;
use crate::train_run::demo_capture::{DEMO_CAPTURE, demo_capture};
use crate::train_run::evaluation::{TestImages, evaluate_images, failure, pose_figures, print_table};
use crate::train_run::interruption::{Interruption, STOPPED_BEFORE_TRAINING};
use crate::train_run::results::{save_metrics, save_poses};
use crate::train_run::run_folder::{
    ALIGN_FILE, AVATAR_FILE, DEFAULT_FOLDER, METRICS_FILE, POSES_FILE, REPORT_FILE, RunFolder,
};
use crate::train_run::training_poses::StartPoses;

/// Command line of `train`.
#[derive(Debug, Args)]
pub struct TrainArgs {
    #[command(flatten)]
    capture: CaptureArgs,
    /// Split to train on.
    #[arg(long, default_value = "train")]
    split: String,
    /// Split to evaluate on [default: test, if there is one]
    #[arg(long)]
    test_split: Option<String>,
    /// Training poses to start from: `given`, the capture's; `truth`, its exact ones, which are then not aligned unless
    /// --set align=... says so; or those of a file, by the frames' ids
    #[arg(long, value_name = "given|truth|FILE", default_value = "given")]
    poses: StartPoses,
    #[command(flatten)]
    lpips: LpipsArgs,
    /// Folder for avatar.ghand, poses.json, metrics.json, align.png and report.png [default: out/train or, if it holds an earlier
    /// run, the next of out/train-2, out/train-3, ...]
    #[arg(long)]
    out: Option<PathBuf>,
    /// Replace the results of an earlier run in the folder.
    #[arg(long)]
    force: bool,
    /// Seed of all random numbers; the same seed on the same device gives the same avatar, byte for byte.
    #[arg(long, value_name = "N", allow_hyphen_values = true)]
    seed: Option<String>,
    /// Change a setting, such as iterations=6000; may be given several times. A wrong name lists all settings.
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Train even if the capture cannot give an avatar, such as one in millimetres; its problems become warnings.
    #[arg(long)]
    ignore_checks: bool,
}

impl TrainArgs {
    fn settings(&self) -> anyhow::Result<TrainSettings> {
        let align = if self.poses == StartPoses::Truth { Align::None } else { Align::default() };
        let mut settings = TrainSettings { align, ..TrainSettings::default() };
        for assignment in &self.set {
            settings.set(assignment)?;
        }
        if let Some(seed) = &self.seed {
            settings.set(&format!("seed={seed}"))?;
        }
        Ok(settings)
    }

    fn folder(&self) -> anyhow::Result<RunFolder> {
        match &self.out {
            Some(out) => RunFolder::named(out, self.force),
            None if self.force => RunFolder::named(Path::new(DEFAULT_FOLDER), true),
            None => RunFolder::next(Path::new(DEFAULT_FOLDER)),
        }
    }
}

/// The usual name of the split for evaluation.
const DEFAULT_TEST_SPLIT: &str = "test";

/// Trains, evaluates and writes the results to a folder.
///
/// # Errors
/// An error that names the file, the option or the setting and its problem, or says why training has failed;
/// [`Stopped`] if the user has stopped it.
pub fn run(args: &TrainArgs, adapter: &AdapterArgs) -> anyhow::Result<()> {
    let settings = args.settings()?;
    let lpips = args.lpips.load()?;
    let mut gpu = adapter.open()?;
    say!("adapter: {}", gpu.info.name);
    let folder = args.folder()?;
    let interruption = Interruption::listen(STOPPED_BEFORE_TRAINING)?;
    interruption.remove_at_end(folder.leftovers());

    let demo = match (&args.capture.capture, &args.out) {
        (Some(_), _) => None,
        (None, Some(out)) => Some(demo_capture(&mut gpu, out.join("capture"), &interruption)?),
        (None, None) => Some(demo_capture(&mut gpu, PathBuf::from(DEMO_CAPTURE), &interruption)?),
    };
    let path = args.capture.capture.as_ref().or(demo.as_ref()).context("--capture: is missing")?;
    // A requested split that does not exist fails here, before training.
    let needed: Vec<&str> = std::iter::once(&args.split).chain(&args.test_split).map(String::as_str).collect();
    let capture = args.capture.open(path, &needed, &[DEFAULT_TEST_SPLIT])?;
    let test_split = args.test_split.as_deref().unwrap_or(DEFAULT_TEST_SPLIT);
    let start = args.poses.applied_to(&capture, &args.split)?;
    check_image_sizes(lpips.as_deref(), &start, test_split)?;
    check_before_training(&start, path, &args.split, test_split, args.ignore_checks)?;
    let train_split = capture.split(&args.split)?.clone();
    let trainer = Trainer::new(&gpu, &start, &args.split, &settings)?.with_lpips(lpips.clone());
    let gaussians = trainer.gaussians();
    say!(
        "training: {} cameras, {} frames, {} images, {gaussians} Gaussians, {} iterations",
        train_split.cameras.len(),
        train_split.frames.len(),
        train_split.views.len(),
        settings.iterations
    );
    if settings.align == Align::Contours {
        say!("aligning poses and the template's proportions with the masks first");
    }
    interruption.stop_first();
    let trained = train(trainer.stop_when(interruption.stop()), settings.iterations)?;
    let stopped_early = trained.iterations < settings.iterations;
    let progress = format!("{} of {} iterations", trained.iterations, settings.iterations);
    if stopped_early {
        say!("stopped early, after {progress}; saving and evaluating the avatar as it is");
    }

    let avatar_path = folder.file(AVATAR_FILE);
    let report_path = folder.file(REPORT_FILE);
    interruption.whole(|| -> anyhow::Result<()> {
        trained.avatar.save(&avatar_path)?;
        folder.remove_other_results()?;
        save_poses(&capture, &train_split.frames, &trained, &folder.file(POSES_FILE))
    })?;
    interruption
        .end_with(format!("stopped before evaluation: the avatar after {progress} is {}", avatar_path.display()));

    let mut shown = None;
    let images = match capture.splits.get(test_split) {
        Some(split) if !split.views.is_empty() => {
            let views = given_views(&capture, split);
            let test = TestImages {
                capture: &capture,
                split: test_split,
                protocol: Protocol::Given,
                views,
                lpips: lpips.as_deref(),
            };
            let (metrics, views) = gpu.retry_on_device_loss("the evaluation", |gpu| {
                evaluate_images(gpu, &trained.avatar, &test, &train_split, &trained.poses)
            })?;
            shown = Some(report(&views));
            Some(metrics)
        }
        _ => None,
    };
    let (pose_error_deg, alignment) = pose_figures(&start, &train_split.frames, &trained);
    let metrics = Metrics {
        images,
        poses: args.poses.to_string(),
        pose_error_deg,
        alignment,
        exposure: trained.exposure.clone(),
        light: trained.light.as_ref().map(LightFit::report),
        seconds: trained.seconds,
        iterations: trained.iterations,
        stopped_early,
        gaussians,
    };
    let outlines = match &trained.alignment {
        Some(alignment) => Some(alignment_picture(&start, &train_split, alignment)?),
        None => None,
    };
    interruption.whole(|| -> anyhow::Result<()> {
        outlines.as_ref().map_or(Ok(()), |picture| write_png(&folder.file(ALIGN_FILE), picture))?;
        shown.as_ref().map_or(Ok(()), |picture| write_png(&report_path, picture))?;
        save_metrics(&metrics, &folder.file(METRICS_FILE))
    })?;
    print_table(&metrics);
    say!("avatar: {}", avatar_path.display());
    if outlines.is_some() {
        say!("alignment: {}", folder.file(ALIGN_FILE).display());
    }
    match metrics.images {
        Some(_) => say!("report: {}", report_path.display()),
        None => say!("no report: there are no images to evaluate in the split `{test_split}`"),
    }
    match (stopped_early, failure(&metrics, &settings)) {
        (false, None) => Ok(()),
        (false, Some(failure)) => Err(anyhow!(failure)),
        (true, None) => Err(Stopped(format!("stopped early, after {progress}: the avatar is saved")).into()),
        (true, Some(failure)) => Err(Stopped(format!("stopped early, after {progress}: {failure}")).into()),
    }
}

/// Lines of progress that a run prints without a terminal for a progress bar.
const PROGRESS_LINES: u64 = 20;
/// Longest time between two lines.
const LONGEST_SILENCE: Duration = Duration::from_secs(30);

fn train(trainer: Trainer, iterations: u64) -> anyhow::Result<Trained> {
    let bar = ProgressBar::new(iterations);
    bar.set_style(ProgressStyle::with_template("{bar:30} {pos}/{len} {msg} {elapsed} (left {eta})")?);
    let start = Instant::now();
    let (mut last_line, mut last_stage) = (start, 0);
    let trained = trainer.train(|p| {
        let loss = p.l1.map_or(String::new(), |l1| format!(" L1 {l1:.4}"));
        let message = format!("stage {}{loss}", p.stage);
        let due = p.iteration % (iterations / PROGRESS_LINES).max(1) == 0 || last_line.elapsed() > LONGEST_SILENCE;
        if bar.is_hidden() && (due || p.stage != last_stage) {
            say!("{}/{iterations} {message} {:.0} s", p.iteration, start.elapsed().as_secs_f64());
            last_line = Instant::now();
        }
        last_stage = p.stage;
        bar.set_position(p.iteration);
        bar.set_message(message);
    });
    bar.finish_and_clear();
    trained.map_err(|error| match error {
        TrainError::Stopped { .. } => Stopped(error.to_string()).into(),
        error => error.into(),
    })
}
