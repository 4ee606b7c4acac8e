//! The state of an alignment and its Gauss-Newton steps.

use std::sync::Arc;

use ghand_capture::mask::covered_pixels;
use ghand_core::pose_error::moving_joints;
use ghand_core::rotation::{axis_angle_from_rotation, rotation_from_axis_angle};
use ghand_core::{HandModel, InvalidHandModel, Pose};
use ghand_hand_model::pose_correctives::with_turned_skin;
use ghand_hand_model::surface::smooth::smoothed;
use nalgebra::{Cholesky, DMatrix, DVector};
use rayon::prelude::*;

use super::frame::{FrameEquations, Rig};
use super::outlines::contour::Edges;
use super::priors::Priors;
use super::proportions::{Proportions, Shaped};
use super::spread::Estimate;
use super::{Images, MaskFit};

/// Steps without knowledge of how the joints vary: for each the distance beyond which a contour counts linearly, pixels.
pub(super) const FIRST_STEPS: [f64; 4] = [20.0, 12.0, 8.0, 5.0];

/// Then the joints' spreads are measured and the fingers start once more, from what these and the given poses say: in the
/// first steps a finger may have taken another one's outline for its own.
pub(super) const STEPS: [f64; 7] = [12.0, 8.0, 5.0, 4.0, 3.0, 3.0, 3.0];

/// The last ones, once frames that were astray are back.
pub(super) const LAST_STEPS: [f64; 3] = [5.0, 3.0, 3.0];

/// Outlines of a mesh of fewer triangles are clearly polygons: contours are those of a smoother one.
const ROUND_FACES: usize = 5000;

/// Newton steps to the likeliest pose without images.
const PRIOR_STEPS: usize = 4;

/// Gets a step's number, median and 95th percentile of the contours' distances before it, pixels, and the poses; returns
/// whether to go on.
pub(super) type AfterStep<'a> = dyn FnMut(usize, [f64; 2], &[Pose]) -> bool + 'a;

/// What of the template's shape is unknown.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Shape {
    Known,
    /// The model's own parameters.
    OfModel,
    /// These, and lengths and thicknesses of bones.
    Unknown,
}

/// The state of an alignment.
pub(super) struct Fit<'a> {
    pub(super) template: &'a HandModel,
    /// Of the template, as a rule with rounder outlines.
    pub(super) proportions: Arc<Proportions>,
    pub(super) edges: Edges,
    pub(super) moving: Vec<usize>,
    pub(super) carries: Vec<Vec<bool>>,
    pub(super) given: Vec<&'a Pose>,
    pub(super) poses: Vec<Pose>,
    /// Empty if the shape is known.
    pub(super) shape: Vec<f64>,
    pub(super) priors: Priors,
}

