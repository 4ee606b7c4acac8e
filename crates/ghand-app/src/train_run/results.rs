//! Writes the result files of a run.

use std::path::Path;

use anyhow::Context;
use ghand_capture::{Capture, Frame};
use ghand_core::{HandModel, Pose};
use ghand_files::atomic_file::write_atomically;
use ghand_motion::pose_sequence::DEFAULT_FPS;
use ghand_motion::pose_sequence::formats::ghand::write_poses;
use ghand_motion::{PoseFrame, PoseSequence};
use ghand_train::Trained;
use serde::Serialize;

/// Writes the refined poses as a pose file, joints in the hand model's order.
///
/// # Errors
/// An error that names the file, if it cannot be written.
pub fn save_poses(capture: &Capture, frames: &[usize], trained: &Trained, path: &Path) -> anyhow::Result<()> {
    // The hand model in the avatar file also has the learned joints.
    let model = HandModel { joints: trained.avatar.template.joints.clone(), ..trained.avatar.model.clone() };
    let frame = |(frame, pose): (&usize, &Pose)| {
        let Frame { id, shape, .. } = capture.frames.get(*frame)?;
        Some(PoseFrame { id: id.clone(), pose: pose.clone(), shape: shape.clone() })
    };
    let frames = frames.iter().zip(&trained.poses).filter_map(frame).collect();
    let joint_names = model.joint_names.clone();
    Ok(write_poses(path, &PoseSequence { fps: DEFAULT_FPS, joint_names, frames, warnings: vec![] }, &model)?)
}

/// Writes the figures.
///
/// # Errors
/// An error that names the file, if it cannot be written.
pub fn save_metrics(metrics: &impl Serialize, path: &Path) -> anyhow::Result<()> {
    let text = serde_json::to_string_pretty(metrics)?;
    write_atomically(path, text.as_bytes()).with_context(|| format!("{}: cannot write", path.display()))
}
