//! The result of a reader, before it is converted to a hand model.

use ghand_core::Side;
use glam::DVec3;

use super::PoseFrame;
use super::file_skeleton::FileSkeleton;
use crate::ik::LANDMARK_COUNT;

/// The content of a file.
pub(crate) struct Recording {
    /// Which hand it is, if the file says.
    pub side: Option<Side>,
    pub fps: Option<f64>,
    pub motion: Motion,
    pub warnings: Vec<String>,
}

pub(crate) enum Motion {
    /// ghand's own rotations.
    Rows(Box<Rows>),
    /// Rotations of MANO's 16 joints.
    Mano(ManoRows),
    /// Rotations of WebXR's 25 joints, each in the frame of its parent; the translation is the wrist's position.
    WebXr { frames: Vec<PoseFrame> },
    /// Positions of 21 landmarks.
    Landmarks { frames: Vec<LandmarkFrame> },
}

/// Rotations in the order of the joints of the model that they are used with, or of a skeleton that the file describes.
pub(crate) struct Rows {
    pub rig: Option<FileSkeleton>,
    pub frames: Vec<PoseFrame>,
    /// Kind of the hand model of a capture.
    pub capture_kind: Option<String>,
    /// Whether they are measured from the model's mean pose, if it has one.
    pub from_mean: bool,
    /// Which hand it is, if the file says so outside the skeleton.
    pub side: Option<Side>,
}

/// Rotations of MANO's 16 joints, in MANO's order.
pub(crate) struct ManoRows {
    pub frames: Vec<PoseFrame>,
    /// Whether they are measured from MANO's mean pose, or from the flat hand.
    pub from_mean: bool,
    /// Whether the root and the translation are those of OpenGL's camera, y up and looking along -z.
    pub opengl: bool,
}

/// One moment.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct LandmarkFrame {
    /// Id of the frame.
    pub id: String,
    /// Positions, metres.
    pub points: [DVec3; LANDMARK_COUNT],
}
