//! The files that a run leaves behind.

use std::path::Path;

use anyhow::Context;
use ghand_core::atomic_file::write_atomically;
use ghand_data::Capture;
use ghand_train::Trained;
use ghand_train::evaluate::Metrics;

/// Writes the refined poses as a pose file, joints in the hand model's order.
///
/// # Errors
/// One that names the file, if it cannot be written.
pub fn save_poses(capture: &Capture, frames: &[usize], trained: &Trained, path: &Path) -> anyhow::Result<()> {
    let frames: Vec<serde_json::Value> = frames
        .iter()
        .zip(&trained.poses)
        .map(|(frame, pose)| {
            serde_json::json!({
                "id": capture.frames[*frame].id,
                "pose": pose.rotations.iter().map(|r| r.to_array()).collect::<Vec<_>>(),
                "translation": pose.translation.to_array(),
                "shape": capture.frames[*frame].shape,
            })
        })
        .collect();
    let text = serde_json::to_string_pretty(&serde_json::json!({ "fps": 30, "frames": frames }))?;
    write_atomically(path, text.as_bytes()).with_context(|| format!("{}: cannot write", path.display()))
}

/// Writes the figures.
///
/// # Errors
/// One that names the file, if it cannot be written.
pub fn save_metrics(metrics: &Metrics, path: &Path) -> anyhow::Result<()> {
    let text = serde_json::to_string_pretty(metrics)?;
    write_atomically(path, text.as_bytes()).with_context(|| format!("{}: cannot write", path.display()))
}
