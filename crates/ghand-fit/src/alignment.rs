//! Alignment: poses, translations and the template's proportions from the masks' contours, before any appearance.
//!
//! Contour bundle adjustment: the template's outer contour in all images of a frame is moved onto the outlines of the
//! masks, by Gauss-Newton steps for all frames together. A frame's pose is eliminated by its Schur complement; the shape
//! is shared. Then the skin's texture refines the poses (`texture.rs`). On the CPU, in f64; the same bits for any number of
//! threads.

mod blur;
mod cameras;
mod correctives;
mod frame;
mod outlines;
pub mod pose_offsets;
mod priors;
mod proportions;
pub mod results;
pub mod shape_fit;
mod side;
pub mod single_frames;
mod spread;
mod stragglers;
pub mod synthesis;
mod texture;
mod triangles;

use std::sync::Arc;
use std::time::Instant;

use ghand_capture::mask::covered_pixels;
use ghand_capture::{Capture, CaptureError, Split, SplitView};
use ghand_core::rotation::{axis_angle_from_rotation, rotation_from_axis_angle};
use ghand_core::{Camera, HandModel, InvalidHandModel, Pose};
use ghand_hand_model::pose_correctives::with_turned_skin;
use ghand_hand_model::surface::smooth::smoothed;
use nalgebra::{Cholesky, DMatrix, DVector};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

pub use cameras::calibration::Calibration;
use cameras::calibration::FrameViews;
pub use cameras::odd::OddCamera;
pub use cameras::time_offsets::TimeOffset;
use cameras::unknowns::Part;
use frame::{FrameEquations, Rig};
use ghand_core::pose_error::moving_joints;
use outlines::contour::Edges;
use outlines::distance_field::DistanceField;
use priors::Priors;
use proportions::{Proportions, Shaped};
pub use results::rejection::Rejection;
use results::rejection::rejection;
use single_frames::PoseKnowledge;
use spread::Estimate;
use texture::SplitContrast;
pub use texture::TextureRefinement;

/// Steps without knowledge of how the joints vary: for each the distance beyond which a contour counts linearly, pixels.
const FIRST_STEPS: [f64; 4] = [20.0, 12.0, 8.0, 5.0];
/// Then the joints' spreads are measured and the fingers start once more, from what these and the given poses say: in the
/// first steps a finger may have taken another one's outline for its own.
const STEPS: [f64; 7] = [12.0, 8.0, 5.0, 4.0, 3.0, 3.0, 3.0];

/// The last ones, once frames that were astray are back.
const LAST_STEPS: [f64; 3] = [5.0, 3.0, 3.0];

/// Turns of cameras and of poses with the shape, once cameras are known to be off.
const FURTHER_CALIBRATIONS: usize = 2;

/// The same, where only landmarks tell where cameras are.
const ROUGH_CALIBRATIONS: usize = 8;

/// Outlines of a mesh of fewer triangles are clearly polygons: contours are those of a smoother one.
const ROUND_FACES: usize = 5000;

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
    /// Poses of the frames of the split that is held out, by contours alone.
    pub held_out: Vec<Pose>,
    /// The template in the proportions found.
    pub template: HandModel,
    /// Why poses and template are those of the capture, if they are.
    pub rejection: Option<Rejection>,
    /// Poses and template that were found and rejected, for the picture of the alignment.
    pub rejected: Option<Box<(Vec<Pose>, HandModel)>>,
    /// What is refined of the cameras; `None` if they are as given.
    pub calibration: Option<Calibration>,
    /// The cameras that take their images clearly earlier or later than the others.
    pub time_offsets: Vec<TimeOffset>,
    /// The cameras that do not show the hand that the others show.
    #[serde(default)]
    pub odd_cameras: Vec<OddCamera>,
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
    /// What it learned of poses in general; `None` in a run that goes on from a checkpoint.
    #[serde(skip)]
    pub knowledge: Option<PoseKnowledge>,
    /// Seconds that it took.
    pub seconds: f64,
}

