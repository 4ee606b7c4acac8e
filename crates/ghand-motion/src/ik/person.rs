//! Fits one hand to landmarks of all frames: its size, the lengths of its bones, and its pose in each frame.
//!
//! A landmark may be a point in space or a pixel of one of several cameras, and any may be missing or wrong. The fit is
//! the most probable hand and poses if errors of landmarks have Student's distribution, with likely angles of joints as
//! in [`super`], and shape and bones of likely lengths ([`proportions`]). It alternates: the poses of all frames, each on
//! its own (`frame`), then one step of Gauss and Newton for the lengths, from which the poses are eliminated (Schur's
//! complement), then the noise, by the EM rule for Student's distribution with the numbers that the unknowns take up
//! subtracted. The noise starts large, so that wrong landmarks are told from right ones by degrees. In the end, the
//! shape is what the found lengths say with a tracker's systematic errors in mind (`from_lengths`).
//!
//! Errors in pixels count in metres at the hand, since a tracker's errors grow with the hand in the image.

pub(crate) mod camera_freedom;
mod frame;
pub(crate) mod proportions;
pub(crate) mod sightings;
mod smoothing;
mod start;

use std::borrow::Cow;

use ghand_core::{Camera, Pose};
use glam::DVec3;
use nalgebra::{DMatrix, DVector};

use self::camera_freedom::{CameraFreedom, NUMBERS as CAMERA_NUMBERS};
use self::frame::FrameFit;
use self::proportions::Proportions;
use self::sightings::{SeenFrame, SightingPosition};
use self::smoothing::{FilmFrame, smooth};
use self::start::{first_pose, scales_of, with_fingers_retried};
use super::levenberg_marquardt::equations;
use super::{BONES, COLD_STEPS, HandIk, LANDMARK_COUNT, UNKNOWNS, WARM_STEPS, median};

/// Most frames that lengths are fitted to: more of a motion tell nothing new, and take long.
const MOST_FRAMES: usize = 150;
/// Rounds of the fit; most are done after ten. Cameras take longer.
const ROUNDS: usize = 25;
const CAMERA_ROUNDS: usize = 100;
/// Rounds after which fingers that have gone astray are tried again.
const RETRY_EVERY: usize = 5;
/// Lengths that change by less than this part of their deviation have arrived.
const SMALL_CHANGE: f64 = 2e-3;
/// As has a noise that changes by less than this part.
const SMALL_NOISE_CHANGE: f64 = 0.01;
/// Noise of a coordinate, metres: at first, bounds, and what is expected before any landmark is seen, which counts as
/// much as [`EXPECTED_COUNT`] numbers. MediaPipe's landmarks are 2 to 5 mm off.
const FIRST_NOISE: f64 = 0.01;
const LEAST_NOISE: f64 = 1e-4;
const MOST_NOISE: f64 = 0.02;
const EXPECTED_NOISE: f64 = 0.003;
const EXPECTED_COUNT: f64 = 2.0;
/// The noise falls by at most this factor in a round.
const NOISE_FALL: f64 = 0.6;
/// At least this part of the numbers remains to measure the noise.
const LEAST_FREEDOM: f64 = 0.1;
/// Attempts at a step, each ten times as damped.
const ATTEMPTS: usize = 4;
/// Standard deviation of a tracker's landmark along the finger, from a model's joint, metres, with the degrees of freedom
/// of its distribution: both mark places inside of a hand that nobody sees, and people's joints differ by as much beyond
/// any shape (5 % of a phalanx of 40 mm are 2 mm; Buryanov and Kotiuk 2010).
const PLACE_DEVIATION: f64 = 0.004;
const PLACE_FREEDOM: f64 = 4.0;
/// Steps to a shape, which is nearly linear in the lengths, and the width of the differences in them.
const SHAPE_ROUNDS: usize = 20;
const SHAPE_STEP: f64 = 1e-4;

/// The hand of a person in all frames.
#[derive(Debug, Clone)]
pub(crate) struct PersonFit {
    /// Of [`Proportions`].
    pub parameters: Vec<f64>,
    /// Noise of a coordinate, metres.
    pub noise: f64,
    /// One for each frame; `None` if its landmarks are not a hand.
    pub frames: Vec<Option<FittedFrame>>,
    /// The cameras, as given or fitted.
    pub cameras: Vec<Camera>,
}

