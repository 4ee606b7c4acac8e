//! `train`: trains an avatar from a capture.

use std::path::{Path, PathBuf};
use std::time::Duration;

use anyhow::{Context, anyhow, bail};
use clap::Args;
use ghand_capture::Capture;
use ghand_files::atomic_file::write_atomically;
use ghand_fit::alignment_picture::alignment_picture;
use ghand_fit::light_fit::LightFit;
use ghand_fit::protocol::given_views;
use ghand_pictures::write_png;
use ghand_train::evaluate::Metrics;
use ghand_train::presets::Preset;
use ghand_train::report::report;
use ghand_train::{Align, Checkpoints, Protocol, Simplify, TrainError, TrainSettings, Trainer};

use crate::capture_args::CaptureArgs;
use crate::capture_preflight::check_before_training;
use crate::cli::{AdapterArgs, Stopped};
use crate::lpips_args::{LpipsArgs, check_image_sizes};
use crate::own_inputs::refuse_capture_folder;
use crate::quality::{self, Quality};
use crate::say;
use crate::train_run::demo_capture::{DEMO_CAPTURE, demo_capture};
use crate::train_run::evaluation::{TestImages, evaluate_images, failure, pose_figures, print_table};
use crate::train_run::full_disk::when_there_is_room;
use crate::train_run::interruption::{Interruption, STOPPED_BEFORE_TRAINING};
use crate::train_run::live_files::write_live_files;
use crate::train_run::live_viewer::LiveViewer;
use crate::train_run::report_page::{Page, write_report_page};
use crate::train_run::results::{save_metrics, save_poses};
use crate::train_run::run_folder::{
    ALIGN_FILE, AVATAR_FILE, CAMERAS_FILE, CONFIG_FILE, DEFAULT_FOLDER, METRICS_FILE, PAGE_FILE, POSES_FILE,
    REPORT_FILE, RunFolder,
};
use crate::train_run::run_record::RunRecord;
use crate::train_run::settings_args::SettingsArgs;
use crate::train_run::training::train;
use crate::train_run::training_poses::StartPoses;

/// Command line of `train`.
#[derive(Debug, Args)]
pub struct TrainArgs {
    #[command(flatten)]
    capture: CaptureArgs,
    /// Split to train on [default: train]
    #[arg(long)]
    split: Option<String>,
    /// Split to evaluate on [default: test, if there is one]
    #[arg(long)]
    test_split: Option<String>,
    /// Training poses to start from: `given`, the capture's; `truth`, its exact ones, which are then not aligned unless
    /// --set align=... says so; or those of a file, by the frames' ids [default: given]
    #[arg(long, value_name = "given|truth|FILE")]
    poses: Option<StartPoses>,
    #[command(flatten)]
    lpips: LpipsArgs,
    /// Folder for avatar.ghand, report.html and the other results [default: out/train or, if it holds an earlier
    /// run, the next of out/train-2, out/train-3, ...]
    #[arg(long)]
    out: Option<PathBuf>,
    /// Replace the results of an earlier run in the folder.
    #[arg(long, conflicts_with = "resume")]
    force: bool,
    /// Go on with the interrupted run in --out [default: the last one], as it was started; other options may be left out.
    /// Without one there, begin if --capture is given.
    #[arg(long)]
    resume: bool,
    /// Show the avatar in the viewer while it is trained, with the curve of its loss and images held out
    #[arg(long)]
    viewer: bool,
    #[command(flatten)]
    settings: SettingsArgs,
    /// Time between two checkpoints, from which an interrupted run goes on [default: 1m]
    #[arg(long, value_name = "TIME", value_parser = humantime::parse_duration)]
    checkpoint_every: Option<Duration>,
    /// Keep a checkpoint of every so many iterations, beside the last two, and after the run [default: 0, none]
    #[arg(long, value_name = "N")]
    keep_checkpoints: Option<u64>,
    /// Bake the avatar for this preset of `viewer` and `ghand render` as well
    #[arg(long, value_enum)]
    quality: Option<Quality>,
    /// Train even if the capture cannot give an avatar, such as one in millimetres; its problems become warnings.
    #[arg(long)]
    ignore_checks: bool,
}

