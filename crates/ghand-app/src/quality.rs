//! How an avatar is played: three presets from fast to exact, as they were measured on an adapter or by default.
//!
//! A preset says whether the avatar is baked, and with how many of its blocks, and how many pixels are drawn. The baked
//! avatar lies beside the one that it was made of, `avatar.baked-0.0625.ghand` beside `avatar.ghand` if it keeps a sixteenth of
//! the blocks, and is made again when that one has changed.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use anyhow::{Context, anyhow};
use clap::ValueEnum;
use etcetera::{BaseStrategy, choose_base_strategy};
use ghand_avatar::{Avatar, Bake, PropertyTables};
use ghand_core::Pose;
use ghand_files::atomic_file::write_atomically;
use ghand_files::input_file;
use ghand_render::Gpu;
use ghand_render::deform::baked::Precision;
use serde::{Deserialize, Serialize};

use crate::commands::bake::pose_set::{PoseSet, PoseSetOptions};
use crate::say;

/// A preset.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord, ValueEnum, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Quality {
    /// Baked, and a smaller picture that is enlarged
    Fast,
    /// Baked, without a loss that can be seen
    Balanced,
    /// The avatar as it was trained
    #[default]
    Exact,
}

impl Quality {
    /// Its name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Quality::Fast => "fast",
            Quality::Balanced => "balanced",
            Quality::Exact => "exact",
        }
    }
}

/// What a preset stands for.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Playback {
    /// The part of its blocks that the baked avatar keeps, 0 to 1; `None`: the avatar is not baked.
    pub kept: Option<f64>,
    /// A picture on the screen is drawn at this part of its width and height, 0.25 to 1, and enlarged.
    pub image_scale: f64,
}

/// Smallest image scale.
const LEAST_SCALE: f64 = 0.25;
/// Components of a joint of a baked avatar.
pub const RANK: usize = 6;
/// Largest file of presets, bytes.
const LARGEST_FILE: u64 = 1 << 20;

impl Playback {
    /// The avatar as it was trained.
    pub const EXACT: Playback = Playback { kept: None, image_scale: 1.0 };

    /// What a preset is on adapters that were not measured: measured on lavapipe, see docs/playback.md.
    fn unmeasured(quality: Quality) -> Playback {
        match quality {
            Quality::Fast => Playback { kept: Some(1.0 / 16.0), image_scale: 0.75 },
            Quality::Balanced => Playback { kept: Some(1.0 / 16.0), image_scale: 1.0 },
            Quality::Exact => Playback::EXACT,
        }
    }

    fn is_valid(&self) -> bool {
        self.kept.is_none_or(|kept| (0.0..=1.0).contains(&kept)) && (LEAST_SCALE..=1.0).contains(&self.image_scale)
    }
}

/// The presets that were measured, by adapter.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct QualityPresets(BTreeMap<String, BTreeMap<Quality, Playback>>);

impl QualityPresets {
    /// Where the user's presets are; `None` if there is no such folder.
    pub fn path() -> Option<PathBuf> {
        Some(choose_base_strategy().ok()?.config_dir().join("ghand").join("quality.json"))
    }

    /// Reads presets; none if there is no file.
    ///
    /// # Errors
    /// An error that names the file if it cannot be used.
    pub fn read(path: &Path) -> anyhow::Result<QualityPresets> {
        if !path.exists() {
            return Ok(QualityPresets::default());
        }
        let name = path.display();
        let bytes = input_file::read(path, LARGEST_FILE).with_context(|| format!("{name}: cannot be read"))?;
        let bytes = bytes.ok_or_else(|| anyhow!("{name}: is too large for presets; remove it"))?;
        let presets: QualityPresets = serde_json::from_slice(&bytes)
            .with_context(|| format!("{name}: is not a file of presets; remove it, or measure again"))?;
        if !presets.0.values().flat_map(BTreeMap::values).all(Playback::is_valid) {
            return Err(anyhow!("{name}: has a number out of its range; remove it, or measure again"));
        }
        Ok(presets)
    }

