//! The project's own capture format: `capture.json`, version 1, with an optional `truth.json` beside it.
//!
//! Lengths are metres, rotations axis-angle in radians in the hand model's axes, cameras OpenCV's. Paths are relative
//! to the capture's folder and must stay inside it. An unknown field is an error, unless its name marks it as a comment
//! (begins with `_`, `//` or `$`). Poses of a MANO model are whole rotations: they include its mean pose.

#[cfg(test)]
mod field_tests;
pub(crate) mod fields;
mod read;
#[cfg(test)]
mod tests;
mod write;

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::cameras::file::CameraFile;

const FORMAT: &str = "ghand-capture";
const VERSION: u64 = 1;
const UNITS: &str = "metre";
/// The value of `masks`.
const MADE: &str = "made";
pub(crate) use read::read_capture;
pub use read::read_capture_text;

pub(crate) const CAPTURE_FILE: &str = "capture.json";

/// The fields of every version of the file; read first, to report a file of another version as such.
#[derive(Deserialize)]
struct HeaderFile {
    format: Option<String>,
    version: Option<u64>,
}

#[derive(Serialize, Deserialize)]
struct CaptureFile {
    format: String,
    version: u64,
    units: String,
    side: String,
    #[serde(default)]
    background: [f64; 3],
    hand_model: HandModelFile,
    /// Coordinates of the centre of the top left pixel, 0.5 or 0; 0.5 if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pixel_center: Option<f64>,
    cameras: Vec<CameraFile>,
    frames: Vec<FrameFile>,
    image_path: String,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    mask_path: Option<String>,
    /// Where other hands are, which masks that are made leave out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    other_hands_path: Option<String>,
    /// `"made"`: masks are made for images that have none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    masks: Option<String>,
    splits: BTreeMap<String, SplitFile>,
}

#[derive(Serialize, Deserialize)]
struct HandModelFile {
    kind: String,
    /// glTF only: the file.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    path: Option<String>,
    /// Names of the joints in the order of the poses' rows; the model's own order if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    joints: Option<Vec<String>>,
    /// Index of each joint's parent in `joints`, -1 for the root.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    parents: Option<Vec<i64>>,
}

#[derive(Serialize, Deserialize)]
struct FrameFile {
    id: String,
    pose: Vec<Vec<f64>>,
    translation: [f64; 3],
    #[serde(default)]
    shape: Vec<f64>,
}

#[derive(Default, Serialize, Deserialize)]
struct SplitFile {
    #[serde(default)]
    cameras: Vec<String>,
    #[serde(default)]
    frames: Vec<String>,
}
