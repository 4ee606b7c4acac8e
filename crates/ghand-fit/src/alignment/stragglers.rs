//! Frames whose fit has gone astray: they are fitted again from the poses to which other frames' experience leads.
//!
//! A tracker errs alike in poses that are alike. What the fit of a good frame found its given pose to be off by is applied
//! to the given pose of a frame that fits poorly, and the fit begins there once more; the best of several is taken.

use ghand_core::rotation::{axis_angle_from_rotation, rotation_from_axis_angle};
use ghand_core::{InvalidHandModel, Pose};
use rayon::prelude::*;

use super::{Fit, Images, STEPS, quantiles};

/// A frame is astray if its template overlaps the masks by so much less than the median frame's does, relative to what the
/// median lacks: where 0.92 is usual, below 0.86.
const ASTRAY: f64 = 1.75;
/// Good frames whose experience is tried, those with the given poses most alike.
const NEIGHBOURS: usize = 4;
/// A new fit is taken if it overlaps the masks by this much more.
const LEAST_GAIN: f64 = 0.01;

impl Fit<'_> {
    /// Fits the frames that are astray again. Returns how many found a better pose.
    pub(super) fn recover_stragglers(&mut self, images: &[Images]) -> Result<usize, InvalidHandModel> {
        let shaped = self.shaped()?.known();
        let (_, overlaps) = self.fit_of(&shaped, &self.poses, images)?;
        let shown: Vec<usize> = (0..images.len()).filter(|k| !images[*k].is_empty()).collect();
        let median = quantiles(shown.iter().map(|k| overlaps[*k]).collect())[0];
        let is_astray = |k: &usize| 1.0 - overlaps[*k] > ASTRAY * (1.0 - median);
        let (astray, good): (Vec<usize>, Vec<usize>) = shown.iter().partition(|k| is_astray(k));
        let best = |frame: &usize| -> Result<Option<(usize, Pose)>, InvalidHandModel> {
            let mut alike: Vec<(f64, usize)> =
                good.iter().map(|other| (self.difference(self.given[*frame], self.given[*other]), *other)).collect();
            alike.sort_by(|a, b| a.0.total_cmp(&b.0));
            let mut starts = vec![self.given[*frame].clone()];
            for (_, other) in alike.iter().take(NEIGHBOURS) {
                starts.push(self.with_experience_of(*frame, *other));
                starts.push(self.with_fingers_of(*frame, *other));
            }
            let mut best: Option<(f64, Pose)> = None;
            for start in starts {
                let pose = self.fitted_alone(&shaped, start, self.given[*frame], &images[*frame], &STEPS, true)?;
                let (_, overlap) = self.fit_of(&shaped, std::slice::from_ref(&pose), &images[*frame..=*frame])?;
                if overlap[0] > best.as_ref().map_or(overlaps[*frame] + LEAST_GAIN, |(found, _)| *found) {
                    best = Some((overlap[0], pose));
                }
            }
            Ok(best.map(|(_, pose)| (*frame, pose)))
        };
        let found: Vec<Option<(usize, Pose)>> = astray.par_iter().map(best).collect::<Result<_, _>>()?;
        let count = found.iter().flatten().count();
        for (frame, pose) in found.into_iter().flatten() {
            self.poses[frame] = pose;
        }
        Ok(count)
    }

    /// Sum of the angles between the rotations of two poses, radians.
    fn difference(&self, a: &Pose, b: &Pose) -> f64 {
        let angle = |joint: &usize| {
            let [a, b] = [a, b].map(|pose| rotation_from_axis_angle(pose.rotations[*joint]));
            axis_angle_from_rotation(&(a * b.transpose())).length()
        };
        self.moving.iter().map(angle).sum()
    }

    /// The given pose of a frame, corrected as the fit corrected that of another one.
    fn with_experience_of(&self, frame: usize, other: usize) -> Pose {
        let mut pose = self.given[frame].clone();
        for joint in &self.moving {
            let rotation = |pose: &Pose| rotation_from_axis_angle(pose.rotations[*joint]);
            let correction = rotation(&self.poses[other]) * rotation(self.given[other]).transpose();
            pose.rotations[*joint] = axis_angle_from_rotation(&(correction * rotation(&pose)));
        }
        pose.translation += self.poses[other].translation - self.given[other].translation;
        pose
    }

    /// The same for the whole hand, with the other frame's fingers.
    fn with_fingers_of(&self, frame: usize, other: usize) -> Pose {
        let corrected = self.with_experience_of(frame, other);
        let mut pose = self.poses[other].clone();
        pose.rotations[0] = corrected.rotations[0];
        pose.translation = corrected.translation;
        pose
    }
}
