//! Cameras that do not take their images at the same moment: how much later than the others each one is.
//!
//! Where the hand moves, an image that was taken later shows it farther along its way. The hand's velocity follows from the
//! poses of neighbouring frames; the offsets are unknown together with all poses, which else would take them in. Nothing is
//! corrected: a pose belongs to a moment.

use ghand_capture::{Capture, Split};
use ghand_core::{Camera, InvalidHandModel, Pose};
use glam::DVec3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::unknowns::{CameraUnknowns, Part};
use crate::alignment::frame::{FrameEquations, Rig};
use crate::alignment::proportions::Shaped;
use crate::alignment::{Fit, Images, STEPS, joint_step, quantiles};

/// Standard deviation of an offset before any image is seen, frames.
const DEVIATION: f64 = 1.0;
/// Neighbouring frames are at most so many numbers apart.
const FARTHEST: i64 = 2;
/// Fewer frames with a velocity tell nothing.
const LEAST_FRAMES: usize = 8;
/// Images that are fitted: those of the frames in which the hand moves fastest.
const IMAGES: usize = 96;
/// An offset is told if both halves of the frames find one that is larger than this, frames, and than half of the whole's.
const LEAST: f64 = 0.15;

/// How much later than the others a camera takes its images.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TimeOffset {
    /// The camera's id.
    pub camera: String,
    /// Later than the median of the cameras, of two than the other one; frames by the numbers that frames are called.
    pub frames: f64,
}

impl std::fmt::Display for TimeOffset {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let how = if self.frames > 0.0 { "later" } else { "earlier" };
        let camera = &self.camera;
        let frames = self.frames.abs();
        write!(
            f,
            "the images of {camera} seem to be taken {frames:.1} frames {how} than the others'; synchronise the cameras, or \
             shift its images by whole frames"
        )
    }
}

