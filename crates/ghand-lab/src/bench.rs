//! `ghand-lab bench`: `splat` times a frame and its gradient, `play` a motion with light and without, `pose`
//! what comes before splatting, `train` a step.

mod play;
mod pose;
mod train;

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::time::Instant;

use anyhow::{bail, ensure};
use clap::{Args, Subcommand};
use ghand_avatar::{Avatar, AvatarConfig, Scene};
use ghand_capture::cameras::named::read_named_camera;
use ghand_core::{Camera, HandModel, Pose, Side};
use ghand_hand_model::builtin::builtin_hand;
use ghand_hand_model::surface::sample_surface;
use ghand_render::Gpu;
use ghand_render::splat::{Purpose, SplatOptions, Splatter, View};

use ghand_app::cli::{AdapterArgs, parse_count, parse_size};
use ghand_app::pose_choice::PoseReadingArgs;
use ghand_app::say;
use ghand_app::scene_file::read_scene_file;
use ghand_avatar::framing::turntable;

/// Options of `ghand-lab bench`.
#[derive(Debug, Args)]
pub struct BenchArgs {
    #[command(subcommand)]
    what: What,
}

#[derive(Debug, Subcommand)]
enum What {
    /// The splatter, forward and backward, on a hand that fills the image or on a scene
    Splat(SplatArgs),
    /// Playing a motion of an avatar, in its light and without light in turns
    Play(play::PlayArgs),
    /// From pose to Gaussians, and the whole frame, of several avatars in turns
    Pose(pose::PoseArgs),
    /// The parts of a training step: networks, deformation, splatter, losses; and the memory
    Train(train::TrainArgs),
}

#[derive(Debug, Args)]
struct SplatArgs {
    /// Approximate number of Gaussians of the hand; the nearest UV resolution is used [default: 87779]
    #[arg(long, value_name = "N")]
    n: Option<usize>,
    /// Image size in pixels [default: the camera's, else 334x512]
    #[arg(long, value_parser = parse_size, value_name = "WxH")]
    size: Option<[u32; 2]>,
    /// `hand`, the built-in one at rest, or a .ply file of Gaussians
    #[arg(long, default_value = "hand", value_name = "hand|FILE")]
    scene: String,
    /// A JSON file with one camera as in a capture.json; a scene needs one
    #[arg(long, value_name = "FILE")]
    camera: Option<PathBuf>,
    /// Number of timed frames, after a few warm-up frames
    #[arg(long, default_value_t = 20, value_name = "N", value_parser = parse_count)]
    frames: u32,
    /// One JSON object instead of lines of text
    #[arg(long)]
    json: bool,
}

/// A motion that is played, and how it is timed.
#[derive(Debug, Args)]
struct MotionArgs {
    /// The motion, as for `ghand render`; it begins again when it is over
    #[arg(long, value_name = "FILE|NAME", default_value = "count")]
    pose: String,
    #[command(flatten)]
    reading: PoseReadingArgs,
    /// Image size in pixels [default: 334x512]
    #[arg(long, value_parser = parse_size, value_name = "WxH")]
    size: Option<[u32; 2]>,
    /// Number of timed frames, after a few warm-up frames
    #[arg(long, default_value_t = 100, value_name = "N", value_parser = parse_count)]
    frames: u32,
    /// JSON instead of lines of text
    #[arg(long)]
    json: bool,
}

/// Default number of Gaussians of the hand.
const DEFAULT_GAUSSIANS: usize = 87_779;
/// Number of warm-up frames.
const WARM_UP: usize = 3;
/// Default size of the image.
const DEFAULT_SIZE: [u32; 2] = [334, 512];

/// Runs a benchmark.
///
/// # Errors
/// One sentence that says what failed.
pub fn run(args: &BenchArgs, adapter: &AdapterArgs) -> anyhow::Result<()> {
    match &args.what {
        What::Splat(args) => splat(args, &adapter.open()?),
        What::Play(args) => play::run(args, adapter),
        What::Pose(args) => pose::run(args, adapter),
        What::Train(args) => train::run(args, adapter),
    }
}

/// The UV resolution whose number of texels is nearest to `count`; texels grow with the square of the resolution.
fn resolution_for(model: &HandModel, count: usize) -> anyhow::Result<u32> {
    let probe = 256;
    let texels = sample_surface(model, probe)?.len();
    let guess = f64::from(probe) * (count as f64 / texels as f64).sqrt();
    Ok((guess.round() as u32).clamp(8, 4096))
}

#[derive(serde::Serialize)]
struct Times {
    median: f64,
    min: f64,
    max: f64,
}

impl Times {
    fn of(mut times: Vec<f64>) -> Times {
        times.sort_by(f64::total_cmp);
        let at = |i: usize| times.get(i).copied().unwrap_or(f64::NAN);
        Times { median: at(times.len() / 2), min: at(0), max: at(times.len().saturating_sub(1)) }
    }
}

