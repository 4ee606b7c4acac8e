//! Refinement of aligned poses by the skin's texture: proportions stay, each frame's pose moves to where its images agree
//! with each other and with the other frames about what the surface looks like.
//!
//! Three cues have a say: the masks' contours; the differences among the images of a frame, which show each point in the
//! same light; and the difference of a frame from the others. How much each counts is measured from how far they disagree
//! (`agreement.rs`).
//!
//! The texture of some images of each frame takes no part; with one or two images a frame, that of some patches of skin. If
//! these, of all frames together, are not explained clearly better than by the poses before, nothing is refined; and frames of
//! which they are explained clearly worse keep their poses.

pub(super) mod agreement;
mod bands;
mod observations;
pub(super) mod surface;

use std::collections::BTreeMap;

use ghand_capture::{CaptureError, Split, SplitView};
use ghand_core::{Camera, InvalidHandModel, Pose};
use glam::DVec3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::frame::{Rig, VertexMotion};
use super::proportions::Shaped;
use super::reduced::Reduced;
use super::{AlignmentError, Fit, Images, STEPS, quantiles};
use agreement::{Agreed, Cue, agree};
use bands::{Band, Contrast};
use observations::{Contrasts, FREEDOM, Observation, Observed, References, observe};
use surface::{SurfacePoint, surface_points};

/// The steps: the band, and whether joints other than the root move. Texture shows where the hand is better than how the
/// fingers bend: a second fine step of these made all poses worse that were measured.
const STAGES: [(Band, bool); 4] = [(Band::Coarse, true), (Band::Fine, true), (Band::Fine, false), (Band::Fine, false)];
/// Every so many images of a frame one is held out; of a frame with too few images for that, one in so many patches of
/// the skin.
const HELD_OUT: usize = 4;
/// A frame with fewer images holds out patches.
const LEAST_IMAGES: usize = 3;
/// Errors of what is held out differ if they do by this many standard errors.
const SIGNIFICANT: f64 = 2.0;

/// How a refinement by texture went.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TextureRefinement {
    /// The poses before it, by contours alone.
    pub contour_poses: Vec<Pose>,
    /// Frames that were refined.
    pub refined: Vec<usize>,
    /// Frames that keep their poses because images held out, or masks, would fit worse.
    pub kept: Vec<usize>,
    /// Contrast of images held out, less what a frame's other images and the other frames lead to expect: root mean square
    /// with bounded influence of outliers, over the points of all frames that could be refined, before and after.
    pub held_out: [f64; 2],
    /// How many times as large as first assumed the variances of the contours are, of the differences among a frame's
    /// images, and of those from the other frames.
    pub variance_factors: [f64; 3],
}

impl TextureRefinement {
    /// Gives refined frames for which `is_worse` their former poses.
    pub(super) fn take_back(&mut self, poses: &mut [Pose], is_worse: impl Fn(usize) -> bool) {
        let (worse, refined): (Vec<usize>, Vec<usize>) = self.refined.iter().partition(|frame| is_worse(**frame));
        worse.iter().for_each(|frame| poses[*frame] = self.contour_poses[*frame].clone());
        self.refined = refined;
        self.kept.extend(&worse);
    }
}

/// The contrast of a split's images.
pub(super) struct SplitContrast(Vec<Option<Contrast>>);

impl SplitContrast {
    /// # Errors
    /// [`CaptureError`] if an image is unusable.
    pub fn load(reduced: &Reduced, split: &Split) -> Result<SplitContrast, CaptureError> {
        let of_view = |view: &SplitView| Ok(Contrast::of_view(&reduced.view(view.camera, view.frame)?));
        Ok(SplitContrast(split.views.par_iter().map(of_view).collect::<Result<_, CaptureError>>()?))
    }

    /// The images of the frames.
    pub fn by_frame<'a>(&'a self, cameras: &'a [Camera], split: &Split) -> Vec<Contrasts<'a>> {
        let mut images: Vec<Contrasts> = vec![vec![]; split.frames.len()];
        for (view, contrast) in split.views.iter().zip(&self.0) {
            images[view.position].extend(contrast.as_ref().map(|contrast| (&cameras[view.camera], contrast)));
        }
        images
    }
}

