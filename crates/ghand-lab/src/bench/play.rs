//! `ghand-lab bench play`: what light apart from skin costs when an avatar plays a motion.

use std::path::PathBuf;
use std::time::Instant;

use anyhow::{Context, ensure};
use clap::Args;
use ghand_app::cli::AdapterArgs;
use ghand_app::lighting::Lighting;
use ghand_app::say;
use ghand_avatar::framing::turntable;
use ghand_avatar::{Avatar, Scene};
use ghand_render::splat::Purpose;

use super::{DEFAULT_SIZE, MotionArgs, Times, WARM_UP};

#[derive(Debug, Args)]
pub(super) struct PlayArgs {
    /// The avatar, a .ghand file; its light must be apart from its skin
    avatar: PathBuf,
    #[command(flatten)]
    motion: MotionArgs,
    #[command(flatten)]
    light: Lighting,
}

#[derive(serde::Serialize)]
struct Report {
    adapter: String,
    tier: &'static str,
    gaussians: usize,
    vertices: usize,
    width: u32,
    height: u32,
    lit_ms: Times,
    unlit_ms: Times,
    /// Setting a pose alone, as a part of `lit_ms`.
    lit_pose_ms: Times,
    /// Median of the frames' ratios of the times with light and without.
    ratio: f64,
}

/// Times the frames of a motion. Each has its pose set and is waited for.
pub(super) fn run(args: &PlayArgs, adapter: &AdapterArgs) -> anyhow::Result<()> {
    let mut lit = Avatar::load(&args.avatar)?;
    ensure!(lit.light.is_some(), "{}: its colours contain the light", args.avatar.display());
    args.light.apply_to(&mut lit)?;
    let unlit = Avatar { light: None, ..lit.clone() };
    let sequence = args.motion.reading.load(&args.motion.pose, &lit.model)?;
    let poses: Vec<_> = sequence.frames.iter().map(|frame| &frame.pose).collect();
    let size = args.motion.size.unwrap_or(DEFAULT_SIZE);
    let cameras = turntable(&lit.model, &poses, 1, size);
    let camera = cameras.first().and_then(|views| views.first()).context("the motion has no frames")?;
    let gpu = adapter.open()?;
    let mut scenes = Vec::new();
    for avatar in [&lit, &unlit] {
        let mut scene = Scene::new(&gpu, &[avatar], Purpose::Images, 1, size)?;
        scene.set_view(&gpu, camera, [0.0; 3])?;
        scenes.push(scene);
    }
    // With light, without, and setting the pose with light.
    let mut times = [vec![], vec![], vec![]];
    let mut ratios = vec![];
    for (frame, pose) in poses.iter().cycle().take(WARM_UP + args.motion.frames as usize).enumerate() {
        let mut now = [[0.0; 2]; 2];
        // The order alternates, in case the second profits from the first.
        for k in [frame % 2, 1 - frame % 2] {
            let start = Instant::now();
            scenes[k].set_pose(&gpu, 0, 0, pose)?;
            let posed = start.elapsed();
            scenes[k].run_frame(&gpu, |_, _| {})?;
            now[k] = [start.elapsed(), posed].map(|time| time.as_secs_f64() * 1e3);
        }
        if frame >= WARM_UP {
            let [[lit, posed], [unlit, _]] = now;
            times.iter_mut().zip([lit, unlit, posed]).for_each(|(times, time)| times.push(time));
            ratios.push(lit / unlit);
        }
    }
    let [lit_ms, unlit_ms, lit_pose_ms] = times.map(Times::of);
    let report = Report {
        adapter: gpu.info.name.clone(),
        tier: gpu.tier.name(),
        gaussians: lit.template.len(),
        vertices: lit.model.vertices.len(),
        width: size[0],
        height: size[1],
        lit_ms,
        unlit_ms,
        lit_pose_ms,
        ratio: Times::of(ratios).median,
    };
    if args.motion.json {
        say!("{}", serde_json::to_string(&report)?);
        return Ok(());
    }
    let Report { adapter, tier, gaussians, vertices, width, height, ratio, .. } = &report;
    say!("{adapter}, {tier} tier: {gaussians} Gaussians, mesh of {vertices} vertices, {width}x{height}");
    let rows =
        [("with light", &report.lit_ms), ("without", &report.unlit_ms), ("pose with light", &report.lit_pose_ms)];
    for (name, t) in rows {
        say!("{name:18} median {:.2} ms, min {:.2}, max {:.2}", t.median, t.min, t.max);
    }
    say!("{:18} {ratio:.3} times the time without", "with light");
    Ok(())
}
