//! `train`: a capture in, an avatar out.

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Instant;

use anyhow::Context;
use clap::Parser;
use ghand_app::LAST_AVATAR;
use ghand_app::capture_args::CaptureArgs;
use ghand_app::capture_checks::check_before_training;
use ghand_app::cli::{self, AdapterArgs};
use ghand_app::commands::render::write_png;
use ghand_app::say;
use ghand_core::atomic_file::write_atomically;
use ghand_data::synthetic::SyntheticOptions;
use ghand_data::{Capture, Split};
use ghand_render::Gpu;
use ghand_train::evaluate::{EvaluatedView, FloorMetrics, ImageMetrics, Metrics, PoseError, evaluate};
use ghand_train::floor::Floor;
use ghand_train::metrics::pose_error_degrees;
use ghand_train::report::report;
use ghand_train::synthetic_scene::make_capture;
use ghand_train::trainer::moving_joints;
use ghand_train::{TrainSettings, Trained, Trainer};
use indicatif::{ProgressBar, ProgressStyle};

/// Train a hand avatar from a capture. Without a capture, a small synthetic one is made first.
#[derive(Parser)]
#[command(version)]
struct Arguments {
    #[command(flatten)]
    capture: CaptureArgs,
    /// Split to train on.
    #[arg(long, default_value = "train")]
    split: String,
    /// Split to evaluate on [default: test, if there is one]
    #[arg(long)]
    test_split: Option<String>,
    /// Folder for avatar.ghand, poses.json, metrics.json and report.png [default: out/train]
    #[arg(long)]
    out: Option<PathBuf>,
    /// Seed of everything random; the same seed on the same device gives the same avatar, byte for byte.
    #[arg(long)]
    seed: Option<u64>,
    /// Change a setting, such as iterations=6000; may be given several times. A wrong name lists all settings.
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Train even where no avatar can be expected of the capture, such as one in millimetres; what is wrong with it is a warning
    /// then.
    #[arg(long)]
    ignore_checks: bool,
    #[command(flatten)]
    adapter: AdapterArgs,
}

fn main() -> ExitCode {
    cli::run(|arguments: Arguments| run(&arguments))
}

/// What the split with the figures is usually called.
const DEFAULT_TEST_SPLIT: &str = "test";
/// How many views of the test split the report shows.
const REPORT_VIEWS: usize = 5;
/// Views that the floor's colours are averaged over.
const FLOOR_VIEWS: usize = 200;

fn run(arguments: &Arguments) -> anyhow::Result<()> {
    let mut settings = TrainSettings::default();
    for assignment in &arguments.set {
        settings.set(assignment)?;
    }
    if let Some(seed) = arguments.seed {
        settings.seed = seed;
    }
    let mut gpu = arguments.adapter.open()?;
    say!("adapter: {}", gpu.info.name);
    let avatar_path = match &arguments.out {
        Some(out) => out.join("avatar.ghand"),
        None => PathBuf::from(LAST_AVATAR),
    };
    let out = avatar_path.parent().unwrap_or(Path::new("."));
    std::fs::create_dir_all(out).with_context(|| format!("{}: cannot make the output folder", out.display()))?;

    // A split that was asked for and is not there fails here, before the training.
    let needed: Vec<&str> =
        std::iter::once(&arguments.split).chain(&arguments.test_split).map(String::as_str).collect();
    let demo = if arguments.capture.capture.is_none() { Some(demo_capture(&mut gpu, out)?) } else { None };
    let path = arguments.capture.capture.as_ref().or(demo.as_ref()).context("--capture: is missing")?;
    let capture = arguments.capture.open(path, &needed, &[DEFAULT_TEST_SPLIT])?;
    let test_split = arguments.test_split.as_deref().unwrap_or(DEFAULT_TEST_SPLIT);
    check_before_training(&capture, path, &arguments.split, test_split, arguments.ignore_checks)?;
    let train_split = capture.split(&arguments.split)?.clone();
    let trainer = Trainer::new(&gpu, &capture, &arguments.split, &settings)?;
    let gaussians = trainer.gaussians();
    say!(
        "training: {} cameras, {} frames, {} images, {gaussians} Gaussians, {} iterations",
        train_split.cameras.len(),
        train_split.frames.len(),
        train_split.views.len(),
        settings.iterations
    );
    let trained = train(trainer, settings.iterations)?;
    trained.avatar.save(&avatar_path)?;

    save_poses(&capture, &train_split.frames, &trained, &out.join("poses.json"))?;

    let report_path = out.join("report.png");
    let images = match capture.splits.get(test_split) {
        Some(test) if !test.views.is_empty() => {
            let (metrics, shown) = gpu
                .persist("the evaluation", |gpu| evaluate_images(gpu, &capture, &train_split, &trained, test_split))?;
            write_png(&report_path, &report(&shown))?;
            Some(metrics)
        }
        _ => {
            // That of an earlier run would be taken for this one's.
            match std::fs::remove_file(&report_path) {
                Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
                    return Err(error).with_context(|| format!("{}: cannot be removed", report_path.display()));
                }
                _ => None,
            }
        }
    };
    let metrics = Metrics {
        images,
        pose_error_deg: pose_error(&capture, &train_split.frames, &trained),
        seconds: trained.seconds,
        iterations: settings.iterations,
        gaussians,
    };
    let text = serde_json::to_string_pretty(&metrics)?;
    let metrics_path = out.join("metrics.json");
    write_atomically(&metrics_path, text.as_bytes())
        .with_context(|| format!("{}: cannot write", metrics_path.display()))?;
    print_table(&metrics);
    say!("avatar: {}", avatar_path.display());
    match metrics.images {
        Some(_) => say!("report: {}", report_path.display()),
        None => say!("no report: there is no image to evaluate on in a split `{test_split}`"),
    }
    Ok(())
}

