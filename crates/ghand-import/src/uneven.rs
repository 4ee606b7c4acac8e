//! Clocks that run faster or slower than the first camera's, and footage that lost frames: part by part of the footage,
//! reprojection tells by how much its frames come too early or too late.

use ghand_capture::cameras::list::LensCamera;
use ghand_core::Camera;
use ghand_core::statistics::median;
use ghand_motion::image_landmarks::UsualFocal;

use crate::moments::moments;
use crate::rig::bundle::refine;
use crate::rig::lengths::BONES;
use crate::rig::{Moment, Unknowns};
use crate::solve::{Known, Solved, solve};
use crate::track::Track;

/// Length of the parts, seconds.
const PART: f64 = 2.5;
/// A part in which a camera and another one see the hand at fewer moments tells nothing.
const LEAST_MOMENTS: usize = 20;
/// Fewer parts tell nothing of how a clock runs.
const LEAST_PARTS: usize = 3;
/// Errors of less than this, root mean square over the parts, are not corrected, frames.
const LEAST_FRAMES: f64 = 0.25;
/// Frames of which it is told how uneven they are.
const TOLD: usize = 200;
/// Mean squared difference of neighbouring parts relative to twice the variance of all: 1 if they only scatter.
const MOST_SCATTER: f64 = 0.5;
/// Rounds of finding cameras and clocks again, and in each of them of correcting times: late frames spoil both.
const ROUNDS: usize = 2;
const CORRECTIONS: usize = 4;

/// What was wrong with the times of a camera's frames.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct UnevenClock {
    /// The camera's number.
    pub camera: usize,
    /// By how much its clock is fast, seconds a second.
    pub fast: f64,
    /// By how much its frames come too late at most, beyond that, seconds; 0 if by less than a frame.
    pub uneven: f64,
}

/// By how much the frames of a part come too late.
#[derive(Debug, Clone, Copy)]
struct Lateness {
    time: f64,
    seconds: f64,
}

/// As [`solve`], with the times of frames corrected where they are sure to be wrong; and which cameras' were. None are if
/// `clocks` are given.
///
/// # Errors
/// As there.
pub fn solve_with_times(
    tracks: &mut [Track],
    lenses: &[LensCamera],
    known: Known,
    focals: &[UsualFocal],
    lengths: &[f64; BONES.len()],
    clocks: Option<&[f64]>,
) -> Result<(Solved, Vec<UnevenClock>), usize> {
    let given: Vec<Vec<f64>> = tracks.iter().map(|track| track.times.clone()).collect();
    let mut solved = solve(tracks, lenses, known, focals, lengths, clocks)?;
    if clocks.is_some() {
        return Ok((solved, vec![]));
    }
    for _ in 0..ROUNDS {
        let mut corrections = 0;
        while corrections < CORRECTIONS && correct_times(tracks, lenses, &solved, lengths) {
            corrections += 1;
        }
        if corrections == 0 {
            break;
        }
        solved = solve(tracks, lenses, known, focals, lengths, None)?;
    }
    let changed = |(camera, given): (usize, &Vec<f64>)| {
        let late = |(time, given): (&f64, &f64)| Lateness { time: *time, seconds: given - time };
        let every = given.len().div_ceil(TOLD).max(1);
        let late: Vec<Lateness> = tracks[camera].times.iter().zip(given).step_by(every).map(late).collect();
        let line = Correction::of_line(late.clone());
        let rest = line.largest_rest();
        let frame = 1.0 / tracks[camera].rate();
        let is_changed = late.iter().any(|late| late.seconds != 0.0);
        is_changed.then_some(UnevenClock { camera, fast: line.slope, uneven: if rest > frame { rest } else { 0.0 } })
    };
    let uneven = given.iter().enumerate().skip(1).filter_map(changed).collect();
    Ok((solved, uneven))
}

/// Corrects the times of all frames but the first camera's, where they are sure to be wrong; returns whether any was.
fn correct_times(tracks: &mut [Track], lenses: &[LensCamera], solved: &Solved, lengths: &[f64; BONES.len()]) -> bool {
    let late = lateness(tracks, lenses, solved, lengths);
    let mut is_changed = false;
    for (camera, late) in late.iter().enumerate().skip(1) {
        let offset = solved.rig.offsets[camera];
        let frame = 1.0 / tracks[camera].rate();
        let Some(correction) = Correction::of(late, LEAST_FRAMES * frame) else { continue };
        is_changed = true;
        for time in &mut tracks[camera].times {
            *time -= correction.at(*time - offset);
        }
    }
    is_changed
}

