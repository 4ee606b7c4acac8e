//! `ghand export`: writes a posed avatar as a scene of Gaussians for other programs.

use std::path::PathBuf;

use anyhow::{Context, bail};
use clap::Args;
use ghand_avatar::Scene;
use ghand_avatar::avatar::Avatar;
use ghand_avatar::ply::SplatScene;
use ghand_files::atomic_file::check_writable;
use ghand_render::splat::Purpose;

use crate::cli::AdapterArgs;
use crate::pose_choice::{PoseReadingArgs, choose_frame};
use crate::say;

/// Command line of `ghand export`.
#[derive(Debug, Args)]
pub struct ExportArgs {
    /// The avatar, a .ghand file
    avatar: PathBuf,
    /// A pose or a motion by name, or a file of poses, as for `render`
    #[arg(long, value_name = "FILE|NAME", default_value = "rest")]
    pose: String,
    #[command(flatten)]
    reading: PoseReadingArgs,
    /// Frame of the file or motion: its id or its number, counted from 0 [default: the first]
    #[arg(long, value_name = "ID")]
    frame: Option<String>,
    /// The scene to write: a .ply file in the layout of 3D Gaussian Splatting; metres. Opacities of 1 are written as
    /// 0.99999
    #[arg(long, value_name = "FILE")]
    ply: PathBuf,
}

/// Poses the avatar and writes its Gaussians. All input is read and checked before anything is written.
///
/// # Errors
/// An error that names the file or the option and its problem.
pub fn run(args: &ExportArgs, adapter: &AdapterArgs) -> anyhow::Result<()> {
    if args.ply.extension().is_none_or(|ending| !ending.eq_ignore_ascii_case("ply")) {
        bail!("--ply {}: must end in .ply", args.ply.display());
    }
    check_writable(&args.ply).with_context(|| format!("--ply {}: cannot be written", args.ply.display()))?;
    let avatar = Avatar::load(&args.avatar)?;
    let frames = args.reading.load(&args.pose, &avatar.model)?.frames;
    let wanted = args.frame.as_deref().unwrap_or("0");
    let frame = choose_frame(frames, wanted).with_context(|| args.pose.clone())?;
    // Only the pose is needed, not the picture: one tile is the smallest picture.
    let mut gpu = adapter.open()?;
    let scene = gpu.retry_on_device_loss("the export", |gpu| -> anyhow::Result<SplatScene> {
        let mut scene = Scene::new(gpu, &[&avatar], Purpose::Images, 1, [8, 8])?;
        scene.set_pose(gpu, 0, 0, &frame.pose)?;
        Ok(scene.posed_splats(gpu, 0)?)
    })?;
    scene.write(&args.ply)?;
    say!("{}: {} Gaussians in the pose {:?}", args.ply.display(), scene.count, frame.id);
    Ok(())
}
