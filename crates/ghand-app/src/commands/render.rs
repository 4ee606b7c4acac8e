//! `ghand render`: renders pictures and films of an avatar in any pose from any view.

mod avatar_colors;

use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use clap::Args;
use ghand_avatar::Scene;
use ghand_avatar::avatar::Avatar;
use ghand_avatar::framing::{orbit, posed_vertices, turntable};
use ghand_capture::cameras::named::read_named_camera;
use ghand_core::{Camera, Pose};
use ghand_motion::{PoseFrame, PoseSequence};
use ghand_pictures::{Background, Destination, Format, Series, Shot, parse_background, turn_rate};
use ghand_render::splat::{Purpose, band_rows};

use crate::baked::baked;
use crate::cli::{AdapterArgs, parse_count, parse_size};
use crate::command_inputs::{CommandInputs, camera_file};
use crate::lighting::Lighting;
use crate::pose_choice::{PoseReadingArgs, frame_number};
use crate::same_tracker::SameTrackerArgs;
use crate::say;
use ghand_pictures::blank_pictures::BlankPictures;

use avatar_colors::AvatarColors;

/// Default size of a picture, if neither the command line nor a camera gives one.
const DEFAULT_SIZE: [u32; 2] = [512, 512];

/// Command line of `ghand render`.
#[derive(Debug, Args)]
#[command(group = clap::ArgGroup::new("view").required(true))]
pub struct RenderArgs {
    /// The avatar, a .ghand file
    avatar: PathBuf,
    /// A pose or a motion by name, or any file of poses listed in docs/poses.md: ghand's, a capture, MANO parameters,
    /// joints of WebXR or OpenXR, landmarks
    #[arg(long, value_name = "FILE|NAME", default_value = "rest")]
    pose: String,
    #[command(flatten)]
    reading: PoseReadingArgs,
    #[command(flatten)]
    same_tracker: SameTrackerArgs,
    /// Only the frame with this id or number, counted from 0 [default: every frame of the file]
    #[arg(long, value_name = "ID")]
    frame: Option<String>,
    /// A JSON file with one camera, such as examples/camera.json, or a camera of a capture, such as capture.json:cam03
    #[arg(long, value_name = "FILE[:ID]", group = "view")]
    camera: Option<PathBuf>,
    /// This many views around the hand, of every frame
    #[arg(long, value_name = "N", group = "view", value_parser = parse_count)]
    turntable: Option<u32>,
    /// One view of each frame of a motion, while the camera goes around the hand this many times; negative: in the
    /// other direction
    #[arg(long, value_name = "TURNS", group = "view", num_args = 0..=1, default_missing_value = "1")]
    #[arg(allow_negative_numbers = true, value_parser = parse_turns)]
    orbit: Option<f64>,
    /// Size of the pictures [default: the camera's, else 512x512]
    #[arg(long, value_name = "WxH", value_parser = parse_size)]
    size: Option<[u32; 2]>,
    /// A folder for pictures such as frame-0012_view-03.png, which replace those of an earlier render; or one picture
    /// (.png, .exr in linear light) or film (.gif, .webm, .mp4). Missing folders are created
    #[arg(long, value_name = "DIR|FILE")]
    out: PathBuf,
    /// What the colours show: skin, or how much the training views saw of each place
    #[arg(long, value_enum, default_value_t)]
    show: AvatarColors,
    #[command(flatten)]
    light: Lighting,
    /// Draw the avatar baked, which is faster; it is baked first, unless it is beside the avatar already
    #[arg(long)]
    baked: bool,
    /// png or exr pictures, or one film: gif, or, with ffmpeg installed, webm or mp4 [default: what --out ends in, else
    /// png]
    #[arg(long, value_name = "FORMAT", value_parser = Format::parse)]
    format: Option<Format>,
    /// Colour behind the hand, display values from 0 to 1; or transparent: colours are multiplied by alpha in
    /// EXR only
    #[arg(long, value_name = "R,G,B|transparent", value_parser = parse_background, default_value = "0,0,0")]
    background: Background,
}

fn parse_turns(text: &str) -> Result<f64, String> {
    let turns = text.parse().ok().filter(|turns: &f64| turns.is_finite() && *turns != 0.0 && turns.abs() <= 1000.0);
    turns.ok_or_else(|| "must be a number of turns other than 0, such as 1, 0.5 or -2".into())
}

