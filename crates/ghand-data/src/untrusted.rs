//! Readers of bytes alone, without the folder that they would come from: what fuzzing feeds.

use std::path::Path;

use ghand_core::hand_model::HandModelError;
use ghand_core::{HandModel, Pose, Side};

use crate::capture::{Capture, CaptureError};
use crate::{ghand_format, hand_appearance, interhand};

/// Reads the text of a `capture.json`. `path` is where it would be: for messages, and for a hand model beside it.
///
/// # Errors
/// As of [`Capture::open_with`].
pub fn read_capture_text(path: &Path, text: &str, mano: Option<&HandModel>) -> Result<Capture, CaptureError> {
    ghand_format::read_capture_text(path, text, mano)
}

/// What was found in bytes that were read as each of InterHand2.6M's annotation files, capture 0.
#[derive(Debug)]
pub struct InterHandCounts {
    /// Cameras with a position.
    pub cameras: serde_json::Result<usize>,
    /// Images of the sequence `ROM`.
    pub images: serde_json::Result<usize>,
    /// Poses of the right hand.
    pub poses: serde_json::Result<usize>,
}

/// Reads bytes as each of the annotation files of InterHand2.6M.
pub fn read_interhand_annotations(json: &[u8]) -> InterHandCounts {
    InterHandCounts {
        cameras: interhand::annotations::read_camera_text(json, "0").map(|tables| tables.campos.len()),
        images: interhand::images::read_image_text(json, "0", &["ROM".into()]).map(|images| images.all.len()),
        poses: interhand::poses::read_pose_text(json, "0", Side::Right).map(|poses| poses.len()),
    }
}

/// Reads bytes as the pickle of a frame of the Hand Appearance dataset: pose and shape. `model` is MANO's.
///
/// # Errors
/// [`HandModelError::Invalid`] names the array that is missing or wrong.
pub fn read_hand_appearance_pose(bytes: &[u8], model: &HandModel) -> Result<(Pose, Vec<f64>), HandModelError> {
    hand_appearance::read_pose("0001_mano.pkl", bytes, model)
}