    /// Writes the presets.
    ///
    /// # Errors
    /// An error that names the file.
    pub fn write(&self, path: &Path) -> anyhow::Result<()> {
        let written = || -> std::io::Result<()> {
            path.parent().map_or(Ok(()), std::fs::create_dir_all)?;
            write_atomically(path, serde_json::to_string_pretty(self)?.as_bytes())
        };
        written().with_context(|| format!("{}: cannot be written", path.display()))
    }

    /// What a preset is on an adapter.
    pub fn of(&self, adapter: &str, quality: Quality) -> Playback {
        let measured = self.0.get(adapter).and_then(|presets| presets.get(&quality));
        measured.copied().unwrap_or(Playback::unmeasured(quality))
    }

    /// Keeps what was measured on an adapter.
    pub fn set(&mut self, adapter: &str, quality: Quality, playback: Playback) {
        self.0.entry(adapter.to_owned()).or_default().insert(quality, playback);
    }
}

/// What a preset of the user is on a device.
///
/// # Errors
/// An error that names the file of presets if it cannot be used.
pub fn playback(gpu: &Gpu, quality: Quality) -> anyhow::Result<Playback> {
    let presets = QualityPresets::path().map_or(Ok(QualityPresets::default()), |path| QualityPresets::read(&path))?;
    Ok(presets.of(&gpu.info.name, quality))
}

/// The file of an avatar that is played in a preset: its own or, baked if it is missing or older, the one beside it.
///
/// # Errors
/// An error that names the file that cannot be read, baked or written.
pub fn prepare(gpu: &Gpu, path: &Path, quality: Quality, playback: Playback) -> anyhow::Result<PathBuf> {
    let Some(kept) = playback.kept else { return Ok(path.to_owned()) };
    let beside = path.with_extension(format!("baked-{kept}.ghand"));
    if is_newer(&beside, path) {
        return Ok(beside);
    }
    let avatar = Avatar::load(path)?;
    if matches!(avatar.tables, PropertyTables::Baked(_)) {
        return Ok(path.to_owned());
    }
    say!("baking {} for `{}`", path.display(), quality.name());
    let poses = PoseSet::gather(&PoseSetOptions::default(), &avatar, None)?;
    let fitted: Vec<Pose> = poses.fitted.into_iter().map(|named| named.pose).collect();
    let bake = Bake::new(gpu, &avatar, &fitted, RANK, |_| ()).with_context(|| path.display().to_string())?;
    let keep = (kept * bake.blocks() as f64).round() as usize;
    bake.avatar(keep, Precision::U8).save(&beside)?;
    Ok(beside)
}

/// Whether a file was written after another.
fn is_newer(path: &Path, than: &Path) -> bool {
    let written = |path: &Path| std::fs::metadata(path).and_then(|metadata| metadata.modified()).ok();
    written(path).zip(written(than)).is_some_and(|(path, than)| path >= than)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn presets_are_those_of_their_adapter_and_are_read_as_they_were_written() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("config/quality.json");
        let mut presets = QualityPresets::read(&path).unwrap();
        assert_eq!(presets.of("any", Quality::Exact), Playback::EXACT);
        assert!(presets.of("any", Quality::Fast).kept.is_some());
        let measured = Playback { kept: Some(0.25), image_scale: 0.5 };
        presets.set("one", Quality::Fast, measured);
        presets.write(&path).unwrap();
        let presets = QualityPresets::read(&path).unwrap();
        assert_eq!(presets.of("one", Quality::Fast), measured);
        assert_ne!(presets.of("other", Quality::Fast), measured);
    }

    #[test]
    fn a_file_that_is_not_one_of_presets_is_one_sentence() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("quality.json");
        let hostile = [
            "",
            "[]",
            r#"{"a":{"slow":{"kept":1,"image_scale":1}}}"#,
            r#"{"a":{"fast":{"kept":2,"image_scale":1}}}"#,
            r#"{"a":{"fast":{"kept":null,"image_scale":0}}}"#,
        ];
        for text in hostile {
            std::fs::write(&path, text).unwrap();
            let message = QualityPresets::read(&path).unwrap_err().to_string();
            assert!(message.contains("quality.json") && !message.contains('\n'), "{message}");
        }
    }
}
