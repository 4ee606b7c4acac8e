//! `ghand export`: writes a posed avatar as a scene of Gaussians, or a hand model as a rigged mesh, for other programs.

use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use clap::Args;
use ghand_avatar::scene_files::SplatScene;
use ghand_avatar::{Avatar, PosedHand};
use ghand_files::atomic_file::check_writable;
use ghand_hand_model::files::rigged_glb::write_rigged_glb;
use ghand_hand_model::joints::axes::why_without_axes;
use ghand_hand_model::pose_correctives::fit_pose_directions;
use ghand_render::DeviceError;

use crate::cli::AdapterArgs;
use crate::command_inputs::CommandInputs;
use crate::hand_model_args::HandModelArgs;
use crate::pose_choice::{PoseReadingArgs, choose_frame};
use crate::say;

/// Command line of `ghand export`.
#[derive(Debug, Args)]
#[command(group = clap::ArgGroup::new("output").required(true))]
pub struct ExportArgs {
    /// The avatar, a .ghand file; for --glb also a hand model: MANO (.pkl, .npz), rigged glTF (.glb, .gltf), builtin or
    /// builtin-left
    #[arg(value_name = "AVATAR|HAND")]
    subject: PathBuf,
    /// A pose or a motion by name, or a file of poses, as for `render` [default: rest]
    #[arg(long, value_name = "FILE|NAME", conflicts_with = "glb")]
    pose: Option<String>,
    #[command(flatten)]
    reading_poses: PoseReadingArgs,
    /// Frame of the file or motion: its id or its number, counted from 0 [default: the first]
    #[arg(long, value_name = "ID", requires = "pose")]
    frame: Option<String>,
    /// The scene to write: a .ply file in the layout of 3D Gaussian Splatting; metres. Opacities of 1 are written as
    /// 0.99999
    #[arg(long, value_name = "FILE", group = "output")]
    ply: Option<PathBuf>,
    /// The rigged hand to write: a .glb file with skeleton, skinning weights and shapes, at rest; metres. Pose
    /// correctives are in its extras, where ghand finds them
    #[arg(long, value_name = "FILE", group = "output")]
    glb: Option<PathBuf>,
    /// Fit pose correctives that keep the volume of bent joints, in place of the hand's own
    #[arg(long, conflicts_with = "ply")]
    fit_pose_correctives: bool,
    #[command(flatten)]
    reading: HandModelArgs,
}

/// Writes what the arguments ask for. All input is read and checked before anything is written.
///
/// # Errors
/// An error that names the file or the option and its problem.
pub fn run(args: &ExportArgs, adapter: &AdapterArgs) -> anyhow::Result<()> {
    let inputs = CommandInputs::default()
        .and([&args.subject])
        .and(args.reading_poses.inputs(args.pose.as_deref()))
        .and(args.reading.reading().inputs());
    [("--ply", &args.ply), ("--glb", &args.glb)]
        .into_iter()
        .try_for_each(|(option, path)| path.as_ref().map_or(Ok(()), |path| inputs.refuse(option, path)))?;
    match (&args.ply, &args.glb) {
        (Some(ply), _) => scene(args, ply, adapter),
        (None, Some(glb)) => rigged_hand(args, glb),
        (None, None) => bail!("give --ply or --glb"),
    }
}

/// Checks that a file's name ends as its format's do, and that it can be written.
fn check_output(option: &str, path: &Path, ending: &str) -> anyhow::Result<()> {
    if path.extension().is_none_or(|found| !found.eq_ignore_ascii_case(ending)) {
        bail!("{option} {}: must end in .{ending}", path.display());
    }
    check_writable(path).with_context(|| format!("{option} {}: cannot be written", path.display()))
}

/// Poses the avatar and writes its Gaussians.
fn scene(args: &ExportArgs, path: &Path, adapter: &AdapterArgs) -> anyhow::Result<()> {
    args.reading.reading().refuse_for("--ply writes an avatar")?;
    check_output("--ply", path, "ply")?;
    let avatar = Avatar::load(&args.subject)?;
    let pose = args.pose.as_deref().unwrap_or("rest");
    let frames = args.reading_poses.load(pose, &avatar.model)?.frames;
    let wanted = args.frame.as_deref().unwrap_or("0");
    let frame = choose_frame(frames, wanted).with_context(|| pose.to_owned())?;
    let scene = match adapter.open() {
        Ok(mut gpu) => gpu.retry_on_device_loss("the export", |gpu| -> anyhow::Result<SplatScene> {
            let mut hand = PosedHand::new(gpu, &avatar)?;
            hand.set_pose(gpu, &frame.pose)?;
            Ok(hand.splats(gpu)?)
        })?,
        Err(DeviceError::NoAdapter { found, .. }) if found.is_empty() => {
            say!("there is no graphics adapter: the processor poses the avatar");
            PosedHand::splats_on_host(&avatar, &frame.pose)?
        }
        Err(error) => return Err(error.into()),
    };
    scene.write(path)?;
    say!("{}: {} Gaussians in the pose {:?}", path.display(), scene.count, frame.id);
    Ok(())
}

/// Writes the hand with its skeleton.
fn rigged_hand(args: &ExportArgs, path: &Path) -> anyhow::Result<()> {
    args.reading_poses.refuse_without("--pose and --ply")?;
    if args.frame.is_some() {
        bail!("--frame: --glb writes the hand at rest; give --ply, or omit --frame");
    }
    check_output("--glb", path, "glb")?;
    let file = args.reading.reading().load(Some(&args.subject))?;
    for warning in &file.warnings {
        log::warn!("{warning}");
    }
    let mut model = file.model;
    if args.fit_pose_correctives {
        model.pose_directions = fit_pose_directions(&model).with_context(|| {
            let cause = why_without_axes(&model.joint_names);
            format!("--fit-pose-correctives: {}: {cause}", args.subject.display())
        })?;
    }
    write_rigged_glb(path, &model)?;
    say!(
        "{}: {} vertices, {} joints, {} shapes, {} pose directions",
        path.display(),
        model.vertices.len(),
        model.joint_count(),
        model.shape_count(),
        model.pose_directions.len() / model.vertices.len().max(1)
    );
    Ok(())
}
