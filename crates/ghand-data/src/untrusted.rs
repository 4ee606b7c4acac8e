//! Readers of bytes without a folder, for fuzzing.

use std::path::Path;

use ghand_core::hand_model::HandModelError;
use ghand_core::{HandModel, Pose, Side, Value};

use crate::capture::{Capture, CaptureError};
use crate::pose_sequence::{PoseError, PoseOptions, PoseSequence, poses_of_value};
use crate::{ghand_format, hand_appearance, interhand};

/// Reads the text of a `capture.json`. `path` is its assumed path, for messages and for a hand model beside it.
///
/// # Errors
/// As in [`Capture::open_with`].
pub fn read_capture_text(path: &Path, text: &str, mano: Option<&HandModel>) -> Result<Capture, CaptureError> {
    ghand_format::read_capture_text(path, text, mano)
}

/// Result of reading bytes as each of InterHand2.6M's annotation files, capture 0.
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

/// Names of arrays that readers of poses use.
const ARRAY_NAMES: [&str; 42] = [
    "pose",
    "translation",
    "shape",
    "fps",
    "flat_hand_mean",
    "ids",
    "joints",
    "rot",
    "trans",
    "poses",
    "pose_hand",
    "right_hand_pose",
    "left_hand_pose",
    "pose_r",
    "rot_r",
    "trans_r",
    "shape_r",
    "pred_rot",
    "pred_hand_pose",
    "pred_trans",
    "pred_betas",
    "pred_valid",
    "global_orient",
    "hand_pose",
    "betas",
    "is_right",
    "cam_t",
    "positions",
    "orientations",
    "world_landmarks",
    "handedness",
    "mocap_framerate",
    "handPose",
    "handTrans",
    "handBeta",
    "handJoints3D",
    "mano_pose",
    "xyz",
    "side",
    "parents",
    "rest_joints",
    "tips",
];

/// Reads poses from arrays as in an `.npz` archive, but without its checksums, which would reject mutations. Each array
/// is a byte that selects its name, two bytes with a length (little-endian), and that many bytes of an `.npy` file.
///
/// # Errors
/// As in [`crate::read_poses`].
pub fn read_pose_arrays(mut bytes: &[u8], model: &HandModel) -> Result<PoseSequence, PoseError> {
    let mut arrays: Vec<(String, Value)> = Vec::new();
    while let [choice, low, high, rest @ ..] = bytes {
        let (npy, rest) = rest.split_at(usize::from(u16::from_le_bytes([*low, *high])).min(rest.len()));
        let name = ARRAY_NAMES[usize::from(*choice) % ARRAY_NAMES.len()];
        if arrays.iter().all(|(known, _)| known != name) {
            arrays.push((name.into(), Value::from_bytes(npy).unwrap_or_else(|e| Value::Unreadable(e.to_string()))));
        }
        bytes = rest;
    }
    poses_of_value("file", &Value::Map(arrays), model, &PoseOptions::default())
}
