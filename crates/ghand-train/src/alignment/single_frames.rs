//! Poses of single frames from the masks' contours of chosen images, for a template of fixed shape.

use ghand_capture::{Capture, CaptureError};
use ghand_core::{HandModel, Pose};
use rayon::prelude::*;

use super::{AlignmentError, DistanceField, FIRST_STEPS, Fit, Images, Priors, Rig, STEPS, inverse};
use crate::alignment::proportions::Shaped;

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

/// Fits the pose of each frame alone: neither the template's shape nor the other frames have a part in it.
///
/// # Errors
/// [`AlignmentError`] if an image is unusable or a pose does not fit the template.
pub fn align_single_frames(
    capture: &Capture,
    template: &HandModel,
    frames: &[SingleFrame],
) -> Result<Vec<Pose>, AlignmentError> {
    let fields = |frame: &SingleFrame| -> Result<Vec<Option<DistanceField>>, CaptureError> {
        let field = |camera: &usize| {
            let mask = capture.load_hand_mask(*camera, frame.frame)?;
            Ok(DistanceField::of_mask(&mask, capture.cameras[*camera].width as usize))
        };
        frame.cameras.iter().map(field).collect()
    };
    let fields: Vec<Vec<Option<DistanceField>>> = frames.par_iter().map(fields).collect::<Result<_, _>>()?;
    let fit = Fit::new(template, frames.iter().map(|frame| &frame.pose).collect());
    let shaped = Shaped { model: template.clone(), d_vertices: vec![], d_joints: vec![] };
    let priors = Priors::new(template, &fit.moving, 1);
    let aligned = |(frame, fields): (&SingleFrame, &Vec<Option<DistanceField>>)| {
        let pairs = frame.cameras.iter().zip(fields);
        let images: Images =
            pairs.filter_map(|(camera, field)| Some((&capture.cameras[*camera], field.as_ref()?))).collect();
        let mut pose = frame.pose.clone();
        for huber in FIRST_STEPS.into_iter().chain(STEPS) {
            let rig = Rig { shaped: &shaped, edges: &fit.edges, moving: &fit.moving, carries: &fit.carries, huber };
            let mut equations = rig.equations(&pose, &images)?;
            priors.add_given(&pose, &frame.pose, &fit.moving, &mut equations.pose_pose, &mut equations.d_pose);
            let step = -(inverse(&equations.pose_pose) * &equations.d_pose);
            pose = fit.moved(&pose, &step);
        }
        Ok(pose)
    };
    frames.par_iter().zip(&fields).map(aligned).collect()
}
