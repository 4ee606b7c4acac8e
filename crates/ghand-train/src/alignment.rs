//! Alignment: poses, translations and the template's proportions from the masks' contours, before any appearance.
//!
//! Contour bundle adjustment: the template's outer contour in all images of a frame is moved onto the outlines of the
//! masks, by Gauss-Newton steps for all frames together. A frame's pose is eliminated by its Schur complement; the shape
//! is shared. Then the skin's texture refines the poses (`texture.rs`). On the CPU, in f64; the same bits for any number of
//! threads.

mod contour;
mod distance_field;
mod frame;
mod priors;
mod proportions;
mod rejection;
pub mod single_frames;
mod spread;
mod texture;

use std::time::Instant;

use ghand_capture::mask::covered_pixels;
use ghand_capture::{Capture, CaptureError, Split};
use ghand_core::posing::pose_hand;
use ghand_core::rotation::{axis_angle_from_rotation, rotation_from_axis_angle};
use ghand_core::{Camera, HandModel, InvalidHandModel, Pose};
use nalgebra::{Cholesky, DMatrix, DVector};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::metrics::moving_joints;
use contour::Edges;
use distance_field::DistanceField;
use frame::{FrameEquations, Rig};
pub(crate) use ghand_capture::mask::squared_distances;
use priors::Priors;
use proportions::Proportions;
pub use rejection::Rejection;
use rejection::rejection;
use spread::Estimate;
use texture::SplitContrast;
pub use texture::TextureRefinement;

/// Steps without knowledge of how the joints vary: for each the distance beyond which a contour counts linearly, pixels.
const FIRST_STEPS: [f64; 4] = [20.0, 12.0, 8.0, 5.0];
/// Then the joints' spreads are measured and the fingers start once more, from what these and the given poses say: in the
/// first steps a finger may have taken another one's outline for its own.
const STEPS: [f64; 7] = [12.0, 8.0, 5.0, 4.0, 3.0, 3.0, 3.0];

/// Newton steps to the likeliest pose without images.
const PRIOR_STEPS: usize = 4;

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

/// Aligned poses; the given ones if the alignment was rejected.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Alignment {
    /// Poses of the split's frames.
    pub poses: Vec<Pose>,
    /// The template in the proportions found.
    pub template: HandModel,
    /// Why poses and template are those of the capture, if they are.
    pub rejection: Option<Rejection>,
    /// How well given poses and those that the alignment found fit the masks.
    pub fit: [MaskFit; 2],
    /// Frames, counted in the split, that keep their given poses because these overlap the masks better.
    pub kept: Vec<usize>,
    /// The likeliest poses by the given ones and how the joints vary over the capture, without the frame's own images.
    pub prior_poses: Vec<Pose>,
    /// How texture refined the poses; `None` if the alignment was rejected.
    pub texture: Option<TextureRefinement>,
    /// Standard deviation of what the aligned rotations may be off by, by contours and priors without texture, root mean
    /// square over frames and axes, radians: by joint, 0 for those that do not move.
    pub uncertainty: Vec<f64>,
    /// Seconds that it took.
    pub seconds: f64,
}

