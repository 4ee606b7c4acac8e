//! `viewer`: look at an avatar in any pose from any side.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::Parser;
use ghand_app::bare_hand::bare_hand;
use ghand_app::cli::{self, AdapterArgs, parse_size};
use ghand_app::pose_choice::PoseReadingArgs;
use ghand_app::train_run::run_folder::last_avatar;
use ghand_app::viewer::app::Viewer;
use ghand_app::viewer::screenshot::screenshot;
use ghand_app::viewer::window;
use ghand_avatar::Avatar;
use ghand_core::Pose;

/// Look at an animatable hand avatar
#[derive(Debug, Parser)]
#[command(version)]
struct Arguments {
    /// The avatar, a .ghand file [default: the last trained one of out/train, out/train-2, ..., else a bare hand]
    avatar: Option<PathBuf>,
    /// The pose at first, or what to play: a pose or a motion by name, or a file of poses of any kind that `ghand render` takes
    #[arg(long, value_name = "FILE|NAME", default_value = "rest")]
    pose: String,
    #[command(flatten)]
    reading: PoseReadingArgs,
    /// Write a picture of the viewer to this PNG file instead of opening a window; needs no display
    #[arg(long, value_name = "FILE")]
    screenshot: Option<PathBuf>,
    /// Size of the screenshot [default: 1280x800]
    #[arg(long, value_name = "WxH", value_parser = parse_size, requires = "screenshot")]
    size: Option<[u32; 2]>,
    #[command(flatten)]
    adapter: AdapterArgs,
}

fn main() -> ExitCode {
    cli::run(run)
}

fn run(arguments: Arguments) -> anyhow::Result<()> {
    if arguments.screenshot.is_none() {
        window::check_display()?;
    }
    let (avatar, source) = avatar(arguments.avatar.as_deref())?;
    let sequence = arguments.reading.load(&arguments.pose, &avatar.model)?;
    let pose = sequence.frames.first().map_or_else(|| Pose::rest(avatar.model.joint_count()), |f| f.pose.clone());
    let gpu = arguments.adapter.open()?;
    let mut viewer = Viewer::new(&gpu, avatar, source.clone(), pose)?;
    if sequence.frames.len() > 1 {
        // A picture of the viewer shows the first frame.
        viewer.play(arguments.pose.clone(), sequence, arguments.screenshot.is_none());
    }
    match &arguments.screenshot {
        Some(path) => screenshot(&mut viewer, arguments.size.unwrap_or(window::WINDOW_SIZE), path),
        None => window::open(&mut viewer, &format!("ghand - {source}")),
    }
}

/// The avatar to show and where it is from.
fn avatar(path: Option<&Path>) -> anyhow::Result<(Avatar, String)> {
    match path.map(Path::to_owned).or_else(last_avatar) {
        Some(path) => Ok((Avatar::load(&path)?, path.display().to_string())),
        None => Ok((bare_hand()?, "no avatar trained yet: bare hand".into())),
    }
}
