//! What a file of a tracker holds, before its cameras have names.

use std::collections::BTreeMap;

use glam::DVec2;

use super::{ImageFrame, ImagePoint, LANDMARK_COUNT};

/// The landmarks of one camera at one moment, in the order of MediaPipe.
pub(super) type Landmarks = [Option<ImagePoint>; LANDMARK_COUNT];

/// The landmarks of one camera by the number of the frame; frames without a hand are there, too.
pub(super) type View = BTreeMap<u64, Landmarks>;

/// What a file holds.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Content {
    pub views: Views,
    /// How far landmarks of fingertips lie before the ends of the fingers, metres.
    pub tip_inset: f64,
    /// Whether it is known to be MediaPipe's, whose landmarks of the palm lie beside the joints.
    pub is_mediapipe: bool,
    /// Frames per second, if the file says.
    pub fps: Option<f64>,
    /// What the user should know.
    pub remarks: Vec<String>,
}

/// The cameras of a file.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Views {
    /// One camera, which has no name.
    One(View),
    /// All cameras, in order.
    All(Vec<View>),
    /// Cameras by their ids.
    Named(Vec<ImageFrame>),
}

impl Content {
    pub fn new(views: Views, tip_inset: f64) -> Content {
        Content { views, tip_inset, is_mediapipe: false, fps: None, remarks: vec![] }
    }
}

/// The problem with a field: its name, and what to do.
pub(super) type Problem = (String, String);

pub(super) fn problem<T>(field: &str, text: impl Into<String>) -> Result<T, Problem> {
    Err((field.into(), text.into()))
}

/// A point that was found. Trackers write what they did not find as NaN, with a score of 0, or as (0, 0), where no hand is.
pub(super) fn point(x: f64, y: f64, score: f64) -> Option<ImagePoint> {
    let at = DVec2::new(x, y);
    let is_found = at.is_finite() && at != DVec2::ZERO && score > 0.0;
    is_found.then_some(ImagePoint { at, score: score.min(1.0) })
}

/// Landmarks in the order of InterHand2.6M, each finger from its tip to the palm and the wrist last, in that of MediaPipe.
pub(super) fn from_interhand(points: &Landmarks) -> Landmarks {
    std::array::from_fn(|k| match k {
        0 => points[20],
        k => points[4 * ((k - 1) / 4) + 3 - (k - 1) % 4],
    })
}