/// How well a template in certain poses fits the masks.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct MaskFit {
    /// Distances of the template's contours from the masks' outlines, pixels: median and 95th percentile; NaN without any.
    pub contours: [f64; 2],
    /// Intersection over union of the template's silhouettes and the masks, mean over the images.
    pub overlap: f64,
    /// Square root of the masks' mean area, pixels.
    pub mask_size: f64,
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
    let start = Instant::now();
    let fields: Vec<Option<DistanceField>> = (split.views.par_iter())
        .map(|view| {
            let mask = capture.load_hand_mask(view.camera, view.frame)?;
            Ok(DistanceField::of_mask(&mask, capture.cameras[view.camera].width as usize))
        })
        .collect::<Result<_, CaptureError>>()?;
    let mut images: Vec<Images> = vec![vec![]; split.frames.len()];
    for (view, field) in split.views.iter().zip(&fields) {
        images[view.position].extend(field.as_ref().map(|field| (&capture.cameras[view.camera], field)));
    }
    let given: Vec<&Pose> = split.frames.iter().map(|frame| &capture.frames[*frame].pose).collect();
    let mut fit = Fit::new(&capture.template, given);
    let steps = FIRST_STEPS.map(|huber| (huber, false)).into_iter().chain(STEPS.map(|huber| (huber, true)));
    for (number, (huber, use_spreads)) in steps.enumerate() {
        if number == FIRST_STEPS.len() {
            fit.start_fingers_again(&images)?;
        }
        let [median, far] = fit.step(&images, huber, use_spreads)?;
        let text = format!("step {number}: contours {median:.2} px, 95 % below {far:.2} px");
        if !after_step(&text, &fit.poses) {
            return Err(AlignmentError::Stopped);
        }
    }
    let refine = |fit: &Fit, usable: &[bool]| {
        let contrast = SplitContrast::load(capture, split)?;
        texture::refine(fit, &contrast.by_frame(capture, split), &images, usable, after_step)
    };
    fit.finish(&images, start, refine)
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
            edges: Edges::of(template),
            priors: Priors::new(template, &moving, given.len()),
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

    /// The frames' equations, with what the given poses say.
    fn equations_with_given(&self, images: &[Images], huber: f64) -> Result<Vec<FrameEquations>, InvalidHandModel> {
        let mut equations = self.equations(images, huber)?;
        for ((pose, given), frame) in self.poses.iter().zip(&self.given).zip(&mut equations) {
            self.priors.add_given(pose, given, &self.moving, &mut frame.pose_pose, &mut frame.d_pose);
        }
        Ok(equations)
    }

    /// Measures the priors from estimates of each frame by its images and its given pose alone.
    fn measure_priors(&mut self, equations: &[FrameEquations]) {
        let estimates: Vec<Estimate> = (equations.par_iter().zip(&self.poses))
            .map(|(frame, pose)| {
                let covariance = inverse(&frame.pose_pose);
                Estimate { pose: self.moved(pose, &-(&covariance * &frame.d_pose)), covariance }
            })
            .collect();
        self.priors.measure(&estimates, &self.given, &self.moving);
    }

    /// Moves the fingers to where the given poses and the joints' spreads say, without the images; the root and the
    /// translation stay.
    fn start_fingers_again(&mut self, images: &[Images]) -> Result<(), InvalidHandModel> {
        let equations = self.equations_with_given(images, FIRST_STEPS[FIRST_STEPS.len() - 1])?;
        self.measure_priors(&equations);
        for k in 0..self.poses.len() {
            let found = self.poses[k].clone();
            self.poses[k] = self.prior_pose(self.given[k]);
            self.poses[k].rotations[0] = found.rotations[0];
            self.poses[k].translation = found.translation;
        }
        Ok(())
    }

    /// The likeliest pose by the given one and the joints' spreads.
    fn prior_pose(&self, given: &Pose) -> Pose {
        let count = 3 * self.moving.len() + 3;
        let mut pose = given.clone();
        for _ in 0..PRIOR_STEPS {
            let (mut matrix, mut gradient) = (DMatrix::zeros(count, count), DVector::zeros(count));
            self.priors.add_given(&pose, given, &self.moving, &mut matrix, &mut gradient);
            self.priors.spread.add(&pose, &mut matrix, &mut gradient);
            pose = self.moved(&pose, &-(inverse(&matrix) * gradient));
        }
        pose
    }

    /// One Gauss-Newton step of all poses and the shape. Returns median and 95th percentile of the contours' distances
    /// before it, pixels.
    fn step(&mut self, images: &[Images], huber: f64, use_spreads: bool) -> Result<[f64; 2], InvalidHandModel> {
        let mut equations = self.equations_with_given(images, huber)?;
        if use_spreads {
            self.measure_priors(&equations);
            for (pose, frame) in self.poses.iter().zip(&mut equations) {
                self.priors.spread.add(pose, &mut frame.pose_pose, &mut frame.d_pose);
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

    /// The result. `refine` refines the poses by texture, given which frames' poses may be believed.
    fn finish(
        mut self,
        images: &[Images],
        start: Instant,
        refine: impl FnOnce(&Fit, &[bool]) -> Result<(Vec<Pose>, TextureRefinement), AlignmentError>,
    ) -> Result<Alignment, AlignmentError> {
        let given: Vec<Pose> = self.given.iter().map(|pose| (*pose).clone()).collect();
        let (given_fit, _) = self.fit_of(self.proportions.template(), &given, images)?;
        let template = self.proportions.shaped(&self.shape)?.model;
        let (_, given_overlaps) = self.fit_of(&template, &given, images)?;
        let (mut aligned_fit, overlaps) = self.fit_of(&template, &self.poses, images)?;
        let mut kept = vec![];
        for (k, (before, after)) in given_overlaps.iter().zip(&overlaps).enumerate() {
            if before > after {
                self.poses[k] = given[k].clone();
                kept.push(k);
            }
        }
        if !kept.is_empty() {
            (aligned_fit, _) = self.fit_of(&template, &self.poses, images)?;
        }
        let rejection = rejection([given_fit, aligned_fit], self.proportions.template(), &template);
        let mut texture = None;
        if rejection.is_none() {
            let usable: Vec<bool> = (0..images.len()).map(|k| !images[k].is_empty() && !kept.contains(&k)).collect();
            let (poses, mut refinement) = refine(&self, &usable)?;
            let overlaps;
            (aligned_fit, overlaps) = self.fit_of(&template, &poses, images)?;
            self.poses = poses;
            if refinement.take_back(&mut self.poses, |frame| overlaps[frame] < given_overlaps[frame]) {
                (aligned_fit, _) = self.fit_of(&template, &self.poses, images)?;
            }
            texture = Some(refinement);
        }
        let fit = [given_fit, aligned_fit];
        let prior_poses = self.given.iter().map(|given| self.prior_pose(given)).collect();
        let uncertainty = self.uncertainty(images)?;
        let seconds = start.elapsed().as_secs_f64();
        let (poses, template) = match rejection {
            Some(_) => (given, self.proportions.template().clone()),
            None => (self.poses, template),
        };
        Ok(Alignment { poses, template, rejection, fit, kept, prior_poses, texture, uncertainty, seconds })
    }

    /// The standard deviations of the joints' rotations, by all that is known.
    fn uncertainty(&self, images: &[Images]) -> Result<Vec<f64>, InvalidHandModel> {
        let mut equations = self.equations_with_given(images, STEPS[STEPS.len() - 1])?;
        for (pose, frame) in self.poses.iter().zip(&mut equations) {
            self.priors.spread.add(pose, &mut frame.pose_pose, &mut frame.d_pose);
        }
        let covariances: Vec<DMatrix<f64>> = equations.par_iter().map(|frame| inverse(&frame.pose_pose)).collect();
        let mut deviations = vec![0.0; self.proportions.template().joint_count()];
        for (place, joint) in self.moving.iter().enumerate() {
            let trace = |c: &DMatrix<f64>| (0..3).map(|axis| c[(3 * place + axis, 3 * place + axis)]).sum::<f64>();
            let sum: f64 = covariances.iter().map(trace).sum();
            deviations[*joint] = (sum / (3 * covariances.len().max(1)) as f64).sqrt();
        }
        Ok(deviations)
    }

    /// How well a template in these poses fits the masks; also the overlap of each frame, 1 for one without masks.
    fn fit_of(
        &self,
        template: &HandModel,
        poses: &[Pose],
        images: &[Images],
    ) -> Result<(MaskFit, Vec<f64>), InvalidHandModel> {
        let of_frame = |(pose, images): (&Pose, &Images)| -> Result<(Vec<f64>, Vec<f64>), InvalidHandModel> {
            let positions = pose_hand(template, &[], pose)?.vertices;
            let normals = template.vertex_normals(&positions);
            let (mut distances, mut overlaps) = (vec![], vec![]);
            for (camera, field) in images {
                let contour = self.edges.contour(&positions, &normals, camera, field);
                distances.extend(contour.iter().map(|point| point.residual.abs()));
                let covered = covered_pixels(camera, &positions, &template.faces);
                let arm_end = self.edges.arm_end(&positions, camera);
                overlaps.push(field.overlap(&covered, camera.width as usize, arm_end));
            }
            Ok((distances, overlaps))
        };
        let frames: Vec<(Vec<f64>, Vec<f64>)> =
            poses.par_iter().zip(images).map(of_frame).collect::<Result<_, InvalidHandModel>>()?;
        let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
        let per_frame =
            frames.iter().map(|(_, overlaps)| if overlaps.is_empty() { 1.0 } else { mean(overlaps) }).collect();
        let (distances, overlaps): (Vec<Vec<f64>>, Vec<Vec<f64>>) = frames.into_iter().unzip();
        let areas: Vec<f64> = images.iter().flatten().map(|(_, field)| field.area() as f64).collect();
        let fit = MaskFit {
            contours: quantiles(distances.concat()),
            overlap: mean(&overlaps.concat()),
            mask_size: mean(&areas).sqrt(),
        };
        Ok((fit, per_frame))
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
