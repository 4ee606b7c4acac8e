//! Opens any capture; its format is recognised from the folder's contents.

use std::path::Path;

use ghand_core::HandModel;
use glam::DVec2;

use super::opened::{CaptureKind, Opened};
use crate::capture::Capture;
use crate::error::CaptureError;
use crate::ghand_format::{CAPTURE_FILE, read_capture};
use crate::hand_appearance::{is_subject, read_hand_appearance};
use crate::images::skipped::SkippedImages;
use crate::interhand::{Sequences, locate, read_interhand};

/// Information that a capture's own files do not contain.
#[derive(Debug, Clone, Default)]
pub struct OpenOptions {
    /// The user's MANO model, for captures whose poses are MANO's. Its side decides which hand is read.
    pub mano: Option<HandModel>,
    /// InterHand2.6M: the sequences to train on; HandAvatar's `ROM04_RT_Occlusion` (`LT` for a left hand) if empty.
    pub train_sequences: Vec<String>,
    /// InterHand2.6M: the sequences to test on; HandAvatar's `ROM03_RT_No_Occlusion` if empty.
    pub test_sequences: Vec<String>,
    /// Hand Appearance: the principal point, pixels; the middle of the image if absent.
    pub principal_point: Option<DVec2>,
}

impl Capture {
    /// Opens a capture that does not need [`OpenOptions`]: its folder or its `capture.json`. No image is
    /// read, but perhaps the header of one.
    ///
    /// # Errors
    /// As in [`Capture::open_with`].
    pub fn open(path: &Path) -> Result<Capture, CaptureError> {
        Capture::open_with(path, &OpenOptions::default()).map(|opened| opened.capture)
    }

    /// Opens a capture: a folder with a `capture.json` or that file, InterHand2.6M (its root or one of its folders
    /// `Capture0`), or a subject of the Hand Appearance dataset. No image is read, but perhaps the header of one.
    ///
    /// # Errors
    /// [`CaptureError`] names the file, the missing or wrong field, and what to do.
    pub fn open_with(path: &Path, options: &OpenOptions) -> Result<Opened, CaptureError> {
        let mano = options.mano.as_ref();
        let file = path.join(CAPTURE_FILE);
        if !path.is_dir() || file.exists() {
            let file = if path.is_dir() { &file } else { path };
            return opened(read_capture(file, mano)?);
        }
        if let Some(location) = locate(path) {
            let sequences = Sequences { train: options.train_sequences.clone(), test: options.test_sequences.clone() };
            return read_interhand(&location?, mano, &sequences);
        }
        if is_subject(path) {
            let (capture, skipped_images) = read_hand_appearance(path, mano, options.principal_point)?;
            return Ok(Opened::plain(CaptureKind::HandAppearance, capture, skipped_images));
        }
        // This error describes what a capture is.
        opened(read_capture(&file, mano)?)
    }
}

/// A capture in ghand's own format.
fn opened((capture, warnings): (Capture, Vec<String>)) -> Result<Opened, CaptureError> {
    Ok(Opened { warnings, ..Opened::plain(CaptureKind::Ghand, capture, SkippedImages::default()) })
}