/// A run that is to be begun or continued.
struct Plan {
    record: RunRecord,
    resumed: bool,
}

impl TrainArgs {
    fn settings(&self) -> anyhow::Result<TrainSettings> {
        self.settings.settings((self.poses == Some(StartPoses::Truth)).then_some(Align::None))
    }

    fn folder(&self) -> anyhow::Result<RunFolder> {
        let default = Path::new(DEFAULT_FOLDER);
        match &self.out {
            Some(out) if self.resume && !out.exists() && self.capture.capture.is_none() => Err(nothing_to_resume(out)),
            out if self.resume => RunFolder::resumed(out.as_deref(), default),
            Some(out) => RunFolder::named(out, self.force),
            None if self.force => RunFolder::named(default, true),
            None => RunFolder::next(default),
        }
    }

    /// The run as these options describe it.
    fn record(&self) -> anyhow::Result<RunRecord> {
        let mut capture = self.capture.clone();
        let demo = match &self.out {
            _ if capture.capture.is_some() => None,
            Some(out) => Some(out.join("capture")),
            None => Some(PathBuf::from(DEMO_CAPTURE)),
        };
        let is_demo = demo.is_some();
        capture.capture = capture.capture.or(demo);
        let poses = match self.poses.clone().unwrap_or_default() {
            StartPoses::File(path) => StartPoses::File(std::path::absolute(path)?),
            other => other,
        };
        Ok(RunRecord {
            capture: capture.absolute()?,
            demo: is_demo,
            split: self.split.clone().unwrap_or_else(|| DEFAULT_SPLIT.into()),
            test_split: self.test_split.clone(),
            poses: poses.to_string(),
            lpips: self.lpips.absolute()?,
            preset: self.settings.preset().into(),
            settings: self.settings()?,
            ignore_checks: self.ignore_checks,
            quality: self.quality,
            checkpoint_every: self.checkpoint_every,
            keep_checkpoints: self.keep_checkpoints,
        })
    }

    /// What to do in a folder; `None` if its run has ended.
    fn plan(&self, folder: &RunFolder) -> anyhow::Result<Option<Plan>> {
        let asked = self.record()?;
        if !self.resume {
            return Ok(Some(Plan { record: asked, resumed: false }));
        }
        let Some(record) = RunRecord::load(&folder.record())? else {
            if folder.is_finished() {
                return Ok(None);
            }
            if self.capture.capture.is_none() {
                return Err(nothing_to_resume(folder.path()));
            }
            say!("there is no run to go on with in {}: it begins", folder.path().display());
            return Ok(Some(Plan { record: asked, resumed: false }));
        };
        let differs = |option: &str, then: String| {
            anyhow!("{option}: the run in {} was started with {then}; leave the option out", folder.path().display())
        };
        if self.capture.capture.is_some() && asked.capture != record.capture {
            let then = record.capture.capture.unwrap_or_default();
            return Err(differs("--capture", format!("{} or other options of it", then.display())));
        }
        if self.split.is_some() && asked.split != record.split {
            return Err(differs("--split", record.split));
        }
        if self.test_split.is_some() && asked.test_split != record.test_split {
            return Err(differs("--test-split", record.test_split.unwrap_or_else(|| DEFAULT_TEST_SPLIT.into())));
        }
        if self.poses.is_some() && asked.poses != record.poses {
            return Err(differs("--poses", record.poses));
        }
        if self.lpips.path().is_some() && asked.lpips != record.lpips {
            return Err(differs("--lpips", "other weights, or none".into()));
        }
        if self.settings.any_given()
            && let Some((key, then, now)) = record.settings.first_difference(&asked.settings)
        {
            bail!(
                "--resume: the setting `{key}` was {then} when the run in {} began, and is {now} now; leave out the options \
                 of settings",
                folder.path().display()
            );
        }
        Ok(Some(Plan { record, resumed: true }))
    }
}

