//! An opened capture: its format, and what its reader had to skip.

use std::fmt;

use crate::capture::Capture;
use crate::skipped_images::SkippedImages;

/// Whose format a capture is in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CaptureKind {
    /// The project's own, `capture.json`.
    Ghand,
    /// InterHand2.6M.
    InterHand,
    /// Hand Appearance.
    HandAppearance,
}

impl fmt::Display for CaptureKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            CaptureKind::Ghand => "capture in ghand's own format",
            CaptureKind::InterHand => "InterHand2.6M",
            CaptureKind::HandAppearance => "Hand Appearance",
        })
    }
}

/// A capture and what was left out of it.
#[derive(Debug, Clone, PartialEq)]
pub struct Opened {
    /// Whose format it is in.
    pub kind: CaptureKind,
    /// The capture.
    pub capture: Capture,
    /// Images that the annotations name but that are of no use.
    pub skipped_images: SkippedImages,
    /// What is odd, a sentence each.
    pub warnings: Vec<String>,
}

impl Opened {
    pub(crate) fn plain(kind: CaptureKind, capture: Capture, skipped_images: SkippedImages) -> Opened {
        Opened { kind, capture, skipped_images, warnings: vec![] }
    }
}
