//! Where a lamp near the hand stands: the place from which its light explains most of what frames show.
//!
//! A lamp has four unknowns besides its strength: two angles, how far away it is, and its size. They are searched for one
//! by one, on a part of the texels and frames, in green, with light from few directions beside it. The search starts from
//! the best of many places all around, since it ends in the nearest of many minima.

use ghand_avatar::light::{IrradianceParts, Lamp, Lamps};
use ghand_core::HandModel;
use ghand_core::light::{DIRECTION_COUNT, directions};
use ghand_core::sphere::spiral_direction;
use glam::{DQuat, DVec3};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::least_squares::{ChannelFit, FrameColors, LightModel, Parts, Unknowns, fit_channel, squared_error_of};
use super::observations::Observations;
use super::terms::{SAME_LAMP, texel_parts};
use crate::texels::frames::evenly;

/// Most frames that take part.
const MOST_FRAMES: usize = 20;
/// The channel that takes part.
const GREEN: usize = 1;
/// Directions of the light beside the lamp while its place is searched for.
const GROUPS: usize = 16;
/// A far start, in the brightest direction: a lamp of this size, as a part of its distance, this far away, metres.
const FAR_SIZE: f64 = 0.1;
const FAR_DISTANCE: f64 = 20.0;
/// Near starts: so many directions, these distances as multiples of the least one, and the size.
const NEAR_DIRECTIONS: usize = 32;
const NEAR_DISTANCES: [f64; 2] = [2.0, 8.0];
const NEAR_SIZE: f64 = 0.3;
/// The first steps: radians, 1 / metres, and parts of the distance.
const FIRST_STEPS: [f64; 4] = [0.1, 0.1, 0.5, 0.08];
/// Rounds of one step for each unknown; after the first ones, steps are halved.
const ROUNDS: usize = 8;
const LONG_ROUNDS: usize = 3;
/// Largest distance, metres: nothing tells a lamp further away from one that is infinitely far.
const FURTHEST: f64 = 50.0;
/// Least distance from skin, metres.
const NEAREST: f64 = 0.1;
/// Largest radius as a part of the distance.
const LARGEST_SIZE: f64 = 0.7;

/// What the search sees: some frames without what lamps found before give them.
pub(super) struct LampSearch<'a> {
    pub seen: &'a Observations,
    pub model: &'a HandModel,
    /// What the directions give the frames, world axes turned by `turn`.
    pub frames: &'a [IrradianceParts],
    pub turn: DQuat,
    /// The frames that take part.
    pub used: &'a [usize],
}

impl LampSearch<'_> {
    /// One lamp more than are known, where a fit of them and the directions is brightest; `None` if none of its light comes
    /// from one place. `known` has no lamps at first.
    pub fn one_more(&self, known: &Lamps, fits: &[ChannelFit]) -> Option<Lamps> {
        let towards = brightest(known, fits)?;
        let texels = self.seen.some_texels();
        let used = evenly(self.used, MOST_FRAMES, 0);
        let base: Vec<Parts> = used.par_iter().map(|f| self.grouped(&self.frames[*f], known)).collect();
        let lamps = known.lamps.len() + 1;
        let groups = group_of_directions();
        let size = |group| groups.iter().filter(|g| **g == group).count() as f64;
        let shares = DVector::from_iterator(GROUPS + lamps, (0..GROUPS).map(size).chain((0..lamps).map(|_| 1.0)));
        let unknowns = Unknowns { model: LightModel::Directions, shares, lamps };
        let error = |lamp: Lamp| -> Option<f64> {
            let place = Lamps { lamps: vec![lamp], ..known.clone() };
            if lamp.offset.length() < known.reach + NEAREST {
                return None;
            }
            let frame = |(f, base): (&usize, &Parts)| -> Option<FrameColors> {
                let frame = &self.frames[*f];
                let at = place.positions(self.turn, &frame.vertices);
                if frame.vertices.iter().any(|v| v.distance(at[0]) < NEAREST) {
                    return None;
                }
                let mut lit = IrradianceParts { columns: vec![], lamps: vec![], ..frame.clone() };
                lit.add_lamps(&place, self.turn, self.model);
                let parts = joined(base, &texel_parts(&lit, self.model, self.seen));
                Some(self.seen.colors(*f, &parts).of_texels(&texels))
            };
            let frames: Option<Vec<FrameColors>> = used.par_iter().zip(&base).map(frame).collect();
            let frames = frames?;
            let frames: Vec<&FrameColors> = frames.iter().collect();
            let fit = fit_channel(&unknowns, &frames, self.seen.samples.len(), GREEN, 0.0);
            Some(squared_error_of(&frames, &fit, GREEN))
        };
        let starts = starts(towards, known.reach + NEAREST);
        let judge = |(towards, start): (DVec3, [f64; 4])| Some((error(lamp(towards, start))?, towards, start));
        let judged: Vec<(f64, DVec3, [f64; 4])> = starts.into_par_iter().filter_map(judge).collect();
        let (mut least, towards, mut best) = judged.into_iter().min_by(|(a, ..), (b, ..)| a.total_cmp(b))?;
        let mut steps = FIRST_STEPS;
        for round in 0..ROUNDS {
            for i in 0..best.len() {
                for step in [steps[i], -steps[i]] {
                    let mut next = best;
                    next[i] += step;
                    if !(1.0 / FURTHEST..1.0 / NEAREST).contains(&next[2]) || !(0.0..LARGEST_SIZE).contains(&next[3]) {
                        continue;
                    }
                    if let Some(error) = error(lamp(towards, next)).filter(|error| *error < least) {
                        (best, least) = (next, error);
                        break;
                    }
                }
            }
            if round >= LONG_ROUNDS {
                steps = steps.map(|step| step / 2.0);
            }
        }
        let mut found = known.clone();
        found.lamps.push(lamp(towards, best));
        Some(found)
    }

    /// What groups of directions, then known lamps, give the texels of a frame.
    fn grouped(&self, frame: &IrradianceParts, known: &Lamps) -> Parts {
        let mut lit = frame.clone();
        lit.add_lamps(known, self.turn, self.model);
        let all = texel_parts(&lit, self.model, self.seen);
        let groups = group_of_directions();
        let lamps = known.lamps.len();
        let mut direct = DMatrix::zeros(all.direct.nrows(), GROUPS + lamps);
        for k in 0..all.direct.ncols() {
            let group = groups.get(k).copied().unwrap_or(GROUPS + k.saturating_sub(DIRECTION_COUNT));
            let mut column = direct.column_mut(group);
            column += all.direct.column(k);
        }
        Parts { mean: direct.row_mean(), direct, closed: all.closed }
    }
}