fn nothing_to_resume(folder: &Path) -> anyhow::Error {
    anyhow!(
        "{}: there is no run to go on with; to begin one, give its --capture or leave out --resume",
        folder.display()
    )
}

/// The usual time between two checkpoints.
const CHECKPOINT_EVERY: Duration = Duration::from_secs(60);
/// The usual name of the split for training.
const DEFAULT_SPLIT: &str = "train";
/// The usual name of the split for evaluation.
const DEFAULT_TEST_SPLIT: &str = "test";

/// The command that makes the same run again.
fn command(record: &RunRecord) -> String {
    let RunRecord { capture, split, test_split, poses, preset, settings, .. } = record;
    let mut command = format!("train --preset {preset}");
    if let (false, Some(path)) = (record.demo, &capture.capture) {
        command += &format!(" --capture {}", path.display());
    }
    if let Some(path) = record.lpips.path() {
        command += &format!(" --lpips {}", path.display());
    }
    let options = [("--split", Some(split), DEFAULT_SPLIT), ("--poses", Some(poses), "given")];
    let named = [("--test-split", test_split.as_ref(), DEFAULT_TEST_SPLIT)];
    for (option, value, default) in options.into_iter().chain(named) {
        if let Some(value) = value.filter(|value| *value != default) {
            command += &format!(" {option} {value}");
        }
    }
    // What the preset does not say.
    let start = Preset::by_name(preset).and_then(Preset::settings).unwrap_or_default().to_toml();
    for line in settings.to_toml().lines().filter(|line| !start.lines().any(|other| other == *line)) {
        command += &format!(" --set {}", line.replace(" = ", "=").replace('"', ""));
    }
    command
}

