//! Poses of single frames from the masks' contours of chosen images, for a template of fixed shape.

use ghand_capture::{Capture, CaptureError, Split, SplitView};
use ghand_core::{HandModel, Pose};
use rayon::prelude::*;

use super::reduced::Reduced;
use super::{AlignmentError, DistanceField, FIRST_STEPS, Fit, Images, Priors, STEPS, Shape, images_of_frames, joined};

/// A frame and the images that its pose is fitted to.
#[derive(Debug, Clone, PartialEq)]
pub struct SingleFrame {
    /// Index of the frame in the capture.
    pub frame: usize,
    /// Indices of the cameras whose masks are used.
    pub cameras: Vec<usize>,
    /// The pose that the fit starts from, and is held to where contours say nothing.
    pub pose: Pose,
}

/// What the frames of a split say of poses in general: which joints move, how they vary, and how far the given poses are off.
#[derive(Debug, Clone)]
pub struct PoseKnowledge {
    pub(super) moving: Vec<usize>,
    pub(super) priors: Priors,
}

/// What the masks of a split's frames, and of one that is held out, say of poses, for a template of fixed shape; and the
/// poses of the latter.
///
/// # Errors
/// [`AlignmentError`] if an image is unusable or a pose does not fit the template.
pub fn pose_knowledge(
    capture: &Capture,
    template: &HandModel,
    split: &Split,
    held_out: &Split,
) -> Result<(PoseKnowledge, Vec<Pose>), AlignmentError> {
    let all = joined(split, Some(held_out));
    let reduced = Reduced::new(capture, &all)?;
    let fields = reduced.fields(&all.views)?;
    let images = images_of_frames(&reduced.cameras, &all, &fields);
    let given = all.frames.iter().map(|frame| &capture.frames[*frame].pose).collect();
    let mut fit = Fit::new(template, given, Shape::Known);
    fit.follow_contours(&images, &mut |_, _, _| true)?;
    let poses = fit.poses.split_off(split.frames.len());
    Ok((PoseKnowledge { moving: fit.moving, priors: fit.priors }, poses))
}

/// Fits the pose of each frame alone: neither the template's shape nor the other frames have a part in it, except by what
/// is known of poses in general, and by the size that large images are reduced to.
///
/// # Errors
/// [`AlignmentError`] if an image is unusable or a pose does not fit the template.
pub fn align_single_frames(
    capture: &Capture,
    template: &HandModel,
    known: Option<&PoseKnowledge>,
    frames: &[SingleFrame],
) -> Result<Vec<Pose>, AlignmentError> {
    if frames.is_empty() {
        return Ok(vec![]);
    }
    let reduced = Reduced::new(capture, &seen_by(frames))?;
    let fields = |frame: &SingleFrame| -> Result<Vec<Option<DistanceField>>, CaptureError> {
        frame.cameras.iter().map(|camera| reduced.field(*camera, frame.frame)).collect()
    };
    let fields: Vec<Vec<Option<DistanceField>>> = frames.par_iter().map(fields).collect::<Result<_, _>>()?;
    let mut fit = Fit::new(template, frames.iter().map(|frame| &frame.pose).collect(), Shape::Known);
    let shaped = fit.shaped()?;
    // The joints that move are those of the frames where the knowledge comes from.
    match known.cloned() {
        Some(PoseKnowledge { moving, priors }) => (fit.moving, fit.priors) = (moving, priors),
        None => fit.priors = Priors::new(template, &fit.moving, 1),
    }
    let aligned = |(frame, fields): (&SingleFrame, &Vec<Option<DistanceField>>)| {
        let pairs = frame.cameras.iter().zip(fields);
        let images: Images =
            pairs.filter_map(|(camera, field)| Some((&reduced.cameras[*camera], field.as_ref()?))).collect();
        let mut pose = fit.fitted_alone(&shaped, frame.pose.clone(), &frame.pose, &images, &FIRST_STEPS, false)?;
        if known.is_some() {
            pose = fit.with_fingers_from_priors(&pose, &frame.pose);
        }
        Ok(fit.fitted_alone(&shaped, pose, &frame.pose, &images, &STEPS, known.is_some())?)
    };
    frames.par_iter().zip(&fields).map(aligned).collect()
}

/// The images that frames are fitted to.
fn seen_by(frames: &[SingleFrame]) -> Split {
    let views = frames.iter().enumerate().flat_map(|(position, frame)| {
        frame.cameras.iter().map(move |camera| SplitView { camera: *camera, frame: frame.frame, position })
    });
    Split { views: views.collect(), ..Split::default() }
}