/// Refines the poses of a fit. `usable` says which frames' poses may be believed: the others neither change nor take part.
///
/// # Errors
/// [`AlignmentError`] if a pose does not fit the template or the caller stopped it.
pub(super) fn refine(
    fit: &Fit,
    images: &[Contrasts],
    masks: &[Images],
    usable: &[bool],
    after_step: &mut dyn FnMut(&str, &[Pose]) -> bool,
) -> Result<(Vec<Pose>, TextureRefinement), AlignmentError> {
    let shaped = fit.shaped()?.known();
    let points = surface_points(&shaped.model);
    let frames: Vec<usize> = (0..images.len()).filter(|frame| usable[*frame] && !images[*frame].is_empty()).collect();
    let refiner = Refiner { fit, shaped: &shaped, points: &points, images, masks };
    let is_free = |frame: usize, image: usize, point: &SurfacePoint| !is_held_out(frame, image, point, images);
    let (mut poses, variance_factors) = refiner.refined(&frames, is_free, after_step)?;
    let judged = refiner.judge(&frames, &poses)?;
    let sum = |part: &dyn Fn(&HeldOut) -> f64| judged.iter().map(part).sum::<f64>();
    let is_better = sum(&|of_frame| of_frame.increase()) < -SIGNIFICANT * sum(&|of_frame| of_frame.variance()).sqrt();
    let is_refined = |of_frame: &HeldOut| is_better && !of_frame.is_worse();
    let mut refined = vec![];
    let mut kept = vec![];
    for (frame, of_frame) in frames.iter().zip(&judged) {
        if is_refined(of_frame) {
            refined.push(*frame);
        } else {
            kept.push(*frame);
            poses[*frame] = fit.poses[*frame].clone();
        }
    }
    let count = sum(&|of_frame| of_frame.count as f64).max(1.0);
    let before = sum(&|of_frame| of_frame.errors[0]);
    let after = sum(&|of_frame| of_frame.errors[usize::from(is_refined(of_frame))]);
    let held_out = [before, after].map(|errors| (errors / count).sqrt());
    let contour_poses = fit.poses.clone();
    Ok((poses, TextureRefinement { contour_poses, refined, kept, held_out, variance_factors }))
}

/// Whether a point in an image of a frame takes no part in its refinement: other images, or patches, from frame to frame.
fn is_held_out(frame: usize, image: usize, point: &SurfacePoint, images: &[Contrasts]) -> bool {
    let count = images[frame].len();
    if count >= LEAST_IMAGES {
        return (image + frame).is_multiple_of(HELD_OUT.min(count));
    }
    let [x, y, z] = point.patch;
    (i64::from(x) + 2 * i64::from(y) + 3 * i64::from(z) + frame as i64).rem_euclid(HELD_OUT as i64) == 0
}

/// What does not change from step to step.
struct Refiner<'a> {
    fit: &'a Fit<'a>,
    shaped: &'a Shaped,
    points: &'a [SurfacePoint],
    images: &'a [Contrasts<'a>],
    masks: &'a [Images<'a>],
}

