//! `ghand pose`: the mesh of a hand model in any pose and shape, or poses of any kind as ghand's own.

use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use clap::Args;
use ghand_core::hand_model::glb::write_glb;
use ghand_core::hand_model::obj::write_obj;
use ghand_core::posing::pose_hand;
use ghand_core::{HandModel, HandModelError, Pose};
use ghand_data::pose_sequence::DEFAULT_FPS;
use ghand_data::pose_sequence::ghand::write_poses;
use ghand_data::{PoseFrame, PoseSequence};
use glam::DVec3;

use crate::hand_model_file::HandModelArgs;
use crate::pose_choice::{PoseReadingArgs, choose_frame};

/// Command line of `ghand pose`.
#[derive(Debug, Args)]
pub struct PoseArgs {
    /// The hand model: MANO (.pkl, .npz) or rigged glTF (.glb, .gltf) [default: the built-in hand]
    #[arg(long, value_name = "FILE")]
    hand_model: Option<PathBuf>,
    #[command(flatten)]
    reading: HandModelArgs,
    /// A pose or a motion by name, or a file of poses: ghand's, a capture.json, MANO parameters, joints of WebXR or OpenXR, or
    /// MediaPipe's world landmarks; its shape and translation are used, too [default: zeros]
    #[arg(long, value_name = "FILE|NAME")]
    pose: Option<String>,
    #[command(flatten)]
    reading_poses: PoseReadingArgs,
    /// Which frame of the file: its id or, counted from 0, its number [default: the first; for .json, all]
    #[arg(long, value_name = "N", requires = "pose")]
    frame: Option<String>,
    /// The mesh to write: .obj (vertices in the order of the model's file) or .glb; metres. Or .json: the poses themselves, as
    /// rotations of this model's joints
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
}

type WriteMesh = fn(&Path, &HandModel, &[DVec3]) -> Result<(), HandModelError>;

/// Poses the hand model and writes its mesh, or writes the poses.
///
/// # Errors
/// One that names the file or the option and what is wrong with it.
pub fn run(args: &PoseArgs) -> anyhow::Result<()> {
    let write_mesh = match args.out.extension().and_then(|e| e.to_str()) {
        Some("obj") => Some(write_obj as WriteMesh),
        Some("glb") => Some(write_glb as WriteMesh),
        Some("json") => None,
        _ => bail!("--out {}: must end in .obj, .glb or .json", args.out.display()),
    };
    let file = args.reading.load(args.hand_model.as_ref())?;
    for warning in &file.warnings {
        log::warn!("{warning}");
    }
    let model = &file.model;
    let mut sequence = sequence(args, model)?;
    let Some(write_mesh) = write_mesh else {
        if let Some(wanted) = &args.frame {
            sequence.frames = vec![chosen(args, sequence.frames, wanted)?];
        }
        write_poses(&args.out, &sequence)?;
        println!("{}: {} frames at {} a second", args.out.display(), sequence.frames.len(), sequence.fps);
        return Ok(());
    };
    let frame = chosen(args, sequence.frames, args.frame.as_deref().unwrap_or("0"))?;
    let posed = pose_hand(model, &frame.shape, &frame.pose)
        .with_context(|| format!("{}: frame {:?}", args.pose.as_deref().unwrap_or("pose"), frame.id))?;
    write_mesh(&args.out, model, &posed.vertices)
        .with_context(|| format!("{}: cannot write the mesh", args.out.display()))?;
    println!("{}: {} vertices, {} triangles", args.out.display(), model.vertices.len(), model.faces.len());
    Ok(())
}

fn sequence(args: &PoseArgs, model: &HandModel) -> anyhow::Result<PoseSequence> {
    if let Some(text) = &args.pose {
        return args.reading_poses.load(text, model);
    }
    // Zeros of a MANO model are its mean pose.
    let mut pose = Pose::rest(model.joint_count());
    if let (Some(space), false) = (&model.pose_space, args.reading_poses.flat_mean) {
        pose.rotations.iter_mut().skip(1).zip(&space.mean).for_each(|(rotation, mean)| *rotation += *mean);
    }
    let frames = vec![PoseFrame { id: "zeros".into(), pose, shape: vec![] }];
    Ok(PoseSequence { fps: DEFAULT_FPS, joint_names: model.joint_names.clone(), frames, warnings: vec![] })
}

fn chosen(args: &PoseArgs, frames: Vec<PoseFrame>, wanted: &str) -> anyhow::Result<PoseFrame> {
    choose_frame(frames, wanted).with_context(|| args.pose.clone().unwrap_or_default())
}
