//! `train`: trains an avatar from a capture.

mod evaluation;
mod inputs;
mod plan;
mod training;
mod writing;

use std::path::PathBuf;
use std::time::Duration;

use anyhow::{anyhow, bail};
use clap::Args;
use ghand_train::TrainingProgress;

use crate::capture_source::CaptureSource;
use crate::cli::{AdapterArgs, Stopped};
use crate::lpips_weights::LpipsWeights;
use crate::run_files::{ALIGN_FILE, AVATAR_FILE, PAGE_FILE, REPORT_FILE};
use crate::same_tracker::remark;
use crate::say;
use crate::train_run::evaluation::{failure, print_table};
use crate::train_run::interruption::{Interruption, STOPPED_BEFORE_TRAINING};
use crate::train_run::settings_args::SettingsArgs;
use crate::train_run::training_poses::StartPoses;
use inputs::Inputs;
use plan::Planned;

/// Command line of `train`.
#[derive(Debug, Args)]
pub struct TrainArgs {
    #[command(flatten)]
    capture: CaptureSource,
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
    lpips: LpipsWeights,
    /// Folder for avatar.ghand, report.html and the other results [default: out/train or, if it holds an earlier
    /// run, the next of out/train-2, out/train-3, ...]
    #[arg(long)]
    out: Option<PathBuf>,
    /// Replace the results of an earlier run in the folder.
    #[arg(long, conflicts_with = "resume")]
    force: bool,
    /// Continue the interrupted run in --out [default: the last one], as it was started; other options may be omitted.
    /// Without one there, start if --capture is given.
    #[arg(long)]
    resume: bool,
    /// Show the avatar in the viewer while it is trained, with the curve of its loss and images held out
    #[arg(long)]
    viewer: bool,
    #[command(flatten)]
    settings: SettingsArgs,
    /// Time between two checkpoints, from which an interrupted run continues [default: 1m]
    #[arg(long, value_name = "TIME", value_parser = humantime::parse_duration)]
    checkpoint_every: Option<Duration>,
    /// Keep a checkpoint of every so many iterations, beside the last two, and after the run [default: 0, none]
    #[arg(long, value_name = "N")]
    keep_checkpoints: Option<u64>,
    /// Train even if the capture cannot give an avatar, such as one in millimetres; its problems become warnings.
    #[arg(long)]
    ignore_checks: bool,
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
    run_watched(args, adapter, &Interruption::listen(STOPPED_BEFORE_TRAINING)?, None).map(|_| ())
}

/// As [`run`], for a program that does it inside itself: `watch` sees the training instead of the terminal. Returns the
/// folder.
///
/// # Errors
/// As [`run`]. A run that is stopped while it trains has written its avatar, and checkpoints to go on from.
pub fn run_watched(
    args: &TrainArgs,
    adapter: &AdapterArgs,
    interruption: &Interruption,
    watch: Option<&mut dyn FnMut(&TrainingProgress)>,
) -> anyhow::Result<PathBuf> {
    if watch.is_some() && (args.viewer || args.settings.print_config()) {
        bail!("--viewer, --print-config: are for the program `train` only; leave them out");
    }
    args.settings()?.check_build()?;
    let mut gpu = adapter.open()?;
    say!("adapter: {}", gpu.info.name);
    let plan = match Planned::new(args)? {
        Planned::Run(plan) => plan,
        Planned::HasEnded(folder) => return Ok(folder),
    };
    interruption.end_with(STOPPED_BEFORE_TRAINING.into());
    interruption.remove_at_end(plan.folder.leftovers());
    let inputs = Inputs::open(args, &plan, &mut gpu, interruption)?;
    interruption.check()?;
    let trained = training::train(args, &plan, &inputs, &gpu, interruption, watch)?;
    let refined = inputs.refined_by(&trained);
    let progress = plan.progress(trained.iterations);
    writing::write_avatar(&plan, &inputs, &trained, &refined, interruption)?;
    let avatar_path = plan.folder.file(AVATAR_FILE);
    interruption
        .end_with(format!("stopped before evaluation: the avatar after {progress} is {}", avatar_path.display()));
    interruption.check()?;
    let evaluated = evaluation::evaluate(&mut gpu, &plan, &inputs, &trained, &refined, interruption)?;
    interruption.check()?;
    writing::write_report(&plan, &inputs, &trained, &evaluated, interruption)?;
    let metrics = &evaluated.metrics;
    print_table(metrics);
    if let Some(line) = trained.avatar.tracker.as_ref().and_then(remark) {
        say!("{line}");
    }
    say!("avatar: {}", avatar_path.display());
    if evaluated.outlines.is_some() {
        say!("alignment: {}", plan.folder.file(ALIGN_FILE).display());
    }
    match metrics.images {
        Some(_) => {
            let [page, report] = [PAGE_FILE, REPORT_FILE].map(|name| plan.folder.file(name));
            say!("report: {}, {}", page.display(), report.display());
        }
        None => say!("no report: there are no images to evaluate in the split `{}`", plan.test_split()),
    }
    match (trained.stopped, failure(metrics, &plan.record.settings)) {
        (false, None) => Ok(plan.folder.path().into()),
        (false, Some(failure)) => Err(anyhow!(failure)),
        (true, failure) => {
            let end = failure.unwrap_or_else(|| "the avatar is saved".into());
            let hint = plan.folder.how_to_resume().map_or(String::new(), |hint| format!("; {hint}"));
            Err(Stopped(format!("stopped early, after {progress}: {end}{hint}")).into())
        }
    }
}