/// A fitted frame.
#[derive(Debug, Clone)]
pub(crate) struct FittedFrame {
    /// The pose of the hand with its bones' own lengths.
    pub pose: Pose,
    /// The distance of each sighting from that hand, metres.
    pub distances: Vec<f64>,
    /// Metres per pixel at the hand, by camera.
    pub scales: Vec<f64>,
}

/// A frame during the fit.
#[derive(Debug, Clone)]
struct Frame<'a> {
    seen: &'a SeenFrame,
    x: [f64; UNKNOWNS],
    scales: Vec<f64>,
}

impl<'a> Frame<'a> {
    fn fit<'b>(&'b self, hand: &'b HandIk, cameras: &'b [Camera], noise: f64) -> FrameFit<'b> {
        FrameFit { hand, seen: self.seen, cameras, scales: &self.scales, noise }
    }

    /// The frame of a sequence, starting from the one before.
    fn start(
        seen: &'a SeenFrame,
        hand: &HandIk,
        cameras: &[Camera],
        noise: f64,
        before: Option<&Frame>,
    ) -> Option<Frame<'a>> {
        let scales = before.map_or(vec![], |before| before.scales.clone());
        let warm = before.filter(|_| scales.len() == cameras.len()).map(|before| &before.x);
        let x = first_pose(&FrameFit { hand, seen, cameras, scales: &scales, noise }, warm)?;
        Some(Frame { seen, x, scales: scales_of(hand, &x, cameras) })
    }
}

/// Fits a person's hand. `cameras` are those that pixels were seen by.
#[cfg(test)]
pub(crate) fn fit_person(proportions: &Proportions, seen: &[SeenFrame], cameras: &[Camera]) -> PersonFit {
    fit_person_and_cameras(proportions, seen, cameras, None)
}

/// Fits a person's hand, and the cameras if they are free.
pub(crate) fn fit_person_and_cameras(
    proportions: &Proportions,
    seen: &[SeenFrame],
    cameras: &[Camera],
    freedom: Option<&CameraFreedom>,
) -> PersonFit {
    let mut cameras = cameras.to_vec();
    let mut parameters = from_medians(proportions, seen);
    let mut hand = proportions.hand(&parameters);
    let mut noise = FIRST_NOISE;
    let count = seen.len().min(MOST_FRAMES);
    let chosen: Vec<usize> = (0..count).map(|k| k * seen.len() / count).collect();
    let mut frames: Vec<Option<Frame>> = vec![None; seen.len()];
    let mut before: Option<usize> = None;
    for &k in &chosen {
        let last = before.and_then(|k| frames[k].as_ref());
        frames[k] = Frame::start(&seen[k], &hand, &cameras, noise, last);
        if frames[k].is_some() {
            before = Some(k);
        }
    }
    let mut some: Vec<Frame> = chosen.iter().filter_map(|k| frames[*k].clone()).collect();
    if !some.is_empty() {
        let mut damping = 0.0;
        let rounds = if freedom.is_some() { CAMERA_ROUNDS } else { ROUNDS };
        for round in 1..=rounds {
            if round % RETRY_EVERY == 0 {
                for frame in &mut some {
                    frame.x = with_fingers_retried(&frame.fit(&hand, &cameras, noise), frame.x);
                }
            }
            let (change, noise_change);
            let shared = Shared { parameters, cameras, freedom };
            (Shared { parameters, cameras, .. }, change, damping) =
                lengths_step(proportions, shared, &mut some, noise, damping);
            hand = proportions.hand(&parameters);
            let measured = measured_noise(proportions, &hand, &some, &cameras, noise);
            let next = measured.max(noise * NOISE_FALL);
            noise_change = (next / noise - 1.0).abs();
            noise = next;
            for frame in &mut some {
                frame.scales = scales_of(&hand, &frame.x, &cameras);
            }
            if change < SMALL_CHANGE && noise_change < SMALL_NOISE_CHANGE {
                break;
            }
        }
    }
    parameters = from_lengths(proportions, &proportions.lengths(&hand));
    hand = proportions.hand(&parameters);
    let mut some = some.into_iter();
    for k in chosen {
        if frames[k].is_some() {
            frames[k] = some.next();
        }
    }
    let frames = finished(&hand, frames, seen, &cameras, noise);
    PersonFit { parameters, noise, frames, cameras }
}

