//! How a run was started, kept beside its checkpoints, so that `train --resume` needs no other options.

use std::path::Path;
use std::time::Duration;

use anyhow::{Context, anyhow};
use ghand_files::atomic_file::write_atomically;
use ghand_files::input_file;
use ghand_files::json_error::plain_json_error;
use ghand_train::TrainSettings;
use serde::{Deserialize, Serialize};

use crate::capture_source::CaptureSource;
use crate::lpips_weights::LpipsWeights;

/// Largest record, bytes.
const LARGEST_RECORD: u64 = 1 << 20;

/// How a run was started. Paths are absolute.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RunRecord {
    /// The capture and how to read it.
    pub capture: CaptureSource,
    /// Whether the capture is the demo's, which is made if it is missing.
    pub demo: bool,
    /// Split to train on.
    pub split: String,
    /// Split to evaluate on, if one was named.
    pub test_split: Option<String>,
    /// The poses that the run started from, as on the command line.
    pub poses: String,
    /// The weights for LPIPS.
    pub lpips: LpipsWeights,
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
    /// An option of ghand 0.1 that was removed.
    #[serde(default, skip_serializing)]
    pub quality: Option<String>,
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
        let record: RunRecord =
            serde_json::from_slice(&bytes).map_err(|error| anyhow!("{name}: {}", plain_json_error(&error)))?;
        if let Some(quality) = &record.quality {
            log::warn!(
                "{name}: --quality {quality} was removed in 0.2 and is ignored; `viewer --baked` bakes what it shows"
            );
        }
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

#[cfg(test)]
mod tests {
    use std::path::PathBuf;

    use glam::DVec2;
    use serde_json::Value;

    use super::*;

    /// A record as ghand 0.1.0 wrote it, with all options, but without its settings.
    const RECORD: &str = include_str!("run_record/run.json");

    #[test]
    fn a_record_of_an_earlier_program_opens_and_is_written_as_it_was() {
        let mut json: Value = serde_json::from_str(RECORD).unwrap();
        json["settings"] = serde_json::to_value(TrainSettings::default()).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run.json");
        std::fs::write(&path, json.to_string()).unwrap();
        let record = RunRecord::load(&path).unwrap().unwrap();
        let options = &record.capture.options;
        assert_eq!(record.capture.capture, Some(PathBuf::from("/captures/hand")));
        assert_eq!(options.hand_model, Some(PathBuf::from("/models/MANO_LEFT.pkl")));
        assert!(options.hand_model_args.left_shapes_as_published);
        assert_eq!(options.train_sequences, ["ROM04_LT_Occlusion"]);
        assert_eq!(options.test_sequences, ["ROM03_LT_No_Occlusion", "ROM05_LT_Wrist_ROM"]);
        assert_eq!(options.principal_point, Some(DVec2::new(224.0, 230.5)));
        assert_eq!(record.lpips.lpips, Some(PathBuf::from("/models/lpips.safetensors")));
        assert_eq!(record.checkpoint_every, Some(Duration::from_millis(100)));
        record.save(&path).unwrap();
        let again: Value = serde_json::from_slice(&std::fs::read(&path).unwrap()).unwrap();
        assert_eq!(record.quality.as_deref(), Some("balanced"));
        json.as_object_mut().unwrap().remove("quality");
        // Of an option that was removed.
        json["capture"]["options"]["hand_model_args"].as_object_mut().unwrap().remove("uv");
        assert_eq!(again, json);
        json["captures"] = Value::Null;
        std::fs::write(&path, json.to_string()).unwrap();
        assert!(RunRecord::load(&path).unwrap_err().to_string().contains("captures"), "an unknown field is an error");
    }
}
