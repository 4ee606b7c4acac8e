//! Counts the entries of annotation files, for untrusted bytes.

use ghand_core::Side;

use super::{annotations, images, poses};

/// The entries found in bytes read as each of InterHand2.6M's annotation files, capture 0.
#[derive(Debug)]
pub struct AnnotationCounts {
    /// Cameras with a position.
    pub cameras: serde_json::Result<usize>,
    /// Images of the sequence `ROM`.
    pub images: serde_json::Result<usize>,
    /// Poses of the right hand.
    pub poses: serde_json::Result<usize>,
}

/// Reads bytes as each of the annotation files of InterHand2.6M.
pub fn count_annotations(json: &[u8]) -> AnnotationCounts {
    AnnotationCounts {
        cameras: annotations::read_camera_text(json, "0").map(|tables| tables.campos.len()),
        images: images::read_image_text(json, "0", &["ROM".into()]).map(|images| images.all.len()),
        poses: poses::read_pose_text(json, "0", Side::Right).map(|poses| poses.len()),
    }
}
