//! Calibration: what the masks say of the cameras, which are never quite where their calibration puts them.
//!
//! Poses and cameras are unknown together, the cameras with priors of a real calibration's width. A part of the calibration
//! is refined if images without a say agree: each camera in turn is left out of half of the frames, and there the hand that
//! the others give must meet its mask better than without the refinement.

use ghand_core::{Camera, InvalidHandModel, Pose};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::unknowns::{CameraChange, CameraUnknowns, NUMBERS, Part, changed, per_camera};
use crate::alignment::frame::{FrameEquations, Rig};
use crate::alignment::outlines::distance_field::DistanceField;
use crate::alignment::proportions::Shaped;
use crate::alignment::{Fit, Images, joint_step, quantiles};

/// Standard deviations of what a calibration is wrong by.
#[derive(Debug, Clone, Copy)]
struct Deviations {
    /// Radians.
    rotation: f64,
    /// As a part of the distance to the hand.
    translation: f64,
    /// As a part of the length.
    focal_length: f64,
    /// As a part of the image's longer side.
    principal_point: f64,
    /// Frames.
    time: f64,
}

/// Of a real calibration.
const CALIBRATED: Deviations = Deviations {
    rotation: 0.5_f64.to_radians(),
    translation: 0.01,
    focal_length: 0.01,
    principal_point: 0.01,
    time: 1.0,
};
/// Of cameras that only the landmarks of the hand tell.
const BY_LANDMARKS: Deviations =
    Deviations { rotation: 3.0_f64.to_radians(), translation: 0.1, focal_length: 0.1, ..CALIBRATED };
/// Images of a frame that tell something of them.
const LEAST_ROUGH_CAMERAS: usize = 2;
/// The combinations that are tried, each after the one before.
const PARTS: [Part; 3] = [Part::Extrinsics, Part::PrincipalPoint, Part::FocalLength];
/// Frames with fewer images tell nothing: a camera is left out, and one alone agrees with any calibration.
const LEAST_CAMERAS: usize = 3;
/// Hands are not nearer, metres.
const LEAST_DISTANCE: f64 = 0.01;
/// Images that are fitted at a time, fewer frames of more cameras: of cameras with a calibration, and of those that only landmarks
/// tell.
const IMAGES: usize = 48;
const ROUGH_IMAGES: usize = 400;
/// Fewer frames tell nothing.
const LEAST_FRAMES: usize = 4;
/// Cameras that are left out in turn, at most.
const FOLDS: usize = 4;
/// Distances beyond which a contour counts linearly, pixels, one for each step.
const STEPS: [f64; 7] = [20.0, 12.0, 8.0, 5.0, 4.0, 3.0, 3.0];
/// The same from poses on that are aligned.
const FURTHER_STEPS: [f64; 4] = [5.0, 4.0, 3.0, 3.0];
/// A refinement lowers what images left out lack in overlap by this part at least, and by so many standard errors.
const LEAST_GAIN: f64 = 0.02;
const STANDARD_ERRORS: f64 = 2.0;
/// A camera is named if it is turned by this much, radians, and so many times as much as others.
const MOVED: f64 = 1.0_f64.to_radians();
const MOVED_MORE: f64 = 2.25;

/// The images of a frame: the camera's number, and the field of the mask.
pub(crate) type FrameViews<'a> = Vec<(usize, &'a DistanceField)>;

/// What was found of the cameras.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Calibration {
    /// Parts that are refined.
    pub parts: Vec<Part>,
    /// How the cameras differ from what was given, by the camera's number.
    pub changes: Vec<CameraChange>,
    /// The ids of cameras that are turned much more than the others.
    #[serde(default)]
    pub moved: Vec<String>,
    /// What the hand lacks in overlap with the masks of images left out, mean over these: as given, and refined.
    pub left_out: [f64; 2],
}

impl Calibration {
    /// What was refined, for people, without a full stop.
    pub fn summary(&self) -> String {
        let [before, after] = self.left_out.map(|lack| 1.0 - lack);
        format!(
            "the cameras' calibration is refined ({}): images left out overlap the hand by {after:.3}, {before:.3} as given",
            self.parts_text()
        )
    }

