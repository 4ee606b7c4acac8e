//! `ghand pose`: the mesh of a hand model in any pose and shape.

use std::path::PathBuf;

use anyhow::{Context, bail};
use clap::Args;
use ghand_core::hand_model::glb::write_glb;
use ghand_core::hand_model::named_poses::POSE_NAMES;
use ghand_core::hand_model::obj::write_obj;
use ghand_core::posing::pose_hand;
use ghand_core::{HandModel, Pose};

use crate::hand_model_file::HandModelArgs;
use crate::pose_file::{PosedFrame, choose_frame, poses};

/// Command line of `ghand pose`.
#[derive(Debug, Args)]
pub struct PoseArgs {
    /// The hand model: MANO (.pkl, .npz) or rigged glTF (.glb, .gltf) [default: the built-in hand]
    #[arg(long, value_name = "FILE")]
    hand_model: Option<PathBuf>,
    #[command(flatten)]
    reading: HandModelArgs,
    /// A JSON file of poses, or a capture.json, or a pose's name; its shape and translation are used, too [default: zeros]
    #[arg(long, value_name = "FILE|NAME")]
    pose: Option<String>,
    /// Which frame of the file: its id or, counted from 0, its number [default: the first]
    #[arg(long, value_name = "N", requires = "pose")]
    frame: Option<String>,
    /// Take the pose as measured from the flat hand: a MANO model's mean pose is not added
    #[arg(long)]
    flat_mean: bool,
    /// The mesh to write: .obj (vertices in the order of the model's file) or .glb; metres
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
}

/// Poses the hand model and writes its mesh.
///
/// # Errors
/// One that names the file or the option and what is wrong with it.
pub fn run(args: &PoseArgs) -> anyhow::Result<()> {
    let write = match args.out.extension().and_then(|e| e.to_str()) {
        Some("obj") => write_obj,
        Some("glb") => write_glb,
        _ => bail!("--out {}: must end in .obj or .glb", args.out.display()),
    };
    let file = args.reading.load(args.hand_model.as_ref())?;
    for warning in &file.warnings {
        log::warn!("{warning}");
    }
    let model = &file.model;
    let mut frame = frame(args, model)?;
    let is_named = args.pose.as_deref().is_some_and(|name| POSE_NAMES.contains(&name));
    // A pose by name is made for the flat hand.
    if let (Some(space), false) = (&model.pose_space, args.flat_mean || is_named) {
        frame.pose.rotations.iter_mut().skip(1).zip(&space.mean).for_each(|(rotation, mean)| *rotation += *mean);
    }
    let posed = pose_hand(model, &frame.shape, &frame.pose)
        .with_context(|| format!("{}: frame {:?}", args.pose.as_deref().unwrap_or("pose"), frame.id))?;
    write(&args.out, model, &posed.vertices)
        .with_context(|| format!("{}: cannot write the mesh", args.out.display()))?;
    println!("{}: {} vertices, {} triangles", args.out.display(), model.vertices.len(), model.faces.len());
    Ok(())
}

fn frame(args: &PoseArgs, model: &HandModel) -> anyhow::Result<PosedFrame> {
    let Some(text) = &args.pose else {
        return Ok(PosedFrame { id: "zeros".into(), pose: Pose::rest(model.joint_count()), shape: vec![] });
    };
    choose_frame(poses(text, model)?, args.frame.as_deref().unwrap_or("0")).with_context(|| text.clone())
}
