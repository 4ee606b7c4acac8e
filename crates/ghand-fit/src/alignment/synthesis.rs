//! Poses by analysis through synthesis: an avatar that has learned for a while is drawn in the pose of each frame, and the
//! pose moves to where the drawn images agree with the frame's. All images of a frame have a say at once, by Gauss-Newton
//! steps.
//!
//! To first order a drawn image changes with the pose as if each pixel moved with the surface that it shows (`samples.rs`),
//! so that no derivative of the splatter is needed. How much pixels count is measured (`noise.rs`), and so is, with the
//! poses found so far, how far the given poses are off and how the joints vary.
//!
//! Some images of each frame, or parts of them, are held out (`held_out.rs`). If they do not come nearer to the avatar over
//! all frames, nothing is refined; and frames in which they are clearly farther from it keep their poses.

mod held_out;
mod noise;
mod samples;
mod visible_faces;

use std::collections::BTreeMap;
use std::time::Instant;

use ghand_capture::CaptureError;
use ghand_core::rotation::{axis_angle_from_rotation, rotation_from_axis_angle};
use ghand_core::{HandModel, InvalidHandModel, Pose};
use ghand_render::RenderError;
use ghand_render::splat::Image;
use glam::{DMat3, DVec3};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::frame::{Rig, VertexMotion};
use super::proportions::Shaped;
use super::spread::Estimate;
use super::texture::agreement::{Cue, agree};
use super::{Fit, STEPS, Shape, inverse};
use crate::views::TrainView;
use held_out::{Comparison, Roles};
use noise::Noise;
use samples::{Band, Sample, samples};

/// The steps: standard deviations of the blurs whose difference is compared, pixels.
const BANDS: [Band; 2] = [Band { blurs: [2.0, 8.0], step: 2 }, Band { blurs: [0.8, 6.0], step: 1 }];
/// Most images that are drawn in a step; but at least some of each frame.
const IMAGES: usize = 600;
/// Images from which noise is measured.
const NOISE_IMAGES: usize = 32;
/// Side of a patch of the skin at rest, metres: its pixels err alike.
const PATCH: f64 = 0.012;
/// Rounds in which the priors, and how much the images count, settle.
const ROUNDS: usize = 3;

