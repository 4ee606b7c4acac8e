//! How a run was started, kept beside its checkpoints, so that `train --resume` needs no other options.

use std::path::Path;
use std::time::Duration;

use anyhow::{Context, anyhow};
use ghand_files::atomic_file::write_atomically;
use ghand_files::input_file;
use ghand_files::json_error::plain_json_error;
use ghand_train::TrainSettings;
use serde::{Deserialize, Serialize};

use crate::capture_args::CaptureArgs;
use crate::lpips_args::LpipsArgs;

/// Largest record, bytes.
const LARGEST_RECORD: u64 = 1 << 20;

/// How a run was started. Paths are absolute.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RunRecord {
    /// The capture and how to read it.
    pub capture: CaptureArgs,
    /// Whether the capture is the demo's, which is made if it is missing.
    pub demo: bool,
    /// Split to train on.
    pub split: String,
    /// Split to evaluate on, if one was named.
    pub test_split: Option<String>,
    /// The poses that the run started from, as on the command line.
    pub poses: String,
    /// The weights for LPIPS.
    pub lpips: LpipsArgs,
    /// Name of the preset that the settings started from.
    pub preset: String,
    /// The settings.
    #[serde(deserialize_with = "TrainSettings::of_run")]
    pub settings: TrainSettings,
    /// Whether a capture with problems is trained on.
    pub ignore_checks: bool,
    /// Time between two checkpoints, if it was given.
    #[serde(default)]
    pub checkpoint_every: Option<Duration>,
    /// Of every how many iterations a checkpoint is kept, if it was given.
    #[serde(default)]
    pub keep_checkpoints: Option<u64>,
}

impl RunRecord {
    /// Reads a record; `None` if there is none.
    ///
    /// # Errors
    /// An error that names the file and what is wrong with it.
    pub fn load(path: &Path) -> anyhow::Result<Option<RunRecord>> {
        if !path.exists() {
            return Ok(None);
        }
        let name = path.display();
        let bytes = input_file::read(path, LARGEST_RECORD).with_context(|| format!("{name}: cannot be read"))?;
        let bytes = bytes.ok_or_else(|| anyhow!("{name}: is too large for the record of a run"))?;
        let record = serde_json::from_slice(&bytes).map_err(|error| anyhow!("{name}: {}", plain_json_error(&error)))?;
        Ok(Some(record))
    }

    /// Writes the record.
    ///
    /// # Errors
    /// An error that names the file if it cannot be written.
    pub fn save(&self, path: &Path) -> anyhow::Result<()> {
        let text = serde_json::to_string_pretty(self)?;
        write_atomically(path, text.as_bytes()).with_context(|| format!("{}: cannot write", path.display()))
    }
}