    /// The names of the parts that are refined, and of cameras that stand out.
    pub fn parts_text(&self) -> String {
        let parts = self.parts.iter().map(|part| part.name()).collect::<Vec<_>>().join(", ");
        if self.moved.is_empty() { parts } else { format!("{parts}, most of all of {}", self.moved.join(" and ")) }
    }

    /// The cameras as refined.
    pub fn applied_to(&self, given: &[Camera]) -> Vec<Camera> {
        given.iter().zip(&self.changes).map(|(camera, change)| changed(camera, change)).collect()
    }
}

/// Frames of a fit with some of their views.
struct Problem<'a> {
    fit: &'a Fit<'a>,
    shaped: &'a Shaped,
    cameras: &'a [Camera],
    /// Frames and their views.
    frames: Vec<(usize, FrameViews<'a>)>,
    /// Distance of the hand from each camera, metres.
    distances: Vec<f64>,
    deviations: Deviations,
}

/// Images that are left out: those of a camera in every second frame.
#[derive(Debug, Clone, Copy)]
struct Fold {
    camera: usize,
    /// 0 or 1: which frames these are.
    odd: usize,
}

impl Fold {
    /// Whether it leaves out a camera's image of the frame at a place among the chosen ones.
    fn leaves_out(self, place: usize, camera: usize) -> bool {
        camera == self.camera && place % 2 == self.odd
    }
}

/// Poses of a problem's frames, and changes of all cameras.
struct Solution {
    poses: Vec<Pose>,
    changes: Vec<CameraChange>,
}

