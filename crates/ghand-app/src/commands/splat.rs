//! `ghand splat`: renders any scene of Gaussians, with the gradient of its pixels.

use std::collections::HashMap;
use std::io::Cursor;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail, ensure};
use bytemuck::cast_slice;
use clap::Args;
use ghand_avatar::scene_files::SplatScene;
use ghand_avatar::scene_framing::{UpAxis, scene_turntable};
use ghand_capture::cameras::named::read_named_camera;
use ghand_core::Camera;
use ghand_files::atomic_file::write_atomically;
use ghand_files::input_file;
use ghand_pictures::{Background, Destination, Format, Series, Shot, parse_background, turn_rate};
use ghand_render::splat::{Purpose, SplatModel, SplatOptions, Splatter, View, band_rows};
use ghand_render::{Gpu, buffers};
use image::ImageFormat;
use safetensors::Dtype;
use safetensors::tensor::TensorView;

use crate::cli::{AdapterArgs, parse_count, parse_size};
use crate::command_inputs::{CommandInputs, camera_file};
use crate::pose_choice::parse_fps;
use crate::say;
use crate::scene_file::read_scene_file;
use ghand_pictures::blank_pictures::BlankPictures;

/// Default size of a picture, if neither the command line nor a camera gives one.
const DEFAULT_SIZE: [u32; 2] = [512, 512];

/// Command line of `ghand splat`.
#[derive(Debug, Args)]
#[command(group = clap::ArgGroup::new("view").required(true))]
pub struct SplatArgs {
    /// The scene: a 3D Gaussian Splatting .ply file, also a compressed one, a .spz or a .splat
    scene: PathBuf,
    /// A JSON file with one camera, such as examples/camera.json, or a camera of a capture, such as capture.json:cam03
    #[arg(long, value_name = "FILE[:ID]", group = "view")]
    camera: Option<PathBuf>,
    /// This many views around the scene; distant outliers are ignored
    #[arg(long, value_name = "N", group = "view", value_parser = parse_count)]
    turntable: Option<u32>,
    /// The scene's axis that points up in a turntable: x, y, z, -x, -y or -z [default: -y]
    #[arg(long, value_name = "AXIS", allow_hyphen_values = true)]
    up: Option<UpAxis>,
    /// Size of the pictures [default: the camera's, else 512x512]
    #[arg(long, value_name = "WxH", value_parser = parse_size)]
    size: Option<[u32; 2]>,
    /// A picture: .exr (floats: colour over the background, and coverage) or .png (8 bits); a film of a turntable
    /// (.gif, .webm, .mp4); or a folder for pictures such as view-03.png, which replace those of an earlier render
    #[arg(long, value_name = "FILE|DIR")]
    out: PathBuf,
    /// png or exr pictures, or one film: gif, or, with ffmpeg installed, webm or mp4 [default: what --out ends in, else
    /// png]
    #[arg(long, value_name = "FORMAT", value_parser = Format::parse)]
    format: Option<Format>,
    /// Pictures per second of a film [default: one turn in 4 seconds, at most 30]
    #[arg(long, value_name = "N", value_parser = parse_fps)]
    fps: Option<f64>,
    /// Colour behind the scene, display values from 0 to 1; or transparent: colours are not multiplied by alpha, not
    /// even in EXR
    #[arg(long, value_name = "R,G,B|transparent", value_parser = parse_background, default_value = "0,0,0")]
    background: Background,
    /// Weights of the pixels' red, green and blue, an .exr of the picture's size; for --gradients
    #[arg(long, value_name = "FILE", requires = "gradients", conflicts_with = "turntable")]
    weights: Option<PathBuf>,
    /// Write the gradient of the picture's weighted sum with respect to the stored numbers, a .safetensors file
    #[arg(long, value_name = "FILE", requires = "weights")]
    gradients: Option<PathBuf>,
    /// Reduce the opacity of small Gaussians to compensate for the pixel blur, even if the file does not say so
    #[arg(long)]
    antialias: bool,
}

