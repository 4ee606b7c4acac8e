//! The smallest baked avatar within a loss, or the best within a size.

use anyhow::bail;
use ghand_avatar::deform::baked::Precision;
use ghand_avatar::{Avatar, Bake, PropertyTables};
use ghand_render::Gpu;

use super::reference_pictures::{Loss, ReferencePictures};
use crate::say;

/// What is asked for; at least one of the two.
#[derive(Debug, Clone, Copy)]
pub struct Goal {
    /// Largest loss, dB.
    pub max_loss_db: Option<f64>,
    /// Largest file, bytes.
    pub max_bytes: Option<usize>,
}

/// A baked avatar and its figures.
pub struct Chosen {
    pub avatar: Avatar,
    pub precision: Precision,
    pub blocks: usize,
    pub components: usize,
    pub bytes: usize,
    pub loss: Loss,
}

/// The search ends when it knows the number of blocks to this part of it.
const RESOLUTION: f64 = 0.03;

/// Finds it.
///
/// # Errors
/// One sentence if no baked avatar is within loss and size, with what can be reached; an error if the device failed.
pub fn smallest(
    gpu: &Gpu,
    bake: &Bake,
    reference: &ReferencePictures,
    goal: Goal,
    precision: Option<Precision>,
) -> anyhow::Result<Chosen> {
    let precisions = precision.map_or(vec![Precision::U8, Precision::F16, Precision::F32], |one| vec![one]);
    let mut least = f64::INFINITY;
    for precision in precisions {
        let made = |keep: usize| make(gpu, bake, reference, keep, precision);
        let most = match goal.max_bytes {
            None => bake.blocks(),
            Some(bytes) => largest_within(bake, precision, bytes)?,
        };
        let all = made(most)?;
        least = least.min(all.loss.db);
        let Some(max_loss) = goal.max_loss_db else { return Ok(all) };
        if all.loss.db > max_loss {
            continue;
        }
        let mut best = all;
        let mut too_few = 0;
        while (best.blocks - too_few) as f64 > (RESOLUTION * best.blocks as f64).max(1.0) {
            // Few blocks bring much: the middle of the logarithms is found sooner.
            let middle = (too_few as f64 + 1.0) * (best.blocks as f64 + 1.0);
            let keep = (middle.sqrt() as usize).clamp(too_few + 1, best.blocks - 1);
            let tried = made(keep)?;
            match tried.loss.db <= max_loss {
                true => best = tried,
                false => too_few = keep,
            }
        }
        return Ok(best);
    }
    let size = goal.max_bytes.map_or(String::new(), |bytes| format!(" in {:.2} MB", bytes as f64 * 1e-6));
    let wanted = goal.max_loss_db.unwrap_or_default();
    bail!(
        "--max-loss-db {wanted}: cannot be reached{size}; the least loss is {least:.3} dB. More components (--rank) and more \
         poses (--fit, --poses) may lower it"
    )
}

fn make(
    gpu: &Gpu,
    bake: &Bake,
    reference: &ReferencePictures,
    keep: usize,
    precision: Precision,
) -> anyhow::Result<Chosen> {
    let avatar = bake.avatar(keep, precision);
    let loss = reference.loss(gpu, &avatar)?;
    let bytes = avatar.file_size()?;
    say!("{keep} blocks: {:.2} MB, loss {:.3} dB", bytes as f64 * 1e-6, loss.db);
    let components = match &avatar.tables {
        PropertyTables::Baked(tables) => tables.components.len(),
        _ => 0,
    };
    Ok(Chosen { avatar, precision, blocks: keep, components, bytes, loss })
}

/// The largest number of blocks in a file of so many bytes.
fn largest_within(bake: &Bake, precision: Precision, bytes: usize) -> anyhow::Result<usize> {
    let size = |keep: usize| bake.avatar(keep, precision).file_size();
    let none = size(0)?;
    if none > bytes {
        let [least, wanted] = [none, bytes].map(|bytes| bytes as f64 * 1e-6);
        bail!(
            "--max-mb {wanted}: is too small for this avatar's Gaussians; without any component it has {least:.2} MB"
        );
    }
    let mut fits = 0;
    let mut too_many = bake.blocks() + 1;
    while too_many - fits > 1 {
        let middle = (fits + too_many) / 2;
        if size(middle)? <= bytes {
            fits = middle;
        } else {
            too_many = middle;
        }
    }
    Ok(fits)
}
