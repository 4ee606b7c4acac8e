//! `ghand-lab ablate`: what each part of the method brings.

pub mod arms;

use std::path::{Path, PathBuf};

use anyhow::{Context, anyhow, bail};
use arms::{ARMS, Arm, ArmFigures, ArmRun, ImageFigures, figures, table};
use clap::Args;
use ghand_capture::Capture;
use ghand_files::atomic_file::write_atomically;
use ghand_files::input_file;
use ghand_measure::baseline::Baseline;
use ghand_measure::evaluation::evaluate;
use ghand_pictures::plot::IntervalPlot;
use ghand_render::Gpu;
use ghand_train::{Align, TrainError, TrainSettings, Trainer};
use serde::Serialize;

use ghand_app::capture_source::CaptureSource;
use ghand_app::cli::{AdapterArgs, Stopped};
use ghand_app::command_inputs::refuse_capture_folder;
use ghand_app::say;
use ghand_app::train_run::interruption::Interruption;
use ghand_app::train_run::settings_args::SettingsArgs;
use ghand_app::train_run::training_poses::StartPoses;
use ghand_files::claim::Claim;
use ghand_pictures::write_png;

/// Command line of `ghand-lab ablate`.
#[derive(Debug, Args)]
#[command(group = clap::ArgGroup::new("subject").args(["capture"]).required(true))]
pub struct AblateArgs {
    #[command(flatten)]
    capture: CaptureSource,
    /// Split to train on
    #[arg(long, default_value = "train")]
    split: String,
    /// Split to evaluate on
    #[arg(long, default_value = "test")]
    test_split: String,
    /// Training poses: `truth`, the capture's exact ones, so that nothing hides in the poses; `given`; or those of a file
    #[arg(long, value_name = "given|truth|FILE", default_value = "truth")]
    poses: StartPoses,
    /// Number of trainings of each arm, with the seeds 1, 2, ...
    #[arg(long, value_name = "N", default_value_t = 6, value_parser = clap::value_parser!(u64).range(1..=100))]
    seeds: u64,
    /// Only these arms; a wrong name lists all
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    arms: Vec<String>,
    /// Train all arms for the same number of iterations, that of the settings, and for the same time, --max-time [default:
    /// both]
    #[arg(long, value_name = "iterations|time", value_delimiter = ',', default_value = "iterations,time")]
    equal: Vec<Budget>,
    #[command(flatten)]
    settings: SettingsArgs,
    /// Folder for ablation.md, ablation.json and the figures of each training; those that are there are not trained again
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

/// What all arms have the same of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum Budget {
    Iterations,
    Time,
}

/// Time of each training if none is given, seconds.
const DEFAULT_SECONDS: f64 = 900.0;
/// Trainings of limited time end before this many iterations.
const MOST_ITERATIONS: u64 = 1_000_000_000;
/// Number of views that the baseline's colours are averaged over.
const BASELINE_VIEWS: usize = 200;
/// Largest file of a training's figures, bytes.
const LARGEST_FILE: u64 = 1 << 26;

impl Budget {
    fn name(self) -> &'static str {
        match self {
            Budget::Iterations => "iterations",
            Budget::Time => "time",
        }
    }

    fn applied_to(self, settings: TrainSettings) -> TrainSettings {
        match self {
            Budget::Iterations => TrainSettings { max_seconds: 0.0, ..settings },
            Budget::Time => {
                let limited = settings.max_seconds > 0.0;
                let max_seconds = if limited { settings.max_seconds } else { DEFAULT_SECONDS };
                TrainSettings { max_seconds, iterations: MOST_ITERATIONS, ..settings }
            }
        }
    }
}

/// `ablation.json`.
#[derive(Serialize)]
struct Report<'a> {
    capture: String,
    split: &'a str,
    test_split: &'a str,
    poses: String,
    settings: &'a TrainSettings,
    equal_iterations: Option<Vec<ArmFigures>>,
    equal_time: Option<Vec<ArmFigures>>,
}