/// Renders the pictures. All input is read and checked before anything is written.
///
/// # Errors
/// An error that names the file or the option and its problem.
pub fn run(args: &RenderArgs, adapter: &AdapterArgs) -> anyhow::Result<()> {
    let destination = Destination::new(&args.out, args.format, stem(&args.pose))?;
    let light = &args.light;
    let inputs = CommandInputs::default()
        .and([&args.avatar])
        .and(args.reading.inputs(Some(&args.pose)))
        .and(args.camera.as_deref().map(camera_file))
        .and(light.input());
    destination.file().map_or(Ok(()), |path| inputs.refuse("--out", path))?;
    let mut avatar = args.show.apply_to(Avatar::load(&args.avatar)?, light)?;
    // The rate of a film of one pose is that of its views.
    let is_film = matches!(destination, Destination::Film(..));
    let sequence = match is_film {
        true => args.reading.load_with_fit(&args.pose, &avatar.model)?.0,
        false => args.reading.load(&args.pose, &avatar.model)?,
    };
    let sequence = args.same_tracker.apply(&args.pose, sequence, &avatar, &args.avatar)?;
    let fps = film_rate(args, &sequence);
    let frames = chosen_frames(args, sequence.frames)?;
    if args.orbit.is_some() && frames.len() == 1 {
        bail!("--orbit: there is only one frame; give a motion, or use --turntable");
    }
    if is_film && frames.len() > 1 && args.turntable.is_some_and(|views| views > 1) {
        bail!("--turntable: a film shows each frame from one view; use --orbit, or choose one frame with --frame");
    }
    let poses: Vec<&Pose> = frames.iter().map(|(_, frame)| &frame.pose).collect();
    let size = args.size.unwrap_or(DEFAULT_SIZE);
    let cameras: Vec<Vec<Camera>> = match (&args.camera, args.orbit) {
        (Some(path), _) => {
            let camera = read_named_camera(path)?;
            let [width, height] = args.size.unwrap_or([camera.width, camera.height]);
            vec![vec![camera.resized(width, height)]; poses.len()]
        }
        (None, Some(turns)) => {
            orbit(&avatar.model, &poses, turns, size).into_iter().map(|camera| vec![camera]).collect()
        }
        (None, None) => turntable(&avatar.model, &poses, args.turntable.unwrap_or(1) as usize, size),
    };
    let size = cameras.first().and_then(|c| c.first()).map_or(size, |c| [c.width, c.height]);
    let mut shots = Vec::new();
    let mut pictures: Vec<(&Pose, &Camera)> = Vec::new();
    for ((number, frame), views) in frames.iter().zip(&cameras) {
        for (view, camera) in views.iter().enumerate() {
            let view = args.turntable.is_some().then_some(view);
            shots.push(Shot { frame: Some(*number), id: Some(frame.id.clone()), view });
            pictures.push((&frame.pose, camera));
        }
    }
    let mut gpu = adapter.open()?;
    if args.baked {
        let played = gpu.retry_on_device_loss("baking", |gpu| baked(gpu, &args.avatar))?;
        avatar = args.show.apply_to(Avatar::load(&played)?, light)?;
    }
    // Outlives the device, so that written pictures need not be rendered again.
    let mut series = Series::new(&destination, &shots, size, args.background, fps)?;
    let mut blank = BlankPictures::default();
    gpu.retry_on_device_loss("rendering", |gpu| -> anyhow::Result<()> {
        let most = [size[0], band_rows(gpu, size)];
        let mut scene = Scene::new(gpu, &[&avatar], Purpose::Images, 1, most)?;
        while let Some((pose, camera)) = series.next().and_then(|number| pictures.get(number)) {
            scene.set_pose(gpu, 0, 0, pose)?;
            let mut picture = series.blank();
            scene.render_bands(gpu, 0, camera, args.background.color(), |row, band| picture.place([0, row], band))?;
            blank.look(&picture, camera, || posed_vertices(&avatar.model, pose));
            series.add(picture.in_linear_light())?;
        }
        Ok(())
    })?;
    blank.warn("the hand");
    say!("{}", series.finish()?);
    Ok(())
}

/// The frames to render, with their numbers in the file.
fn chosen_frames(args: &RenderArgs, frames: Vec<PoseFrame>) -> anyhow::Result<Vec<(usize, PoseFrame)>> {
    let Some(wanted) = &args.frame else { return Ok(frames.into_iter().enumerate().collect()) };
    let number = frame_number(&frames, wanted).with_context(|| args.pose.clone())?;
    Ok(frames.into_iter().enumerate().skip(number).take(1).collect())
}

/// Frame rate of a film: that of a motion, else one that makes a turn take a few seconds.
fn film_rate(args: &RenderArgs, sequence: &PoseSequence) -> f64 {
    if sequence.frames.len() > 1 && args.frame.is_none() {
        return sequence.fps;
    }
    args.reading.fps.unwrap_or_else(|| turn_rate(args.turntable.unwrap_or(1) as usize))
}

/// The name of a film of a named pose or a file.
fn stem(pose: &str) -> &str {
    Path::new(pose).file_stem().and_then(|stem| stem.to_str()).unwrap_or("film")
}
