//! `ghand bake`: makes a small, fast avatar for playing from any avatar.

pub mod hand_painter;
mod pictures;
pub mod pose_set;
pub mod pose_set_args;
mod reference_pictures;
mod search;

use std::path::PathBuf;

use anyhow::{Context, bail};
use clap::Args;
use ghand_avatar::deform::baked::Precision;
use ghand_avatar::{Avatar, Bake};
use ghand_core::Pose;
use ghand_files::atomic_file::{check_writable, write_atomically};
use ghand_files::claim::Claim;
use ghand_pictures::write_png;
use ghand_render::Gpu;
use indicatif::ProgressBar;
use serde::de::IntoDeserializer;
use serde::{Deserialize, Serialize};

use crate::capture_source::{CaptureSource, check_sides};
use crate::cli::AdapterArgs;
use crate::command_inputs::CommandInputs;
use crate::say;
use pose_set::{NamedPose, PoseSet};
use pose_set_args::PoseSetArgs;
use reference_pictures::{Loss, ReferencePictures};
use search::{Chosen, Goal};

/// Command line of `ghand bake`.
#[derive(Debug, Args)]
pub struct BakeArgs {
    /// The avatar, a .ghand file
    avatar: PathBuf,
    /// The baked avatar, a .ghand file; beside it FILE.json, with all figures, and two pictures
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// Largest loss in poses that are not fitted: the smallest file within it is made [default: 0.1, unless --max-mb is
    /// given]. It is what the difference from the avatar makes of the avatar's PSNR on the images of --capture; without
    /// that, of 33 dB
    #[arg(long, value_name = "DB", value_parser = parse_positive)]
    max_loss_db: Option<f64>,
    /// Largest file, 10^6 bytes
    #[arg(long, value_name = "MB", value_parser = parse_positive)]
    max_mb: Option<f64>,
    /// Most components of a joint
    #[arg(long, value_name = "K", default_value_t = 6, value_parser = clap::value_parser!(u8).range(1..=10))]
    rank: u8,
    /// Bits of the numbers in which components are stored; with f16 and u8, positions have 16 bits and colours 8
    /// [default: u8, or the first of f16 and f32 that is within the loss]
    #[arg(long, value_name = "f32|f16|u8", value_parser = parse_precision)]
    precision: Option<Precision>,
    #[command(flatten)]
    capture: CaptureSource,
    /// Split of the capture whose images the loss is measured on; their poses are not fitted
    #[arg(long, default_value = "test", requires = "capture")]
    split: String,
    #[command(flatten)]
    poses: PoseSetArgs,
    /// Replace earlier results
    #[arg(long)]
    force: bool,
}

fn parse_precision(name: &str) -> Result<Precision, serde::de::value::Error> {
    Precision::deserialize(name.into_deserializer())
}

fn parse_positive(text: &str) -> Result<f64, String> {
    let value = text.parse().ok().filter(|value: &f64| *value > 0.0 && value.is_finite());
    value.ok_or_else(|| "must be a number above 0".into())
}

/// Largest loss without other wishes, dB.
const DEFAULT_LOSS: f64 = 0.1;

/// All figures of a run.
#[derive(Debug, Serialize)]
struct Report {
    avatar: String,
    gaussians: usize,
    precision: Precision,
    components: usize,
    /// Blocks that were kept, and all: a block is a component's values for 64 Gaussians.
    blocks: [usize; 2],
    bytes: usize,
    bytes_of_avatar: u64,
    poses_fitted: usize,
    /// On poses that were not fitted.
    loss: Loss,
    /// The random pose within the joints' limits, among some that were not fitted, in which the baked avatar differs most.
    worst_pose: WorstPose,
}

#[derive(Debug, Serialize)]
struct WorstPose {
    name: String,
    /// PSNR between pictures of the two, dB.
    psnr: f64,
    /// Largest distance between the places of a Gaussian, mm.
    largest_mm: f64,
    axis_angles: Vec<[f64; 3]>,
}