/// The poses of the model with a person's shape, without the bones' own lengths: it is put where the landmarks are,
/// whatever its bones lack. Of a model without shapes, the bones' directions are right. `times` are those of a film's
/// frames, seconds: its poses become smooth. Empty without a film.
pub(crate) fn model_poses(
    proportions: &Proportions,
    fit: &PersonFit,
    seen: &[SeenFrame],
    cameras: &[Camera],
    times: &[f64],
) -> Vec<Option<Pose>> {
    let person = proportions.hand(&fit.parameters);
    let (hand, seen) = if proportions.has_shape() {
        let hand = proportions.hand(&proportions.without_bones(&fit.parameters));
        let seen = with_agreement(proportions, &person, &hand, seen);
        (hand, Cow::Owned(seen))
    } else {
        (person, Cow::Borrowed(seen))
    };
    let mut numbers = vec![];
    let mut film = vec![];
    for (k, frame) in fit.frames.iter().enumerate() {
        let Some(frame) = frame else { continue };
        let problem = FrameFit { hand: &hand, seen: &seen[k], cameras, scales: &frame.scales, noise: fit.noise };
        let (_, x) = problem.solve(hand.unknowns(&frame.pose), COLD_STEPS);
        numbers.push(k);
        film.push(FilmFrame::new(problem, times.get(k).copied().unwrap_or(0.0), x));
    }
    if !times.is_empty() {
        smooth(&mut film);
    }
    let mut poses = vec![None; fit.frames.len()];
    for (k, frame) in numbers.into_iter().zip(&film) {
        poses[k] = Some(hand.pose(&frame.x));
    }
    poses
}

/// Landmarks at which the model has its joint elsewhere than the person count less, by Student's distribution: they would
/// pull all others with them.
fn with_agreement(proportions: &Proportions, person: &HandIk, model: &HandIk, seen: &[SeenFrame]) -> Vec<SeenFrame> {
    let [theirs, own] = [person, model].map(|hand| along_fingers(&proportions.lengths(hand)));
    let agreement = |landmark: usize| {
        let place = landmark.checked_sub(1);
        let off = place.map_or(0.0, |place| (theirs[place] - own[place]) / PLACE_DEVIATION);
        PLACE_FREEDOM / (PLACE_FREEDOM + off * off)
    };
    let mut seen = seen.to_vec();
    let sightings = seen.iter_mut().flat_map(|frame| &mut frame.sightings);
    sightings.for_each(|sighting| sighting.confidence *= agreement(sighting.landmark));
    seen
}

/// All frames, those that were not chosen from the ones before.
fn finished(
    hand: &HandIk,
    mut frames: Vec<Option<Frame>>,
    seen: &[SeenFrame],
    cameras: &[Camera],
    noise: f64,
) -> Vec<Option<FittedFrame>> {
    let mut before: Option<Frame> = None;
    let mut fitted = vec![];
    for (frame, seen) in frames.iter_mut().zip(seen) {
        let mut found = match frame.take() {
            Some(mut frame) => {
                frame.x = frame.fit(hand, cameras, noise).solve(frame.x, WARM_STEPS).1;
                Some(frame)
            }
            None => Frame::start(seen, hand, cameras, noise, before.as_ref()),
        };
        if let Some(frame) = &mut found {
            frame.x = with_fingers_retried(&frame.fit(hand, cameras, noise), frame.x);
        }
        fitted.push(found.as_ref().map(|frame| FittedFrame {
            pose: hand.pose(&frame.x),
            distances: frame.fit(hand, cameras, noise).gaps(&frame.x).iter().map(|gap| gap.squared.sqrt()).collect(),
            scales: frame.scales.clone(),
        }));
        before = found.or(before);
    }
    fitted
}

/// Lengths from medians over the frames whose landmarks are all in space; the model's own without any.
fn from_medians(proportions: &Proportions, seen: &[SeenFrame]) -> Vec<f64> {
    let points: Vec<[DVec3; LANDMARK_COUNT]> = seen.iter().filter_map(SeenFrame::points).collect();
    let observed = BONES.map(|(from, to)| median(points.iter().map(|p| p[from].distance(p[to])).collect()));
    if observed.iter().all(|length| *length > 0.0) {
        // Noise makes bones longer: only what all of them say together.
        proportions.without_bones(&from_lengths(proportions, &observed))
    } else {
        vec![0.0; proportions.count()]
    }
}