impl Alignment {
    /// All templates in it.
    pub fn templates_mut(&mut self) -> impl Iterator<Item = &mut HandModel> {
        let rejected = self.rejected.as_mut().map(|rejected| &mut rejected.1);
        std::iter::once(&mut self.template).chain(rejected)
    }
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

/// Aligns the frames of a split, together with those of a split that is held out, if there is one: the masks of these have
/// a say in the proportions, in how joints vary and in the cameras' calibration, their colours have none. `after_step` gets a description and the poses of
/// all frames after each step, and returns whether to go on.
///
/// # Errors
/// [`AlignmentError`] if an image or a pose is unusable, or the caller stopped it.
pub fn align(
    capture: &Capture,
    split: &Split,
    held_out: Option<&Split>,
    after_step: &mut dyn FnMut(&str, &[Pose]) -> bool,
) -> Result<Alignment, AlignmentError> {
    let start = Instant::now();
    let all = joined(split, held_out);
    let fields = DistanceField::of_views(capture, &all.views)?;
    let as_given = images_of_frames(&capture.cameras, &all, &fields);
    let given: Vec<&Pose> = all.frames.iter().map(|frame| &capture.frames[*frame].pose).collect();
    let mut fit = Fit::new(&capture.template, given.clone(), Shape::Unknown);
    let went_on = fit.follow_contours(&as_given, &mut |number, [median, far], poses| {
        after_step(&format!("step {number}: contours {median:.2} px, 95 % below {far:.2} px"), poses)
    })?;
    if !went_on {
        return Err(AlignmentError::Stopped);
    }
    let views = calibration_views(&all, &fields);
    let mut calibration = fit.calibrate(&capture.cameras, &views)?;
    if let Some(calibration) = &mut calibration {
        // Poses and proportions were fitted with wrong cameras: they start once more.
        let cameras = calibration.applied_to(&capture.cameras);
        fit = Fit::new(&capture.template, given.clone(), Shape::Unknown);
        fit.follow_contours(&images_of_frames(&cameras, &all, &fields), &mut |_, _, _| true)?;
        for _ in 0..FURTHER_CALIBRATIONS {
            fit.calibrate_further(&capture.cameras, &views, calibration)?;
            let cameras = calibration.applied_to(&capture.cameras);
            let images = images_of_frames(&cameras, &all, &fields);
            for huber in LAST_STEPS {
                fit.step(&images, huber, true)?;
            }
        }
    }
    let refined = calibration.as_ref().map(|calibration| calibration.applied_to(&capture.cameras));
    let cameras = refined.as_ref().unwrap_or(&capture.cameras);
    let images = images_of_frames(cameras, &all, &fields);
    fit.follow_mask_ends(&images)?;
    let refine = |fit: &Fit, usable: &[bool]| {
        let contrast = SplitContrast::load(capture, split)?;
        texture::refine(fit, &contrast.by_frame(cameras, &all), &images, usable, after_step)
    };
    let frames = split.frames.len();
    let given_fit = fit.fit_as_given(&as_given[..frames])?;
    let seen_by = Capture { cameras: cameras.clone(), ..capture.clone() };
    let odd_cameras = fit.odd_cameras(&seen_by, &all, &fields)?;
    let mut time_offsets = fit.time_offsets(capture, &all, &images)?;
    time_offsets.retain(|offset| odd_cameras.iter().all(|odd| odd.camera != offset.camera));
    let mut aligned = fit.finish(&images, frames, given_fit, start, refine)?;
    if aligned.rejection.is_none() {
        (aligned.calibration, aligned.time_offsets) = (calibration, time_offsets);
        aligned.odd_cameras = odd_cameras;
    }
    Ok(aligned)
}

/// The cameras of a capture of which only landmarks of the hand tell where they are, and their focal lengths if
/// `focals_are_known` is not set, refined by the contours in the images of a split. The lengths of all that they see stay open: only proportions are told.
///
/// # Errors
/// As of [`align`].
pub fn refine_rough_cameras(
    capture: &Capture,
    split: &Split,
    focals_are_known: bool,
) -> Result<Vec<Camera>, AlignmentError> {
    let parts = if focals_are_known { &[Part::Extrinsics][..] } else { &[Part::Extrinsics, Part::FocalLength] };
    let fields = DistanceField::of_views(capture, &split.views)?;
    let views = views_of_frames(split, &fields);
    let given: Vec<&Pose> = split.frames.iter().map(|frame| &capture.frames[*frame].pose).collect();
    let mut fit = Fit::with_own_outlines(&capture.template, given, Shape::Unknown);
    fit.follow_contours(&images_of_frames(&capture.cameras, split, &fields), &mut |_, _, _| true)?;
    let mut changes = vec![[0.0; cameras::unknowns::NUMBERS]; capture.cameras.len()];
    let mut refined = capture.cameras.clone();
    for _ in 0..ROUGH_CALIBRATIONS {
        changes = fit.calibrate_roughly(parts, &capture.cameras, &views, changes)?;
        let moved = capture.cameras.iter().zip(&changes);
        refined = moved.map(|(camera, change)| cameras::unknowns::changed(camera, change)).collect();
        let images = images_of_frames(&refined, split, &fields);
        for huber in LAST_STEPS {
            fit.step(&images, huber, true)?;
        }
    }
    Ok(refined)
}

/// The frames of a split and then those of another one.
fn joined(split: &Split, other: Option<&Split>) -> Split {
    let mut all = split.clone();
    if let Some(other) = other {
        let first = split.frames.len();
        all.frames.extend(&other.frames);
        all.views.extend(other.views.iter().map(|view| SplitView { position: first + view.position, ..*view }));
    }
    all
}

/// The views of a split by frame, with their cameras' numbers; those without outline are left out.
fn views_of_frames<'a>(split: &Split, fields: &'a [Option<DistanceField>]) -> Vec<FrameViews<'a>> {
    let mut views: Vec<FrameViews> = vec![vec![]; split.frames.len()];
    for (view, field) in split.views.iter().zip(fields) {
        views[view.position].extend(field.as_ref().map(|field| (view.camera, field)));
    }
    views
}

