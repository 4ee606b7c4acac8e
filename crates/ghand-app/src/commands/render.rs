//! `ghand render`: pictures of an avatar in any pose from any view.

use std::io::Cursor;
use std::path::{Path, PathBuf};

use anyhow::Context;
use clap::Args;
use ghand_avatar::avatar::Avatar;
use ghand_avatar::renderer::AvatarRenderer;
use ghand_core::atomic_file::write_atomically;
use ghand_core::{Camera, Pose};
use ghand_data::PoseFrame;
use ghand_data::camera_file::read_camera;
use ghand_render::splat::{Image, Purpose};
use image::{ImageFormat, RgbImage};

use crate::cli::{AdapterArgs, parse_color, parse_size};
use crate::framing::turntable;
use crate::pose_choice::{PoseReadingArgs, choose_frame};
use crate::say;

/// Size of a picture when neither the command line nor a camera says.
const DEFAULT_SIZE: [u32; 2] = [512, 512];

/// Command line of `ghand render`.
#[derive(Debug, Args)]
#[command(group = clap::ArgGroup::new("view").required(true))]
pub struct RenderArgs {
    /// The avatar, a .ghand file
    avatar: PathBuf,
    /// A pose or a motion by name, or a file of poses: ghand's, a capture.json, MANO parameters, joints of WebXR or OpenXR, or
    /// MediaPipe's world landmarks
    #[arg(long, value_name = "FILE|NAME", default_value = "rest")]
    pose: String,
    #[command(flatten)]
    reading: PoseReadingArgs,
    /// Only the frame of this id or, counted from 0, number [default: every frame of the file]
    #[arg(long, value_name = "ID")]
    frame: Option<String>,
    /// A JSON file with one camera as in a capture.json
    #[arg(long, value_name = "FILE", group = "view")]
    camera: Option<PathBuf>,
    /// This many views around the hand
    #[arg(long, value_name = "N", group = "view", value_parser = clap::value_parser!(u32).range(1..=10_000))]
    turntable: Option<u32>,
    /// Size of the pictures [default: the camera's, for a turntable 512x512]
    #[arg(long, value_name = "WxH", value_parser = parse_size)]
    size: Option<[u32; 2]>,
    /// Folder for the pictures 0000.png, 0001.png, ...; made if it is not there
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Colour behind the hand, display values from 0 to 1
    #[arg(long, value_name = "R,G,B", value_parser = parse_color, default_value = "0,0,0")]
    background: [f32; 3],
}

/// Renders the pictures. All input is read and checked before anything is written.
///
/// # Errors
/// One that names the file or the option and what is wrong with it.
pub fn run(args: &RenderArgs, adapter: &AdapterArgs) -> anyhow::Result<()> {
    let avatar = Avatar::load(&args.avatar)?;
    let frames = chosen_frames(args, &avatar)?;
    let poses: Vec<&Pose> = frames.iter().map(|f| &f.pose).collect();
    let cameras = match &args.camera {
        Some(path) => {
            let camera = read_camera(path)?;
            let [width, height] = args.size.unwrap_or([camera.width, camera.height]);
            vec![vec![camera.resized(width, height)]; poses.len()]
        }
        None => {
            let views = args.turntable.unwrap_or(1) as usize;
            turntable(&avatar.model, &poses, views, args.size.unwrap_or(DEFAULT_SIZE))
        }
    };
    let size = cameras.first().and_then(|c| c.first()).map_or(DEFAULT_SIZE, |c| [c.width, c.height]);
    let mut gpu = adapter.open()?;
    let pictures: Vec<(&Pose, &Camera)> =
        poses.iter().zip(&cameras).flat_map(|(pose, views)| views.iter().map(move |camera| (*pose, camera))).collect();
    // Outlives the device: what is written need not be rendered again.
    let mut number = 0;
    gpu.persist("rendering", |gpu| -> anyhow::Result<()> {
        let mut renderer = AvatarRenderer::new(gpu, &avatar, Purpose::Images, 1, size)?;
        while let Some((pose, camera)) = pictures.get(number) {
            renderer.set_pose(gpu, 0, pose)?;
            let image = renderer.render(gpu, 0, camera, args.background)?;
            std::fs::create_dir_all(&args.out)
                .with_context(|| format!("{}: cannot make the folder", args.out.display()))?;
            write_png(&args.out.join(format!("{number:04}.png")), &to_rgb8(&image)?)?;
            number += 1;
        }
        Ok(())
    })?;
    say!("{number} pictures of {} x {} pixels in {}", size[0], size[1], args.out.display());
    Ok(())
}

fn chosen_frames(args: &RenderArgs, avatar: &Avatar) -> anyhow::Result<Vec<PoseFrame>> {
    let frames = args.reading.load(&args.pose, &avatar.model)?.frames;
    match &args.frame {
        None => Ok(frames),
        Some(wanted) => Ok(vec![choose_frame(frames, wanted).with_context(|| args.pose.clone())?]),
    }
}

/// The image as 8-bit display values.
///
/// # Errors
/// One if the image has not as many pixels as it says.
pub fn to_rgb8(image: &Image) -> anyhow::Result<RgbImage> {
    let bytes =
        image.rgba.iter().flat_map(|[r, g, b, _]| [*r, *g, *b].map(|v| (v.clamp(0.0, 1.0) * 255.0).round() as u8));
    RgbImage::from_raw(image.width, image.height, bytes.collect()).context("the device gave an image of the wrong size")
}

/// Writes a picture as PNG, whole or not at all.
///
/// # Errors
/// One that names the file.
pub fn write_png(path: &Path, picture: &RgbImage) -> anyhow::Result<()> {
    let context = || format!("{}: cannot write the picture", path.display());
    let mut png = Cursor::new(Vec::new());
    picture.write_to(&mut png, ImageFormat::Png).with_context(context)?;
    write_atomically(path, png.get_ref()).with_context(context)
}
