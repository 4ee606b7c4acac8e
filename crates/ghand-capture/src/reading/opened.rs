//! An opened capture: its format, and the images that its reader skipped.

use std::fmt;

use crate::capture::Capture;
use crate::images::skipped::SkippedImages;

/// The format of a capture.
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

/// A capture, and the images that were skipped.
#[derive(Debug, Clone, PartialEq)]
pub struct Opened {
    /// Its format.
    pub kind: CaptureKind,
    /// The capture.
    pub capture: Capture,
    /// Annotated images that cannot be used.
    pub skipped_images: SkippedImages,
    /// Oddities, one sentence each.
    pub warnings: Vec<String>,
}

impl Opened {
    pub(crate) fn plain(kind: CaptureKind, capture: Capture, skipped_images: SkippedImages) -> Opened {
        Opened { kind, capture, skipped_images, warnings: vec![] }
    }
}