/// Why poses could not be refined.
#[derive(Debug, thiserror::Error)]
pub enum SynthesisError {
    /// An image has become unreadable.
    #[error(transparent)]
    Capture(#[from] CaptureError),
    /// A pose does not fit the template.
    #[error(transparent)]
    Pose(#[from] InvalidHandModel),
    /// The avatar could not be drawn.
    #[error(transparent)]
    Render(#[from] RenderError),
}

/// How a refinement by an avatar went.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SynthesisRefinement {
    /// Iterations of the training after which it came.
    pub iteration: u64,
    /// Number of frames that were refined.
    pub refined_frames: usize,
    /// Number of frames that keep their poses, because images held out would be farther from the avatar.
    pub kept_frames: usize,
    /// Mean absolute difference of images held out from the avatar, in display values with bounded influence of outliers,
    /// in the frames that were refined: before.
    pub held_out_before: f64,
    /// The same after it; before any frame kept its pose, if none was refined.
    pub held_out_after: f64,
    /// Root mean square rotation of the joints in refined frames, degrees.
    pub turned_deg: f64,
    /// Seconds that it took.
    pub seconds: f64,
}

impl SynthesisRefinement {
    /// One line for people.
    pub fn summary(&self) -> String {
        format!(
            "after {} iterations the avatar refined the poses of {} frames, {} keep theirs; images held out are off by \
             {:.4}, {:.4} before",
            self.iteration, self.refined_frames, self.kept_frames, self.held_out_after, self.held_out_before
        )
    }
}

/// What is refined.
pub struct SynthesisProblem<'a> {
    /// The avatar's template with its rest joints.
    pub template: &'a HandModel,
    /// The capture's poses of the frames.
    pub given: Vec<&'a Pose>,
    /// The frame of each image, as its place among the frames.
    pub frames: Vec<usize>,
    /// The images, by number.
    pub view: &'a (dyn Fn(usize) -> Result<TrainView, CaptureError> + Sync),
    /// The integer fraction of the resolution as they were taken at which they are.
    pub reduction: u32,
}

/// Draws the avatar in a pose as a view shows it; `None` if the caller wants to stop.
pub type Draw<'a> = dyn FnMut(&TrainView, &Pose) -> Result<Option<Image>, RenderError> + 'a;

/// Refines the poses of all frames from `poses` on, after so many iterations of the training; `None` if the caller stopped.
///
/// # Errors
/// [`SynthesisError`] if an image is unusable, a pose does not fit the template or drawing failed.
pub fn refine_by_synthesis(
    problem: &SynthesisProblem,
    poses: &[Pose],
    iteration: u64,
    draw: &mut Draw,
) -> Result<Option<(Vec<Pose>, SynthesisRefinement)>, SynthesisError> {
    let start = Instant::now();
    let mut fit = Fit::new(problem.template, problem.given.clone(), Shape::Known);
    fit.poses = poses.to_vec();
    let shaped = fit.shaped()?;
    let mut refiner = Refiner {
        roles: Roles::of_frames(&problem.frames, poses.len()),
        patches: patches(&shaped.model),
        shaped,
        problem,
        fit,
    };
    for band in BANDS {
        if !refiner.step(band, draw)? {
            return Ok(None);
        }
    }
    let Some(judged) = refiner.judge(poses, draw)? else { return Ok(None) };
    let is_better = judged.iter().map(Comparison::increase).sum::<f64>() < 0.0;
    let mut refined = vec![];
    for (frame, comparison) in judged.iter().enumerate() {
        if is_better && !comparison.is_worse() && !refiner.roles[frame].used.is_empty() {
            refined.push(frame);
        } else {
            refiner.fit.poses[frame] = poses[frame].clone();
        }
    }
    let counted: Vec<&Comparison> = match refined.is_empty() {
        true => judged.iter().collect(),
        false => refined.iter().map(|frame| &judged[*frame]).collect(),
    };
    let [held_out_before, held_out_after] = [0, 1].map(|which| Comparison::mean(&counted, which));
    let refinement = SynthesisRefinement {
        iteration,
        refined_frames: refined.len(),
        kept_frames: poses.len() - refined.len(),
        held_out_before,
        held_out_after,
        turned_deg: refiner.turned(poses, &refined).to_degrees(),
        seconds: start.elapsed().as_secs_f64(),
    };
    Ok(Some((refiner.fit.poses, refinement)))
}

/// The patch of each face.
fn patches(template: &HandModel) -> Vec<[i32; 3]> {
    let patch = |face: &[u32; 3]| {
        let center = face.iter().map(|corner| template.vertices[*corner as usize]).sum::<DVec3>() / 3.0;
        (center / PATCH).to_array().map(|v| v.floor() as i32)
    };
    template.faces.iter().map(patch).collect()
}

/// Half the squared residuals of a face as a function of its position, to second order.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
struct Pull {
    information: DMat3,
    gradient: DVec3,
}

impl Pull {
    fn add_sample(&mut self, sample: &Sample, noise: &Noise) {
        let weight = noise.weight(sample);
        let g = sample.gradient;
        self.information += DMat3::from_cols(g * g.x, g * g.y, g * g.z) * weight;
        self.gradient += weight * sample.residual * g;
    }

    fn add(&mut self, other: &Pull) {
        self.information += other.information;
        self.gradient += other.gradient;
    }
}

/// A refinement at work.
struct Refiner<'a> {
    problem: &'a SynthesisProblem<'a>,
    fit: Fit<'a>,
    shaped: Shaped,
    /// What each image of the frames is for.
    roles: Vec<Roles>,
    /// By face.
    patches: Vec<[i32; 3]>,
}