impl Refiner<'_> {
    /// All poses after refining some frames by what `is_used` chooses (of frame, image and point), and the factors of the cues'
    /// variances.
    fn refined(
        &self,
        frames: &[usize],
        is_used: impl Fn(usize, usize, &SurfacePoint) -> bool + Sync,
        after_step: &mut dyn FnMut(&str, &[Pose]) -> bool,
    ) -> Result<(Vec<Pose>, [f64; 3]), AlignmentError> {
        let mut poses = self.fit.poses.clone();
        let mut factors = [1.0; 3];
        for (number, (band, move_fingers)) in STAGES.into_iter().enumerate() {
            let observed = self.observe(frames, &poses, band, &is_used)?;
            let references = References::new(&observed, self.points);
            let agreed = self.step(frames, &poses, &observed, &references, move_fingers)?;
            for (frame, step) in frames.iter().zip(&agreed.steps) {
                poses[*frame] = self.fit.moved(&poses[*frame], step);
            }
            factors = [0, 1, 2].map(|cue| agreed.factors[cue]);
            if !after_step(&format!("texture, step {number}"), &poses) {
                return Err(AlignmentError::Stopped);
            }
        }
        Ok((poses, factors))
    }

    /// What the images held out of some frames say about their poses.
    fn judge(&self, frames: &[usize], poses: &[Pose]) -> Result<Vec<HeldOut>, InvalidHandModel> {
        let before = self.observe(frames, &self.fit.poses, Band::Fine, |_, _, _| true)?;
        let after = self.observe(frames, poses, Band::Fine, |_, _, _| true)?;
        let references = References::new(&after, self.points);
        let of_frame = |place: usize| {
            let is_held_out = |image, point: &SurfacePoint| is_held_out(frames[place], image, point, self.images);
            let by_patches = self.images[frames[place]].len() < LEAST_IMAGES;
            HeldOut::new(&references, self.points, place, [&before[place], &after[place]], by_patches, is_held_out)
        };
        Ok((0..frames.len()).into_par_iter().map(of_frame).collect())
    }

    /// What the images of some frames show, as far as `is_used` (of frame, image and point).
    fn observe(
        &self,
        frames: &[usize],
        poses: &[Pose],
        band: Band,
        is_used: impl Fn(usize, usize, &SurfacePoint) -> bool + Sync,
    ) -> Result<Vec<Observed>, InvalidHandModel> {
        let of_frame = |frame: &usize| {
            let images = &self.images[*frame];
            observe(self.shaped, self.points, &poses[*frame], images, band, |image, point| {
                is_used(*frame, image, point)
            })
        };
        frames.par_iter().map(of_frame).collect()
    }

    /// A Gauss-Newton step of some frames, by contours, texture and what is known before.
    fn step(
        &self,
        frames: &[usize],
        poses: &[Pose],
        observed: &[Observed],
        references: &References,
        move_fingers: bool,
    ) -> Result<Agreed, InvalidHandModel> {
        let Fit { edges, moving, carries, given, priors, .. } = self.fit;
        let rig = Rig { shaped: self.shaped, edges, moving, carries, huber: STEPS[STEPS.len() - 1] };
        let of_frame = |(place, frame): (usize, &usize)| -> Result<(Vec<Cue>, Cue, Vec<f64>), InvalidHandModel> {
            let pose = &poses[*frame];
            let contours = rig.equations(pose, &self.masks[*frame])?;
            let mut cues = vec![Cue { information: contours.pose_pose, gradient: contours.d_pose }];
            let distances = contours.distances;
            cues.extend(self.texture_cues(&rig, place, pose, &observed[place], references)?);
            let mut prior = Cue::nothing(cues[0].gradient.len());
            priors.add_given(pose, given[*frame], moving, &mut prior.information, &mut prior.gradient);
            priors.spread.add(pose, &mut prior.information, &mut prior.gradient);
            Ok((cues, prior, distances))
        };
        let equations = frames.par_iter().enumerate().map(of_frame).collect::<Result<Vec<_>, _>>()?;
        let mut cues = vec![];
        let mut priors = vec![];
        let mut distances = vec![];
        for (of_frame, prior, of_contours) in equations {
            cues.push(of_frame);
            priors.push(prior);
            distances.extend(of_contours);
        }
        // Contours are assumed to be 1 pixel off, in all images of a frame alike. At best they err as far as their distances
        // tell, and independently. The median of a normal distribution's absolute values is 0.67 standard deviations.
        let images = frames.iter().map(|frame| self.masks[*frame].len()).max().unwrap_or(0);
        let deviation = quantiles(distances)[0] / 0.67;
        let least = if deviation.is_nan() { 1.0 } else { deviation.powi(2).min(1.0) / images.max(1) as f64 };
        let of_joint = |place: usize| (move_fingers || moving[place] == 0).then_some(3 * place..3 * place + 3);
        let translation = 3 * moving.len()..3 * moving.len() + 3;
        let unknowns: Vec<usize> = (0..moving.len()).filter_map(of_joint).flatten().chain(translation).collect();
        Ok(agree(&cues, &priors, &[least, 1.0, 1.0], &unknowns))
    }

    /// What texture says about a frame's pose: by the differences among its images, and from the other frames.
    fn texture_cues(
        &self,
        rig: &Rig,
        place: usize,
        pose: &Pose,
        observed: &Observed,
        references: &References,
    ) -> Result<[Cue; 2], InvalidHandModel> {
        let posed = self.shaped.pose(pose)?;
        let mut motion = VertexMotion::new(rig, &posed);
        let mut cues = [0, 1].map(|_| Cue::nothing(3 * rig.moving.len() + 3));
        let mut row: Vec<(usize, DVec3)> = vec![];
        for (point, own) in observed.iter().enumerate() {
            let Some(pulls) = references.pulls(place, point, own) else { continue };
            motion.of_face_point(self.points[point].corners, self.points[point].weights, &mut row);
            for (cue, pull) in cues.iter_mut().zip(pulls) {
                for (i, a) in &row {
                    cue.gradient[*i] += a.dot(pull.gradient);
                    let pulled = pull.information * *a;
                    row.iter().for_each(|(j, b)| cue.information[(*i, *j)] += pulled.dot(*b));
                }
            }
        }
        Ok(cues)
    }
}