/// A lamp near a direction, from its unknowns.
fn lamp(towards: DVec3, [a, b, nearness, size]: [f64; 4]) -> Lamp {
    let (across, other) = towards.any_orthonormal_pair();
    let towards = (towards + across * a + other * b).normalize();
    Lamp { offset: towards / nearness, radius: size / nearness, radiance: [1.0; 3] }
}

/// Where the search for a lamp may start: directions and unknowns, far away in the brightest direction and near all around.
fn starts(brightest: DVec3, least_distance: f64) -> Vec<(DVec3, [f64; 4])> {
    let near = |k: usize| {
        let towards = spiral_direction(k, NEAR_DIRECTIONS);
        NEAR_DISTANCES.map(|distance| (towards, [0.0, 0.0, 1.0 / (distance * least_distance), NEAR_SIZE]))
    };
    let far = (brightest, [0.0, 0.0, 1.0 / FAR_DISTANCE, FAR_SIZE]);
    (0..NEAR_DIRECTIONS).flat_map(near).chain([far]).collect()
}

/// The lamps' place and reach in some frames, without lamps.
pub(super) fn place(frames: &[IrradianceParts]) -> Lamps {
    let middles: Vec<DVec3> = frames.iter().map(|frame| Lamps::middle(&frame.vertices)).collect();
    let place = middles.iter().sum::<DVec3>() / middles.len().max(1) as f64;
    let reach = middles.iter().map(|middle| middle.distance(place)).fold(0.0, f64::max);
    Lamps { place, reach, lamps: vec![] }
}

/// The brightest direction of a fit that is not that of a known lamp, the light's axes.
fn brightest(known: &Lamps, fits: &[ChannelFit]) -> Option<DVec3> {
    let radiance = |k: usize| fits.iter().map(|fit| fit.light[k]).sum::<f64>() / fits.len() as f64;
    let is_new = |d: &DVec3| known.lamps.iter().all(|lamp| d.dot(lamp.offset.normalize_or_zero()) < SAME_LAMP);
    let all = directions();
    let new = (0..all.len()).filter(|k| is_new(&all[*k]));
    let brightest = new.max_by(|a, b| radiance(*a).total_cmp(&radiance(*b)))?;
    (radiance(brightest) > 1.0).then(|| all[brightest])
}

/// The group of each direction.
fn group_of_directions() -> [usize; DIRECTION_COUNT] {
    let middles: [DVec3; GROUPS] = std::array::from_fn(|k| spiral_direction(k, GROUPS));
    let nearest = |d: DVec3| (0..GROUPS).max_by(|a, b| middles[*a].dot(d).total_cmp(&middles[*b].dot(d))).unwrap_or(0);
    directions().map(nearest)
}

/// Parts with more unknowns.
fn joined(parts: &Parts, more: &Parts) -> Parts {
    let count = parts.direct.ncols();
    let mut direct = parts.direct.clone().resize_horizontally(count + more.direct.ncols(), 0.0);
    direct.columns_mut(count, more.direct.ncols()).copy_from(&more.direct);
    Parts { mean: direct.row_mean(), direct, closed: parts.closed.clone() }
}
