//! `ghand-lab bench pose`: what it takes to pose avatars, and to draw them, in turns.

use std::path::PathBuf;
use std::time::Instant;

use anyhow::{Context, ensure};
use clap::Args;
use ghand_avatar::{Avatar, Scene};
use ghand_render::splat::Purpose;

use super::{DEFAULT_SIZE, MotionArgs, Times, WARM_UP};
use ghand_app::cli::AdapterArgs;
use ghand_app::say;
use ghand_avatar::framing::turntable;

#[derive(Debug, Args)]
pub(super) struct PoseArgs {
    /// The avatars, .ghand files; the others are compared with the first
    #[arg(required = true, value_name = "AVATAR")]
    avatars: Vec<PathBuf>,
    #[command(flatten)]
    motion: MotionArgs,
}

#[derive(serde::Serialize)]
struct Report {
    avatar: String,
    adapter: String,
    gaussians: usize,
    width: u32,
    height: u32,
    /// From a pose on the host to posed Gaussians on the device.
    pose_ms: Times,
    /// From a pose to a drawn frame.
    frame_ms: Times,
    /// The first avatar's median over this one's: how many times faster this one is.
    pose_ratio: f64,
    frame_ratio: f64,
}

/// Times the frames of a motion, each waited for, with all avatars in turns: one frame its pose alone, the next whole.
pub(super) fn run(args: &PoseArgs, adapter: &AdapterArgs) -> anyhow::Result<()> {
    let avatars = args.avatars.iter().map(|path| Ok(Avatar::load(path)?)).collect::<anyhow::Result<Vec<_>>>()?;
    let first = avatars.first().context("there is no avatar")?;
    let motion = args.motion.reading.load(&args.motion.pose, &first.model)?;
    let mut poses: Vec<_> = motion.frames.into_iter().map(|frame| frame.pose).collect();
    // Networks compute nothing for a pose that has not changed.
    poses.dedup();
    ensure!(!poses.is_empty(), "{}: has no poses", args.motion.pose);
    let joints = first.template.joint_count();
    for (path, avatar) in args.avatars.iter().zip(&avatars) {
        ensure!(avatar.template.joint_count() == joints, "{}: has other joints than the first", path.display());
    }
    let [width, height] = args.motion.size.unwrap_or(DEFAULT_SIZE);
    let camera = turntable(&first.model, &[&poses[0]], 1, [width, height]).into_iter().flatten().next();
    let camera = camera.context("there is no view to render")?;
    let gpu = adapter.open()?;
    let mut scenes = vec![];
    for avatar in &avatars {
        let mut scene = Scene::new(&gpu, &[avatar], Purpose::Images, 1, [width, height])?;
        scene.set_view(&gpu, &camera, [0.0; 3])?;
        scenes.push((scene, vec![], vec![]));
    }
    for k in 0..args.motion.frames as usize + WARM_UP {
        let [first, second] = [2 * k, 2 * k + 1].map(|frame| &poses[frame % poses.len()]);
        for (scene, pose_ms, frame_ms) in &mut scenes {
            let start = Instant::now();
            scene.set_pose(&gpu, 0, 0, first)?;
            scene.pose_only(&gpu, 0, None)?;
            gpu.wait()?;
            let posed = start.elapsed();
            let start = Instant::now();
            scene.set_pose(&gpu, 0, 0, second)?;
            scene.set_frame(&gpu, 0);
            scene.run_frame(&gpu, |_, _| {})?;
            if k >= WARM_UP {
                pose_ms.push(1e3 * posed.as_secs_f64());
                frame_ms.push(1e3 * start.elapsed().as_secs_f64());
            }
        }
    }
    let mut reports: Vec<Report> = vec![];
    for ((path, avatar), (_, pose_ms, frame_ms)) in args.avatars.iter().zip(&avatars).zip(scenes) {
        let (pose_ms, frame_ms) = (Times::of(pose_ms), Times::of(frame_ms));
        let of_first = reports.first().map(|first| [first.pose_ms.median, first.frame_ms.median]);
        let [pose_first, frame_first] = of_first.unwrap_or([pose_ms.median, frame_ms.median]);
        reports.push(Report {
            avatar: path.display().to_string(),
            adapter: gpu.info.name.clone(),
            gaussians: avatar.template.len(),
            width,
            height,
            pose_ratio: pose_first / pose_ms.median,
            frame_ratio: frame_first / frame_ms.median,
            pose_ms,
            frame_ms,
        });
    }
    if args.motion.json {
        say!("{}", serde_json::to_string(&reports)?);
        return Ok(());
    }
    say!("adapter: {}; {width}x{height}; medians of {} frames", gpu.info.name, args.motion.frames);
    for r in &reports {
        say!(
            "{}: {} Gaussians, pose {:.3} ms ({:.1} times), frame {:.2} ms ({:.2} times)",
            r.avatar,
            r.gaussians,
            r.pose_ms.median,
            r.pose_ratio,
            r.frame_ms.median,
            r.frame_ratio
        );
    }
    Ok(())
}
