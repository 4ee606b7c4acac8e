//! `ghand pose`: writes or draws the mesh of a hand model in any pose and shape, or converts poses to ghand's own
//! format.

mod mesh_picture;

use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use clap::Args;
use ghand_avatar::framing::portrait;
use ghand_capture::cameras::named::read_named_camera;
use ghand_core::posing::pose_hand;
use ghand_core::{HandModel, Pose};
use ghand_hand_model::HandModelError;
use ghand_hand_model::files::glb::write_glb;
use ghand_hand_model::files::obj::write_obj;
use ghand_hand_model::shape_values::shape_from_text;
use ghand_motion::pose_sequence::DEFAULT_FPS;
use ghand_motion::pose_sequence::formats::ghand::{write_fitted_poses, write_poses};
use ghand_motion::{LandmarkFit, PoseFrame, PoseSequence};
use ghand_pictures::{Background, Picture, StillFormat, parse_background};
use glam::DVec3;

use crate::cli::{AdapterArgs, parse_size};
use crate::command_inputs::{CommandInputs, camera_file};
use crate::hand_model_file::HandModelReading;
use crate::pose_choice::{PoseReadingArgs, choose_frame};
use crate::say;
use ghand_pictures::blank_pictures::BlankPictures;

use mesh_picture::{PictureStyle, draw};

/// Default size of a picture, if neither the command line nor a camera gives one.
const DEFAULT_SIZE: [u32; 2] = [512, 512];

/// Command line of `ghand pose`.
#[derive(Debug, Args)]
#[command(group = clap::ArgGroup::new("output").required(true).multiple(true))]
pub struct PoseArgs {
    /// The hand model: MANO (.pkl, .npz), rigged glTF (.glb, .gltf; FILE:left is the left one of two), an avatar (.ghand),
    /// whose mesh and joints are used, or builtin or builtin-left; poses are written for its joints [default:
    /// builtin]
    #[arg(long, value_name = "FILE|NAME", visible_alias = "for")]
    hand_model: Option<PathBuf>,
    #[command(flatten)]
    reading: HandModelReading,
    /// A pose or a motion by name, or any file of poses listed in docs/poses.md: ghand's, a capture, MANO parameters,
    /// joints of WebXR or OpenXR, landmarks; its shape and translation are used, too [default: zeros]
    #[arg(long, value_name = "FILE|NAME")]
    pose: Option<String>,
    /// The hand's shape instead of the poses': names or numbers of shape directions with values,
    /// finger-length=2,hand-scale=-1, or values in order, 0.5,1,-2; `inspect` lists the names
    #[arg(long, value_name = "NAME=VALUE,...", allow_hyphen_values = true)]
    shape: Option<String>,
    #[command(flatten)]
    reading_poses: PoseReadingArgs,
    /// Frame of the file: its id or its number, counted from 0 [default: the first; for .json, all]
    #[arg(long, value_name = "N", requires = "pose")]
    frame: Option<String>,
    /// The mesh to write: .obj (vertices in the order of the model's file) or .glb; metres. Or .json: the poses
    /// themselves, as rotations of this model's joints
    #[arg(long, value_name = "FILE", group = "output")]
    out: Option<PathBuf>,
    /// A picture of the mesh to draw, .png or .exr (32-bit floats)
    #[arg(long, value_name = "FILE", group = "output")]
    picture: Option<PathBuf>,
    #[command(flatten)]
    look: LookArgs,
}

/// How the picture looks.
#[derive(Debug, Args)]
struct LookArgs {
    /// solid, wireframe (hidden lines removed), solid-wireframe, weights (one colour per joint, mixed by skinning
    /// weight), or weights=JOINT (one joint's weight: grey where it is 0, then violet to yellow; a name or number as
    /// `inspect` lists)
    #[arg(long, value_name = "STYLE", default_value = "solid", requires = "picture")]
    style: PictureStyle,
    /// A JSON file with one camera, such as examples/camera.json, or a camera of a capture, such as capture.json:cam03
    /// [default: one that sees the back of the hand]
    #[arg(long, value_name = "FILE[:ID]", requires = "picture")]
    camera: Option<PathBuf>,
    /// Size of the picture [default: the camera's, else 512x512]
    #[arg(long, value_name = "WxH", value_parser = parse_size, requires = "picture")]
    size: Option<[u32; 2]>,
    /// Colour behind the hand, display values from 0 to 1; or transparent
    #[arg(long, value_name = "R,G,B|transparent", value_parser = parse_background, default_value = "1,1,1")]
    #[arg(requires = "picture")]
    background: Background,
}