/// The views of a split by frame, those of a frame that it has twice together with the first of these: cameras that are held
/// out are calibrated, too.
fn calibration_views<'a>(split: &Split, fields: &'a [Option<DistanceField>]) -> Vec<FrameViews<'a>> {
    let mut views = views_of_frames(split, fields);
    for position in 1..views.len() {
        let frame = split.frames[position];
        if let Some(first) = split.frames[..position].iter().position(|other| *other == frame) {
            let more = std::mem::take(&mut views[position]);
            let known: Vec<usize> = views[first].iter().map(|(camera, _)| *camera).collect();
            views[first].extend(more.into_iter().filter(|(camera, _)| !known.contains(camera)));
        }
    }
    views
}

/// The views of a split by frame with their cameras; those without outline are left out.
fn images_of_frames<'a>(cameras: &'a [Camera], split: &Split, fields: &'a [Option<DistanceField>]) -> Vec<Images<'a>> {
    let images = |views: FrameViews<'a>| views.into_iter().map(|(camera, field)| (&cameras[camera], field)).collect();
    views_of_frames(split, fields).into_iter().map(images).collect()
}

/// Gets a step's number, median and 95th percentile of the contours' distances before it, pixels, and the poses; returns
/// whether to go on.
type AfterStep<'a> = dyn FnMut(usize, [f64; 2], &[Pose]) -> bool + 'a;

/// What of the template's shape is unknown.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Shape {
    Known,
    /// The model's own parameters.
    OfModel,
    /// These, and lengths and thicknesses of bones.
    Unknown,
}

/// The state of an alignment.
struct Fit<'a> {
    template: &'a HandModel,
    /// Of the template, as a rule with rounder outlines.
    proportions: Arc<Proportions>,
    edges: Edges,
    moving: Vec<usize>,
    carries: Vec<Vec<bool>>,
    given: Vec<&'a Pose>,
    poses: Vec<Pose>,
    /// Empty if the shape is known.
    shape: Vec<f64>,
    priors: Priors,
}