/// Trains, evaluates and writes the results to a folder.
///
/// # Errors
/// An error that names the file, the option or the setting and its problem, or says why training has failed;
/// [`Stopped`] if the user has stopped it.
pub fn run(args: &TrainArgs, adapter: &AdapterArgs) -> anyhow::Result<()> {
    if args.settings.are_only_printed(&args.settings()?) {
        return Ok(());
    }
    args.settings()?.check_build()?;
    let mut gpu = adapter.open()?;
    say!("adapter: {}", gpu.info.name);
    if let (Some(out), Some(capture), false) = (&args.out, &args.capture.capture, args.force) {
        refuse_capture_folder("--out", out, capture)?;
    }
    let folder = args.folder()?;
    let Some(Plan { record, resumed }) = args.plan(&folder)? else {
        say!("the run in {} has ended: there is nothing to go on with", folder.path().display());
        return Ok(());
    };
    args.capture.check()?;
    let settings = &record.settings;
    // What is given on the command line is the same as in the record, in the user's own words.
    let lpips = if args.lpips.path().is_some() { &args.lpips } else { &record.lpips }.load()?;
    let given = if args.capture.capture.is_some() { &args.capture } else { &record.capture };
    let recorded_poses: StartPoses = record.poses.parse()?;
    let poses = args.poses.clone().unwrap_or(recorded_poses);
    let interruption = Interruption::listen(STOPPED_BEFORE_TRAINING)?;
    interruption.remove_at_end(folder.leftovers());

    let path = given.capture.clone().context("--capture: is missing")?;
    if record.demo {
        demo_capture(&mut gpu, path.clone(), &interruption)?;
    }
    let path = &path;
    // A requested split that does not exist fails here, before training.
    let needed: Vec<&str> = std::iter::once(&record.split).chain(&record.test_split).map(String::as_str).collect();
    let mut capture = given.open(path, &needed, &[DEFAULT_TEST_SPLIT])?;
    let test_split = record.test_split.as_deref().unwrap_or(DEFAULT_TEST_SPLIT);
    let start = poses.applied_to(&capture, &record.split)?;
    // What is compared and saved has the shape that training starts from, too.
    capture.template.clone_from(&start.template);
    capture.frames.iter_mut().zip(&start.frames).for_each(|(own, start)| own.shape.clone_from(&start.shape));
    check_image_sizes(lpips.as_deref(), &start, test_split)?;
    check_before_training(&start, path, &record.split, test_split, args.ignore_checks || record.ignore_checks)?;
    let train_split = capture.split(&record.split)?.clone();
    let mut trainer = Trainer::new(&gpu, &start, &record.split, settings)?.with_lpips(lpips.clone());
    let gaussians = match settings.simplify {
        Simplify::Off => format!("{} Gaussians", trainer.gaussians()),
        Simplify::Auto => "as many Gaussians as they require".into(),
    };
    say!(
        "training: {} cameras, {} frames, {} images, {gaussians}, {} iterations",
        train_split.cameras.len(),
        train_split.frames.len(),
        train_split.views.len(),
        settings.iterations
    );
    if resumed && let Some(checkpoint) = Checkpoints::latest(&folder.checkpoints())? {
        trainer = trainer.resume(checkpoint)?;
    }
    if capture.splits.contains_key(test_split) {
        trainer = trainer.watch(test_split)?;
    }
    if trainer.reduction() > 1 {
        log::warn!(
            "images are trained on at 1/{} of their size, because this graphics device takes no larger ones; they are \
             compared at full size",
            trainer.reduction()
        );
    }
    match trainer.resumed_at() {
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
    let every = args.checkpoint_every.or(record.checkpoint_every).unwrap_or(CHECKPOINT_EVERY);
    let kept = args.keep_checkpoints.or(record.keep_checkpoints).unwrap_or(0);
    let checkpoints = Checkpoints::new(&folder.checkpoints(), every, kept);
    let trainer = trainer.stop_when(interruption.stop()).save_to(checkpoints);
    let viewer = if args.viewer { LiveViewer::open(folder.path(), &folder.checkpoints()) } else { None };
    let trained = match train(trainer, settings.iterations, &folder.checkpoints(), viewer) {
        Ok(trained) => trained,
        Err(error) => {
            if matches!(error.downcast_ref(), Some(TrainError::Diverged { .. })) {
                folder.end(false);
            }
            return Err(match (error.downcast::<Stopped>(), folder.how_to_resume()) {
                (Ok(Stopped(line)), Some(hint)) => Stopped(format!("{line}; {hint}")).into(),
                (Ok(stopped), None) => stopped.into(),
                (Err(error), _) => error,
            });
        }
    };
    let stopped_early = trained.stopped;
    let progress = format!("{} of {} iterations", trained.iterations, settings.iterations);
    if stopped_early {
        say!("stopped early, after {progress}; saving and evaluating the avatar as it is");
    }
    if let Some(simplification) = &trained.simplification {
        say!("{}", simplification.summary());
    }
    if trained.skipped_steps > 0 {
        say!("{} steps were skipped, because a gradient in them was not finite", trained.skipped_steps);
    }

    let mut refined = Capture { cameras: trained.cameras.clone(), ..capture.clone() };
    refined.color_correction.cameras.clone_from(&trained.colors);
    let avatar_path = folder.file(AVATAR_FILE);
    let report_path = folder.file(REPORT_FILE);
    when_there_is_room(&avatar_path, &interruption, || {
        interruption.whole(|| -> anyhow::Result<()> {
            trained.avatar.save(&avatar_path)?;
            folder.remove_other_results()?;
            let config = folder.file(CONFIG_FILE);
            let written = write_atomically(&config, settings.to_toml().as_bytes());
            written.with_context(|| format!("{}: cannot write", config.display()))?;
            if refined.cameras != capture.cameras || !refined.color_correction.is_empty() {
                refined.save_cameras(&folder.file(CAMERAS_FILE))?;
            }
            save_poses(&capture, &train_split.frames, &trained, &folder.file(POSES_FILE))
        })
    })?;
    interruption
        .end_with(format!("stopped before evaluation: the avatar after {progress} is {}", avatar_path.display()));

    let mut shown = None;
    let (mut images, mut given) = (None, None);
    if let Some(split) = capture.splits.get(test_split).filter(|split| !split.views.is_empty()) {
        let mut cut = refined.clone();
        cut.images.aligned = trained.masks_of.clone();
        let test = |protocol, views| TestImages {
            // Poses that are fitted to masks come with the cameras, their colours and the masks of training.
            capture: if protocol == Protocol::Masks { &cut } else { &capture },
            split: test_split,
            protocol,
            views,
            lpips: lpips.as_deref(),
        };
        let mut evaluate = |test: &TestImages| {
            gpu.retry_on_device_loss("the evaluation", |gpu| {
                evaluate_images(gpu, &trained.avatar, test, &train_split, &trained.poses)
            })
        };
        let as_given = evaluate(&test(Protocol::Given, given_views(&capture, split)))?;
        // Without exact poses, given ones say more about the tracker than about the avatar.
        let (headline, views) = match &trained.held_out {
            Some(held_out) => {
                given = Some(as_given.0);
                evaluate(&test(Protocol::Masks, held_out.clone()))?
            }
            None => as_given,
        };
        shown = Some(report(&views));
        images = Some(headline);
    }
    let (pose_error_deg, alignment) = pose_figures(&start, &train_split.frames, &trained);
    let metrics = Metrics {
        images,
        given,
        preset: record.preset.clone(),
        model: trained.settings.model,
        components: trained.settings.components,
        poses: poses.to_string(),
        pose_error_deg,
        alignment,
        blurred: trained.blurred,
        exposure: trained.exposure.clone(),
        light: trained.light.as_ref().map(LightFit::report),
        seconds: trained.seconds,
        iterations: trained.iterations,
        stopped_early,
        skipped_steps: trained.skipped_steps,
        gaussians: trained.avatar.template.len(),
        simplification: trained.simplification.clone(),
    };
    let outlines = match &trained.alignment {
        Some(alignment) => Some(alignment_picture(&start, &train_split, alignment)?),
        None => None,
    };
    let pictures = [
        ("Truth, rendering, their difference four times as strong, and the floor", &shown),
        ("The template's outlines before (red) and after the alignment", &outlines),
    ];
    let page = Page {
        capture: path,
        command: &command(&record),
        settings,
        metrics: &metrics,
        curve: &trained.curve,
        pictures: pictures.into_iter().filter_map(|(caption, picture)| Some((caption, picture.as_ref()?))).collect(),
    };
    when_there_is_room(&report_path, &interruption, || {
        interruption.whole(|| -> anyhow::Result<()> {
            outlines.as_ref().map_or(Ok(()), |picture| write_png(&folder.file(ALIGN_FILE), picture))?;
            shown.as_ref().map_or(Ok(()), |picture| write_png(&report_path, picture))?;
            write_live_files(folder.path(), &trained.curve, &trained.previews)?;
            write_report_page(&folder.file(PAGE_FILE), &page)?;
            save_metrics(&metrics, &folder.file(METRICS_FILE))
        })
    })?;
    if !stopped_early {
        folder.end(kept > 0);
    }
    print_table(&metrics);
    say!("avatar: {}", avatar_path.display());
    if let Some(quality) = args.quality.or(record.quality) {
        let playback = quality::playback(&gpu, quality)?;
        let played =
            gpu.retry_on_device_loss("baking", |gpu| quality::prepare(gpu, &avatar_path, quality, playback))?;
        say!("for --quality {}: {}", quality.name(), played.display());
    }
    if outlines.is_some() {
        say!("alignment: {}", folder.file(ALIGN_FILE).display());
    }
    match metrics.images {
        Some(_) => say!("report: {}, {}", folder.file(PAGE_FILE).display(), report_path.display()),
        None => say!("no report: there are no images to evaluate in the split `{test_split}`"),
    }
    match (stopped_early, failure(&metrics, settings)) {
        (false, None) => Ok(()),
        (false, Some(failure)) => Err(anyhow!(failure)),
        (true, failure) => {
            let end = failure.unwrap_or_else(|| "the avatar is saved".into());
            let hint = folder.how_to_resume().map_or(String::new(), |hint| format!("; {hint}"));
            Err(Stopped(format!("stopped early, after {progress}: {end}{hint}")).into())
        }
    }
}