/// Renders the scene. All input is read and checked before anything is written.
///
/// # Errors
/// An error that names the file or the option and its problem.
pub fn run(args: &SplatArgs, adapter: &AdapterArgs) -> anyhow::Result<()> {
    let name = args.scene.file_stem().and_then(|stem| stem.to_str()).unwrap_or("film");
    let destination = Destination::new(&args.out, args.format, name)?;
    if args.up.is_some() && args.turntable.is_none() {
        bail!("--up: is for a turntable; give --turntable, or omit --up");
    }
    if args.gradients.is_some() && args.weights.is_none() {
        bail!("--gradients: needs --weights and --camera; give them, or omit --gradients");
    }
    if args.fps.is_some() && !matches!(destination, Destination::Film(..)) {
        bail!("--fps: --out {} is not a film; give .gif, .webm or .mp4, or omit --fps", args.out.display());
    }
    let inputs = CommandInputs::default()
        .and([&args.scene])
        .and(args.camera.as_deref().map(camera_file))
        .and(args.weights.as_ref());
    destination.file().map_or(Ok(()), |path| inputs.refuse("--out", path))?;
    args.gradients.as_ref().map_or(Ok(()), |path| inputs.refuse("--gradients", path))?;
    if let Some(path) = &args.gradients
        && path.extension().is_none_or(|ending| !ending.eq_ignore_ascii_case("safetensors"))
    {
        bail!("--gradients {}: must end in .safetensors", path.display());
    }
    let scene = read_scene_file(&args.scene)?;
    let cameras = cameras(args, &scene)?;
    let size = cameras.first().map_or(DEFAULT_SIZE, |camera| [camera.width, camera.height]);
    let weights = args.weights.as_deref().map(|path| read_weights(path, size)).transpose()?;
    let shots: Vec<Shot> = (0..cameras.len()).map(|view| Shot { view: Some(view), ..Shot::default() }).collect();
    let fps = args.fps.unwrap_or_else(|| turn_rate(cameras.len()));
    let mut gpu = adapter.open()?;
    // Outlives the device, so that written pictures need not be rendered again.
    let mut series = Series::new(&destination, &shots, size, args.background, fps)?;
    let mut broken = 0;
    let mut blank = BlankPictures::default();
    gpu.retry_on_device_loss("rendering", |gpu| -> anyhow::Result<()> {
        let mut splatter = splatter(gpu, args, &scene, size, weights.is_some())?;
        while let Some(camera) = series.next().and_then(|number| cameras.get(number)) {
            let view = View::new(camera, scene.count, args.background.color(), 1.0);
            let mut picture = series.blank();
            if weights.is_some() {
                // In one piece, because the gradient is propagated through the last frame.
                splatter.set_view(gpu, view)?;
                picture.place([0, 0], &splatter.render(gpu)?);
            } else {
                splatter.render_bands(gpu, view, |row, band| picture.place([0, row], band))?;
            }
            broken = broken.max(splatter.read_counters(gpu)?.broken);
            if let (Some(path), Some(weights)) = (&args.gradients, &weights) {
                let bytes = gradients(gpu, &splatter, weights, scene.degree)?;
                write_atomically(path, &bytes)
                    .with_context(|| format!("{}: cannot write the gradients", path.display()))?;
            }
            blank.look(&picture, camera, || scene.means());
            series.add(picture)?;
        }
        Ok(())
    })?;
    blank.warn("the scene");
    if broken > 0 {
        log::warn!("{}: {broken} Gaussians have numbers that are not finite and were skipped", args.scene.display());
    }
    say!("{}; {} Gaussians", series.finish()?, scene.count);
    if let Some(path) = &args.gradients {
        say!("{}: the gradient of {} Gaussians", path.display(), scene.count);
    }
    Ok(())
}

fn cameras(args: &SplatArgs, scene: &SplatScene) -> anyhow::Result<Vec<Camera>> {
    match &args.camera {
        Some(path) => {
            let camera = read_named_camera(path)?;
            let [width, height] = args.size.unwrap_or([camera.width, camera.height]);
            Ok(vec![camera.resized(width, height)])
        }
        None => {
            let views = args.turntable.unwrap_or(1) as usize;
            Ok(scene_turntable(scene, views, args.up.unwrap_or_default(), args.size.unwrap_or(DEFAULT_SIZE)))
        }
    }
}

