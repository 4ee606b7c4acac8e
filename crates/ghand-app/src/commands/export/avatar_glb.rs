//! An avatar as a rigged, textured `.glb`, on request with its Gaussians.

use std::path::Path;

use anyhow::{Context, bail};
use ghand_avatar::gaussian_glb::add_gaussians;
use ghand_avatar::textured_hand::{Correctives, TexturedHand};
use ghand_avatar::{Avatar, PropertyTables};
use ghand_core::Pose;
use ghand_core::mesh::Texture;
use ghand_files::atomic_file::write_atomically;
use ghand_hand_model::files::rigged_glb::{CorrectiveKey, Motion, RiggedHand};
use glam::DVec3;
use image::{ExtendedColorType, ImageEncoder};

use super::hand_model::fit_correctives;
use super::one_sided::one_sided;
use super::{DEFAULT_TEXTURE, ExportArgs};
use crate::baked::baked;
use crate::cli::AdapterArgs;
use crate::say;

/// Most frames of a motion at which its correctives are computed; they change slowly, and are interpolated between.
const MOST_KEYS: usize = 64;

/// Writes the avatar's hand with its skeleton, skin and motions.
///
/// # Errors
/// An error that names the file or the option and its problem.
pub fn write(args: &ExportArgs, out: &Path, adapter: &AdapterArgs) -> anyhow::Result<()> {
    let shown = args.subject.display();
    args.reading.refuse_for(&format!("{shown} is an avatar"))?;
    let mut avatar = Avatar::load(&args.subject)?;
    let mut opening: Option<Pose> = None;
    let mut sequences = vec![];
    for text in &args.pose {
        let sequence = args.frames(text, &avatar)?;
        match &sequence.frames[..] {
            [frame] if opening.is_none() => opening = Some(frame.pose.clone()),
            [_] => bail!("--pose {text}: a second pose; a .glb opens in one, beside any number of motions"),
            frames => {
                let poses: Vec<Pose> = frames.iter().map(|frame| frame.pose.clone()).collect();
                sequences.push((motion_name(text), sequence.fps, poses));
            }
        }
    }
    if args.gaussians && !matches!(avatar.tables, PropertyTables::Baked(_)) {
        let mut gpu = adapter.open()?;
        let path = gpu.retry_on_device_loss("baking", |gpu| baked(gpu, &args.subject))?;
        avatar = Avatar::load(&path)?;
    }
    let mut hand = TexturedHand::new(&avatar, args.texture.unwrap_or(DEFAULT_TEXTURE))?;
    if args.fit_pose_correctives {
        fit_correctives(&mut hand.model, &args.subject)?;
    }
    let skin = hand.skin(png(&hand.texture)?);
    let names = args.joint_names.map(|names| names.of(&hand.model.joint_names));
    let correctives = PoseCorrectives::of(&avatar, opening.as_ref(), &sequences)?;
    let motions: Vec<Motion> = (sequences.iter().zip(&correctives.keys))
        .map(|((name, fps, poses), keys)| Motion { name, fps: *fps, poses, correctives: keys })
        .collect();
    let rigged = RiggedHand {
        skin: Some(&skin),
        joint_names: names.as_deref(),
        pose: opening.as_ref(),
        motions: &motions,
        correctives: &correctives.targets,
        corrective_weights: &correctives.opening,
    };
    let mut document = rigged.document(&hand.model)?;
    if args.gaussians {
        add_gaussians(&mut document, &avatar)?;
    }
    let bytes = document.finish()?;
    write_atomically(out, &bytes).with_context(|| format!("{}: cannot write the avatar", out.display()))?;
    let gaussians = if args.gaussians { format!(", {} Gaussians", avatar.template.len()) } else { String::new() };
    say!(
        "{}: {} vertices, {} joints, {} pose directions, a texture of {} texels, {} motions, {} pose correctives\
         {gaussians}, {:.2} MB",
        out.display(),
        hand.model.vertices.len(),
        hand.model.joint_count(),
        hand.model.pose_directions.len() / hand.model.vertices.len().max(1),
        hand.texture.width,
        motions.len(),
        correctives.targets.len() / hand.model.vertices.len().max(1),
        bytes.len() as f64 * 1e-6
    );
    Ok(())
}

/// What the exported poses change of the hand beyond skinning.
struct PoseCorrectives {
    targets: Vec<DVec3>,
    /// The weights in the pose in which the file opens.
    opening: Vec<f64>,
    /// Of each motion.
    keys: Vec<Vec<CorrectiveKey>>,
}

impl PoseCorrectives {
    fn of(
        avatar: &Avatar,
        opening: Option<&Pose>,
        sequences: &[(String, f64, Vec<Pose>)],
    ) -> anyhow::Result<PoseCorrectives> {
        let frames: Vec<Vec<usize>> = sequences.iter().map(|(_, _, poses)| key_frames(poses.len())).collect();
        let keys = sequences.iter().zip(&frames).flat_map(|((_, _, poses), frames)| frames.iter().map(|k| &poses[*k]));
        let poses: Vec<Pose> = opening.into_iter().chain(keys).cloned().collect();
        let Correctives { targets, weights } = one_sided(&Correctives::of(avatar, &poses)?);
        let mut weights = weights.into_iter();
        let opening = opening.and_then(|_| weights.next()).unwrap_or_default();
        let keys = frames.into_iter().map(|frames| {
            frames.into_iter().zip(&mut weights).map(|(frame, weights)| CorrectiveKey { frame, weights }).collect()
        });
        Ok(PoseCorrectives { keys: keys.collect(), targets, opening })
    }
}

/// The frames at which a motion's correctives are computed: first and last, and evenly between them.
fn key_frames(count: usize) -> Vec<usize> {
    let keys = count.min(MOST_KEYS);
    (0..keys).map(|k| k * (count - 1) / (keys - 1).max(1)).collect()
}

/// The name of an animation: a motion's own, or that of its file.
fn motion_name(text: &str) -> String {
    Path::new(text).file_stem().map_or_else(|| text.to_owned(), |stem| stem.to_string_lossy().into_owned())
}

/// A texture as a PNG file.
fn png(texture: &Texture) -> anyhow::Result<Vec<u8>> {
    use image::codecs::png::{CompressionType, FilterType, PngEncoder};
    let mut bytes = vec![];
    PngEncoder::new_with_quality(&mut bytes, CompressionType::Best, FilterType::Adaptive)
        .write_image(texture.rgb.as_flattened(), texture.width, texture.height, ExtendedColorType::Rgb8)
        .context("the texture cannot be written as a PNG file")?;
    Ok(bytes)
}
