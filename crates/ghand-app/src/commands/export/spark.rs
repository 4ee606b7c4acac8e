//! A folder with a web page that plays an avatar's Gaussians with three.js and Spark: four bones move each of them.

use std::path::Path;

use anyhow::{Context, bail};
use ghand_avatar::four_bones::FourBones;
use ghand_avatar::framing::{middle, turntable};
use ghand_avatar::scene_files::SplatScene;
use ghand_avatar::{Avatar, PosedHand, Scene};
use ghand_core::skeleton::{Affine, pose_skeleton};
use ghand_core::{Camera, Pose};
use ghand_files::atomic_file::{check_writable, write_atomically};
use ghand_measure::metrics::{psnr_of, quantize};
use ghand_motion::PoseSequence;
use ghand_render::splat::{Image, Purpose};
use ghand_render::{Gpu, RenderError};
use glam::DQuat;
use serde_json::json;

use super::ExportArgs;
use crate::cli::AdapterArgs;
use crate::command_inputs::CommandInputs;
use crate::say;

/// The page.
const PAGE: &str = include_str!("spark/index.html");
/// Its files.
const NAMES: [&str; 4] = ["hand.ply", "bones.bin", "motion.json", "index.html"];
/// What is played if the command line says nothing.
const DEFAULT_MOTION: &str = "count";
/// Frames that are compared with ghand's pictures.
const COMPARED: usize = 8;
/// Size of these pictures.
const SIZE: [u32; 2] = [512, 512];

/// Writes the folder.
///
/// # Errors
/// An error that names the file or the option and its problem.
pub fn write(args: &ExportArgs, folder: &Path, inputs: &CommandInputs, adapter: &AdapterArgs) -> anyhow::Result<()> {
    if folder.exists() && !folder.is_dir() {
        bail!("--spark {}: is a file; give a folder", folder.display());
    }
    let paths = NAMES.map(|name| folder.join(name));
    for path in &paths {
        inputs.refuse("--spark", path)?;
        check_writable(path).with_context(|| format!("--spark {}: cannot be written", path.display()))?;
    }
    let avatar = args.avatar()?;
    if avatar.template.joint_count() > usize::from(u8::MAX) + 1 {
        bail!("{}: has {} joints; Spark moves at most 256", args.subject.display(), avatar.template.joint_count());
    }
    let pose = if args.pose.is_empty() { DEFAULT_MOTION } else { args.only_pose()? };
    let motion = args.frames(pose, &avatar)?;
    let rest = PosedHand::splats_on_host(&avatar, &Pose::rest(avatar.model.joint_count()))?;
    let bones = FourBones::of(&avatar);
    let loss = match adapter.open_if_any()? {
        Ok(mut gpu) => {
            let loss = gpu.retry_on_device_loss("the comparison", |gpu| -> anyhow::Result<f64> {
                Ok(psnr(gpu, &avatar, &rest, &bones, &motion)?)
            })?;
            format!("four bones a Gaussian: {loss:.1} dB from ghand's pictures of the same poses")
        }
        Err(_) => "four bones a Gaussian; their loss is not measured, for there is no graphics adapter".into(),
    };
    let [splats, bytes, poses, page] = &paths;
    rest.write(splats)?;
    let put = |path: &Path, contents: &[u8]| {
        write_atomically(path, contents).with_context(|| format!("{}: cannot be written", path.display()))
    };
    put(bytes, &bone_bytes(&bones))?;
    put(poses, motion_json(&avatar, &motion).to_string().as_bytes())?;
    put(page, PAGE.as_bytes())?;
    say!(
        "{}: {} Gaussians, {} bones, {} frames; {loss}. Serve the folder, for example with `python3 -m http.server`",
        page.display(),
        rest.count,
        avatar.template.joint_count(),
        motion.frames.len()
    );
    Ok(())
}

/// For each Gaussian four bones, then their weights in bytes.
fn bone_bytes(bones: &FourBones) -> Vec<u8> {
    let rows = bones.joints.iter().zip(bones.bytes());
    rows.flat_map(|(joints, weights)| joints.map(|joint| joint as u8).into_iter().chain(weights)).collect()
}

/// The names of the bones, the middle of the hand at rest (metres), and per frame what takes each bone from rest to pose: a
/// rotation (x, y, z, w) and a translation.
fn motion_json(avatar: &Avatar, motion: &PoseSequence) -> serde_json::Value {
    let template = &avatar.template;
    let frame = |pose: &Pose| -> Vec<[f32; 7]> {
        let chain = pose_skeleton(&template.parents, &template.joints, &pose.rotations);
        let bone = |bone: &Affine| {
            let [x, y, z, w] = DQuat::from_mat3(&bone.linear).as_quat().to_array();
            let [a, b, c] = (bone.translation + pose.translation).as_vec3().to_array();
            [x, y, z, w, a, b, c]
        };
        chain.posed_from_rest.iter().map(bone).collect()
    };
    json!({
        "fps": motion.fps,
        "middle": middle(&avatar.model.vertices).as_vec3().to_array(),
        "bones": template.joint_names,
        "frames": motion.frames.iter().map(|f| frame(&f.pose)).collect::<Vec<_>>()
    })
}

/// PSNR, dB, between what four bones make of the Gaussians and ghand's pictures: the mean over frames from all parts of the
/// motion.
fn psnr(
    gpu: &Gpu,
    avatar: &Avatar,
    rest: &SplatScene,
    bones: &FourBones,
    motion: &PoseSequence,
) -> Result<f64, RenderError> {
    let count = motion.frames.len().min(COMPARED);
    let poses: Vec<&Pose> =
        (0..count).map(|k| &motion.frames[(2 * k + 1) * motion.frames.len() / (2 * count)].pose).collect();
    let cameras: Vec<Camera> = turntable(&avatar.model, &poses, 1, SIZE).into_iter().flatten().collect();
    let mut exact = Scene::new(gpu, &[avatar], Purpose::Images, 1, SIZE)?;
    let mut sum = 0.0;
    for (pose, camera) in poses.iter().zip(&cameras) {
        exact.set_pose(gpu, 0, 0, pose)?;
        let expected = exact.render(gpu, 0, camera, [0.0; 3])?;
        let moved = bones.posed(rest, avatar, pose);
        let mut scene = Scene::of_static_gaussians(gpu, &moved, SIZE)?;
        let found = scene.render(gpu, 0, camera, [0.0; 3])?;
        sum += of_pictures(&found, &expected);
    }
    Ok(sum / count as f64)
}

fn of_pictures(found: &Image, expected: &Image) -> f64 {
    let bytes = |image: &Image| -> Vec<[u8; 3]> { image.rgba.iter().map(|p| quantize([p[0], p[1], p[2]])).collect() };
    let [found, expected] = [found, expected].map(bytes);
    let pairs = found.as_flattened().iter().zip(expected.as_flattened());
    let sum: f64 = pairs.map(|(a, b)| ((f64::from(*a) - f64::from(*b)) / 255.0).powi(2)).sum();
    psnr_of(sum, 3 * found.len())
}