/// Of each camera, by how much the frames of each part come too late.
fn lateness(
    tracks: &[Track],
    lenses: &[LensCamera],
    solved: &Solved,
    lengths: &[f64; BONES.len()],
) -> Vec<Vec<Lateness>> {
    let times = &tracks[0].times;
    let mut late = vec![vec![]; tracks.len()];
    let [Some(start), Some(end)] = [times.first(), times.last()] else { return late };
    let all = moments(tracks, lenses, &solved.rig.offsets, times);
    let focal = |camera: &Camera| UsualFocal { pixels: camera.focal.x, deviation: UsualFocal::UNSTATED };
    let focals: Vec<UsualFocal> = solved.rig.cameras.iter().map(focal).collect();
    let parts = ((end - start) / PART) as usize;
    for part in 0..parts {
        let from = start + PART * part as f64;
        let is_inside = |time: &f64| *time >= from && *time < from + PART;
        let common: Vec<Moment> = (times.iter().zip(&all))
            .filter(|(time, moment)| is_inside(time) && moment.iter().flatten().count() >= 2)
            .map(|(_, moment)| moment.clone())
            .collect();
        if common.len() < LEAST_MOMENTS {
            continue;
        }
        let unknowns = Unknowns { places: false, focals: false, clocks: true, size: false };
        let (found, _) = refine(&solved.rig, &common, lengths, unknowns, &focals);
        for (camera, late) in late.iter_mut().enumerate().skip(1) {
            if common.iter().filter(|moment| moment[camera].is_some()).count() >= LEAST_MOMENTS {
                let seconds = found.offsets[camera] - solved.rig.offsets[camera];
                late.push(Lateness { time: from + 0.5 * PART, seconds });
            }
        }
    }
    late
}

/// How times are corrected: by a line, and by what is left of the parts' lateness beside it.
struct Correction {
    /// Seconds a second, and seconds at time 0.
    slope: f64,
    base: f64,
    /// What is left at the parts' times.
    rest: Vec<Lateness>,
}

impl Correction {
    /// `None` if all is less than `least`, or scatter.
    fn of(late: &[Lateness], least: f64) -> Option<Correction> {
        if late.len() < LEAST_PARTS {
            return None;
        }
        let mean_square = |values: &mut dyn Iterator<Item = f64>| {
            let (sum, count) = values.fold((0.0, 0.0), |(sum, count), value| (sum + value * value, count + 1.0));
            sum / count
        };
        let mean = late.iter().map(|late| late.seconds).sum::<f64>() / late.len() as f64;
        let variance = mean_square(&mut late.iter().map(|late| late.seconds - mean));
        let steps = mean_square(&mut late.windows(2).map(|pair| pair[1].seconds - pair[0].seconds));
        if variance.sqrt() < least || steps > MOST_SCATTER * 2.0 * variance {
            return None;
        }
        Some(Self::of_line(late.to_vec()))
    }

    /// The line through most of them, and what it leaves.
    fn of_line(late: Vec<Lateness>) -> Correction {
        let mut slopes = vec![];
        for (k, a) in late.iter().enumerate() {
            slopes.extend(late[k + 1..].iter().map(|b| (b.seconds - a.seconds) / (b.time - a.time)));
        }
        let slope = median(slopes);
        let base = median(late.iter().map(|late| late.seconds - slope * late.time));
        let rest = late.iter().map(|l| Lateness { seconds: l.seconds - base - slope * l.time, ..*l }).collect();
        Correction { slope, base, rest }
    }

    /// By how much a frame comes too late, seconds.
    fn at(&self, time: f64) -> f64 {
        let after = self.rest.partition_point(|late| late.time < time);
        let rest = match (after.checked_sub(1).and_then(|k| self.rest.get(k)), self.rest.get(after)) {
            (Some(a), Some(b)) => a.seconds + (time - a.time) / (b.time - a.time) * (b.seconds - a.seconds),
            (Some(one), None) | (None, Some(one)) => one.seconds,
            (None, None) => 0.0,
        };
        self.base + self.slope * time + rest
    }

    fn largest_rest(&self) -> f64 {
        self.rest.iter().map(|late| late.seconds.abs()).fold(0.0, f64::max)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn late(of: impl Fn(f64) -> f64) -> Vec<Lateness> {
        (0..10).map(|k| f64::from(k) * PART).map(|time| Lateness { time, seconds: of(time) }).collect()
    }

    #[test]
    fn scatter_is_left_and_drift_and_lost_frames_are_corrected() {
        let scatter = |time: f64| 0.003 * (7.0 * time).sin();
        assert!(Correction::of(&late(scatter), 0.008).is_none());
        assert!(Correction::of(&late(|time| 10.0 * scatter(time)), 0.008).is_none(), "nothing but scatter");
        let steep = |time: f64| 0.002 * time - 0.02 + scatter(time);
        assert!(Correction::of(&late(steep)[..2], 0.008).is_none(), "too few parts");
        let drift = Correction::of(&late(steep), 0.008).unwrap();
        assert!((drift.slope - 0.002).abs() < 3e-4 && drift.largest_rest() < 0.008, "{}", drift.slope);
        assert!((drift.at(10.0) - 0.0).abs() < 0.005, "{}", drift.at(10.0));
        // Four frames are lost in the middle.
        let lost = |time: f64| if time > 12.0 { 0.067 } else { -0.067 };
        let correction = Correction::of(&late(|time| lost(time) + scatter(time)), 0.008).unwrap();
        assert!([2.0, 9.0, 15.0, 22.0].iter().all(|time| (correction.at(*time) - lost(*time)).abs() < 0.01));
    }
}
