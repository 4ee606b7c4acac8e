//! Alignment: poses, translations and the template's proportions from the masks' contours, before any appearance.
//!
//! Contour bundle adjustment: the template's outer contour in all images of a frame is moved onto the outlines of the
//! masks, by Gauss-Newton steps for all frames together. A frame's pose is eliminated by its Schur complement; the shape
//! is shared. On the CPU, in f64; the same bits for any number of threads.

mod contour;
mod distance_field;
mod frame;
mod priors;
mod proportions;
pub mod single_frames;

use ghand_capture::{Capture, CaptureError, Split};
use ghand_core::rotation::{axis_angle_from_rotation, rotation_from_axis_angle};
use ghand_core::{Camera, HandModel, InvalidHandModel, Pose};
use nalgebra::{Cholesky, DMatrix, DVector};
use rayon::prelude::*;

use crate::metrics::moving_joints;
use contour::Edges;
use distance_field::DistanceField;
pub(crate) use distance_field::squared_distances;
use frame::{FrameEquations, Rig};
use priors::{Estimate, Priors};
use proportions::Proportions;

/// For each step: the distance beyond which a contour counts linearly, pixels, and whether the joints' spreads are used.
const STEPS: [(f64, bool); 10] = [
    (20.0, false),
    (12.0, false),
    (8.0, false),
    (5.0, true),
    (4.0, true),
    (3.0, true),
    (3.0, true),
    (3.0, true),
    (3.0, true),
    (3.0, true),
];

/// Why the poses could not be aligned.
#[derive(Debug, thiserror::Error)]
pub enum AlignmentError {
    /// An image or a mask is unusable.
    #[error(transparent)]
    Capture(#[from] CaptureError),
    /// A pose does not fit the template.
    #[error(transparent)]
    Pose(#[from] InvalidHandModel),
    /// The caller stopped it.
    #[error("the alignment was stopped")]
    Stopped,
}

/// Aligned poses.
#[derive(Debug, Clone)]
pub struct Alignment {
    /// Poses of the split's frames.
    pub poses: Vec<Pose>,
    /// The template in the proportions found.
    pub template: HandModel,
    /// Distances of the template's contours from the masks' outlines, given and aligned, pixels: median and 95th
    /// percentile.
    pub contours: [[f64; 2]; 2],
}

/// A frame's images.
type Images<'a> = Vec<(&'a Camera, &'a DistanceField)>;

/// Aligns the frames of a split. `after_step` gets a description and the poses after each step, and returns whether to go
/// on.
///
/// # Errors
/// [`AlignmentError`] if an image or a pose is unusable, or the caller stopped it.
pub fn align(
    capture: &Capture,
    split: &Split,
    after_step: &mut dyn FnMut(&str, &[Pose]) -> bool,
) -> Result<Alignment, AlignmentError> {
    let fields: Vec<Option<DistanceField>> = (split.views.par_iter())
        .map(|view| {
            let image = capture.load_view(view.camera, view.frame)?;
            let mask: Vec<bool> = image.rgba.iter().map(|pixel| pixel[3] >= 128).collect();
            Ok(DistanceField::of_mask(&mask, image.width as usize))
        })
        .collect::<Result<_, CaptureError>>()?;
    let mut images: Vec<Images> = vec![vec![]; split.frames.len()];
    for (view, field) in split.views.iter().zip(&fields) {
        images[view.position].extend(field.as_ref().map(|field| (&capture.cameras[view.camera], field)));
    }
    let given: Vec<&Pose> = split.frames.iter().map(|frame| &capture.frames[*frame].pose).collect();
    let mut fit = Fit::new(&capture.template, given);
    let mut first = None;
    for (number, (huber, use_spreads)) in STEPS.into_iter().enumerate() {
        let [median, far] = fit.step(&images, huber, use_spreads)?;
        first.get_or_insert([median, far]);
        let text = format!("step {number}: contours {median:.2} px, 95 % below {far:.2} px");
        if !after_step(&text, &fit.poses) {
            return Err(AlignmentError::Stopped);
        }
    }
    let template = fit.proportions.shaped(&fit.shape)?.model;
    let last = fit.distances(&images)?;
    Ok(Alignment { poses: fit.poses, template, contours: [first.unwrap_or(last), last] })
}

/// The state of an alignment.
struct Fit<'a> {
    proportions: Proportions<'a>,
    edges: Edges,
    moving: Vec<usize>,
    carries: Vec<Vec<bool>>,
    given: Vec<&'a Pose>,
    poses: Vec<Pose>,
    shape: Vec<f64>,
    priors: Priors,
}

impl<'a> Fit<'a> {
    fn new(template: &'a HandModel, given: Vec<&'a Pose>) -> Fit<'a> {
        let joints = template.joint_count();
        let poses: Vec<Pose> = given.iter().map(|pose| (*pose).clone()).collect();
        let moves = moving_joints(&poses);
        let moving: Vec<usize> = (0..joints).filter(|k| moves[*k]).collect();
        let is_above = |k: usize, mut below: usize| loop {
            match (below == k, template.parents[below]) {
                (true, _) => return true,
                (false, Some(parent)) => below = parent,
                (false, None) => return false,
            }
        };
        let carries = (0..joints).map(|k| (0..joints).map(|j| is_above(k, j)).collect()).collect();
        let proportions = Proportions::new(template);
        Fit {
            edges: Edges::of(&template.faces),
            priors: Priors::new(&moving),
            shape: vec![0.0; proportions.parameter_count()],
            poses,
            proportions,
            moving,
            carries,
            given,
        }
    }