impl Fit<'_> {
    /// Finds what the cameras' calibration is wrong by, from the given poses on. `None` if it stays as it is.
    pub(crate) fn calibrate(
        &self,
        cameras: &[Camera],
        views: &[FrameViews],
    ) -> Result<Option<Calibration>, InvalidHandModel> {
        let shaped = self.shaped()?.known();
        let Some(frames) = chosen_frames(views, LEAST_CAMERAS, IMAGES) else { return Ok(None) };
        let mut used: Vec<usize> = views.iter().flatten().map(|(camera, _)| *camera).collect();
        used.sort_unstable();
        used.dedup();
        let count = used.len().min(FOLDS);
        let folds: Vec<Fold> = (0..count).map(|k| Fold { camera: used[k * used.len() / count], odd: k % 2 }).collect();
        let problem = |left_out: Option<Fold>| Problem::new(self, &shaped, cameras, views, &frames, left_out);
        let given: Vec<Pose> = frames.iter().map(|frame| self.given[*frame].clone()).collect();
        let start = || Solution { poses: given.clone(), changes: vec![[0.0; NUMBERS]; cameras.len()] };
        // What each image that is left out lacks in overlap.
        let judged = |parts: &[Part]| -> Result<Vec<f64>, InvalidHandModel> {
            let mut lacks = vec![];
            for fold in &folds {
                let solution = problem(Some(*fold)).solve(parts, start(), &STEPS)?;
                let refined = changed(&cameras[fold.camera], &solution.changes[fold.camera]);
                let of_frame = |(place, pose): (usize, &Pose)| -> Result<Option<f64>, InvalidHandModel> {
                    let view = views[frames[place]].iter().find(|(camera, _)| fold.leaves_out(place, *camera));
                    let Some((_, field)) = view else { return Ok(None) };
                    let images: Images = vec![(&refined, *field)];
                    let (_, overlaps) = self.fit_of(&shaped, std::slice::from_ref(pose), &[images])?;
                    Ok(Some(1.0 - overlaps[0]))
                };
                let of_fold: Vec<Option<f64>> =
                    solution.poses.par_iter().enumerate().map(of_frame).collect::<Result<_, _>>()?;
                lacks.extend(of_fold.into_iter().flatten());
            }
            Ok(lacks)
        };
        let as_given = judged(&[])?;
        let (mut parts, mut best): (Vec<Part>, Vec<f64>) = (vec![], as_given.clone());
        for part in PARTS {
            let tried: Vec<Part> = parts.iter().copied().chain([part]).collect();
            let lacks = judged(&tried)?;
            let gains: Vec<f64> = best.iter().zip(&lacks).map(|(before, after)| before - after).collect();
            let gain = mean(&gains);
            let error = (mean(&gains.iter().map(|g| (g - gain).powi(2)).collect::<Vec<f64>>())
                / gains.len().max(1) as f64)
                .sqrt();
            log::debug!("calibration {tried:?}: lack {:.4} -> {:.4} +- {error:.4}", mean(&best), mean(&lacks));
            if gain > STANDARD_ERRORS * error && gain > LEAST_GAIN * mean(&best) {
                (parts, best) = (tried, lacks);
            }
        }
        if parts.is_empty() {
            return Ok(None);
        }
        let Solution { changes, .. } = problem(None).solve(&parts, start(), &STEPS)?;
        let moved = moved(cameras, &changes, &used);
        Ok(Some(Calibration { parts, changes, moved, left_out: [mean(&as_given), mean(&best)] }))
    }

    /// Refines the calibration once more from the present poses and shape on. `given` are the cameras as they came.
    pub(crate) fn calibrate_further(
        &self,
        given: &[Camera],
        views: &[FrameViews],
        calibration: &mut Calibration,
    ) -> Result<(), InvalidHandModel> {
        let shaped = self.shaped()?.known();
        let Some(frames) = chosen_frames(views, LEAST_CAMERAS, IMAGES) else { return Ok(()) };
        let poses = frames.iter().map(|frame| self.poses[*frame].clone()).collect();
        let start = Solution { poses, changes: calibration.changes.clone() };
        let problem = Problem::new(self, &shaped, given, views, &frames, None);
        calibration.changes = problem.solve(&calibration.parts, start, &FURTHER_STEPS)?.changes;
        Ok(())
    }

    /// Refines parts of the calibration of cameras that only landmarks tell, from the present poses and shape on, and
    /// from `changes` of the cameras as `given`.
    pub(crate) fn calibrate_roughly(
        &self,
        parts: &[Part],
        given: &[Camera],
        views: &[FrameViews],
        changes: Vec<CameraChange>,
    ) -> Result<Vec<CameraChange>, InvalidHandModel> {
        let shaped = self.shaped()?.known();
        let Some(frames) = chosen_frames(views, LEAST_ROUGH_CAMERAS, ROUGH_IMAGES) else { return Ok(changes) };
        let poses = frames.iter().map(|frame| self.poses[*frame].clone()).collect();
        let problem = Problem { deviations: BY_LANDMARKS, ..Problem::new(self, &shaped, given, views, &frames, None) };
        Ok(problem.solve(parts, Solution { poses, changes }, &FURTHER_STEPS)?.changes)
    }
}

/// The ids of the cameras that are turned much more than the others, if most are where they were.
fn moved(cameras: &[Camera], changes: &[CameraChange], used: &[usize]) -> Vec<String> {
    let turn = |camera: usize| changes[camera][..3].iter().map(|angle| angle * angle).sum::<f64>().sqrt();
    let is_far = |camera: &usize| {
        let others = used.iter().filter(|other| *other != camera).map(|other| turn(*other));
        turn(*camera) > MOVED.max(MOVED_MORE * quantiles(others.collect())[0])
    };
    let far = used.iter().copied().filter(is_far);
    far.map(|camera| cameras[camera].id.clone()).collect()
}