impl<'a> Fit<'a> {
    pub(super) fn new(template: &'a HandModel, given: Vec<&'a Pose>, shape: Shape) -> Fit<'a> {
        Fit::of_proportions(round_proportions(template), template, given, shape)
    }

    /// With the template's own outlines: those of imports, where round ones brought neither cameras nor hands nearer.
    pub(super) fn with_own_outlines(template: &'a HandModel, given: Vec<&'a Pose>, shape: Shape) -> Fit<'a> {
        Fit::of_proportions(Arc::new(Proportions::new(template.clone())), template, given, shape)
    }

    pub(super) fn of_proportions(
        proportions: Arc<Proportions>,
        template: &'a HandModel,
        given: Vec<&'a Pose>,
        shape: Shape,
    ) -> Fit<'a> {
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
        let parameters = match shape {
            Shape::Known => 0,
            Shape::OfModel => template.shape_count(),
            Shape::Unknown => proportions.parameter_count(),
        };
        Fit {
            template,
            edges: Edges::of(proportions.template()),
            priors: Priors::new(template, &moving, given.len()),
            shape: vec![0.0; parameters],
            poses,
            proportions,
            moving,
            carries,
            given,
        }
    }

    /// All steps. `after_step` gets the step's number, median and 95th percentile of the contours' distances before it, and
    /// the poses, and returns whether to go on. Returns whether all steps were done.
    pub(super) fn follow_contours(
        &mut self,
        images: &[Images],
        after_step: &mut AfterStep<'_>,
    ) -> Result<bool, InvalidHandModel> {
        let steps = FIRST_STEPS.map(|huber| (huber, false)).into_iter().chain(STEPS.map(|huber| (huber, true)));
        for (number, (huber, use_spreads)) in steps.enumerate() {
            if number == FIRST_STEPS.len() {
                self.start_fingers_again(images)?;
            }
            let distances = self.step(images, huber, use_spreads)?;
            if !after_step(number, distances, &self.poses) {
                return Ok(false);
            }
        }
        // What was astray had its say in shape and spreads: with it in its place they are found again.
        if self.recover_stragglers(images)? > 0 {
            for huber in LAST_STEPS {
                self.step(images, huber, true)?;
            }
        }
        Ok(true)
    }

    /// Further steps in which the template's end counts, if the masks end there, too.
    pub(super) fn follow_mask_ends(&mut self, images: &[Images]) -> Result<(), InvalidHandModel> {
        if self.masks_end_with_template(images)? {
            self.edges = Edges::of(self.proportions.template()).with_arm_end();
            for huber in LAST_STEPS {
                self.step(images, huber, true)?;
            }
        }
        Ok(())
    }

    /// The pose of a frame by its own images and what is known of poses, for a fixed shape, from `pose` on.
    pub(super) fn fitted_alone(
        &self,
        shaped: &Shaped,
        mut pose: Pose,
        given: &Pose,
        images: &Images,
        steps: &[f64],
        use_spreads: bool,
    ) -> Result<Pose, InvalidHandModel> {
        for huber in steps {
            let Fit { edges, moving, carries, .. } = self;
            let rig = Rig { shaped, edges, moving, carries, huber: *huber };
            let mut equations = rig.equations(&pose, images)?;
            self.priors.add_given(&pose, given, moving, &mut equations.pose_pose, &mut equations.d_pose);
            if use_spreads {
                self.priors.spread.add(&pose, &mut equations.pose_pose, &mut equations.d_pose);
            }
            pose = self.moved(&pose, &-(inverse(&equations.pose_pose) * &equations.d_pose));
        }
        Ok(pose)
    }

    pub(super) fn shaped(&self) -> Result<Shaped, InvalidHandModel> {
        match self.shape.is_empty() {
            true => Ok(self.proportions.as_given()),
            false => self.proportions.shaped(&self.shape),
        }
    }

    /// The template in its shape, without the vertices that round its outlines off.
    pub(super) fn shaped_template(&self) -> Result<HandModel, InvalidHandModel> {
        let fine = self.shaped()?.model;
        let vertices = fine.vertices[..self.template.vertices.len()].to_vec();
        let joints = fine.joints;
        let mut shaped = HandModel { vertices, joints, ..self.template.clone() };
        if !self.shape.is_empty() {
            shaped.shape_directions.clear();
            shaped.shape_names.clear();
            shaped.joint_directions.clear();
            shaped.joint_regressor.clear();
        }
        Ok(shaped)
    }

    pub(super) fn equations(&self, images: &[Images], huber: f64) -> Result<Vec<FrameEquations>, InvalidHandModel> {
        let shaped = self.shaped()?;
        let rig = Rig { shaped: &shaped, edges: &self.edges, moving: &self.moving, carries: &self.carries, huber };
        self.poses.par_iter().zip(images).map(|(pose, images)| rig.equations(pose, images)).collect()
    }

    /// The frames' equations, with what the given poses say.
    pub(super) fn equations_with_given(
        &self,
        images: &[Images],
        huber: f64,
    ) -> Result<Vec<FrameEquations>, InvalidHandModel> {
        let mut equations = self.equations(images, huber)?;
        for ((pose, given), frame) in self.poses.iter().zip(&self.given).zip(&mut equations) {
            self.priors.add_given(pose, given, &self.moving, &mut frame.pose_pose, &mut frame.d_pose);
        }
        Ok(equations)
    }

    /// Measures the priors from estimates of each frame by its images and its given pose alone.
    pub(super) fn measure_priors(&mut self, equations: &[FrameEquations]) {
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
    pub(super) fn start_fingers_again(&mut self, images: &[Images]) -> Result<(), InvalidHandModel> {
        let equations = self.equations_with_given(images, FIRST_STEPS[FIRST_STEPS.len() - 1])?;
        self.measure_priors(&equations);
        for k in 0..self.poses.len() {
            self.poses[k] = self.with_fingers_from_priors(&self.poses[k], self.given[k]);
        }
        Ok(())
    }

    /// A pose with the fingers of the likeliest one by the given one and the joints' spreads.
    pub(super) fn with_fingers_from_priors(&self, pose: &Pose, given: &Pose) -> Pose {
        let mut likely = self.prior_pose(given);
        likely.rotations[0] = pose.rotations[0];
        likely.translation = pose.translation;
        likely
    }

    /// The likeliest pose by the given one and the joints' spreads.
    pub(super) fn prior_pose(&self, given: &Pose) -> Pose {
        let count = 3 * self.moving.len() + 3;
        let mut pose = given.clone();
        for _ in 0..PRIOR_STEPS {
            let mut matrix = DMatrix::zeros(count, count);
            let mut gradient = DVector::zeros(count);
            self.priors.add_given(&pose, given, &self.moving, &mut matrix, &mut gradient);
            self.priors.spread.add(&pose, &mut matrix, &mut gradient);
            pose = self.moved(&pose, &-(inverse(&matrix) * gradient));
        }
        pose
    }

    /// One Gauss-Newton step of all poses and the shape. Returns median and 95th percentile of the contours' distances
    /// before it, pixels.
    pub(super) fn step(
        &mut self,
        images: &[Images],
        huber: f64,
        use_spreads: bool,
    ) -> Result<[f64; 2], InvalidHandModel> {
        let mut equations = self.equations_with_given(images, huber)?;
        if use_spreads {
            self.measure_priors(&equations);
            for (pose, frame) in self.poses.iter().zip(&mut equations) {
                self.priors.spread.add(pose, &mut frame.pose_pose, &mut frame.d_pose);
            }
        }
        let deviations: Vec<f64> = (0..self.shape.len()).map(|k| self.proportions.deviation(k)).collect();
        let step = joint_step(&equations, &self.shape, &deviations);
        for (pose, step) in self.poses.iter_mut().zip(&step.poses) {
            *pose = moved(&self.moving, pose, step);
        }
        self.shape.iter_mut().zip(step.shared.iter()).for_each(|(value, step)| *value += step);
        Ok(quantiles(equations.into_iter().flat_map(|frame| frame.distances).collect()))
    }

    /// How well a hand in these poses fits the masks; also the overlap of each frame, 1 for one without masks.
    pub(super) fn fit_of(
        &self,
        shaped: &Shaped,
        poses: &[Pose],
        images: &[Images],
    ) -> Result<(MaskFit, Vec<f64>), InvalidHandModel> {
        let of_frame = |(pose, images): (&Pose, &Images)| -> Result<(Vec<f64>, Vec<f64>), InvalidHandModel> {
            let positions = shaped.pose(pose)?.vertices;
            let normals = shaped.model.vertex_normals(&positions);
            let mut distances = vec![];
            let mut overlaps = vec![];
            for (camera, field) in images {
                let contour = self.edges.contour(&positions, &normals, camera, field);
                distances.extend(contour.iter().map(|point| field.image_pixels * point.residual.abs()));
                let covered = covered_pixels(camera, &positions, &shaped.model.faces);
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
        let areas: Vec<f64> =
            images.iter().flatten().map(|(_, field)| field.area() as f64 * field.image_pixels.powi(2)).collect();
        let fit = MaskFit {
            contours: quantiles(distances.concat()),
            overlap: mean(&overlaps.concat()),
            mask_size: mean(&areas).sqrt(),
        };
        Ok((fit, per_frame))
    }

    /// A pose after a step.
    pub(super) fn moved(&self, pose: &Pose, step: &DVector<f64>) -> Pose {
        moved(&self.moving, pose, step)
    }
}

/// The proportions of a template, as a rule with rounder outlines.
pub(super) fn round_proportions(template: &HandModel) -> Arc<Proportions> {
    let corrected = with_turned_skin(template);
    let is_coarse = template.faces.len() < ROUND_FACES;
    Arc::new(Proportions::new(if is_coarse { smoothed(&corrected) } else { corrected }))
}

/// A pose after a step of the joints that move and of the translation.
fn moved(moving: &[usize], pose: &Pose, step: &DVector<f64>) -> Pose {
    let vector = |at: usize| glam::DVec3::new(step[at], step[at + 1], step[at + 2]);
    let mut moved = pose.clone();
    for (i, joint) in moving.iter().enumerate() {
        let rotation = rotation_from_axis_angle(vector(3 * i)) * rotation_from_axis_angle(pose.rotations[*joint]);
        moved.rotations[*joint] = axis_angle_from_rotation(&rotation);
    }
    moved.translation += vector(3 * moving.len());
    moved
}

/// A Gauss-Newton step.
pub(super) struct JointStep {
    /// Of each frame's pose.
    pub(super) poses: Vec<DVector<f64>>,
    /// Of what the frames share.
    pub(super) shared: DVector<f64>,
}

/// A step of all frames and of what they share, which is `shared` now and has these standard deviations before any image is
/// seen, about 0.
pub(super) fn joint_step(equations: &[FrameEquations], shared: &[f64], deviations: &[f64]) -> JointStep {
    let inverses: Vec<DMatrix<f64>> = equations.par_iter().map(|frame| inverse(&frame.pose_pose)).collect();
    let count = shared.len();
    let mut matrix = DMatrix::zeros(count, count);
    let mut gradient = DVector::zeros(count);
    let parts: Vec<(DMatrix<f64>, DVector<f64>)> = (equations.par_iter().zip(&inverses))
        .map(|(frame, inverse)| {
            let eliminated = frame.pose_shared.transpose() * inverse;
            (&frame.shared_shared - &eliminated * &frame.pose_shared, &frame.d_shared - &eliminated * &frame.d_pose)
        })
        .collect();
    for (part, d) in parts {
        matrix += part;
        gradient += d;
    }
    for (k, (value, deviation)) in shared.iter().zip(deviations).enumerate() {
        matrix[(k, k)] += deviation.powi(-2);
        gradient[k] += value / deviation.powi(2);
    }
    let shared = -(inverse(&matrix) * gradient);
    let pose = |(frame, inverse): (&FrameEquations, &DMatrix<f64>)| {
        -(inverse * (&frame.d_pose + &frame.pose_shared * &shared))
    };
    JointStep { poses: equations.iter().zip(&inverses).map(pose).collect(), shared }
}

/// The inverse of a symmetric positive definite matrix; of one that is not quite, with a little more on the diagonal.
pub(super) fn inverse(matrix: &DMatrix<f64>) -> DMatrix<f64> {
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
pub(super) fn quantiles(mut values: Vec<f64>) -> [f64; 2] {
    values.sort_by(f64::total_cmp);
    [0.5, 0.95].map(|part| values.get((values.len() as f64 * part) as usize).copied().unwrap_or(f64::NAN))
}