/// The figures on a split that has images, and some of them for the report.
fn evaluate_images(
    gpu: &Gpu,
    capture: &Capture,
    train: &Split,
    trained: &Trained,
    split: &str,
) -> anyhow::Result<(ImageMetrics, Vec<EvaluatedView>)> {
    let test = capture.split(split)?;
    let total = test.views.len();
    let floor = Floor::new(gpu, capture, train, &trained.poses, FLOOR_VIEWS)?;
    let mut shown: Vec<EvaluatedView> = Vec::new();
    let mut index = 0;
    let evaluation = evaluate(gpu, &trained.avatar, capture, split, &floor, |view| {
        // Evenly over the frames, a different camera each time.
        let rows = REPORT_VIEWS.min(total);
        if shown.len() < rows && index >= shown.len() * total / rows + shown.len() % test.cameras.len().max(1) {
            shown.push(view);
        }
        index += 1;
    })?;
    let (avatar, floor) = (evaluation.avatar, evaluation.floor);
    let metrics = ImageMetrics {
        split: split.into(),
        frames: evaluation.views,
        psnr: avatar.psnr,
        psnr_hand: avatar.psnr_hand,
        ssim: avatar.ssim,
        floor: FloorMetrics { psnr: floor.psnr, psnr_hand: floor.psnr_hand, ssim: floor.ssim },
    };
    Ok((metrics, shown))
}

/// The synthetic capture of runs without one: made once, in the output folder.
fn demo_capture(gpu: &mut Gpu, out: &Path) -> anyhow::Result<PathBuf> {
    let folder = out.join("capture");
    if !folder.join("capture.json").exists() {
        say!("making a synthetic capture in {}", folder.display());
        gpu.persist("the synthetic capture", |gpu| -> anyhow::Result<()> {
            Ok(make_capture(gpu, &SyntheticOptions::default(), &folder)?)
        })?;
    }
    Ok(folder)
}

/// Lines of progress that a run prints where there is no terminal for a bar.
const PROGRESS_LINES: u64 = 20;

fn train(trainer: Trainer, iterations: u64) -> anyhow::Result<Trained> {
    let bar = ProgressBar::new(iterations);
    bar.set_style(ProgressStyle::with_template("{bar:30} {pos}/{len} {msg} {elapsed} (left {eta})")?);
    let start = Instant::now();
    let trained = trainer.train(|p| {
        let message = p.l1.map_or(String::new(), |l1| format!("stage {} L1 {l1:.4}", p.stage));
        if bar.is_hidden() && p.iteration % (iterations / PROGRESS_LINES).max(1) == 0 {
            say!("{}/{iterations} {message} {:.0} s", p.iteration, start.elapsed().as_secs_f64());
        }
        bar.set_position(p.iteration);
        bar.set_message(message);
    })?;
    bar.finish_and_clear();
    Ok(trained)
}

/// Joint-angle errors of the capture's and the refined training poses, where the truth of all of them is known.
fn pose_error(capture: &Capture, frames: &[usize], trained: &Trained) -> Option<PoseError> {
    let truth = capture.truth.as_ref()?;
    let truth: Option<Vec<_>> = frames.iter().map(|f| truth.get(*f)?.clone()).collect();
    let truth = truth?;
    let given: Vec<_> = frames.iter().map(|f| capture.frames[*f].pose.clone()).collect();
    let counts = moving_joints(&given);
    Some(PoseError {
        before: pose_error_degrees(&given, &truth, &counts),
        after: pose_error_degrees(&trained.poses, &truth, &counts),
    })
}

/// The refined poses as a pose file, joints in the hand model's order.
fn save_poses(capture: &Capture, frames: &[usize], trained: &Trained, path: &Path) -> anyhow::Result<()> {
    let frames: Vec<serde_json::Value> = frames
        .iter()
        .zip(&trained.poses)
        .map(|(frame, pose)| {
            serde_json::json!({
                "id": capture.frames[*frame].id,
                "pose": pose.rotations.iter().map(|r| r.to_array()).collect::<Vec<_>>(),
                "translation": pose.translation.to_array(),
                "shape": capture.frames[*frame].shape,
            })
        })
        .collect();
    let text = serde_json::to_string_pretty(&serde_json::json!({ "fps": 30, "frames": frames }))?;
    write_atomically(path, text.as_bytes()).with_context(|| format!("{}: cannot write", path.display()))
}

fn print_table(m: &Metrics) {
    if let Some(m) = &m.images {
        say!("\n{} images of split `{}` (new poses, new views)", m.frames, m.split);
        say!("            PSNR   PSNR on the hand   SSIM");
        say!("  floor    {:6.2}      {:6.2}         {:.4}", m.floor.psnr, m.floor.psnr_hand, m.floor.ssim);
        say!("  avatar   {:6.2}      {:6.2}         {:.4}", m.psnr, m.psnr_hand, m.ssim);
        say!(
            "  gain     {:+6.2}      {:+6.2}         {:+.4}",
            m.psnr - m.floor.psnr,
            m.psnr_hand - m.floor.psnr_hand,
            m.ssim - m.floor.ssim
        );
    }
    if let Some(e) = m.pose_error_deg {
        say!("pose error: {:.2} degrees given, {:.2} refined", e.before, e.after);
    }
    say!("{} Gaussians, {} iterations in {:.0} s\n", m.gaussians, m.iterations, m.seconds);
}
