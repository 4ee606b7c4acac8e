//! `ghand bench splat`: how long a frame and its gradient take.

use std::time::Instant;

use anyhow::bail;
use clap::{Args, Subcommand};
use ghand_avatar::{Avatar, AvatarConfig, AvatarRenderer};
use ghand_core::HandModel;
use ghand_core::Pose;
use ghand_core::hand_model::procedural::ProceduralHand;
use ghand_core::surface::sample_surface;
use ghand_render::{Gpu, buffers};

use crate::cli::{AdapterArgs, parse_size};
use crate::framing::turntable;

/// Options of `ghand bench`.
#[derive(Debug, Args)]
pub struct BenchArgs {
    #[command(subcommand)]
    what: What,
}

#[derive(Debug, Subcommand)]
enum What {
    /// The splatter, forward and backward, on the procedural hand filling the image
    Splat(SplatArgs),
}

#[derive(Debug, Args)]
struct SplatArgs {
    /// About how many Gaussians; the nearest UV resolution is taken
    #[arg(long, default_value_t = 87_779, value_name = "N")]
    n: usize,
    /// Image size in pixels
    #[arg(long, default_value = "334x512", value_parser = parse_size, value_name = "WxH")]
    size: [u32; 2],
    /// Frames that are timed, after a few that are not
    #[arg(long, default_value_t = 20, value_name = "N")]
    frames: usize,
    /// One JSON object instead of a line of text
    #[arg(long)]
    json: bool,
}

/// Frames that warm the caches up.
const WARM_UP: usize = 3;

/// Runs a benchmark.
///
/// # Errors
/// One sentence that says what failed.
pub fn run(args: &BenchArgs, adapter: &AdapterArgs) -> anyhow::Result<()> {
    let What::Splat(args) = &args.what;
    if args.frames == 0 {
        bail!("--frames must be at least 1");
    }
    splat(args, &adapter.open()?)
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

fn time(frames: usize, mut frame: impl FnMut() -> anyhow::Result<()>) -> anyhow::Result<Times> {
    for _ in 0..WARM_UP {
        frame()?;
    }
    let mut times = Vec::with_capacity(frames);
    for _ in 0..frames {
        let start = Instant::now();
        frame()?;
        times.push(start.elapsed().as_secs_f64() * 1e3);
    }
    times.sort_by(f64::total_cmp);
    let at = |i: usize| times.get(i).copied().unwrap_or(f64::NAN);
    Ok(Times { median: at(times.len() / 2), min: at(0), max: at(times.len() - 1) })
}

fn splat(args: &SplatArgs, gpu: &Gpu) -> anyhow::Result<()> {
    let model = ProceduralHand::default().build()?;
    let config = AvatarConfig { uv_resolution: resolution_for(&model, args.n)?, ..Default::default() };
    let avatar = Avatar::untrained(&model, &config, [0.8, 0.6, 0.5], 0)?;
    let rest = Pose::rest(model.joint_count());
    let views = turntable(&model, &[&rest], 1, args.size);
    let Some(camera) = views.first().and_then(|v| v.first()) else { bail!("there is no view to render") };
    let mut renderer = AvatarRenderer::new(gpu, &avatar, 1, args.size)?;
    renderer.set_pose(gpu, 0, &rest)?;
    // Makes room for all intersections, and poses the hand: what is timed is the splatter alone.
    renderer.render(gpu, 0, camera, [0.0; 3])?;
    let pixels = args.size[0] as usize * args.size[1] as usize;
    // A gradient that changes from pixel to pixel: zeros could be faster than what training meets.
    let gradient: Vec<f32> = (0..4 * pixels).map(|i| ((i * 37 % 101) as f32 - 50.0) * 1e-6).collect();
    gpu.queue.write_buffer(renderer.splatter.d_image(), 0, bytemuck::cast_slice(&gradient));
    let counters: Vec<u32> = buffers::read(gpu, renderer.splatter.counters(), 3)?;
    let submit = |encode: &dyn Fn(&mut wgpu::CommandEncoder)| -> anyhow::Result<()> {
        let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        encode(&mut encoder);
        gpu.queue.submit([encoder.finish()]);
        Ok(gpu.wait()?)
    };
    let forward = time(args.frames, || submit(&|e| renderer.splatter.forward(e)))?;
    let backward = time(args.frames, || submit(&|e| renderer.splatter.backward(e)))?;
    let (count, [width, height]) = (avatar.template.len(), args.size);
    if args.json {
        let report = serde_json::json!({
            "adapter": gpu.info.name,
            "gaussians": count,
            "intersections": counters[2],
            "width": width,
            "height": height,
            "forward_ms": forward,
            "backward_ms": backward,
        });
        println!("{report}");
    } else {
        println!("{}: {count} Gaussians, {} tile intersections, {width}x{height}", gpu.info.name, counters[2]);
        for (name, t) in [("forward", forward), ("backward", backward)] {
            println!("{name:9} median {:.2} ms, min {:.2}, max {:.2}", t.median, t.min, t.max);
        }
    }
    Ok(())
}
