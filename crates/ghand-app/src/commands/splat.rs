//! `ghand splat`: a picture of any scene of Gaussians, and the gradient of its pixels.

use std::collections::HashMap;
use std::io::Cursor;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail, ensure};
use bytemuck::cast_slice;
use clap::Args;
use ghand_avatar::ply::SplatScene;
use ghand_core::atomic_file::write_atomically;
use ghand_core::input_file;
use ghand_data::camera_file::read_camera;
use ghand_render::splat::{Image, Purpose, SplatModel, SplatOptions, Splatter, View};
use ghand_render::{Gpu, buffers};
use image::{DynamicImage, ImageFormat, Rgba32FImage};
use safetensors::Dtype;
use safetensors::tensor::TensorView;

use super::render::{to_rgb8, write_png};
use crate::cli::{AdapterArgs, parse_color};
use crate::say;

/// Command line of `ghand splat`.
#[derive(Debug, Args)]
pub struct SplatArgs {
    /// The scene: a 3D Gaussian Splatting .ply file
    scene: PathBuf,
    /// A JSON file with one camera as in a capture.json
    #[arg(long, value_name = "FILE")]
    camera: PathBuf,
    /// The picture: .exr (floats: colour over the background, and coverage) or .png (8 bits of colour)
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// Colour behind the scene, display values from 0 to 1
    #[arg(long, value_name = "R,G,B", value_parser = parse_color, default_value = "0,0,0")]
    background: [f32; 3],
    /// Weights of the pixels' red, green and blue, an .exr of the picture's size; for --gradients
    #[arg(long, value_name = "FILE", requires = "gradients")]
    weights: Option<PathBuf>,
    /// Write the gradient of the weighted sum of the picture to the numbers stored in the scene, a .safetensors file
    #[arg(long, value_name = "FILE", requires = "weights")]
    gradients: Option<PathBuf>,
    /// Take as much opacity off small Gaussians as the blur of a pixel adds
    #[arg(long)]
    antialias: bool,
}

/// Renders the scene. All input is read and checked before anything is written.
///
/// # Errors
/// One that names the file or the option and what is wrong with it.
pub fn run(args: &SplatArgs, adapter: &AdapterArgs) -> anyhow::Result<()> {
    let write_picture = match args.out.extension().and_then(|e| e.to_str()) {
        Some("exr") => write_exr,
        Some("png") => |path: &Path, image: &Image| write_png(path, &to_rgb8(image)?),
        _ => bail!("--out {}: must end in .exr or .png", args.out.display()),
    };
    let scene = SplatScene::read(&args.scene)?;
    let camera = read_camera(&args.camera)?;
    let size = [camera.width, camera.height];
    let weights = args.weights.as_deref().map(|path| read_weights(path, size)).transpose()?;
    let gpu = adapter.open()?;
    let model = SplatModel { antialias: args.antialias, ..scene.model() };
    let purpose = if weights.is_some() { Purpose::Gradients } else { Purpose::Images };
    let mut splatter = Splatter::new(&gpu, SplatOptions { model, purpose, depth: false }, scene.count, size)?;
    gpu.queue.write_buffer(splatter.gaussians(), 0, cast_slice(&scene.table));
    splatter.set_view(&gpu, View::new(&camera, scene.count, args.background, 1.0))?;
    let image = splatter.render(&gpu)?;
    let counters: Vec<u32> = buffers::read(&gpu, splatter.counters(), 4)?;
    if let Some(broken @ 1..) = counters.get(3) {
        log::warn!("{}: {broken} Gaussians hold numbers that are not finite and were left out", args.scene.display());
    }
    let gradients = weights.map(|weights| gradients(&gpu, &splatter, &weights, scene.degree)).transpose()?;
    write_picture(&args.out, &image)?;
    if let (Some(path), Some(bytes)) = (&args.gradients, gradients) {
        write_atomically(path, &bytes).with_context(|| format!("{}: cannot write the gradients", path.display()))?;
    }
    say!("{} Gaussians, {} x {} pixels: {}", scene.count, size[0], size[1], args.out.display());
    Ok(())
}

/// Writes colour over the background and coverage as 32-bit floats, whole or not at all.
fn write_exr(path: &Path, image: &Image) -> anyhow::Result<()> {
    let context = || format!("{}: cannot write the picture", path.display());
    let floats = cast_slice::<[f32; 4], f32>(&image.rgba).to_vec();
    let picture = Rgba32FImage::from_raw(image.width, image.height, floats).with_context(context)?;
    let mut bytes = Cursor::new(Vec::new());
    DynamicImage::from(picture).write_to(&mut bytes, ImageFormat::OpenExr).with_context(context)?;
    write_atomically(path, bytes.get_ref()).with_context(context)
}

/// Bytes: a picture as large as can be, 16384 x 16384, of half floats.
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
    ensure!(picture.as_raw().iter().all(|w| w.is_finite()), "{name}: holds a weight that is not finite");
    Ok(picture.pixels().map(|p| [p.0[0], p.0[1], p.0[2], 0.0]).collect())
}

/// The gradients of the stored numbers as a safetensors file.
fn gradients(gpu: &Gpu, splatter: &Splatter, weights: &[[f32; 4]], degree: u32) -> anyhow::Result<Vec<u8>> {
    gpu.queue.write_buffer(splatter.d_image(), 0, cast_slice(weights));
    let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    splatter.backward(&mut encoder);
    gpu.queue.submit([encoder.finish()]);
    let (model, count) = (splatter.options().model, splatter.count());
    let table: Vec<f32> = buffers::read(gpu, splatter.d_gaussians(), model.rows() * count)?;
    // The table is by row, the tensors are by Gaussian.
    let by_gaussian = |rows: std::ops::Range<usize>| -> Vec<u8> {
        (0..count)
            .flat_map(|i| rows.clone().map(move |row| (row, i)))
            .flat_map(|(row, i)| table[row * count + i].to_le_bytes())
            .collect()
    };
    let functions = (degree as usize + 1).pow(2);
    let (rotation, opacity, color) = (model.rotation_row(), model.opacity_row(), model.color_row());
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
