//! By how much the clocks of two cameras differ, from how the hand moves: fingers bend and the hand turns alike for all
//! cameras, wherever these are. Good to a frame or so; the bundle adjustment then finds the rest.

use std::f64::consts::PI;

use glam::DVec3;

use crate::rig::LANDMARKS;
use crate::rig::start::rotation_between;
use crate::track::Track;

/// Joints whose angle is compared: three of each finger.
const JOINTS: usize = 15;
/// Numbers of a signal: the joints' angles, and how fast the hand turns.
const NUMBERS: usize = JOINTS + 1;
/// Samples of a signal per second.
const RATE: f64 = 60.0;
/// Frames further apart are a gap, seconds.
const GAP: f64 = 0.15;
/// Clocks are compared over at least this time, seconds, and this part of the shorter footage.
const LEAST_OVERLAP: f64 = 1.5;
const LEAST_PART: f64 = 0.3;
/// Clocks differ by at most this, seconds.
const MOST_OFFSET: f64 = 60.0;
/// Samples that are compared at most: of long footage not all.
const MOST_SAMPLES: usize = 4000;
/// A movement that agrees by less than this (correlation) does not tell the time.
const LEAST_AGREEMENT: f64 = 0.3;
/// Gestures that are repeated agree at several differences: those that agree by this part of the best one's agreement, and
/// are this far apart, seconds; so many at most.
const NEARLY_AS_GOOD: f64 = 0.6;
const APART: f64 = 0.4;
const MOST_OFFSETS: usize = 8;

/// A difference of clocks.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ClockOffset {
    /// What to add to the first camera's time to have the other one's, seconds.
    pub seconds: f64,
    /// How well the movements agree: a correlation, 1 at best.
    pub agreement: f64,
}

/// How a hand moves, in equal steps of time.
struct Signal {
    start: f64,
    samples: Vec<Option<[f64; NUMBERS]>>,
}

/// What the clock of `other` may be relative to that of `first`, the best agreement first: several where gestures are
/// repeated, none if the hand moves too little or too differently to tell.
pub fn offsets(first: &Track, other: &Track) -> Vec<ClockOffset> {
    let (Some(a), Some(b)) = (Signal::of(first), Signal::of(other)) else { return vec![] };
    let least =
        ((LEAST_OVERLAP * RATE) as usize).max((LEAST_PART * a.samples.len().min(b.samples.len()) as f64) as usize);
    // Sample i of the first is sample i + lag of the other.
    let most = (MOST_OFFSET * RATE) as i64;
    let same_time = ((a.start - b.start) * RATE) as i64;
    let lags = same_time - most..=same_time + most;
    let stride = a.samples.len().div_ceil(MOST_SAMPLES);
    let all: Vec<(i64, f64)> =
        lags.filter_map(|lag| Some((lag, agreement(&a, &b, lag, stride, least / stride)?))).collect();
    let mut order: Vec<usize> = (0..all.len()).filter(|k| all[*k].1 >= LEAST_AGREEMENT).collect();
    order.sort_by(|x, y| all[*y].1.total_cmp(&all[*x].1));
    let mut found: Vec<ClockOffset> = vec![];
    for k in order {
        let (lag, agreement) = all[k];
        let near = |by: i64| all.iter().find(|(other, _)| *other == lag + by).map_or(agreement, |(_, value)| *value);
        let is_peak = near(-1) <= agreement && near(1) <= agreement;
        let of_lag = |part: f64| b.start - a.start + (lag as f64 + part) / RATE;
        let is_far = found.iter().all(|other| (other.seconds - of_lag(0.0)).abs() >= APART);
        if !is_peak || !is_far || found.first().is_some_and(|best| agreement < NEARLY_AS_GOOD * best.agreement) {
            continue;
        }
        let curvature = near(-1) - 2.0 * agreement + near(1);
        let part = if curvature < 0.0 { (0.5 * (near(-1) - near(1)) / curvature).clamp(-0.5, 0.5) } else { 0.0 };
        found.push(ClockOffset { seconds: of_lag(part), agreement });
        if found.len() == MOST_OFFSETS {
            break;
        }
    }
    found
}

impl Signal {
    fn of(track: &Track) -> Option<Signal> {
        let seen: Vec<(f64, [f64; JOINTS], &[DVec3; LANDMARKS])> = (track.times.iter().zip(&track.sightings))
            .filter_map(|(time, sighting)| sighting.as_ref().map(|s| (*time, angles(&s.world), &s.world)))
            .collect();
        let (start, end) = (seen.first()?.0, seen.last()?.0);
        let mut samples = vec![None; ((end - start) * RATE) as usize + 1];
        for pair in seen.windows(2) {
            let [(before, from, points), (after, to, next)] = [pair[0], pair[1]];
            let step = after - before;
            if step <= 0.0 || step > GAP {
                continue;
            }
            let turn = rotation_between(points, next);
            let cosine = 0.5 * (turn.x_axis.x + turn.y_axis.y + turn.z_axis.z - 1.0);
            let speed = cosine.clamp(-1.0, 1.0).acos() / step;
            let first = ((before - start) * RATE).ceil() as usize;
            for k in first..=((after - start) * RATE).floor() as usize {
                let part = (k as f64 / RATE + start - before) / step;
                let mut sample = [0.0; NUMBERS];
                for (value, (from, to)) in sample.iter_mut().zip(from.iter().zip(to)) {
                    *value = from + part * (to - from);
                }
                // As large as the angles that fingers bend by.
                sample[NUMBERS - 1] = 0.3 * speed.min(PI);
                if let Some(place) = samples.get_mut(k) {
                    *place = Some(sample);
                }
            }
        }
        Some(Signal { start, samples })
    }
}

/// Angles of the joints, radians.
fn angles(points: &[DVec3; LANDMARKS]) -> [f64; JOINTS] {
    std::array::from_fn(|k| {
        let at = 1 + 4 * (k / 3) + k % 3;
        // The first joint of each finger is next to the wrist.
        let before = if k % 3 == 0 { 0 } else { at - 1 };
        let [a, b] = [points[at] - points[before], points[at + 1] - points[at]];
        let angle = a.angle_between(b);
        if angle.is_finite() { angle } else { 0.0 }
    })
}

/// The correlation of two signals if sample i of the first is sample i + lag of the other, over all numbers by their
/// variance, at every `stride`-th sample; `None` if fewer than `least` of these overlap.
fn agreement(a: &Signal, b: &Signal, lag: i64, stride: usize, least: usize) -> Option<f64> {
    let pairs: Vec<(&[f64; NUMBERS], &[f64; NUMBERS])> = (a.samples.iter().enumerate().step_by(stride))
        .filter_map(|(i, sample)| {
            let j = usize::try_from(i as i64 + lag).ok()?;
            Some((sample.as_ref()?, b.samples.get(j)?.as_ref()?))
        })
        .collect();
    if pairs.len() < least {
        return None;
    }
    let count = pairs.len() as f64;
    let mut covariance = 0.0;
    let mut variances = 0.0;
    for k in 0..NUMBERS {
        let (x, y) = pairs.iter().fold((0.0, 0.0), |sum, (x, y)| (sum.0 + x[k], sum.1 + y[k]));
        let (x, y) = (x / count, y / count);
        let mut sums = [0.0; 3];
        for (a, b) in &pairs {
            sums[0] += (a[k] - x) * (b[k] - y);
            sums[1] += (a[k] - x).powi(2);
            sums[2] += (b[k] - y).powi(2);
        }
        covariance += sums[0];
        variances += (sums[1] * sums[2]).sqrt();
    }
    (variances > 0.0).then(|| covariance / variances)
}