/// Trains all arms and writes what they bring.
///
/// # Errors
/// An error that names the file, the option or the setting and its problem; [`Stopped`] if the user has stopped it.
pub fn run(args: &AblateArgs, adapter: &AdapterArgs) -> anyhow::Result<()> {
    let arms = chosen(&args.arms)?;
    if args.settings.seed_given() {
        bail!("--seed: the trainings have the seeds 1, 2, ...; say how many with --seeds, and omit --seed");
    }
    if args.settings.max_time_given() && !args.equal.contains(&Budget::Time) {
        bail!("--max-time: is the time of --equal time; give that, or omit --max-time");
    }
    let settings = args.settings.fixed_settings((args.poses == StartPoses::Truth).then_some(Align::Off))?;
    settings.check()?;
    if args.settings.are_only_printed(&settings) {
        return Ok(());
    }
    arms.iter().try_for_each(|arm| arm.settings(&settings).check_build())?;
    let path = args.capture.capture.as_ref().context("--capture: is missing")?;
    refuse_capture_folder("--out", &args.out, path)?;
    let _claim = Claim::folder(&args.out)?;
    let capture = args.capture.open(path, &[&args.split, &args.test_split], &[])?;
    if capture.split(&args.test_split)?.views.is_empty() {
        bail!("{}: the split {:?} has no images to compare with", path.display(), args.test_split);
    }
    let start = args.poses.applied_to(&capture, &args.split)?;
    let folder = args.out.join("runs");
    std::fs::create_dir_all(&folder).with_context(|| format!("{}: cannot create the folder", folder.display()))?;
    let mut gpu = adapter.open()?;
    say!("adapter: {}", gpu.info.name);
    let interruption = Interruption::listen("stopped: trainings that have ended are kept")?;

    let mut report = Report {
        capture: path.display().to_string(),
        split: &args.split,
        test_split: &args.test_split,
        poses: args.poses.to_string(),
        settings: &settings,
        equal_iterations: None,
        equal_time: None,
    };
    for budget in &args.equal {
        let mut runs = vec![];
        // All arms with one seed come before the next seed, so that a table can be had early.
        for seed in 1..=args.seeds {
            for arm in &arms {
                let file = folder.join(format!("{}-{}-{seed}.json", budget.name(), arm.name));
                let settings = budget.applied_to(TrainSettings { seed, ..arm.settings(&settings) });
                let run = match read_run(&file)? {
                    Some((before, run)) if before == settings => run,
                    Some(_) => bail!("{}: was made with other settings; choose another --out", file.display()),
                    None => {
                        say!("{}, seed {seed}, equal {}", arm.name, budget.name());
                        interruption.stop_first();
                        let run =
                            train(&mut gpu, &start, (&args.split, &args.test_split), arm, &settings, &interruption)?;
                        let text = serde_json::to_string(&(&settings, &run))?;
                        write_atomically(&file, text.as_bytes())
                            .with_context(|| format!("{}: cannot write", file.display()))?;
                        say!("{}", one_line(&run));
                        run
                    }
                };
                runs.push(run);
            }
        }
        let figures = figures(&runs);
        say!("\nequal {}\n\n{}", budget.name(), table(&figures));
        write_plot(&args.out, *budget, &figures)?;
        match budget {
            Budget::Iterations => report.equal_iterations = Some(figures),
            Budget::Time => report.equal_time = Some(figures),
        }
        write(&report, &args.out)?;
    }
    say!("figures: {}", args.out.join("ablation.md").display());
    Ok(())
}

fn chosen(names: &[String]) -> anyhow::Result<Vec<Arm>> {
    let all = || ARMS.iter().map(|arm| arm.name).collect::<Vec<_>>().join(", ");
    let one = |name: &String| ARMS.iter().find(|arm| arm.name == name).copied();
    let named = |name| one(name).ok_or_else(|| anyhow!("--arms: there is no arm `{name}`; the arms are {}", all()));
    if names.is_empty() { Ok(ARMS.to_vec()) } else { names.iter().map(named).collect() }
}

/// The settings and figures of a training that has ended.
fn read_run(file: &Path) -> anyhow::Result<Option<(TrainSettings, ArmRun)>> {
    if !file.exists() {
        return Ok(None);
    }
    let bytes = input_file::read(file, LARGEST_FILE).with_context(|| format!("{}: cannot be read", file.display()))?;
    let read = serde_json::from_slice(&bytes.unwrap_or_default());
    Ok(Some(read.with_context(|| format!("{}: has no figures of a training; remove it", file.display()))?))
}

