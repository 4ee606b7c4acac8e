//! The baked avatar that `--baked` plays: `avatar.baked.ghand` beside `avatar.ghand`, made again when that one has changed.

use std::path::{Path, PathBuf};

use anyhow::Context;
use ghand_avatar::deform::baked::Precision;
use ghand_avatar::{Avatar, Bake, PropertyTables};
use ghand_core::Pose;
use ghand_render::Gpu;

use crate::commands::bake::pose_set::{PoseSet, PoseSetOptions};
use crate::say;

/// Components of a joint of a baked avatar.
pub const RANK: usize = 6;
/// The part of its blocks that is kept: a loss that cannot be seen, see docs/playback.md.
const KEPT: f64 = 1.0 / 16.0;

/// The file of an avatar, baked; made if it is missing or older than the avatar. An avatar that is baked is its own.
///
/// # Errors
/// An error that names the file that cannot be read, baked or written.
pub fn baked(gpu: &Gpu, path: &Path) -> anyhow::Result<PathBuf> {
    let beside = path.with_extension("baked.ghand");
    if is_newer(&beside, path) {
        return Ok(beside);
    }
    let avatar = Avatar::load(path)?;
    if matches!(avatar.tables, PropertyTables::Baked(_)) {
        return Ok(path.to_owned());
    }
    say!("baking {}", path.display());
    let poses = PoseSet::gather(&PoseSetOptions::default(), &avatar, None)?;
    let fitted: Vec<Pose> = poses.fitted.into_iter().map(|named| named.pose).collect();
    let bake = Bake::new(gpu, &avatar, &fitted, RANK, |_| ()).with_context(|| path.display().to_string())?;
    let keep = (KEPT * bake.blocks() as f64).round() as usize;
    bake.avatar(keep, Precision::U8).save(&beside)?;
    Ok(beside)
}

/// Whether a file was written after another.
fn is_newer(path: &Path, than: &Path) -> bool {
    let written = |path: &Path| std::fs::metadata(path).and_then(|metadata| metadata.modified()).ok();
    written(path).zip(written(than)).is_some_and(|(path, than)| path >= than)
}