    fn equations(&self, images: &[Images], huber: f64) -> Result<Vec<FrameEquations>, InvalidHandModel> {
        let shaped = self.proportions.shaped(&self.shape)?;
        let rig = Rig { shaped: &shaped, edges: &self.edges, moving: &self.moving, carries: &self.carries, huber };
        self.poses.par_iter().zip(images).map(|(pose, images)| rig.equations(pose, images)).collect()
    }

    /// One Gauss-Newton step of all poses and the shape. Returns median and 95th percentile of the contours' distances
    /// before it, pixels.
    fn step(&mut self, images: &[Images], huber: f64, use_spreads: bool) -> Result<[f64; 2], InvalidHandModel> {
        let mut equations = self.equations(images, huber)?;
        for ((pose, given), frame) in self.poses.iter().zip(&self.given).zip(&mut equations) {
            self.priors.add_given(pose, given, &self.moving, &mut frame.pose_pose, &mut frame.d_pose);
        }
        if use_spreads {
            let alone: Vec<(DVector<f64>, DMatrix<f64>)> = equations
                .par_iter()
                .map(|frame| {
                    let inverse = inverse(&frame.pose_pose);
                    (-(&inverse * &frame.d_pose), inverse)
                })
                .collect();
            let estimates: Vec<Estimate> = (alone.into_iter().zip(&self.poses))
                .map(|((step, covariance), pose)| Estimate { pose: self.moved(pose, &step), covariance })
                .collect();
            self.priors.measure(&estimates, &self.given, &self.moving);
            for (pose, frame) in self.poses.iter().zip(&mut equations) {
                self.priors.add_spread(pose, &self.moving, &mut frame.pose_pose, &mut frame.d_pose);
            }
        }
        let inverses: Vec<DMatrix<f64>> = equations.par_iter().map(|frame| inverse(&frame.pose_pose)).collect();
        let count = self.shape.len();
        let (mut matrix, mut gradient) = (DMatrix::zeros(count, count), DVector::zeros(count));
        let parts: Vec<(DMatrix<f64>, DVector<f64>)> = (equations.par_iter().zip(&inverses))
            .map(|(frame, inverse)| {
                let eliminated = frame.pose_shape.transpose() * inverse;
                (&frame.shape_shape - &eliminated * &frame.pose_shape, &frame.d_shape - &eliminated * &frame.d_pose)
            })
            .collect();
        for (part, d) in parts {
            matrix += part;
            gradient += d;
        }
        for (k, value) in self.shape.iter().enumerate() {
            let information = self.proportions.deviation(k).powi(-2);
            matrix[(k, k)] += information;
            gradient[k] += information * value;
        }
        let d_shape = -(inverse(&matrix) * gradient);
        for (k, (frame, inverse)) in equations.iter().zip(&inverses).enumerate() {
            let step = -(inverse * (&frame.d_pose + &frame.pose_shape * &d_shape));
            self.poses[k] = self.moved(&self.poses[k], &step);
        }
        self.shape.iter_mut().zip(d_shape.iter()).for_each(|(value, step)| *value += step);
        Ok(quantiles(equations.into_iter().flat_map(|frame| frame.distances).collect()))
    }

    fn distances(&self, images: &[Images]) -> Result<[f64; 2], InvalidHandModel> {
        let equations = self.equations(images, 3.0)?;
        Ok(quantiles(equations.into_iter().flat_map(|frame| frame.distances).collect()))
    }

    /// A pose after a step.
    fn moved(&self, pose: &Pose, step: &DVector<f64>) -> Pose {
        let vector = |at: usize| glam::DVec3::new(step[at], step[at + 1], step[at + 2]);
        let mut moved = pose.clone();
        for (i, joint) in self.moving.iter().enumerate() {
            let rotation = rotation_from_axis_angle(vector(3 * i)) * rotation_from_axis_angle(pose.rotations[*joint]);
            moved.rotations[*joint] = axis_angle_from_rotation(&rotation);
        }
        moved.translation += vector(3 * self.moving.len());
        moved
    }
}

/// The inverse of a symmetric positive definite matrix; of one that is not quite, with a little more on the diagonal.
fn inverse(matrix: &DMatrix<f64>) -> DMatrix<f64> {
    let largest = matrix.diagonal().amax().max(1.0);
    let mut extra = 0.0;
    loop {
        let mut candidate = matrix.clone();
        (0..candidate.nrows()).for_each(|k| candidate[(k, k)] += extra);
        if let Some(factors) = Cholesky::new(candidate) {
            return factors.inverse();
        }
        extra = if extra == 0.0 { 1e-12 * largest } else { 10.0 * extra };
    }
}

/// Median and 95th percentile.
fn quantiles(mut values: Vec<f64>) -> [f64; 2] {
    values.sort_by(f64::total_cmp);
    [0.5, 0.95].map(|part| values.get((values.len() as f64 * part) as usize).copied().unwrap_or(f64::NAN))
}
