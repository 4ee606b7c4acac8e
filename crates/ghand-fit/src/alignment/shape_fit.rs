//! Shape and poses for a capture whose poses come from landmarks: what its hand model can be, by the masks' contours and
//! the skin's texture.

use std::time::Instant;

use ghand_capture::{Capture, Split};
use ghand_core::Pose;

use super::reduced::Reduced;
use super::results::rejection::Rejection;
use super::texture::{self, SplitContrast};
use super::{AlignmentError, Fit, MaskFit, Shape, images_of_frames, joined};

/// A hand as the images show it.
#[derive(Debug, Clone)]
pub struct ShapeFit {
    /// What the shape parameters of the capture's frames change by, `n_s`.
    pub shape: Vec<f64>,
    /// Poses of all frames of the capture; those of other splits as given.
    pub poses: Vec<Pose>,
    /// How well the given and the found hand fit the masks.
    pub fit: [MaskFit; 2],
    /// Why shape and poses are the given ones, if they are.
    pub rejection: Option<Rejection>,
}

/// Fits the shape parameters of a capture's hand model, and the poses of the frames of some splits. Unlike
/// [`align`](super::align), it keeps bones in the proportions that the model has for them, and cameras as they are. It takes
/// images of several cameras: to one, a larger hand that is farther away looks the same.
///
/// # Errors
/// [`AlignmentError`] if an image or a pose is unusable.
pub fn fit_shape(capture: &Capture, splits: &[&Split]) -> Result<ShapeFit, AlignmentError> {
    let start = Instant::now();
    let split = &splits.iter().fold(Split::default(), |all, split| joined(&all, Some(split)));
    let reduced = Reduced::new(capture, split)?;
    let fields = reduced.fields(&split.views)?;
    let images = images_of_frames(&reduced.cameras, split, &fields);
    let given: Vec<&Pose> = split.frames.iter().map(|frame| &capture.frames[*frame].pose).collect();
    let mut fit = Fit::with_own_outlines(&capture.template, given, Shape::OfModel);
    fit.follow_contours(&images, &mut |_, _, _| true)?;
    fit.follow_mask_ends(&images)?;
    let given_fit = fit.fit_as_given(&images)?;
    let mut shape = fit.shape.clone();
    let refine = |fit: &Fit, usable: &[bool]| {
        let contrast = SplitContrast::load(&reduced, split)?;
        texture::refine(fit, &contrast.by_frame(&reduced.cameras, split), &images, usable, &mut |_, _| true)
    };
    let found = fit.finish(&images, split.frames.len(), given_fit, start, refine)?;
    if found.rejection.is_some() {
        shape.fill(0.0);
    }
    let mut poses: Vec<Pose> = capture.frames.iter().map(|frame| frame.pose.clone()).collect();
    split.frames.iter().zip(found.poses).for_each(|(frame, pose)| poses[*frame] = pose);
    Ok(ShapeFit { shape, poses, fit: found.fit, rejection: found.rejection })
}