/// The frames from which cameras are calibrated, with `images` at most in all, evenly over those that have `least` or more.
fn chosen_frames(views: &[FrameViews], least: usize, images: usize) -> Option<Vec<usize>> {
    let shown: Vec<usize> = (0..views.len()).filter(|frame| views[*frame].len() >= least).collect();
    let per_frame = shown.iter().map(|frame| views[*frame].len()).max()?;
    let count = (images / per_frame).max(LEAST_FRAMES).min(shown.len());
    (count >= LEAST_FRAMES).then(|| (0..count).map(|k| shown[(2 * k + 1) * shown.len() / (2 * count)]).collect())
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

impl<'a> Problem<'a> {
    /// Of some frames of a fit, without what a fold leaves out.
    fn new(
        fit: &'a Fit<'a>,
        shaped: &'a Shaped,
        cameras: &'a [Camera],
        views: &[FrameViews<'a>],
        frames: &[usize],
        left_out: Option<Fold>,
    ) -> Problem<'a> {
        let distance = |camera: &Camera| {
            let depths: Vec<f64> =
                frames.iter().map(|frame| camera.project(fit.given[*frame].translation).1.abs()).collect();
            mean(&depths).max(LEAST_DISTANCE)
        };
        let of_frame = |(place, frame): (usize, &usize)| {
            let is_kept = |camera: usize| left_out.is_none_or(|fold| !fold.leaves_out(place, camera));
            (*frame, views[*frame].iter().filter(|(camera, _)| is_kept(*camera)).copied().collect::<FrameViews>())
        };
        let distances = cameras.iter().map(distance).collect();
        let frames = frames.iter().enumerate().map(of_frame).collect();
        Problem { fit, shaped, cameras, frames, distances, deviations: CALIBRATED }
    }

    /// Fits poses, and these parts of the calibration of all cameras.
    fn solve(&self, parts: &[Part], start: Solution, steps: &[f64]) -> Result<Solution, InvalidHandModel> {
        let Fit { edges, moving, carries, .. } = self.fit;
        let ids: Vec<&str> = self.cameras.iter().map(|camera| camera.id.as_str()).collect();
        let unknowns = CameraUnknowns { cameras: &ids, parts, velocities: &[], times: &[] };
        let places: Vec<usize> = per_camera(parts).collect();
        let deviations: Vec<f64> = (0..ids.len())
            .flat_map(|camera| places.iter().map(move |place| (camera, *place)))
            .map(|(c, p)| self.deviation(c, p))
            .collect();
        let mut poses = start.poses;
        let mut values: Vec<f64> =
            start.changes.iter().flat_map(|change| places.iter().map(|place| change[*place])).collect();
        for huber in steps {
            let cameras: Vec<Camera> = self
                .cameras
                .iter()
                .zip(changes(&values, &places, ids.len()))
                .map(|(c, change)| changed(c, &change))
                .collect();
            let rig = Rig { shaped: self.shaped, edges, moving, carries, huber: *huber };
            let of_frame = |((frame, views), pose): (&(usize, FrameViews), &Pose)| {
                let images: Images = views.iter().map(|(camera, field)| (&cameras[*camera], *field)).collect();
                let mut equations = rig.equations_with(pose, &images, Some(&unknowns))?;
                let FrameEquations { pose_pose, d_pose, .. } = &mut equations;
                self.fit.priors.add_given(pose, self.fit.given[*frame], moving, pose_pose, d_pose);
                Ok(equations)
            };
            let equations: Vec<FrameEquations> =
                self.frames.par_iter().zip(&poses).map(of_frame).collect::<Result<_, InvalidHandModel>>()?;
            let step = joint_step(&equations, &values, &deviations);
            for (pose, step) in poses.iter_mut().zip(&step.poses) {
                *pose = self.fit.moved(pose, step);
            }
            values.iter_mut().zip(step.shared.iter()).for_each(|(value, step)| *value += step);
        }
        Ok(Solution { poses, changes: changes(&values, &places, ids.len()) })
    }

    /// Standard deviation of a number of a camera before any image is seen.
    fn deviation(&self, camera: usize, place: usize) -> f64 {
        let Camera { width, height, .. } = &self.cameras[camera];
        let deviations = &self.deviations;
        match place {
            0..3 => deviations.rotation,
            3..6 => deviations.translation * self.distances[camera],
            6 => deviations.focal_length,
            7..9 => deviations.principal_point * f64::from(*width.max(height)),
            _ => deviations.time,
        }
    }
}

/// Changes of all cameras from values of what is unknown.
fn changes(values: &[f64], places: &[usize], cameras: usize) -> Vec<CameraChange> {
    let of_camera = |camera: usize| {
        let mut change = [0.0; NUMBERS];
        for (k, place) in places.iter().enumerate() {
            change[*place] = values[camera * places.len() + k];
        }
        change
    };
    (0..cameras).map(of_camera).collect()
}