impl<'a> Fit<'a> {
    fn new(template: &'a HandModel, given: Vec<&'a Pose>, shape: Shape) -> Fit<'a> {
        Fit::of_proportions(round_proportions(template), template, given, shape)
    }

    /// With the template's own outlines: those of imports, where round ones brought neither cameras nor hands nearer.
    fn with_own_outlines(template: &'a HandModel, given: Vec<&'a Pose>, shape: Shape) -> Fit<'a> {
        Fit::of_proportions(Arc::new(Proportions::new(template.clone())), template, given, shape)
    }

    fn of_proportions(
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
    fn follow_contours(&mut self, images: &[Images], after_step: &mut AfterStep<'_>) -> Result<bool, InvalidHandModel> {
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
    fn follow_mask_ends(&mut self, images: &[Images]) -> Result<(), InvalidHandModel> {
        if self.masks_end_with_template(images)? {
            self.edges = Edges::of(self.proportions.template()).with_arm_end();
            for huber in LAST_STEPS {
                self.step(images, huber, true)?;
            }
        }
        Ok(())
    }

    /// The pose of a frame by its own images and what is known of poses, for a fixed shape, from `pose` on.
    fn fitted_alone(
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

    fn shaped(&self) -> Result<Shaped, InvalidHandModel> {
        match self.shape.is_empty() {
            true => Ok(self.proportions.as_given()),
            false => self.proportions.shaped(&self.shape),
        }
    }

    /// The template in its shape, without the vertices that round its outlines off.
    fn shaped_template(&self) -> Result<HandModel, InvalidHandModel> {
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

    fn equations(&self, images: &[Images], huber: f64) -> Result<Vec<FrameEquations>, InvalidHandModel> {
        let shaped = self.shaped()?;
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
            self.poses[k] = self.with_fingers_from_priors(&self.poses[k], self.given[k]);
        }
        Ok(())
    }

    /// A pose with the fingers of the likeliest one by the given one and the joints' spreads.
    fn with_fingers_from_priors(&self, pose: &Pose, given: &Pose) -> Pose {
        let mut likely = self.prior_pose(given);
        likely.rotations[0] = pose.rotations[0];
        likely.translation = pose.translation;
        likely
    }

    /// The likeliest pose by the given one and the joints' spreads.
    fn prior_pose(&self, given: &Pose) -> Pose {
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
    fn step(&mut self, images: &[Images], huber: f64, use_spreads: bool) -> Result<[f64; 2], InvalidHandModel> {
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

    /// The result for so many frames, those after them being held out; `given_fit` is that of the given poses. `refine` refines the poses by texture, given which
    /// frames' poses may be believed.
    fn finish(
        mut self,
        images: &[Images],
        frames: usize,
        given_fit: MaskFit,
        start: Instant,
        refine: impl FnOnce(&Fit, &[bool]) -> Result<(Vec<Pose>, TextureRefinement), AlignmentError>,
    ) -> Result<Alignment, AlignmentError> {
        let mut given: Vec<Pose> = self.given.iter().map(|pose| (*pose).clone()).collect();
        let shaped = self.shaped()?.known();
        let (_, given_overlaps) = self.fit_of(&shaped, &given, images)?;
        let (_, overlaps) = self.fit_of(&shaped, &self.poses, images)?;
        let mut kept: Vec<usize> = (0..images.len()).filter(|k| given_overlaps[*k] > overlaps[*k]).collect();
        kept.iter().for_each(|k| self.poses[*k] = given[*k].clone());
        let mut aligned_fit = self.fit_of(&shaped, &self.poses[..frames], &images[..frames])?.0;
        let is_other_hand = self.is_other_hand(images)?;
        let rejection = rejection([given_fit, aligned_fit], self.template, &shaped.model, is_other_hand);
        let mut texture = None;
        if rejection.is_none() {
            let is_usable = |k: usize| k < frames && !images[k].is_empty() && !kept.contains(&k);
            let usable: Vec<bool> = (0..images.len()).map(is_usable).collect();
            let (poses, mut refinement) = refine(&self, &usable)?;
            let (_, overlaps) = self.fit_of(&shaped, &poses, images)?;
            self.poses = poses;
            refinement.take_back(&mut self.poses, |frame| overlaps[frame] < given_overlaps[frame]);
            aligned_fit = self.fit_of(&shaped, &self.poses[..frames], &images[..frames])?.0;
            refinement.contour_poses.truncate(frames);
            texture = Some(refinement);
        }
        let uncertainty = self.uncertainty(images)?;
        kept.retain(|k| *k < frames);
        let fit = [given_fit, aligned_fit];
        let prior_poses = self.given[..frames].iter().map(|given| self.prior_pose(given)).collect();
        let seconds = start.elapsed().as_secs_f64();
        let template = self.shaped_template()?;
        let knowledge = Some(PoseKnowledge { moving: self.moving, priors: self.priors });
        let (mut poses, template, rejected) = match rejection {
            Some(_) => {
                self.poses.truncate(frames);
                let own = self.template.clone();
                (std::mem::take(&mut given), own, Some(Box::new((self.poses, template))))
            }
            None => (self.poses, template, None),
        };
        let held_out = poses.split_off(frames);
        Ok(Alignment {
            poses,
            held_out,
            template,
            rejection,
            rejected,
            calibration: None,
            time_offsets: vec![],
            odd_cameras: vec![],
            fit,
            kept,
            prior_poses,
            texture,
            uncertainty,
            knowledge,
            seconds,
        })
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

    /// How well the template as it came, in the given poses, fits the masks of the first frames.
    fn fit_as_given(&self, images: &[Images]) -> Result<MaskFit, InvalidHandModel> {
        let given: Vec<Pose> = self.given[..images.len()].iter().map(|pose| (*pose).clone()).collect();
        Ok(self.fit_of(&self.proportions.as_given(), &given, images)?.0)
    }

    /// How well a hand in these poses fits the masks; also the overlap of each frame, 1 for one without masks.
    fn fit_of(
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
                distances.extend(contour.iter().map(|point| point.residual.abs()));
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
        moved(&self.moving, pose, step)
    }
}

/// The proportions of a template, as a rule with rounder outlines.
fn round_proportions(template: &HandModel) -> Arc<Proportions> {
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
struct JointStep {
    /// Of each frame's pose.
    poses: Vec<DVector<f64>>,
    /// Of what the frames share.
    shared: DVector<f64>,
}

/// A step of all frames and of what they share, which is `shared` now and has these standard deviations before any image is
/// seen, about 0.
fn joint_step(equations: &[FrameEquations], shared: &[f64], deviations: &[f64]) -> JointStep {
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
