//! `ghand-lab explain`: pictures and numbers of what an avatar has learned: shape bases, blend coefficients, residual skinning
//! weights and the residual skeleton.

mod avatar_properties;
mod figures;
mod output;
mod page;
mod sections;
mod skeleton_picture;
mod statistics;
mod surface_normals;

use std::path::PathBuf;

use anyhow::{Context, bail};
use clap::Args;
use ghand_avatar::{Avatar, PropertyTables};
use ghand_hand_model::named_poses::POSE_NAMES;
use ghand_motion::PoseFrame;
use ghand_render::Gpu;

use avatar_properties::AvatarProperties;
use figures::Figures;
use ghand_app::cli::AdapterArgs;
use ghand_app::pose_choice::{PoseReadingArgs, pose_by_name};
use ghand_app::say;
use output::OutputFolder;
use page::{Section, sheet};

/// Command line of `ghand-lab explain`.
#[derive(Debug, Args)]
pub struct ExplainArgs {
    /// The avatar, a .ghand file
    avatar: PathBuf,
    /// Poses to explain it in: a motion by name, or any file or folder of poses, as for `render`; of more than 24, an even
    /// selection [default: all poses by name]
    #[arg(long, value_name = "FILE|NAME")]
    poses: Option<String>,
    #[command(flatten)]
    reading: PoseReadingArgs,
    /// Folder for explain.png, which has all pictures, the single pictures, and explain.json
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Replace the files of an earlier run
    #[arg(long)]
    force: bool,
}

/// Most poses.
const MOST_POSES: usize = 24;

/// Writes pictures and numbers. All input is read and checked before anything is written.
///
/// # Errors
/// An error that names the file or the option and its problem.
pub fn run(args: &ExplainArgs, adapter: &AdapterArgs) -> anyhow::Result<()> {
    let avatar = Avatar::load(&args.avatar)?;
    if matches!(avatar.tables, PropertyTables::Baked(_)) {
        bail!("{}: is baked; explain the avatar that it was baked from", args.avatar.display());
    }
    let frames = chosen_poses(args, &avatar)?;
    let output = OutputFolder::check(&args.out, args.force)?;
    let mut gpu = adapter.open()?;
    let (figures, sections) = gpu.retry_on_device_loss("the explanation", |gpu| explain(gpu, &avatar, &frames))?;
    let title = format!("What {} has learned", file_name(args));
    let picture = sheet(&title, &sections);
    let count = output.write(&args.avatar, &figures, &sections, &picture)?;
    say!("{}", figures.summary());
    say!("{}: all pictures in explain.png, {count} single ones, explain.json", args.out.display());
    Ok(())
}

fn explain(gpu: &Gpu, avatar: &Avatar, frames: &[PoseFrame]) -> anyhow::Result<(Figures, Vec<Section>)> {
    let explained = AvatarProperties::read(gpu, avatar, frames)?;
    let figures = Figures::new(avatar, &explained);
    let sections = sections::draw(gpu, avatar, &explained, &figures)?;
    Ok((figures, sections))
}

/// The poses of the command line.
fn chosen_poses(args: &ExplainArgs, avatar: &Avatar) -> anyhow::Result<Vec<PoseFrame>> {
    let Some(poses) = &args.poses else {
        args.reading.refuse_without("--poses")?;
        let by_name = |name: &&str| {
            let pose = pose_by_name(name, &avatar.model).context("--poses: is missing")?;
            Ok(PoseFrame { id: (*name).to_owned(), pose, shape: vec![] })
        };
        return POSE_NAMES.iter().map(by_name).collect();
    };
    let frames = args.reading.load(poses, &avatar.model)?.frames;
    if frames.is_empty() {
        bail!("{poses}: has no poses");
    }
    let count = frames.len();
    let chosen = count.min(MOST_POSES);
    if chosen < count {
        say!("{poses}: {chosen} of its {count} poses, evenly chosen");
    }
    // With rounding, the first and the last pose are among them.
    let steps = chosen.saturating_sub(1).max(1);
    let wanted: Vec<usize> = (0..chosen).map(|k| (k * (count - 1) + steps / 2) / steps).collect();
    Ok(frames.into_iter().enumerate().filter(|(number, _)| wanted.contains(number)).map(|(_, frame)| frame).collect())
}

fn file_name(args: &ExplainArgs) -> String {
    args.avatar.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned())
}
