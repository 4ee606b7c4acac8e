//! The result of a reader, before it is converted to a hand model.

use ghand_core::Side;
use glam::DVec3;

use super::file_skeleton::FileSkeleton;
use crate::ik::LANDMARK_COUNT;
use crate::image_landmarks::ImageFrame;
use crate::pose_sequence::{PoseFrame, Skipped};

/// The content of a file.
pub(crate) struct Recording {
    /// Which hand it is, if the file says.
    pub side: Option<Side>,
    /// The rate of all files of this kind, if it is known; one that a file gives comes first.
    pub usual_fps: Option<f64>,
    pub motion: Motion,
    /// Frames without a usable pose.
    pub skipped: Skipped,
    pub warnings: Vec<String>,
}

pub(crate) enum Motion {
    /// ghand's own rotations.
    Rows(Box<Rows>),
    /// Rotations of MANO's 16 joints.
    Mano(ManoRows),
    /// Rotations of WebXR's 25 joints, each in the frame of its parent; the translation is the wrist's position.
    WebXr { frames: Vec<PoseFrame> },
    /// Positions of 21 landmarks, those of the fingertips `tip_inset` metres inside the finger.
    Landmarks { frames: Vec<LandmarkFrame>, tip_inset: f64 },
    /// Landmarks in the images of cameras.
    ImageLandmarks { frames: Vec<ImageFrame>, tip_inset: f64 },
}

impl Motion {
    /// Number of usable frames.
    pub fn len(&self) -> usize {
        match self {
            Motion::Rows(rows) => rows.frames.len(),
            Motion::Mano(rows) => rows.frames.len(),
            Motion::WebXr { frames } => frames.len(),
            Motion::Landmarks { frames, .. } => frames.len(),
            Motion::ImageLandmarks { frames, .. } => frames.len(),
        }
    }
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
    /// What the rotations of a left hand are.
    pub left: LeftRotations,
}

/// What the rotations of a left hand's MANO parameters are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum LeftRotations {
    /// Those of MANO's left model.
    Own,
    /// Those of a right hand, the mirror image, as networks for right hands give them.
    Mirrored,
    /// The file does not say: taken as those of the left model.
    Assumed,
    /// Its keys are those of a network for right hands: taken as a right hand's.
    AssumedMirrored,
}

/// One moment.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct LandmarkFrame {
    /// Id of the frame.
    pub id: String,
    /// Positions, metres.
    pub points: [DVec3; LANDMARK_COUNT],
}
