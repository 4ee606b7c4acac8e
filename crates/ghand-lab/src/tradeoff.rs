//! `ghand-lab tradeoff`: what speed costs in accuracy, on this machine: an avatar as it is, baked, simplified and drawn smaller.

mod measure;
mod report;
mod variants;

use std::path::PathBuf;

use anyhow::{Context, bail};
use clap::Args;
use ghand_avatar::Avatar;

use ghand_app::capture_source::CaptureSource;
use ghand_app::capture_source::check_sides;
use ghand_app::cli::{AdapterArgs, parse_count};
use ghand_app::command_inputs::refuse_capture_folder;
use ghand_app::commands::bake::pose_set_args::PoseSetArgs;
use ghand_app::say;
use ghand_files::claim::Claim;
use measure::Measured;

/// Command line of `ghand-lab tradeoff`.
#[derive(Debug, Args)]
#[command(group = clap::ArgGroup::new("subject").args(["capture"]).required(true))]
pub struct TradeoffArgs {
    /// The avatars, .ghand files: for example one trained at another UV resolution, or a baked one
    #[arg(required = true, value_name = "AVATAR")]
    avatars: Vec<PathBuf>,
    #[command(flatten)]
    capture: CaptureSource,
    /// Split of the capture whose images tell the accuracy
    #[arg(long, default_value = "test")]
    split: String,
    /// Number of images, evenly chosen
    #[arg(long, value_name = "N", default_value_t = 24, value_parser = parse_count)]
    images: u32,
    /// Rounds of timing: in each all variants have their turn
    #[arg(long, value_name = "N", default_value_t = 9, value_parser = parse_count)]
    rounds: u32,
    #[command(flatten)]
    poses: PoseSetArgs,
    /// Folder for tradeoff.md, tradeoff.json and the plot, tradeoff.png
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Replace the files of an earlier run
    #[arg(long)]
    force: bool,
}

/// Measures all variants. All input is read and checked before anything is written.
///
/// # Errors
/// An error that names the file or the option and its problem.
pub fn run(args: &TradeoffArgs, adapter: &AdapterArgs) -> anyhow::Result<()> {
    let avatars: Vec<(String, Avatar)> = args
        .avatars
        .iter()
        .map(|path| Ok((variants::short_name(path, args.avatars.len()), Avatar::load(path)?)))
        .collect::<anyhow::Result<_>>()?;
    let path = args.capture.capture.as_ref().context("--capture: is missing")?;
    if !args.force {
        refuse_capture_folder("--out", &args.out, path)?;
    }
    report::check_folder(&args.out, args.force)?;
    let _claim = Claim::folder(&args.out)?;
    let capture = args.capture.open(path, &[&args.split], &[])?;
    for ((_, avatar), path) in avatars.iter().zip(&args.avatars) {
        check_sides(&path.display().to_string(), avatar.template.side, &capture)?;
        if avatar.template.joint_names != capture.template.joint_names {
            bail!("{}: has other joints than the capture's hand", path.display());
        }
    }
    let images = capture.split(&args.split)?.views.len().min(args.images as usize);
    let mut gpu = adapter.open()?;
    say!("adapter: {}", gpu.info.name);
    let measured: Vec<Measured> = gpu.retry_on_device_loss("the measurement", |gpu| {
        let all = variants::variants(gpu, &avatars, &args.poses, &capture, &args.split)?;
        measure::measure(gpu, &all, &capture, &args.split, images, args.rounds as usize)
    })?;
    let report = report::TradeoffReport::new(&gpu, path, args, images, measured);
    report.write(&args.out)?;
    say!("{}", report.table());
    say!("figures and plot: {}", args.out.join("tradeoff.md").display());
    Ok(())
}