impl Refiner<'_> {
    /// A Gauss-Newton step of all frames. Returns whether to go on.
    fn step(&mut self, band: Band, draw: &mut Draw) -> Result<bool, SynthesisError> {
        let used: Vec<usize> = self.roles.iter().flat_map(|roles| roles.used.iter().copied()).collect();
        let chosen = used.len().min(NOISE_IMAGES);
        let mut all = vec![];
        for k in 0..chosen {
            let Some(seen) = self.samples(used[k * used.len() / chosen], band, draw)? else { return Ok(false) };
            all.extend(seen);
        }
        let noise = Noise::of(&all);
        let mut pulls: Vec<Vec<Pull>> = vec![];
        for frame in 0..self.fit.poses.len() {
            let mut own = vec![Pull::default(); self.shaped.model.faces.len()];
            for k in 0..self.roles[frame].used.len() {
                let Some(seen) = self.samples(self.roles[frame].used[k], band, draw)? else { return Ok(false) };
                seen.iter().for_each(|sample| own[sample.face as usize].add_sample(sample, &noise));
            }
            pulls.push(own);
        }
        let factor = self.patch_factor(&pulls);
        let cues = (pulls.par_iter().zip(&self.fit.poses))
            .map(|(pulls, pose)| Ok(vec![self.cue(pulls, pose, factor)?]))
            .collect::<Result<Vec<Vec<Cue>>, InvalidHandModel>>()?;
        self.move_poses(&cues);
        Ok(true)
    }

    /// What an image says about its frame's pose, without what is held out.
    fn samples(&self, index: usize, band: Band, draw: &mut Draw) -> Result<Option<Vec<Sample>>, SynthesisError> {
        let view = (self.problem.view)(index)?;
        let pose = &self.fit.poses[view.frame];
        let Some(drawn) = draw(&view, pose)? else { return Ok(None) };
        let positions = self.shaped.pose(pose)?.vertices;
        let roles = &self.roles[view.frame];
        let is_used = |pixel| !roles.is_held_out(index, pixel, self.problem.reduction);
        Ok(Some(samples(&view, &drawn, &positions, &self.shaped.model.faces, band, is_used)))
    }

    /// How many times as much the pulls of whole patches vary as those of independent pixels would.
    fn patch_factor(&self, pulls: &[Vec<Pull>]) -> f64 {
        let of_frame = |pulls: &Vec<Pull>| {
            let mut patches: BTreeMap<[i32; 3], Pull> = BTreeMap::new();
            for (pull, patch) in pulls.iter().zip(&self.patches) {
                patches.entry(*patch).or_default().add(pull);
            }
            let squares = patches.values().map(|pull| pull.gradient.length_squared()).sum::<f64>();
            let trace = |pull: &Pull| (0..3).map(|axis| pull.information.col(axis)[axis]).sum::<f64>();
            [squares, patches.values().map(trace).sum::<f64>()]
        };
        let parts: Vec<[f64; 2]> = pulls.par_iter().map(of_frame).collect();
        let [squares, expected] = [0, 1].map(|k| parts.iter().map(|part| part[k]).sum::<f64>());
        if expected > 0.0 { (squares / expected).max(1.0) } else { 1.0 }
    }

    /// What the pulls of its faces say about a frame's pose.
    fn cue(&self, pulls: &[Pull], pose: &Pose, factor: f64) -> Result<Cue, InvalidHandModel> {
        let Fit { edges, moving, carries, .. } = &self.fit;
        let rig = Rig { shaped: &self.shaped, edges, moving, carries, huber: STEPS[STEPS.len() - 1] };
        let posed = self.shaped.pose(pose)?;
        let mut motion = VertexMotion::new(&rig, &posed);
        let mut cue = Cue::nothing(3 * moving.len() + 3);
        let mut row: Vec<(usize, DVec3)> = vec![];
        let pulled = self.shaped.model.faces.iter().zip(pulls).filter(|(_, pull)| pull.information != DMat3::ZERO);
        for (face, pull) in pulled {
            motion.of_face_point(*face, [1.0 / 3.0; 3], &mut row);
            for (i, a) in &row {
                cue.gradient[*i] += a.dot(pull.gradient) / factor;
                let along = pull.information * *a / factor;
                row.iter().for_each(|(j, b)| cue.information[(*i, *j)] += along.dot(*b));
            }
        }
        Ok(cue)
    }

    /// Moves all poses by what images, the given poses and the joints' spreads say. The spreads, and how far the given poses
    /// are off, are measured with it.
    fn move_poses(&mut self, cues: &[Vec<Cue>]) {
        let unknowns: Vec<usize> = (0..3 * self.fit.moving.len() + 3).collect();
        let mut doubt = 1.0;
        let mut steps = vec![];
        for _ in 0..ROUNDS {
            let Fit { poses, given, moving, priors, .. } = &self.fit;
            let estimate = |((cue, pose), given): ((&Vec<Cue>, &Pose), &&Pose)| {
                let mut sum = Cue { information: &cue[0].information / doubt, gradient: &cue[0].gradient / doubt };
                priors.add_given(pose, given, moving, &mut sum.information, &mut sum.gradient);
                let covariance = inverse(&sum.information);
                Estimate { pose: self.fit.moved(pose, &-(&covariance * &sum.gradient)), covariance }
            };
            let estimates: Vec<Estimate> = cues.par_iter().zip(poses).zip(given).map(estimate).collect();
            let Fit { given, moving, priors, .. } = &mut self.fit;
            priors.measure(&estimates, given, moving);
            let Fit { poses, given, moving, priors, .. } = &self.fit;
            let prior = |(pose, given): (&Pose, &&Pose)| {
                let mut prior = Cue::nothing(unknowns.len());
                priors.add_given(pose, given, moving, &mut prior.information, &mut prior.gradient);
                priors.spread.add(pose, &mut prior.information, &mut prior.gradient);
                prior
            };
            let of_priors: Vec<Cue> = poses.iter().zip(given).map(prior).collect();
            let agreed = agree(cues, &of_priors, &[1.0], &unknowns);
            doubt = agreed.factors[0];
            steps = agreed.steps;
        }
        let moved = self.fit.poses.iter().zip(&steps).map(|(pose, step)| self.fit.moved(pose, step));
        self.fit.poses = moved.collect();
    }

    /// By frame, how far what is held out is from the avatar in the poses before and now.
    fn judge(&self, before: &[Pose], draw: &mut Draw) -> Result<Option<Vec<Comparison>>, SynthesisError> {
        let mut judged = vec![];
        for (frame, roles) in self.roles.iter().enumerate() {
            let mut comparison = Comparison::default();
            for (place, index) in roles.judges().iter().enumerate() {
                let view = (self.problem.view)(*index)?;
                let Some(first) = draw(&view, &before[frame])? else { return Ok(None) };
                let Some(now) = draw(&view, &self.fit.poses[frame])? else { return Ok(None) };
                let counts = |pixel| roles.is_held_out(*index, pixel, self.problem.reduction);
                comparison.add(place, &view, [&first, &now], self.problem.reduction, counts);
            }
            judged.push(comparison);
        }
        Ok(Some(judged))
    }

    /// Root mean square rotation of the joints that move in some frames, since these poses, radians.
    fn turned(&self, before: &[Pose], frames: &[usize]) -> f64 {
        let mut sum = 0.0;
        for frame in frames {
            for joint in &self.fit.moving {
                let [a, b] =
                    [&before[*frame], &self.fit.poses[*frame]].map(|p| rotation_from_axis_angle(p.rotations[*joint]));
                sum += axis_angle_from_rotation(&(a.transpose() * b)).length_squared();
            }
        }
        (sum / (frames.len() * self.fit.moving.len()).max(1) as f64).sqrt()
    }
}

#[cfg(test)]
mod tests;