/// The parameters of a hand whose [`BONES`] have these lengths, metres. The shape is the most probable one if landmarks
/// lie [`PLACE_DEVIATION`] from a model's joints along the fingers; the bones are what it leaves.
///
/// A shape is not asked for more: with many frames, what lies between a tracker's joints and a model's is sure to a
/// fraction of a millimetre, and a shape that made up for it would be anybody's.
fn from_lengths(proportions: &Proportions, observed: &[f64; BONES.len()]) -> Vec<f64> {
    let mut parameters = vec![0.0; proportions.count()];
    let count = proportions.own_count();
    let lengths = |parameters: &[f64]| proportions.lengths(&proportions.hand(parameters));
    let target = along_fingers(observed);
    for _ in 0..SHAPE_ROUNDS {
        let now = along_fingers(&lengths(&parameters));
        let moved = |k: usize| {
            let mut moved = parameters.clone();
            moved[k] += SHAPE_STEP;
            along_fingers(&lengths(&moved))
        };
        let columns: Vec<_> = (0..count).map(moved).collect();
        let mut matrix = DMatrix::zeros(count, count);
        let mut gradient = DVector::zeros(count);
        for (place, (now, target)) in now.iter().zip(&target).enumerate() {
            let error = (now - target) / PLACE_DEVIATION;
            let weight = (PLACE_FREEDOM + 1.0) / (PLACE_FREEDOM + error * error);
            let slope = |k: usize| (columns[k][place] - now) / (SHAPE_STEP * PLACE_DEVIATION);
            for i in 0..count {
                gradient[i] += weight * slope(i) * error;
                (0..count).for_each(|j| matrix[(i, j)] += weight * slope(i) * slope(j));
            }
        }
        add_prior(proportions, &parameters[..count], &mut matrix, &mut gradient);
        let Some(step) = matrix.cholesky().map(|factor| factor.solve(&gradient)) else { break };
        if step.iter().any(|value| !value.is_finite()) {
            break;
        }
        parameters.iter_mut().zip(step.iter()).for_each(|(value, step)| *value -= step);
    }
    let left = lengths(&parameters);
    for ((value, observed), left) in parameters.iter_mut().skip(count).zip(observed).zip(left) {
        let logarithm = (observed / left).ln();
        *value = if logarithm.is_finite() { logarithm } else { 0.0 };
    }
    parameters
}

/// The way from the wrist along the bones to each landmark but the wrist.
fn along_fingers(lengths: &[f64; BONES.len()]) -> [f64; BONES.len()] {
    let mut way = 0.0;
    std::array::from_fn(|k| {
        way = if k % 4 == 0 { lengths[k] } else { way + lengths[k] };
        way
    })
}

fn add_prior(proportions: &Proportions, parameters: &[f64], matrix: &mut DMatrix<f64>, gradient: &mut DVector<f64>) {
    for (k, value) in parameters.iter().enumerate() {
        let (_, weight) = proportions.prior(k, *value);
        matrix[(k, k)] += weight;
        gradient[k] += weight * value;
    }
}

fn prior_cost(proportions: &Proportions, parameters: &[f64]) -> f64 {
    parameters.iter().enumerate().map(|(k, value)| proportions.prior(k, *value).0).sum()
}

/// What all frames share.
struct Shared<'a> {
    /// Of [`Proportions`].
    parameters: Vec<f64>,
    cameras: Vec<Camera>,
    /// What is known of the cameras, if they are unknowns.
    freedom: Option<&'a CameraFreedom>,
}

impl Shared<'_> {
    fn prior_cost(&self, proportions: &Proportions) -> f64 {
        prior_cost(proportions, &self.parameters)
            + self.freedom.map_or(0.0, |freedom| freedom.prior_cost(&self.cameras))
    }

    fn moved(&self, step: &DVector<f64>) -> Self {
        let (lengths, cameras) = step.as_slice().split_at(self.parameters.len());
        let parameters = self.parameters.iter().zip(lengths).map(|(value, step)| value + step).collect();
        let cameras = match self.freedom {
            Some(_) => CameraFreedom::moved(&self.cameras, cameras),
            None => self.cameras.clone(),
        };
        Shared { parameters, cameras, freedom: self.freedom }
    }
}

