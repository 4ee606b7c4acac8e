//! Positions of the cameras relative to the hand.

use ghand_core::rotation::rotation_from_axis_angle;
use glam::DVec3;

use crate::capture::Capture;

/// The position of one camera, and its images.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CameraFacts {
    /// Distance from the hand's mean position, metres.
    pub distance: f64,
    /// Whether that position lies in front of the camera.
    pub in_front: bool,
    /// Number of images in the splits.
    pub images: usize,
}

/// Facts of every camera; `pairs` (camera, frame) are the images of all splits, each once.
pub(super) fn camera_facts(capture: &Capture, pairs: &[(usize, usize)]) -> Vec<CameraFacts> {
    let hand = mean_position(capture);
    let mut facts: Vec<CameraFacts> = (capture.cameras.iter())
        .map(|camera| {
            let seen = camera.camera_from_world(hand);
            CameraFacts { distance: seen.length(), in_front: seen.z > 0.0, images: 0 }
        })
        .collect();
    for (camera, _) in pairs {
        if let Some(facts) = facts.get_mut(*camera) {
            facts.images += 1;
        }
    }
    facts
}

/// The mean over the frames of the hand's centre, world, metres: the centre of the template's vertices, moved only with
/// the root.
fn mean_position(capture: &Capture) -> DVec3 {
    let template = &capture.template;
    let middle = template.vertices.iter().sum::<DVec3>() / template.vertices.len().max(1) as f64;
    let root = template.joints.first().copied().unwrap_or_default();
    let of_frame = (capture.frames.iter()).map(|frame| {
        let turn = frame.pose.rotations.first().copied().unwrap_or_default();
        rotation_from_axis_angle(turn) * (middle - root) + root + frame.pose.translation
    });
    of_frame.sum::<DVec3>() / capture.frames.len().max(1) as f64
}