#[derive(serde::Serialize)]
struct Report {
    adapter: String,
    tier: &'static str,
    gaussians: usize,
    intersections: u32,
    width: u32,
    height: u32,
    forward_ms: Times,
    backward_ms: Times,
    stages: BTreeMap<&'static str, Times>,
}

/// A splatter that has just rendered the scene.
fn set_up(args: &SplatArgs, gpu: &Gpu) -> anyhow::Result<(Splatter, Camera)> {
    let camera = args.camera.as_deref().map(read_named_camera).transpose()?;
    let camera = match (camera, args.size) {
        (Some(camera), Some([width, height])) => Some(camera.resized(width, height)),
        (camera, _) => camera,
    };
    if args.scene != "hand" {
        ensure!(args.n.is_none(), "--n: --scene {} has its own Gaussians; omit --n", args.scene);
        let scene = read_scene_file(args.scene.as_ref())?;
        let Some(camera) = camera else { bail!("--scene {}: needs a --camera", args.scene) };
        let size = [camera.width, camera.height];
        let options = SplatOptions { model: scene.model(), purpose: Purpose::Gradients, ..SplatOptions::default() };
        let mut splatter = Splatter::new(gpu, options, scene.count, size)?;
        gpu.queue.write_buffer(splatter.gaussians(), 0, bytemuck::cast_slice(&scene.table));
        splatter.set_view(gpu, View::new(&camera, scene.count, [0.0; 3], 1.0))?;
        splatter.render(gpu)?;
        return Ok((splatter, camera));
    }
    let model = builtin_hand(Side::Right)?;
    let config = AvatarConfig {
        uv_resolution: resolution_for(&model, args.n.unwrap_or(DEFAULT_GAUSSIANS))?,
        ..Default::default()
    };
    let avatar = Avatar::untrained(&model, &config, [0.8, 0.6, 0.5], 0)?;
    let rest = Pose::rest(model.joint_count());
    let around = || turntable(&model, &[&rest], 1, args.size.unwrap_or(DEFAULT_SIZE)).into_iter().flatten().next();
    let Some(camera) = camera.or_else(around) else { bail!("there is no view to render") };
    let mut scene = Scene::new(gpu, &[&avatar], Purpose::Gradients, 1, [camera.width, camera.height])?;
    scene.set_pose(gpu, 0, 0, &rest)?;
    scene.render(gpu, 0, &camera, [0.0; 3])?;
    Ok((scene.into_splatter(), camera))
}

fn splat(args: &SplatArgs, gpu: &Gpu) -> anyhow::Result<()> {
    let (splatter, camera) = set_up(args, gpu)?;
    let pixels = camera.width as usize * camera.height as usize;
    // A gradient that changes from pixel to pixel: zeros could be faster than the gradients in training.
    let gradient: Vec<f32> = (0..4 * pixels).map(|i| ((i * 37 % 101) as f32 - 50.0) * 1e-6).collect();
    gpu.queue.write_buffer(splatter.d_image(), 0, bytemuck::cast_slice(&gradient));
    let wanted = splatter.read_counters(gpu)?.intersections_wanted;
    ensure!(wanted <= splatter.capacity(), "the scene does not fit the device");
    let time = |encode: &dyn Fn(&mut wgpu::CommandEncoder)| -> anyhow::Result<Times> {
        let mut times = Vec::new();
        for frame in 0..WARM_UP + args.frames as usize {
            let start = Instant::now();
            let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
            encode(&mut encoder);
            gpu.queue.submit([encoder.finish()]);
            gpu.wait()?;
            if frame >= WARM_UP {
                times.push(start.elapsed().as_secs_f64() * 1e3);
            }
        }
        Ok(Times::of(times))
    };
    let forward_ms = time(&|encoder| splatter.forward(encoder))?;
    let backward_ms = time(&|encoder| splatter.backward(encoder))?;
    let mut stages: BTreeMap<&'static str, Vec<f64>> = BTreeMap::new();
    for _ in 0..args.frames {
        for (stage, milliseconds) in splatter.time_stages(gpu)? {
            stages.entry(stage.name()).or_default().push(milliseconds);
        }
    }
    let report = Report {
        adapter: gpu.info.name.clone(),
        tier: gpu.tier.name(),
        gaussians: splatter.count(),
        intersections: wanted,
        width: camera.width,
        height: camera.height,
        forward_ms,
        backward_ms,
        stages: stages.into_iter().map(|(name, times)| (name, Times::of(times))).collect(),
    };
    if args.json {
        say!("{}", serde_json::to_string(&report)?);
        return Ok(());
    }
    let Report { adapter, tier, gaussians, width, height, .. } = &report;
    say!("{adapter}, {tier} tier: {gaussians} Gaussians, {wanted} tile intersections, {width}x{height}");
    let totals = [("forward", &report.forward_ms), ("backward", &report.backward_ms)];
    for (name, t) in totals.into_iter().chain(report.stages.iter().map(|(name, t)| (*name, t))) {
        say!("{name:18} median {:.2} ms, min {:.2}, max {:.2}", t.median, t.min, t.max);
    }
    Ok(())
}