/// One step of what frames share and of all poses: the new values, their largest change in deviations, and the damping that
/// the step needed.
fn lengths_step<'a>(
    proportions: &Proportions,
    shared: Shared<'a>,
    frames: &mut [Frame],
    noise: f64,
    damping: f64,
) -> (Shared<'a>, f64, f64) {
    let Shared { parameters, cameras, freedom } = &shared;
    let hand = proportions.hand(parameters);
    for frame in frames.iter_mut() {
        frame.x = frame.fit(&hand, cameras, noise).solve(frame.x, WARM_STEPS).1;
    }
    let lengths = parameters.len();
    let count = lengths + freedom.map_or(0, CameraFreedom::count);
    let derivatives = proportions.derivatives(parameters);
    let mut matrix = DMatrix::zeros(count, count);
    let mut gradient = DVector::zeros(count);
    let mut cost = shared.prior_cost(proportions);
    let mut follow = vec![];
    for frame in frames.iter() {
        let fit = frame.fit(&hand, cameras, noise);
        cost += fit.cost(&frame.x);
        let Some(reduced) = Reduced::of(&fit, &frame.x, &derivatives, freedom.is_some()) else {
            follow.push(None);
            continue;
        };
        matrix += &reduced.matrix;
        gradient += &reduced.gradient;
        follow.push(Some(reduced));
    }
    add_prior(proportions, parameters, &mut matrix, &mut gradient);
    if let Some(freedom) = freedom {
        freedom.add_prior(cameras, lengths, &mut matrix, &mut gradient);
    }
    let mut damping = damping;
    for _ in 0..ATTEMPTS {
        let mut damped = matrix.clone();
        (0..count).for_each(|k| damped[(k, k)] *= 1.0 + damping);
        let Some(step) = damped.cholesky().map(|factor| -factor.solve(&gradient)) else { break };
        let tried = shared.moved(&step);
        let tried_hand = proportions.hand(&tried.parameters);
        let mut tried_cost = tried.prior_cost(proportions);
        let moved: Vec<Frame> = (frames.iter().zip(&follow))
            .map(|(frame, reduced)| {
                let x = reduced.as_ref().map_or(frame.x, |reduced| reduced.follow(&frame.x, &step, &hand));
                let fit = frame.fit(&tried_hand, &tried.cameras, noise);
                let (cost, x) = fit.solve(x, WARM_STEPS);
                tried_cost += cost;
                Frame { x, ..frame.clone() }
            })
            .collect();
        if tried_cost <= cost {
            frames.iter_mut().zip(moved).for_each(|(frame, moved)| *frame = moved);
            let change = step.iter().take(lengths).enumerate().map(|(k, step)| (step / proportions.deviation(k)).abs());
            let change = change.fold(CameraFreedom::size_of(&step.as_slice()[lengths..]), f64::max);
            return (tried, change, damping * 0.1);
        }
        damping = (damping * 10.0).max(0.01);
    }
    (shared, 0.0, damping)
}

/// The equations of a frame for the parameters, from which its pose is eliminated.
struct Reduced {
    matrix: DMatrix<f64>,
    gradient: DVector<f64>,
    /// The step of the pose without and with each parameter's.
    own: DVector<f64>,
    by_parameter: DMatrix<f64>,
}