/// Errors of the images held out of a frame, in two poses.
#[derive(Debug, Clone, Default, PartialEq)]
struct HeldOut {
    /// Points that are seen in both poses, in all these images.
    count: usize,
    /// Sums of their squared errors, with bounded influence of outliers.
    errors: [f64; 2],
    /// By patch, how much larger the second sum is.
    increases: BTreeMap<[i32; 3], f64>,
}

impl HeldOut {
    /// How far the images held out are from what the others lead to expect; `by_patches`, from what the other frames do.
    /// `place` is the frame's in the references.
    fn new(
        references: &References,
        points: &[SurfacePoint],
        place: usize,
        observed: [&Observed; 2],
        by_patches: bool,
        is_held_out: impl Fn(usize, &SurfacePoint) -> bool,
    ) -> HeldOut {
        let mut sum = HeldOut::default();
        for (point, surface_point) in points.iter().enumerate() {
            let is_held_out = |own: &&Observation| is_held_out(own.image, surface_point);
            let expected = observed.map(|observed| {
                let others = observed[point].iter().filter(|own| !is_held_out(own));
                let others: Vec<Observation> = others.copied().collect();
                (by_patches || !others.is_empty()).then(|| references.expected(place, point, &others))?
            });
            let [Some(before), Some(after)] = expected else { continue };
            for first in observed[0][point].iter().filter(is_held_out) {
                let Some(second) = observed[1][point].iter().find(|own| own.image == first.image) else { continue };
                let errors = [(first, before), (second, after)].map(|(own, (value, variance))| {
                    let square = (own.value - value).powi(2);
                    square / (1.0 + square / (FREEDOM * variance))
                });
                sum.count += 1;
                sum.errors = [0, 1].map(|k| sum.errors[k] + errors[k]);
                *sum.increases.entry(surface_point.patch).or_default() += errors[1] - errors[0];
            }
        }
        sum
    }

    /// How much larger the second pose's errors are.
    fn increase(&self) -> f64 {
        self.errors[1] - self.errors[0]
    }

    /// The variance of that, were it an accident: the points of a patch err alike, patches independently.
    fn variance(&self) -> f64 {
        self.increases.values().map(|increase| increase.powi(2)).sum()
    }

    fn is_worse(&self) -> bool {
        self.increase() > SIGNIFICANT * self.variance().sqrt()
    }
}

#[cfg(test)]
mod tests;
