//! What the hand's outlines in the chosen images tell beyond its landmarks: cameras that are only roughly known, the hand's
//! shape, and its poses.

use std::path::Path;

use ghand_capture::cameras::list::LensCamera;
use ghand_capture::{Capture, Split};
use ghand_core::Pose;
use ghand_fit::alignment::refine_rough_cameras;
use ghand_fit::alignment::shape_fit::fit_shape;

use crate::ImportError;
use crate::rig::lengths::{hand_length, lengths_of};

/// The hand as its outlines show it.
pub struct Outlined {
    /// Shape parameters of the hand model.
    pub shape: Vec<f64>,
    /// Poses of all frames.
    pub poses: Vec<Pose>,
    /// From the wrist to the tip of the middle finger, metres; `None` if shape and poses stay as they were.
    pub length: Option<f64>,
    /// Why they do.
    pub why_not: Option<String>,
}

/// Refines cameras by the hand's contours in the capture that was written.
///
/// # Errors
/// If an image is unusable.
pub fn refine_cameras(out: &Path, lenses: &mut [LensCamera], focals_are_known: bool) -> Result<(), ImportError> {
    let written = written(out)?;
    let refined = refine_rough_cameras(&written, written.split("train")?, focals_are_known)?;
    for (lens, camera) in lenses.iter_mut().zip(refined) {
        lens.camera = camera;
    }
    Ok(())
}

/// Fits shape and poses to the capture that was written: `capture`, all of whose frames have the same shape.
///
/// # Errors
/// If an image is unusable.
pub fn fit_outlines(out: &Path, capture: &Capture) -> Result<Outlined, ImportError> {
    let mut written = written(out)?;
    let splits: Vec<&Split> = written.splits.values().collect();
    let fitted = fit_shape(&written, &splits)?;
    let mut shape = capture.frames.first().map_or(vec![], |frame| frame.shape.clone());
    shape.iter_mut().zip(&fitted.shape).for_each(|(value, change)| *value += change);
    written.take_shape(&shape)?;
    let length = hand_length(&lengths_of(&written.template, 0.0, &[])?);
    let why_not = fitted.rejection.map(|rejection| rejection.to_string());
    Ok(Outlined { shape, poses: fitted.poses, length: why_not.is_none().then_some(length), why_not })
}

/// The capture as read again: with masks that are made.
fn written(out: &Path) -> Result<Capture, ImportError> {
    let mut written = Capture::open(out)?;
    let names: Vec<String> = written.splits.keys().cloned().collect();
    written.skip_unusable_images(&names.iter().map(String::as_str).collect::<Vec<_>>())?;
    Ok(written)
}
