//! Alignment: poses, translations and the template's proportions from the masks' contours, before any appearance.
//!
//! Contour bundle adjustment: the template's outer contour in all images of a frame is moved onto the outlines of the
//! masks, by Gauss-Newton steps for all frames together. A frame's pose is eliminated by its Schur complement; the shape
//! is shared. Then the skin's texture refines the poses (`texture.rs`). On the CPU, in f64; the same bits for any number of
//! threads.

mod blur;
mod cameras;
mod correctives;
mod fit;
mod frame;
mod outlines;
pub mod pose_offsets;
mod priors;
mod proportions;
mod reduced;
pub mod results;
pub mod shape_fit;
mod side;
pub mod single_frames;
mod spread;
mod stragglers;
mod texture;
mod triangles;

use std::time::Instant;

use ghand_capture::{Capture, CaptureError, Split, SplitView};
use ghand_core::{Camera, HandModel, InvalidHandModel, Pose};
use nalgebra::DMatrix;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

pub use cameras::calibration::Calibration;
use cameras::calibration::FrameViews;
pub use cameras::odd::OddCamera;
pub use cameras::time_offsets::TimeOffset;
use cameras::unknowns::Part;
use fit::{FIRST_STEPS, Fit, LAST_STEPS, STEPS, Shape, inverse, joint_step, quantiles, round_proportions};
use outlines::contour::Edges;
use outlines::distance_field::DistanceField;
use priors::Priors;
use reduced::Reduced;
pub use results::rejection::Rejection;
use results::rejection::rejection;
use single_frames::PoseKnowledge;
use texture::SplitContrast;
pub use texture::TextureRefinement;

/// Turns of cameras and of poses with the shape, once cameras are known to be off.
const FURTHER_CALIBRATIONS: usize = 2;

/// The same, where only landmarks tell where cameras are.
const ROUGH_CALIBRATIONS: usize = 24;

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
    let reduced = Reduced::new(capture, &all)?;
    let fields = reduced.fields(&all.views)?;
    let as_given = images_of_frames(&reduced.cameras, &all, &fields);
    let given: Vec<&Pose> = all.frames.iter().map(|frame| &capture.frames[*frame].pose).collect();
    let mut fit = Fit::new(&capture.template, given.clone(), Shape::Unknown);
    let went_on = fit.follow_contours(&as_given, &mut |number, [median, far], poses| {
        let [median, far] = [median, far].map(|distance| reduced.usual() * distance);
        after_step(&format!("step {number}: contours {median:.2} px, 95 % below {far:.2} px"), poses)
    })?;
    if !went_on {
        return Err(AlignmentError::Stopped);
    }
    let views = calibration_views(&all, &fields);
    let mut calibration = fit.calibrate(&reduced.cameras, &views)?;
    if let Some(calibration) = &mut calibration {
        // Poses and proportions were fitted with wrong cameras: they start once more.
        let cameras = calibration.applied_to(&reduced.cameras);
        fit = Fit::new(&capture.template, given.clone(), Shape::Unknown);
        fit.follow_contours(&images_of_frames(&cameras, &all, &fields), &mut |_, _, _| true)?;
        for _ in 0..FURTHER_CALIBRATIONS {
            fit.calibrate_further(&reduced.cameras, &views, calibration)?;
            let cameras = calibration.applied_to(&reduced.cameras);
            let images = images_of_frames(&cameras, &all, &fields);
            for huber in LAST_STEPS {
                fit.step(&images, huber, true)?;
            }
        }
    }
    let refined = calibration.as_ref().map(|calibration| calibration.applied_to(&reduced.cameras));
    let cameras = refined.as_ref().unwrap_or(&reduced.cameras);
    let images = images_of_frames(cameras, &all, &fields);
    fit.follow_mask_ends(&images)?;
    let refine = |fit: &Fit, usable: &[bool]| {
        let contrast = SplitContrast::load(&reduced, split)?;
        texture::refine(fit, &contrast.by_frame(cameras, &all), &images, usable, after_step)
    };
    let frames = split.frames.len();
    let given_fit = fit.fit_as_given(&as_given[..frames])?;
    let odd_cameras = fit.odd_cameras(&reduced, cameras, &all, &fields)?;
    let mut time_offsets = fit.time_offsets(capture, &all, &images)?;
    time_offsets.retain(|offset| odd_cameras.iter().all(|odd| odd.camera != offset.camera));
    let mut aligned = fit.finish(&images, frames, given_fit, start, refine)?;
    if aligned.rejection.is_none() {
        aligned.calibration = calibration.map(|found| reduced.full_size_calibration(found));
        (aligned.time_offsets, aligned.odd_cameras) = (time_offsets, odd_cameras);
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
    let reduced = Reduced::new(capture, split)?;
    let fields = reduced.fields(&split.views)?;
    let views = views_of_frames(split, &fields);
    let given: Vec<&Pose> = split.frames.iter().map(|frame| &capture.frames[*frame].pose).collect();
    let mut fit = Fit::with_own_outlines(&capture.template, given, Shape::Unknown);
    fit.follow_contours(&images_of_frames(&reduced.cameras, split, &fields), &mut |_, _, _| true)?;
    let mut changes = vec![[0.0; cameras::unknowns::NUMBERS]; reduced.cameras.len()];
    let mut refined = reduced.cameras.clone();
    for _ in 0..ROUGH_CALIBRATIONS {
        changes = fit.calibrate_roughly(parts, &reduced.cameras, &views, changes)?;
        let moved = reduced.cameras.iter().zip(&changes);
        refined = moved.map(|(camera, change)| cameras::unknowns::changed(camera, change)).collect();
        let images = images_of_frames(&refined, split, &fields);
        for huber in LAST_STEPS {
            fit.step(&images, huber, true)?;
        }
    }
    Ok(reduced.full_size(refined))
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

impl Fit<'_> {
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
}
