//! `ghand-lab bench train`: the parts of a training step.

use std::collections::BTreeMap;
use std::time::Instant;

use anyhow::Context;
use clap::Args;
use ghand_avatar::Avatar;
use ghand_core::{Pose, Side};
use ghand_fit::views::TrainView;
use ghand_hand_model::builtin::builtin_hand;
use ghand_train::step::{Rates, Step};

use super::{DEFAULT_SIZE, Times, resolution_for};
use ghand_app::cli::{AdapterArgs, parse_count, parse_size};
use ghand_app::say;
use ghand_app::train_run::settings_args::SettingsArgs;
use ghand_avatar::framing::turntable;

#[derive(Debug, Args)]
pub(super) struct TrainArgs {
    #[command(flatten)]
    settings: SettingsArgs,
    /// Approximate number of Gaussians [default: as a set `uv_resolution` gives, or 10815; 87779 with `--preset paper`]
    #[arg(long, value_name = "N")]
    n: Option<usize>,
    /// Image size in pixels [default: 334x512]
    #[arg(long, value_parser = parse_size, value_name = "WxH")]
    size: Option<[u32; 2]>,
    /// Number of timed iterations, after one to warm up
    #[arg(long, default_value_t = 10, value_name = "N", value_parser = parse_count)]
    iterations: u32,
    /// One JSON object instead of lines of text
    #[arg(long)]
    json: bool,
}

/// Gaussians of the paper's model, on MANO.
const PAPER_GAUSSIANS: usize = 87_779;
/// Gaussians where the settings leave them to a capture's images, which this has not.
const GAUSSIANS: usize = 10_815;

#[derive(serde::Serialize)]
struct Report {
    adapter: String,
    tier: &'static str,
    gaussians: usize,
    width: u32,
    height: u32,
    images_per_step: usize,
    ms: Vec<(&'static str, Times)>,
    /// Of the whole program, if the system tells.
    peak_memory_mb: Option<f64>,
    set_up_s: f64,
}

/// Trains an untrained hand on a picture of its own, which is enough for the times.
pub(super) fn run(args: &TrainArgs, adapter: &AdapterArgs) -> anyhow::Result<()> {
    let start = Instant::now();
    let mut settings = args.settings.fixed_settings(None)?;
    settings.check()?;
    let model = builtin_hand(Side::Right)?;
    let unless_set = || match args.settings.preset() {
        "paper" => Some(PAPER_GAUSSIANS),
        _ => (settings.uv_resolution == 0).then_some(GAUSSIANS),
    };
    let wanted = args.n.or_else(unless_set);
    if let Some(count) = wanted {
        settings.uv_resolution = resolution_for(&model, count)?;
    }
    if args.settings.are_only_printed(&settings) {
        return Ok(());
    }
    settings.check_build()?;
    let gpu = adapter.open()?;
    let avatar = Avatar::untrained(&model, &settings.avatar(), [0.8, 0.6, 0.5], settings.seed)?;
    let poses = [Pose::rest(model.joint_count())];
    let size = args.size.unwrap_or(DEFAULT_SIZE);
    let count = settings.images_per_step;
    let cameras = turntable(&model, &[&poses[0]], count, size).into_iter().flatten();
    let views: Vec<TrainView> = cameras
        .map(|camera| TrainView {
            camera_index: 0,
            frame: 0,
            size: [camera.width, camera.height],
            pixels: vec![[128, 128, 128, 255]; camera.width as usize * camera.height as usize],
            camera,
        })
        .collect();
    let mobility = vec![1.0; model.joint_count()];
    let mut step = Step::new(&gpu, &avatar, 1, views.len(), size, &mobility)?;
    step.set_pose(&gpu, 0, &poses[0])?;
    let set_up_s = start.elapsed().as_secs_f64();
    let mut times: BTreeMap<&'static str, Vec<f64>> = BTreeMap::new();
    let mut names = vec![];
    for iteration in 0..=u64::from(args.iterations) {
        let rates = Rates { step: iteration + 1, tables: 1.0, pose: None, pose_step: 1, lpips: false };
        let values = 3.0 * f64::from(size[0]) * f64::from(size[1]);
        let parts = step.time_parts(&gpu, &views, values, &settings, &rates).context("a step")?;
        names = parts.iter().map(|(name, _)| *name).collect();
        if iteration > 0 {
            parts.into_iter().for_each(|(name, seconds)| times.entry(name).or_default().push(1e3 * seconds));
        }
    }
    let report = Report {
        adapter: gpu.info.name.clone(),
        tier: gpu.tier.name(),
        gaussians: avatar.template.len(),
        width: size[0],
        height: size[1],
        images_per_step: views.len(),
        ms: names.into_iter().map(|name| (name, Times::of(times.remove(name).unwrap_or_default()))).collect(),
        peak_memory_mb: peak_memory_mb(),
        set_up_s,
    };
    if args.json {
        say!("{}", serde_json::to_string(&report)?);
        return Ok(());
    }
    say!(
        "{}, {} tier: {} Gaussians, model {:?}, {}x{}, {} image(s) a step",
        report.adapter,
        report.tier,
        report.gaussians,
        settings.model,
        size[0],
        size[1],
        report.images_per_step
    );
    for (name, t) in &report.ms {
        say!("{name:18} median {:.1} ms, min {:.1}, max {:.1}", t.median, t.min, t.max);
    }
    if let Some(memory) = report.peak_memory_mb {
        say!("peak memory {memory:.0} MB");
    }
    Ok(())
}

/// The most memory that this program has had, where the system is Linux.
fn peak_memory_mb() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    Some(line.trim().strip_suffix("kB")?.trim().parse::<f64>().ok()? / 1024.0)
}
