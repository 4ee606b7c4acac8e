//! `ghand pose`: the mesh of a hand model in any pose and shape, as a file or as a picture.

use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use clap::Args;
use ghand_core::hand_model::glb::write_glb;
use ghand_core::hand_model::named_poses::POSE_NAMES;
use ghand_core::hand_model::obj::write_obj;
use ghand_core::posing::pose_hand;
use ghand_core::{HandModel, HandModelError, Pose};
use glam::DVec3;
use image::RgbImage;

use crate::camera_file::read_camera;
use crate::cli::{AdapterArgs, parse_color, parse_size};
use crate::commands::render::write_png;
use crate::framing::portrait;
use crate::hand_model_file::HandModelArgs;
use crate::mesh_picture::{PictureStyle, draw, over};
use crate::pose_file::{PosedFrame, choose_frame, poses};

/// Size of a picture when neither the command line nor a camera says.
const DEFAULT_SIZE: [u32; 2] = [512, 512];

/// Command line of `ghand pose`.
#[derive(Debug, Args)]
#[command(group = clap::ArgGroup::new("output").required(true).multiple(true))]
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
    #[arg(long, value_name = "FILE", group = "output")]
    out: Option<PathBuf>,
    /// A picture of the mesh to draw, .png
    #[arg(long, value_name = "FILE", group = "output")]
    picture: Option<PathBuf>,
    #[command(flatten)]
    look: LookArgs,
}

/// How the picture looks.
#[derive(Debug, Args)]
struct LookArgs {
    /// solid, wireframe (hidden lines removed), solid-wireframe, weights (a colour a joint, mixed by skinning weight), or
    /// weights=JOINT (one joint's weight from violet to yellow, grey where it is 0; a name or number as `inspect` lists)
    #[arg(long, value_name = "STYLE", default_value = "solid", requires = "picture")]
    style: PictureStyle,
    /// A JSON file with one camera as in a capture.json [default: one that sees the back of the hand]
    #[arg(long, value_name = "FILE", requires = "picture")]
    camera: Option<PathBuf>,
    /// Size of the picture [default: the camera's, else 512x512]
    #[arg(long, value_name = "WxH", value_parser = parse_size, requires = "picture")]
    size: Option<[u32; 2]>,
    /// Colour behind the hand, display values from 0 to 1
    #[arg(long, value_name = "R,G,B", value_parser = parse_color, default_value = "1,1,1", requires = "picture")]
    background: [f32; 3],
}

/// How a mesh is written.
type Write = fn(&Path, &HandModel, &[DVec3]) -> Result<(), HandModelError>;

/// Poses the hand model, writes its mesh and draws it.
///
/// # Errors
/// One that names the file or the option and what is wrong with it.
pub fn run(args: &PoseArgs, adapter: &AdapterArgs) -> anyhow::Result<()> {
    let mesh = args.out.as_ref().map(|path| Ok::<_, anyhow::Error>((path, writer(path)?))).transpose()?;
    if let Some(path) = args.picture.as_ref().filter(|p| p.extension().is_none_or(|e| e != "png")) {
        bail!("--picture {}: must end in .png", path.display());
    }
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
    // Drawn before the mesh is written: what cannot be drawn leaves no file.
    let picture = match &args.picture {
        Some(path) => Some((path, picture(&args.look, adapter, model, &frame.pose, &posed.vertices)?)),
        None => None,
    };
    if let Some((path, write)) = mesh {
        write(path, model, &posed.vertices).with_context(|| format!("{}: cannot write the mesh", path.display()))?;
        println!("{}: {} vertices, {} triangles", path.display(), model.vertices.len(), model.faces.len());
    }
    if let Some((path, picture)) = picture {
        write_png(path, &picture)?;
        println!("{}: {} x {} pixels", path.display(), picture.width(), picture.height());
    }
    Ok(())
}

fn writer(path: &Path) -> anyhow::Result<Write> {
    match path.extension().and_then(|e| e.to_str()) {
        Some("obj") => Ok(write_obj),
        Some("glb") => Ok(write_glb),
        _ => bail!("--out {}: must end in .obj or .glb", path.display()),
    }
}

fn picture(
    look: &LookArgs,
    adapter: &AdapterArgs,
    model: &HandModel,
    pose: &Pose,
    vertices: &[DVec3],
) -> anyhow::Result<RgbImage> {
    let camera = match &look.camera {
        Some(path) => {
            let camera = read_camera(path)?;
            let [width, height] = look.size.unwrap_or([camera.width, camera.height]);
            camera.resized(width, height)
        }
        None => portrait(model, pose, vertices, look.size.unwrap_or(DEFAULT_SIZE)),
    };
    let image = draw(&adapter.open()?, model, vertices, &camera, &look.style)?;
    over(&image, look.background)
}

fn frame(args: &PoseArgs, model: &HandModel) -> anyhow::Result<PosedFrame> {
    let Some(text) = &args.pose else {
        return Ok(PosedFrame { id: "zeros".into(), pose: Pose::rest(model.joint_count()), shape: vec![] });
    };
    choose_frame(poses(text, model)?, args.frame.as_deref().unwrap_or("0")).with_context(|| text.clone())
}
