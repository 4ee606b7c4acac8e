//! A posed avatar as a scene of Gaussians, or each frame of a motion.

use std::path::{Path, PathBuf};

use anyhow::Context;
use ghand_avatar::scene_files::SplatScene;
use ghand_avatar::{Avatar, PosedHand};
use ghand_core::Pose;
use ghand_files::atomic_file::check_writable;

use super::ExportArgs;
use super::format::{ExportFormat, numbered};
use crate::cli::AdapterArgs;
use crate::command_inputs::CommandInputs;
use crate::say;

/// Poses the avatar and writes its Gaussians.
///
/// # Errors
/// An error that names the file or the option and its problem.
pub fn write(
    args: &ExportArgs,
    format: ExportFormat,
    out: &Path,
    inputs: &CommandInputs,
    adapter: &AdapterArgs,
) -> anyhow::Result<()> {
    let avatar = args.avatar()?;
    let frames = args.frames(args.only_pose()?, &avatar)?.frames;
    let paths: Vec<PathBuf> = match frames.len() {
        1 => vec![out.to_owned()],
        count => (0..count).map(|frame| numbered(out, frame)).collect(),
    };
    for path in &paths {
        inputs.refuse("--out", path)?;
        check_writable(path).with_context(|| format!("--out {}: cannot be written", path.display()))?;
    }
    let poses: Vec<&Pose> = frames.iter().map(|frame| &frame.pose).collect();
    let mut count = 0;
    // A device that is lost is asked again only for the frames that are missing.
    let mut left = paths.iter();
    posed(&avatar, &poses, adapter, &mut |scene| {
        let Some(path) = left.next() else { return Ok(()) };
        count = scene.count;
        match format {
            ExportFormat::Spz => scene.write_spz(path)?,
            _ => args.sh_degree.map_or(scene.clone(), |degree| scene.with_degree(degree)).write(path)?,
        }
        Ok(())
    })?;
    match (&frames[..], &paths[..]) {
        ([frame], [path]) => say!("{}: {count} Gaussians in the pose {:?}", path.display(), frame.id),
        (_, [first, .., last]) => {
            say!("{} to {}: {} frames of {count} Gaussians", first.display(), last.display(), paths.len());
        }
        _ => {}
    }
    Ok(())
}

/// Hands on the Gaussians of each pose, from the device or, without one, from the processor.
///
/// # Errors
/// An error if the device fails or a pose does not fit; the first of `take`.
pub fn posed(
    avatar: &Avatar,
    poses: &[&Pose],
    adapter: &AdapterArgs,
    take: &mut dyn FnMut(&SplatScene) -> anyhow::Result<()>,
) -> anyhow::Result<()> {
    match adapter.open_if_any()? {
        Ok(mut gpu) => {
            let mut done = 0;
            gpu.retry_on_device_loss("the export", |gpu| -> anyhow::Result<()> {
                let mut hand = PosedHand::new(gpu, avatar)?;
                while let Some(pose) = poses.get(done) {
                    hand.set_pose(gpu, pose)?;
                    take(&hand.splats(gpu)?)?;
                    done += 1;
                }
                Ok(())
            })
        }
        Err(_) => {
            say!("there is no graphics adapter: the processor poses the avatar");
            poses.iter().try_for_each(|pose| take(&PosedHand::splats_on_host(avatar, pose)?))
        }
    }
}