impl Reduced {
    fn of(fit: &FrameFit, x: &[f64; UNKNOWNS], derivatives: &[Vec<DVec3>], with_cameras: bool) -> Option<Reduced> {
        let (own, own_gradient, stays) = equations(fit, x, 1.0);
        let own = DMatrix::from_fn(UNKNOWNS, UNKNOWNS, |i, j| own[i][j]);
        let own_gradient = DVector::from_column_slice(&own_gradient);
        let hand = fit.hand;
        let chain = hand.chain(x);
        let places = hand.places(&chain, x);
        let rows = hand.landmark_derivatives(&chain, x);
        // How landmarks move with the parameters, `[parameter][landmark]`.
        let moves: Vec<[DVec3; LANDMARK_COUNT]> = (derivatives.iter())
            .map(|rest| {
                let mut moved = rest.clone();
                for (joint, parent) in hand.parents.iter().enumerate() {
                    if let Some(p) = *parent {
                        moved[joint] = moved[p] + chain.world[p].linear * (rest[joint] - rest[p]);
                    }
                }
                hand.landmarks.map(|joint| moved[joint])
            })
            .collect();
        let lengths = derivatives.len();
        let count = lengths + if with_cameras { CAMERA_NUMBERS * fit.cameras.len() } else { 0 };
        let mut mixed = DMatrix::zeros(UNKNOWNS, count);
        let mut matrix = DMatrix::zeros(count, count);
        let mut gradient = DVector::zeros(count);
        for sighting in &fit.seen.sightings {
            let i = sighting.landmark;
            let gap = sighting.gap(places[i], fit.cameras, fit.scales);
            let (_, weight) = sighting.cost_and_weight(&gap, fit.noise);
            let mut moves: Vec<(usize, DVec3)> = moves.iter().map(|moves| moves[i]).enumerate().collect();
            if let (true, SightingPosition::Pixel(number, _)) = (with_cameras, sighting.place)
                && let Some(camera) = fit.cameras.get(number)
            {
                moves.extend((lengths + CAMERA_NUMBERS * number..).zip(CameraFreedom::moves(camera, places[i])));
            }
            for &(k, by) in &moves {
                let felt = gap.information * by * weight;
                gradient[k] += by.dot(gap.pull) * weight;
                for (at, moved) in &rows[i] {
                    if !stays[*at] {
                        mixed[(*at, k)] += moved.dot(felt);
                    }
                }
                for &(j, other) in &moves {
                    matrix[(k, j)] += felt.dot(other);
                }
            }
        }
        let factor = own.cholesky()?;
        let by_parameter = factor.solve(&mixed);
        let own = factor.solve(&own_gradient);
        matrix -= mixed.transpose() * &by_parameter;
        gradient -= mixed.transpose() * &own;
        Some(Reduced { matrix, gradient, own, by_parameter })
    }

    /// The pose after a step of the parameters.
    fn follow(&self, x: &[f64; UNKNOWNS], step: &DVector<f64>, hand: &HandIk) -> [f64; UNKNOWNS] {
        let own = &self.own + &self.by_parameter * step;
        let mut moved = *x;
        moved.iter_mut().zip(own.iter()).for_each(|(value, step)| *value -= step);
        for (value, range) in moved.iter_mut().skip(UNKNOWNS - hand.ranges.len()).zip(&hand.ranges) {
            *value = value.clamp(range.low, range.high);
        }
        moved
    }
}

/// The noise of a coordinate that the gaps of all frames say, metres.
fn measured_noise(proportions: &Proportions, hand: &HandIk, frames: &[Frame], cameras: &[Camera], noise: f64) -> f64 {
    let mut squares = 0.0;
    let mut numbers = 0.0;
    let mut taken = proportions.count() as f64;
    for frame in frames {
        let fit = frame.fit(hand, cameras, noise);
        for (sighting, gap) in frame.seen.sightings.iter().zip(fit.gaps(&frame.x)) {
            let (_, weight) = sighting.cost_and_weight(&gap, noise);
            squares += weight * noise * noise * gap.squared;
            numbers += sighting.confidence * gap.dimensions;
        }
        taken += determined(&fit, &frame.x);
    }
    let free = (numbers - taken).max(LEAST_FREEDOM * numbers);
    let variance = (squares + EXPECTED_COUNT * EXPECTED_NOISE.powi(2)) / (free + EXPECTED_COUNT);
    variance.sqrt().clamp(LEAST_NOISE, MOST_NOISE)
}

/// How many of the unknowns of a pose the landmarks determine; likely angles the rest.
fn determined(fit: &FrameFit, x: &[f64; UNKNOWNS]) -> f64 {
    let (matrix, _, stays) = equations(fit, x, 1.0);
    let Some(inverse) = DMatrix::from_fn(UNKNOWNS, UNKNOWNS, |i, j| matrix[i][j]).cholesky().map(|f| f.inverse())
    else {
        return UNKNOWNS as f64;
    };
    let first = UNKNOWNS - fit.hand.ranges.len();
    let by_prior = |k: usize| match stays[k] {
        true => 1.0,
        false if k < first => 0.0,
        false => inverse[(k, k)] / fit.hand.ranges[k - first].spread.powi(2),
    };
    (0..UNKNOWNS).map(|k| 1.0 - by_prior(k).min(1.0)).sum()
}

#[cfg(test)]
mod tests;