/// A splatter that holds the scene; for a gradient, the whole picture at once.
fn splatter(
    gpu: &Gpu,
    args: &SplatArgs,
    scene: &SplatScene,
    size: [u32; 2],
    has_gradient: bool,
) -> anyhow::Result<Splatter> {
    let mut model = scene.model();
    if args.antialias && !model.antialias {
        model = SplatModel { antialias: true, narrow: true, ..model };
    }
    let (purpose, rows) =
        if has_gradient { (Purpose::Gradients, size[1]) } else { (Purpose::Images, band_rows(gpu, size)) };
    let splatter =
        Splatter::new(gpu, SplatOptions { model, purpose, ..SplatOptions::default() }, scene.count, [size[0], rows])?;
    gpu.queue.write_buffer(splatter.gaussians(), 0, cast_slice(&scene.table));
    Ok(splatter)
}

/// Bytes: the largest possible picture, 16384 x 16384, in half floats.
const LARGEST_WEIGHTS: u64 = 1 << 31;

/// The gradient of the image: one weight for each of red, green and blue.
fn read_weights(path: &Path, [width, height]: [u32; 2]) -> anyhow::Result<Vec<[f32; 4]>> {
    let name = path.display();
    let bytes = input_file::read(path, LARGEST_WEIGHTS).with_context(|| format!("{name}: cannot read the weights"))?;
    let bytes = bytes.with_context(|| format!("{name}: is larger than {} MiB", LARGEST_WEIGHTS >> 20))?;
    let mut reader = image::ImageReader::with_format(Cursor::new(bytes), ImageFormat::OpenExr);
    let mut limits = image::Limits::default();
    limits.max_image_width = Some(width);
    limits.max_image_height = Some(height);
    reader.limits(limits);
    let picture = reader
        .decode()
        .with_context(|| format!("{name}: not an OpenEXR picture of {width} x {height} pixels"))?
        .into_rgb32f();
    let got = picture.dimensions();
    ensure!(got == (width, height), "{name}: is {} x {} pixels, the camera's are {width} x {height}", got.0, got.1);
    ensure!(picture.as_raw().iter().all(|w| w.is_finite()), "{name}: has a weight that is not finite");
    Ok(picture.pixels().map(|p| [p.0[0], p.0[1], p.0[2], 0.0]).collect())
}

/// The gradients of the stored numbers as a safetensors file.
fn gradients(gpu: &Gpu, splatter: &Splatter, weights: &[[f32; 4]], degree: u32) -> anyhow::Result<Vec<u8>> {
    gpu.queue.write_buffer(splatter.d_image(), 0, cast_slice(weights));
    let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    splatter.backward(&mut encoder);
    gpu.queue.submit([encoder.finish()]);
    let model = splatter.options().model;
    let count = splatter.count();
    let table: Vec<f32> = buffers::read(gpu, splatter.d_gaussians(), model.rows() * count)?;
    // The tensors are by Gaussian.
    let by_gaussian = |rows: std::ops::Range<usize>| -> Vec<u8> {
        (0..count)
            .flat_map(|i| rows.clone().map(move |row| (row, i)))
            .flat_map(|(row, i)| table[model.index(row, i, count)].to_le_bytes())
            .collect()
    };
    let functions = (degree as usize + 1).pow(2);
    let rotation = model.rotation_row();
    let opacity = model.opacity_row();
    let color = model.color_row();
    let parts = [
        ("means", 0..3, vec![count, 3]),
        ("log_scales", SplatModel::SCALE_ROW..rotation, vec![count, 3]),
        ("quats", rotation..opacity, vec![count, 4]),
        ("opacity_logits", opacity..color, vec![count]),
        ("sh", color..model.rows(), vec![count, functions, 3]),
    ];
    let bytes: Vec<(&str, Vec<u8>, Vec<usize>)> =
        parts.into_iter().map(|(name, rows, shape)| (name, by_gaussian(rows), shape)).collect();
    let mut tensors = HashMap::new();
    for (name, bytes, shape) in &bytes {
        tensors.insert(*name, TensorView::new(Dtype::F32, shape.clone(), bytes)?);
    }
    Ok(safetensors::serialize(tensors, None)?)
}
