//! `truth.json`: exact poses beside a capture, if known. Training never reads it; evaluation may.
//!
//! `{"frames":[{"id":"0000","pose":[[x,y,z]],"translation":[x,y,z]}]}`, like the frames of a `capture.json`.

use std::path::Path;

use ghand_core::Pose;
use serde::{Deserialize, Serialize};

use crate::capture::Capture;
use crate::error::CaptureError;
use crate::reading::json_file::{LARGEST_FILE, parse, write_json};
use crate::reading::text_file::read_text;
use crate::reading::validation::{FileValidator, JointRows};

pub(crate) const TRUTH_FILE: &str = "truth.json";

#[derive(Serialize, Deserialize)]
struct TruthFile {
    frames: Vec<TruthFrame>,
}

#[derive(Serialize, Deserialize)]
struct TruthFrame {
    id: String,
    pose: Vec<Vec<f64>>,
    translation: [f64; 3],
}

/// Exact poses with the ids of their frames, each once; `None` if the file is missing. `joints` are the hand model's.
pub(crate) fn read_truth(path: &Path, joints: JointRows) -> Result<Option<Vec<(String, Pose)>>, CaptureError> {
    if !path.exists() {
        return Ok(None);
    }
    let remedy = "make the file readable, or remove it (it is optional)";
    let text = read_text(path, LARGEST_FILE, "read the exact poses", remedy)?;
    let file: TruthFile = parse(path, &text)?;
    let validator = FileValidator { path };
    validator.index("frames", file.frames.iter().map(|f| f.id.as_str()))?;
    let pose = |f: TruthFrame| validator.pose(&f.id, &f.pose, f.translation, joints).map(|pose| (f.id, pose));
    file.frames.into_iter().map(pose).collect::<Result<_, _>>().map(Some)
}

/// Writes the truth into the capture's folder, if known.
pub(crate) fn write_truth(capture: &Capture) -> Result<(), CaptureError> {
    let Some(truth) = &capture.truth else { return Ok(()) };
    let frames = (capture.frames.iter().zip(truth))
        .filter_map(|(frame, pose)| {
            let pose = pose.as_ref()?;
            Some(TruthFrame { id: frame.id.clone(), pose: pose_rows(pose), translation: pose.translation.to_array() })
        })
        .collect();
    write_json(&capture.root.join(TRUTH_FILE), &TruthFile { frames })
}

/// Axis-angle numbers of a pose, one row per joint.
pub(crate) fn pose_rows(pose: &Pose) -> Vec<Vec<f64>> {
    pose.rotations.iter().map(|r| r.to_array().to_vec()).collect()
}
