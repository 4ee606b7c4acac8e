//! The poses of the training frames: those that a run starts from, and those that it found.

use std::collections::HashMap;
use std::convert::Infallible;
use std::fmt;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use anyhow::{Context, bail};
use ghand_capture::Capture;
use ghand_core::Pose;
use ghand_motion::{PoseFrame, PoseOptions, read_poses};

/// The poses that a run starts from.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub enum StartPoses {
    /// The capture's own.
    #[default]
    Given,
    /// The capture's exact ones.
    Truth,
    /// Those of a file, by the frames' ids.
    File(PathBuf),
}

impl FromStr for StartPoses {
    type Err = Infallible;

    fn from_str(text: &str) -> Result<StartPoses, Infallible> {
        Ok(match text {
            "given" => StartPoses::Given,
            "truth" => StartPoses::Truth,
            path => StartPoses::File(path.into()),
        })
    }
}

impl fmt::Display for StartPoses {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            StartPoses::Given => f.write_str("given"),
            StartPoses::Truth => f.write_str("truth"),
            StartPoses::File(path) => write!(f, "{}", path.display()),
        }
    }
}

impl StartPoses {
    /// The capture with these poses in the frames of the split of that name; other frames keep theirs. If a file has another
    /// shape of the hand than the capture, all frames get it: they show one person.
    ///
    /// # Errors
    /// One sentence that names the option or the file if a pose is missing or does not fit the hand model.
    pub fn applied_to(&self, capture: &Capture, split: &str) -> anyhow::Result<Capture> {
        let frames = &capture.split(split)?.frames;
        let mut changed = capture.clone();
        let poses = match self {
            StartPoses::Given => return Ok(changed),
            StartPoses::Truth => true_poses(capture, split).context("--poses truth")?,
            StartPoses::File(path) => {
                let found = frames_of_split(path, capture, split).context("--poses")?;
                if let Some(shape) = other_shape(&found, capture, frames) {
                    changed.take_shape(&shape).with_context(|| format!("--poses: {}", path.display()))?;
                }
                found.into_iter().map(|frame| frame.pose).collect()
            }
        };
        for (frame, pose) in frames.iter().zip(poses) {
            if let Some(frame) = changed.frames.get_mut(*frame) {
                frame.pose = pose;
            }
        }
        Ok(changed)
    }
}

/// The mean shape of these frames of a file, if one is not the capture's; `None` also if they have none.
fn other_shape(found: &[PoseFrame], capture: &Capture, frames: &[usize]) -> Option<Vec<f64>> {
    let given = |frame: &usize| capture.frames.get(*frame).map(|frame| &frame.shape);
    let is_other = |(found, frame): (&PoseFrame, &usize)| !found.shape.is_empty() && Some(&found.shape) != given(frame);
    if !found.iter().zip(frames).any(is_other) {
        return None;
    }
    let shapes: Vec<&Vec<f64>> = found.iter().map(|frame| &frame.shape).filter(|shape| !shape.is_empty()).collect();
    let length = shapes.iter().map(|shape| shape.len()).max()?;
    let mean = |i: usize| shapes.iter().filter_map(|shape| shape.get(i)).sum::<f64>() / shapes.len() as f64;
    Some((0..length).map(mean).collect())
}

/// The exact poses of a split's frames.
///
/// # Errors
/// One sentence that names the capture, and the first frame without an exact pose if it has others.
pub fn true_poses(capture: &Capture, split: &str) -> anyhow::Result<Vec<Pose>> {
    let Some(truth) = &capture.truth else {
        bail!("{}: the capture has no exact poses (truth.json)", capture.root.display());
    };
    let pose = |frame: &usize| match truth.get(*frame).cloned().flatten() {
        Some(pose) => Ok(pose),
        None => bail!(
            "{}: truth.json has no pose for the frame {:?} of the split {split:?}",
            capture.root.display(),
            frame_id(capture, *frame)
        ),
    };
    capture.split(split)?.frames.iter().map(pose).collect()
}

/// The poses of a split's frames in a file of poses, by the frames' ids.
///
/// # Errors
/// One sentence that names the file, and the frame or the field that is wrong.
pub fn poses_of_split(path: &Path, capture: &Capture, split: &str) -> anyhow::Result<Vec<Pose>> {
    Ok(frames_of_split(path, capture, split)?.into_iter().map(|frame| frame.pose).collect())
}

fn frames_of_split(path: &Path, capture: &Capture, split: &str) -> anyhow::Result<Vec<PoseFrame>> {
    let sequence = read_poses(path, &capture.hand_model, &PoseOptions { by_id: true, ..Default::default() })?;
    sequence.warnings.iter().for_each(|warning| log::warn!("{}: {warning}", path.display()));
    let mut by_id: HashMap<String, PoseFrame> =
        sequence.frames.into_iter().map(|frame| (frame.id.clone(), frame)).collect();
    let pose = |frame: &usize| match by_id.remove(frame_id(capture, *frame)) {
        Some(pose) => Ok(pose),
        None => bail!(
            "{}: has no pose for the frame {:?} of the split {split:?}",
            path.display(),
            frame_id(capture, *frame)
        ),
    };
    capture.split(split)?.frames.iter().map(pose).collect()
}

fn frame_id(capture: &Capture, frame: usize) -> &str {
    capture.frames.get(frame).map_or("", |frame| frame.id.as_str())
}
