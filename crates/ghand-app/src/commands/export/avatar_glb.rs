//! An avatar as a rigged, textured `.glb`, on request with its Gaussians.

use std::path::Path;

use anyhow::{Context, bail};
use ghand_avatar::gaussian_glb::add_gaussians;
use ghand_avatar::textured_hand::TexturedHand;
use ghand_avatar::{Avatar, PropertyTables};
use ghand_core::Pose;
use ghand_core::mesh::Texture;
use ghand_files::atomic_file::write_atomically;
use ghand_hand_model::files::rigged_glb::{Motion, RiggedHand};
use image::{ExtendedColorType, ImageEncoder};

use super::hand_model::fit_correctives;
use super::{DEFAULT_TEXTURE, ExportArgs};
use crate::baked::baked;
use crate::cli::AdapterArgs;
use crate::say;

/// Writes the avatar's hand with its skeleton, skin and motions.
///
/// # Errors
/// An error that names the file or the option and its problem.
pub fn write(args: &ExportArgs, out: &Path, adapter: &AdapterArgs) -> anyhow::Result<()> {
    let shown = args.subject.display();
    args.reading.reading().refuse_for(&format!("{shown} is an avatar"))?;
    let mut avatar = Avatar::load(&args.subject)?;
    let mut opening: Option<Pose> = None;
    let mut sequences = vec![];
    for text in &args.pose {
        let sequence = args.frames(text, &avatar.model)?;
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
    let motions: Vec<Motion> = sequences.iter().map(|(name, fps, poses)| Motion { name, fps: *fps, poses }).collect();
    let rigged =
        RiggedHand { skin: Some(&skin), joint_names: names.as_deref(), pose: opening.as_ref(), motions: &motions };
    let mut document = rigged.document(&hand.model)?;
    if args.gaussians {
        add_gaussians(&mut document, &avatar)?;
    }
    let bytes = document.finish()?;
    write_atomically(out, &bytes).with_context(|| format!("{}: cannot write the avatar", out.display()))?;
    let gaussians = if args.gaussians { format!(", {} Gaussians", avatar.template.len()) } else { String::new() };
    say!(
        "{}: {} vertices, {} joints, {} pose directions, a texture of {} texels, {} motions{gaussians}, {:.2} MB",
        out.display(),
        hand.model.vertices.len(),
        hand.model.joint_count(),
        hand.model.pose_directions.len() / hand.model.vertices.len().max(1),
        hand.texture.width,
        motions.len(),
        bytes.len() as f64 * 1e-6
    );
    Ok(())
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