/// Bakes an avatar. All input is read and checked before anything is written.
///
/// # Errors
/// An error that names the file or the option and its problem.
pub fn run(args: &BakeArgs, adapter: &AdapterArgs) -> anyhow::Result<()> {
    let avatar = Avatar::load(&args.avatar)?;
    let beside = |ending: &str| args.out.with_extension(ending);
    if args.out.extension().is_none_or(|ending| ending != "ghand") {
        bail!("--out {}: must end in .ghand", args.out.display());
    }
    let outputs = [args.out.clone(), beside("json"), beside("worst.png"), beside("loss.png")];
    if !args.force {
        let inputs = CommandInputs::default().and([&args.avatar]).and(args.capture.inputs()).and(args.poses.inputs());
        outputs.iter().try_for_each(|output| inputs.refuse("--out", output))?;
        if let Some(output) = outputs.iter().find(|output| output.exists()) {
            let remedy = "give another --out, or --force to replace it";
            bail!("--out {}: {} exists already; {remedy}", args.out.display(), output.display());
        }
    }
    check_writable(&args.out).with_context(|| format!("--out {}: cannot be written", args.out.display()))?;
    let _claim = Claim::beside(&args.out)?;
    let capture = match &args.capture.capture {
        Some(path) => {
            let capture = args.capture.open(path, &[&args.split], &[])?;
            check_sides(&args.avatar.display().to_string(), avatar.template.side, &capture)?;
            Some(capture)
        }
        None => {
            args.capture.check()?;
            None
        }
    };
    let poses = PoseSet::gather(
        &args.poses.read(&avatar.model)?,
        &avatar,
        capture.as_ref().map(|capture| (capture, args.split.as_str())),
    )?;
    let mut gpu = adapter.open()?;
    say!("adapter: {}", gpu.info.name);
    let (bake, reference, chosen, worst, pictures) = gpu.retry_on_device_loss("baking", |gpu| {
        let fitted: Vec<Pose> = poses.fitted.iter().map(|named| named.pose.clone()).collect();
        say!("computing {} poses", fitted.len());
        let bar = ProgressBar::new(fitted.len() as u64);
        let bake = Bake::new(gpu, &avatar, &fitted, args.rank.into(), |done| bar.set_position(done as u64));
        bar.finish_and_clear();
        let bake = bake.with_context(|| args.avatar.display().to_string())?;
        let reference = match &capture {
            Some(capture) => ReferencePictures::with_images(gpu, &avatar, capture, &args.split)?,
            None => ReferencePictures::without_images(gpu, &avatar, &poses.held_out)?,
        };
        let chosen = search::smallest(gpu, &bake, &reference, goal(args), args.precision)?;
        let worst = worst_pose(gpu, &avatar, &chosen.avatar, &poses.extreme, bake.order())?;
        let pictures = [
            pictures::side_by_side(gpu, &avatar, &chosen.avatar, &worst.pose)?,
            pictures::heat_map(gpu, &avatar, &chosen.avatar, bake.order(), &poses.held_out)?,
        ];
        anyhow::Ok((bake, reference, chosen, worst, pictures))
    })?;
    let [worst_picture, heat_map] = pictures;
    let report = report(args, &bake, &poses, &chosen, worst)?;
    chosen.avatar.save(&args.out)?;
    let json = serde_json::to_vec_pretty(&report)?;
    write_atomically(&beside("json"), &json).with_context(|| format!("{}", beside("json").display()))?;
    write_png(&beside("worst.png"), &worst_picture)?;
    write_png(&beside("loss.png"), &heat_map)?;
    print(args, &report, &reference);
    Ok(())
}

/// What is asked for.
fn goal(args: &BakeArgs) -> Goal {
    let default = args.max_mb.is_none().then_some(DEFAULT_LOSS);
    Goal { max_loss_db: args.max_loss_db.or(default), max_bytes: args.max_mb.map(|mb| (mb * 1e6) as usize) }
}

fn report(args: &BakeArgs, bake: &Bake, poses: &PoseSet, chosen: &Chosen, worst: Worst) -> anyhow::Result<Report> {
    let file = std::fs::metadata(&args.avatar).with_context(|| args.avatar.display().to_string())?;
    Ok(Report {
        avatar: args.avatar.display().to_string(),
        gaussians: chosen.avatar.template.len(),
        precision: chosen.precision,
        components: chosen.components,
        blocks: [chosen.blocks, bake.blocks()],
        bytes: chosen.bytes,
        bytes_of_avatar: file.len(),
        poses_fitted: poses.fitted.len(),
        loss: chosen.loss.clone(),
        worst_pose: WorstPose {
            name: worst.pose.name,
            psnr: worst.psnr,
            largest_mm: worst.largest_mm,
            axis_angles: worst.pose.pose.rotations.iter().map(|rotation| rotation.to_array()).collect(),
        },
    })
}

/// The pose in which two avatars differ most.
struct Worst {
    pose: NamedPose,
    psnr: f64,
    largest_mm: f64,
}

fn worst_pose(
    gpu: &Gpu,
    avatar: &Avatar,
    baked: &Avatar,
    poses: &[NamedPose],
    order: &[usize],
) -> anyhow::Result<Worst> {
    let reference = ReferencePictures::without_images(gpu, avatar, poses)?;
    let psnr = reference.loss(gpu, baked)?.psnr_to_exact;
    let per_pose = |k: usize| {
        let of_pose = &psnr[k * psnr.len() / poses.len()..(k + 1) * psnr.len() / poses.len()];
        of_pose.iter().copied().fold(f64::INFINITY, f64::min)
    };
    let worst = (0..poses.len()).min_by(|a, b| per_pose(*a).total_cmp(&per_pose(*b)));
    let Some(worst) = worst else { bail!("there are no poses to compare") };
    let pose = poses[worst].clone();
    let largest_mm = pictures::distances(gpu, avatar, baked, &pose.pose, order)?.into_iter().fold(0.0, f64::max) * 1e3;
    Ok(Worst { psnr: per_pose(worst), largest_mm, pose })
}

fn print(args: &BakeArgs, report: &Report, reference: &ReferencePictures) {
    let megabytes = |bytes: f64| format!("{:.2} MB", bytes * 1e-6);
    say!(
        "{} Gaussians, {} components, {} of {} blocks, {}",
        report.gaussians,
        report.components,
        report.blocks[0],
        report.blocks[1],
        serde_json::to_value(report.precision).ok().and_then(|v| v.as_str().map(str::to_owned)).unwrap_or_default()
    );
    say!("{} instead of {}", megabytes(report.bytes as f64), megabytes(report.bytes_of_avatar as f64));
    say!("loss {:.3} dB {}", report.loss.db, reference.description());
    if let Some(fall) = report.loss.on_images {
        say!("PSNR on these images changes by {:+.3} dB", -fall);
    }
    say!(
        "worst random pose: {}, {:.1} dB to the avatar, no Gaussian off by more than {:.1} mm",
        report.worst_pose.name,
        report.worst_pose.psnr,
        report.worst_pose.largest_mm
    );
    let name = |ending: &str| args.out.with_extension(ending).display().to_string();
    say!("{}, {}, {}, {}", args.out.display(), name("json"), name("worst.png"), name("loss.png"));
}