impl Fit<'_> {
    /// The offsets of the cameras of a split's frames; empty if frames have no numbers, hardly move, or agree.
    pub(crate) fn time_offsets(
        &self,
        capture: &Capture,
        split: &Split,
        images: &[Images],
    ) -> Result<Vec<TimeOffset>, InvalidHandModel> {
        let shaped = self.shaped()?.known();
        let mut ids: Vec<&str> = images.iter().flatten().map(|(camera, _): &(&Camera, _)| camera.id.as_str()).collect();
        ids.sort_unstable();
        ids.dedup();
        let vertices: Vec<Vec<DVec3>> = (self.poses.par_iter())
            .map(|pose| Ok(shaped.pose(pose)?.vertices))
            .collect::<Result<_, InvalidHandModel>>()?;
        let names: Vec<Option<(&str, i64)>> =
            split.frames.iter().map(|frame| numbered(&capture.frames[*frame].id)).collect();
        let mut moving: Vec<(usize, Vec<DVec3>)> = (0..images.len())
            .filter(|frame| images[*frame].len() >= 2)
            .filter_map(|frame| {
                let (before, after, time) = neighbours(&names, frame)?;
                let pairs = vertices[before].iter().zip(&vertices[after]);
                Some((frame, pairs.map(|(a, b)| (*b - *a) / time).collect()))
            })
            .collect();
        if ids.len() < 2 || moving.len() < LEAST_FRAMES {
            return Ok(vec![]);
        }
        let speed = |velocities: &[DVec3]| velocities.iter().map(|v| v.length()).sum::<f64>();
        moving.sort_by(|a, b| speed(&b.1).total_cmp(&speed(&a.1)));
        moving.truncate((IMAGES / ids.len()).max(LEAST_FRAMES));
        let of = |frames: &[&(usize, Vec<DVec3>)]| self.offsets_of(&shaped, &ids, frames, images);
        let half = |odd: usize| moving.iter().skip(odd).step_by(2).collect::<Vec<_>>();
        let halves = [of(&half(0))?, of(&half(1))?];
        let all: Vec<f64> = halves[0].iter().zip(&halves[1]).map(|(a, b)| 0.5 * (a + b)).collect();
        let is_sure = |k: &usize| {
            let least = LEAST.max(0.5 * all[*k].abs());
            halves.iter().all(|half| half[*k] * all[*k].signum() > least)
        };
        let offset = |k: usize| TimeOffset { camera: ids[k].into(), frames: all[k] };
        // Of two cameras, which are as far from each other, the later one is told.
        let told = |k: &usize| is_sure(k) && (ids.len() > 2 || all[*k] > 0.0);
        Ok((0..ids.len()).filter(told).map(offset).collect())
    }

    /// How much later than the median, or than the other one of two, each camera takes its images. Frames come with their velocities.
    fn offsets_of(
        &self,
        shaped: &Shaped,
        cameras: &[&str],
        frames: &[&(usize, Vec<DVec3>)],
        images: &[Images],
    ) -> Result<Vec<f64>, InvalidHandModel> {
        let Fit { edges, moving, carries, .. } = self;
        let mut poses: Vec<Pose> = frames.iter().map(|(frame, _): &&(usize, _)| self.poses[*frame].clone()).collect();
        let mut times = vec![0.0; cameras.len()];
        for huber in STEPS {
            let rig = Rig { shaped, edges, moving, carries, huber };
            let of_frame = |((frame, velocities), pose): (&&(usize, Vec<DVec3>), &Pose)| {
                let unknowns = CameraUnknowns { cameras, parts: &[Part::Time], velocities, times: &times };
                let mut equations = rig.equations_with(pose, &images[*frame], Some(&unknowns))?;
                let FrameEquations { pose_pose, d_pose, .. } = &mut equations;
                self.priors.add_given(pose, self.given[*frame], moving, pose_pose, d_pose);
                Ok(equations)
            };
            let equations: Vec<FrameEquations> =
                frames.par_iter().zip(&poses).map(of_frame).collect::<Result<_, InvalidHandModel>>()?;
            let step = joint_step(&equations, &times, &vec![DEVIATION; cameras.len()]);
            for (pose, step) in poses.iter_mut().zip(&step.poses) {
                *pose = self.moved(pose, step);
            }
            times.iter_mut().zip(step.shared.iter()).for_each(|(time, step)| *time += step);
        }
        // Of two cameras neither is the usual one.
        let usual = |k: usize| if times.len() == 2 { times[1 - k] } else { quantiles(times.clone())[0] };
        Ok((0..times.len()).map(|k| times[k] - usual(k)).collect())
    }
}

/// The sequence and the number of a frame, if its name ends with one.
fn numbered(id: &str) -> Option<(&str, i64)> {
    let digits = id.bytes().rev().take_while(u8::is_ascii_digit).count();
    let (name, number) = id.split_at(id.len() - digits);
    Some((name, number.parse().ok()?))
}

/// The frames before and after one, as places among `names`, and the time between them, frames.
fn neighbours(names: &[Option<(&str, i64)>], frame: usize) -> Option<(usize, usize, f64)> {
    let (name, number) = names[frame]?;
    let apart = |other: usize| names[other].filter(|(other, _)| *other == name).map(|(_, other)| other - number);
    let nearest = |sign: i64| {
        let near = (0..names.len()).filter_map(|other| Some((sign * apart(other)?, other)));
        near.filter(|(apart, _)| (1..=FARTHEST).contains(apart)).min()
    };
    let (before, after) = (nearest(-1), nearest(1));
    let (first, last) = (before.unwrap_or((0, frame)), after.unwrap_or((0, frame)));
    let time = first.0 + last.0;
    (time > 0).then_some((first.1, last.1, time as f64))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn neighbours_are_near_frames_of_the_same_sequence() {
        let names: Vec<Option<(&str, i64)>> = ["0001", "0002", "0004", "0009", "b/0003", "last"].map(numbered).to_vec();
        assert_eq!(names[4], Some(("b/", 3)));
        assert_eq!(neighbours(&names, 1), Some((0, 2, 3.0)));
        assert_eq!(neighbours(&names, 0), Some((0, 1, 1.0)), "one side is enough");
        assert_eq!(neighbours(&names, 3), None, "five frames apart");
        assert_eq!(neighbours(&names, 4), None, "another sequence");
        assert_eq!(neighbours(&names, 5), None, "no number");
    }
}