/// The kind of output that `--out` requests.
enum Output<'a> {
    Mesh(&'a Path, WriteMesh),
    Poses(&'a Path),
}

type WriteMesh = fn(&Path, &HandModel, &PoseFrame, &[DVec3]) -> Result<(), HandModelError>;

/// Poses the hand model, writes its mesh and draws it, or writes the poses.
///
/// # Errors
/// An error that names the file or the option and its problem.
pub fn run(args: &PoseArgs, adapter: &AdapterArgs) -> anyhow::Result<()> {
    let output = args.out.as_deref().map(output).transpose()?;
    let format = args.picture.as_deref().map(|path| StillFormat::of(path, "--picture")).transpose()?;
    let inputs = CommandInputs::default()
        .and(&args.hand_model)
        .and(args.reading_poses.inputs(args.pose.as_deref()))
        .and(args.look.camera.as_deref().map(camera_file));
    [("--out", &args.out), ("--picture", &args.picture)]
        .into_iter()
        .try_for_each(|(option, path)| path.as_ref().map_or(Ok(()), |path| inputs.refuse(option, path)))?;
    if let (Some(_), Some(Output::Mesh(..)) | None) = (args.reading_poses.fps, &output)
        && args.frame.is_none()
    {
        bail!("--fps: one pose is written, the first; give --frame, --out FILE.json, or omit --fps");
    }
    let file = args.reading.load(args.hand_model.as_ref())?;
    for warning in &file.warnings {
        log::warn!("{warning}");
    }
    let model = &file.model;
    let (mut sequence, fit) = sequence(args, model)?;
    if let Some(fit) = &fit {
        say!("{}", fit.to_string().trim_end());
    }
    if let Some(text) = &args.shape {
        let shape = shape_from_text(model, text).context("--shape")?;
        sequence.frames.iter_mut().for_each(|frame| frame.shape.clone_from(&shape));
    }
    if let Some(Output::Poses(path)) = output {
        if args.picture.is_some() {
            bail!(
                "--picture with --out {}: a picture shows one pose; use .obj or .glb, or omit one of the two options",
                path.display()
            );
        }
        if let Some(wanted) = &args.frame {
            sequence.frames = vec![chosen(args, sequence.frames, wanted)?];
        }
        match &fit {
            Some(fit) => write_fitted_poses(path, &sequence, fit, model)?,
            None => write_poses(path, &sequence, model)?,
        }
        say!("{}: {} frames at {} per second", path.display(), sequence.frames.len(), sequence.fps);
        return Ok(());
    }
    let frame = chosen(args, sequence.frames, args.frame.as_deref().unwrap_or("0"))?;
    let posed = pose_hand(model, &frame.shape, &frame.pose)
        .with_context(|| format!("{}: frame {:?}", args.pose.as_deref().unwrap_or("pose"), frame.id))?;
    // Drawn before anything is written, so that a failed drawing leaves no file.
    let picture = match (&args.picture, format) {
        (Some(path), Some(format)) => {
            Some((path, picture(&args.look, format, adapter, model, &frame.pose, &posed.vertices)?))
        }
        _ => None,
    };
    if let Some(Output::Mesh(path, write)) = output {
        write(path, model, &frame, &posed.vertices)
            .with_context(|| format!("{}: cannot write the mesh", path.display()))?;
        say!("{}: {} vertices, {} triangles", path.display(), model.vertices.len(), model.faces.len());
    }
    if let Some((path, picture)) = picture {
        let [width, height] = picture.size;
        picture.write(path)?;
        say!("{}: {width} x {height} pixels", path.display());
    }
    Ok(())
}

fn output(path: &Path) -> anyhow::Result<Output<'_>> {
    let ending = path.extension().and_then(|e| e.to_str()).map(str::to_ascii_lowercase);
    match ending.as_deref() {
        Some("obj") => Ok(Output::Mesh(path, |path, model, _, vertices| write_obj(path, model, vertices))),
        Some("glb") => {
            Ok(Output::Mesh(path, |path, model, frame, _| write_glb(path, model, &frame.shape, &frame.pose)))
        }
        Some("json") => Ok(Output::Poses(path)),
        _ => bail!("--out {}: must end in .obj, .glb or .json", path.display()),
    }
}

fn picture(
    look: &LookArgs,
    format: StillFormat,
    adapter: &AdapterArgs,
    model: &HandModel,
    pose: &Pose,
    vertices: &[DVec3],
) -> anyhow::Result<Picture> {
    let camera = match &look.camera {
        Some(path) => {
            let camera = read_named_camera(path)?;
            let [width, height] = look.size.unwrap_or([camera.width, camera.height]);
            camera.resized(width, height)
        }
        None => portrait(model, pose, vertices, look.size.unwrap_or(DEFAULT_SIZE)),
    };
    let mut picture = Picture::blank([camera.width, camera.height], look.background, format);
    draw(&adapter.open()?, model, vertices, &camera, &look.style, &mut picture)?;
    let mut blank = BlankPictures::default();
    blank.look(&picture, &camera, || vertices.iter().copied());
    blank.warn("the hand");
    Ok(picture.in_linear_light())
}

fn sequence(args: &PoseArgs, model: &HandModel) -> anyhow::Result<(PoseSequence, Option<LandmarkFit>)> {
    if let Some(text) = &args.pose {
        return args.reading_poses.load_with_fit(text, model);
    }
    if args.reading_poses.flat_mean && model.pose_space.is_none() {
        bail!("--flat-mean: {} is not a MANO model with a mean pose; omit --flat-mean", model.name);
    }
    let mut others = args.reading_poses.clone();
    others.flat_mean = false;
    others.refuse_without("--pose")?;
    // Zeros are the mean pose of a MANO model.
    let mut pose = Pose::rest(model.joint_count());
    if let (Some(space), false) = (&model.pose_space, args.reading_poses.flat_mean) {
        pose.rotations.iter_mut().skip(1).zip(&space.mean).for_each(|(rotation, mean)| *rotation += *mean);
    }
    let frames = vec![PoseFrame { id: "zeros".into(), pose, shape: vec![] }];
    let joint_names = model.joint_names.clone();
    Ok((PoseSequence { fps: DEFAULT_FPS, joint_names, frames, warnings: vec![] }, None))
}

fn chosen(args: &PoseArgs, frames: Vec<PoseFrame>, wanted: &str) -> anyhow::Result<PoseFrame> {
    choose_frame(frames, wanted).with_context(|| args.pose.clone().unwrap_or_default())
}