fn train(
    gpu: &mut Gpu,
    capture: &Capture,
    (split, test_split): (&str, &str),
    arm: &Arm,
    settings: &TrainSettings,
    interruption: &Interruption,
) -> anyhow::Result<ArmRun> {
    let trained = Trainer::new(gpu, capture, split, settings)?.stop_when(interruption.stop()).train(|_| ());
    let trained = match trained {
        Ok(trained) if !trained.stopped => trained,
        Ok(_) | Err(TrainError::Stopped { .. }) => {
            return Err(Stopped("stopped: the same command goes on with this training".into()).into());
        }
        Err(error) => return Err(error.into()),
    };
    let train_split = capture.split(split)?;
    let mut images = vec![];
    gpu.retry_on_device_loss("the evaluation", |gpu| -> anyhow::Result<()> {
        images.clear();
        let baseline = Baseline::new(gpu, capture, train_split, &trained.poses, BASELINE_VIEWS)?;
        evaluate(gpu, &trained.avatar, capture, test_split, &baseline, |view| {
            let [camera, frame] = view.name;
            let likeness = view.likeness;
            let [psnr, psnr_hand, ssim] = [likeness.psnr, likeness.psnr_hand, likeness.ssim];
            images.push(ImageFigures { frame, camera, psnr, psnr_hand, ssim });
        })?;
        Ok(())
    })?;
    let iterations = trained.iterations;
    let seconds = trained.seconds;
    Ok(ArmRun { arm: arm.name.into(), seed: settings.seed, iterations, seconds, images })
}

/// Means over the images of a training.
fn one_line(run: &ArmRun) -> String {
    let mean = |of: fn(&ImageFigures) -> f64| run.images.iter().map(of).sum::<f64>() / run.images.len().max(1) as f64;
    let psnr = mean(|image| image.psnr);
    let on_hand = mean(|image| image.psnr_hand);
    let ssim = mean(|image| image.ssim);
    let ArmRun { iterations, seconds, .. } = run;
    format!("  {psnr:.2} dB, {on_hand:.2} on the hand, SSIM {ssim:.4}; {iterations} iterations, {seconds:.0} s")
}

/// Writes `ablation.json` and `ablation.md`.
fn write(report: &Report, folder: &Path) -> anyhow::Result<()> {
    let text = serde_json::to_string_pretty(report)?;
    let mut page = format!(
        "# Ablation\n\nCapture `{}`, trained on `{}`, compared on `{}`; training poses: {}. Intervals of 95 %, bootstrapped \
         over the poses of the split.\n",
        report.capture, report.split, report.test_split, report.poses
    );
    let parts = [(Budget::Iterations, &report.equal_iterations), (Budget::Time, &report.equal_time)];
    for (budget, figures) in parts {
        if let Some(figures) = figures {
            let name = budget.name();
            page += &format!("\n## Equal {name}\n\n![PSNR on the hand](ablation-{name}.png)\n\n{}", table(figures));
        }
    }
    for (name, text) in [("ablation.json", text), ("ablation.md", page)] {
        let path = folder.join(name);
        write_atomically(&path, text.as_bytes()).with_context(|| format!("{}: cannot write", path.display()))?;
    }
    Ok(())
}

/// Writes a plot of the arms.
fn write_plot(folder: &Path, budget: Budget, figures: &[ArmFigures]) -> anyhow::Result<()> {
    let row = |arm: &ArmFigures| (arm.arm.clone(), [arm.psnr_hand.mean, arm.psnr_hand.low, arm.psnr_hand.high]);
    let plot = IntervalPlot {
        title: format!("Parts of the method, equal {}", budget.name()),
        axis: "PSNR on the hand, dB, with 95 % intervals over poses".into(),
        rows: figures.iter().map(row).collect(),
    };
    Ok(write_png(&folder.join(format!("ablation-{}.png", budget.name())), &plot.to_image()?)?)
}
