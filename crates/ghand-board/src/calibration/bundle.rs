//! Refines lenses, places and clocks of cameras together with the board's pose at all moments (bundle adjustment).
//!
//! Levenberg and Marquardt's method; the board's poses are eliminated by Schur's complement. The noise of corners starts
//! large and is measured on the way, so that wrong corners are told from right ones by degrees. The same input gives the
//! same bits for any number of threads.

use std::sync::Arc;

use ghand_capture::cameras::rigid::Rigid;
use glam::{DVec2, DVec3};
use nalgebra::{DMatrix, DVector, SMatrix};
use rayon::prelude::*;

use super::equations::{BOARD_NUMBERS, CAMERA_NUMBERS, CLOCK, Equations, PLACE, cost, equations, squares};
use super::lens::{Coefficients, FIRST_COEFFICIENT, FOCAL, Lens, PRINCIPAL};
use super::pose::moved;

/// Standard deviations of what is likely without any image: logarithms of the focal length and of the pixels' aspect; the
/// principal point, relative to the image's diagonal; k1, k2, p1, p2, k3.
const FOCAL_DEVIATION: f64 = 0.5;
const ASPECT_DEVIATION: f64 = 0.01;
const PRINCIPAL_DEVIATION: f64 = 0.04;
const COEFFICIENT_DEVIATIONS: [f64; 5] = [0.3, 0.2, 0.005, 0.005, 0.1];
/// Bounds of corners' noise, pixels, and how much it falls at most at once.
pub(super) const FIRST_NOISE: f64 = 4.0;
const LEAST_NOISE: f64 = 0.02;
const NOISE_FALL: f64 = 0.5;
/// The median of the squared length of two normal numbers.
const MEDIAN_SQUARE: f64 = 1.386;
/// Steps of the method.
const STEPS: usize = 60;
/// Steps that lower the cost by less than this part, with a settled noise, end it.
const SMALL_CHANGE: f64 = 1e-7;
/// Damping at first, and the one at which no step helps.
const FIRST_DAMPING: f64 = 1e-3;
const MOST_DAMPING: f64 = 1e8;

/// One camera.
#[derive(Debug, Clone)]
pub(super) struct FilmCamera {
    pub lens: Lens,
    /// `camera_from_world`.
    pub place: Rigid,
    /// What to add to the first camera's time to have this one's, seconds.
    pub clock: f64,
    /// Standard deviation of a corner's coordinate, pixels.
    pub noise: f64,
}

/// What of a camera is unknown.
#[derive(Debug, Clone, Copy)]
pub(super) struct Unknown {
    pub coefficients: Coefficients,
    pub place: bool,
    /// The likely clock and its standard deviation, seconds.
    pub clock: Option<[f64; 2]>,
}

/// A corner in one image.
#[derive(Debug, Clone, Copy)]
pub(super) struct SeenPoint {
    /// Where it is on the board, metres.
    pub place: DVec3,
    pub pixel: DVec2,
    /// How fast it moves, pixels per second.
    pub velocity: DVec2,
    /// Standard deviation beside the noise, pixels: of what moves.
    pub slack: f64,
}

/// The board as one camera sees it.
#[derive(Debug, Clone)]
pub(super) struct SeenBoard {
    pub camera: usize,
    pub points: Vec<SeenPoint>,
}

/// The board at one moment.
#[derive(Debug, Clone)]
pub(super) struct Moment {
    /// `world_from_board`.
    pub board: Rigid,
    pub seen: Arc<[SeenBoard]>,
}

/// How sure the numbers are.
pub(super) struct Adjusted {
    /// Half of it is the negative logarithm of the probability.
    pub cost: f64,
    /// Covariance of all cameras' numbers; 0 of those that are not unknown. `None` if the images do not tell them.
    pub covariance: Option<DMatrix<f64>>,
}

/// The state that is refined.
#[derive(Debug, Clone)]
pub(super) struct State {
    pub cameras: Vec<FilmCamera>,
    pub moments: Vec<Moment>,
}

/// Refines cameras and the board's poses.
pub(super) fn adjust(state: &mut State, unknown: &[Unknown]) -> Adjusted {
    let active = active(unknown);
    let seen_at: Vec<f64> = state.cameras.iter().map(|camera| camera.clock).collect();
    let mut damping = FIRST_DAMPING;
    for _ in 0..STEPS {
        let noises = measured_noises(state, &seen_at);
        let mut is_settled = true;
        for (camera, measured) in state.cameras.iter_mut().zip(noises) {
            let next = measured.max(camera.noise * NOISE_FALL).max(LEAST_NOISE);
            is_settled &= (next / camera.noise - 1.0).abs() < 0.01;
            camera.noise = next;
        }
        let before = total_cost(state, unknown, &seen_at);
        let reduced = Reduced::of(state, unknown, &seen_at, &active);
        let mut lower = None;
        while damping < MOST_DAMPING {
            if let Some(moved) = reduced.step(state, damping) {
                let found = total_cost(&moved, unknown, &seen_at);
                if found < before {
                    lower = Some((moved, found));
                    damping = (damping * 0.1).max(1e-10);
                    break;
                }
            }
            damping *= 8.0;
        }
        match lower {
            Some((moved, found)) => {
                *state = moved;
                if is_settled && before - found < SMALL_CHANGE * before {
                    break;
                }
            }
            None if is_settled => break,
            None => damping = FIRST_DAMPING,
        }
    }
    let reduced = Reduced::of(state, unknown, &seen_at, &active);
    let covariance = reduced.eliminated(0.0).and_then(|(matrix, _)| Some(matrix.cholesky()?.inverse()));
    let covariance = covariance.map(|found| {
        let count = CAMERA_NUMBERS * state.cameras.len();
        let mut all = DMatrix::zeros(count, count);
        for (i, row) in active.iter().enumerate() {
            for (j, column) in active.iter().enumerate() {
                all[(*row, *column)] = found[(i, j)];
            }
        }
        all
    });
    Adjusted { cost: total_cost(state, unknown, &seen_at), covariance }
}

/// Places of the unknown numbers among all cameras'.
fn active(unknown: &[Unknown]) -> Vec<usize> {
    let of_camera = |(camera, unknown): (usize, &Unknown)| {
        let mut numbers: Vec<usize> = unknown.coefficients.unknown().collect();
        if unknown.place {
            numbers.extend(PLACE..PLACE + 6);
        }
        if unknown.clock.is_some() {
            numbers.push(CLOCK);
        }
        numbers.into_iter().map(move |number| CAMERA_NUMBERS * camera + number)
    };
    unknown.iter().enumerate().flat_map(of_camera).collect()
}

/// The noise of each camera's corners, from the median of their errors.
fn measured_noises(state: &State, seen_at: &[f64]) -> Vec<f64> {
    let noise = |camera: usize| {
        let mut found: Vec<(f64, f64)> = vec![];
        for moment in &state.moments {
            for board in moment.seen.iter().filter(|board| board.camera == camera) {
                let slacks = board.points.iter().map(|point| point.slack);
                found.extend(slacks.zip(squares(state, moment, board, seen_at)));
            }
        }
        // Of those that move least.
        found.sort_by(|a, b| a.0.total_cmp(&b.0));
        found.truncate(found.len().div_ceil(2).max(found.len().min(200)));
        let mut squares: Vec<f64> =
            found.iter().map(|(slack, square)| square - MEDIAN_SQUARE * slack * slack).collect();
        squares.sort_by(f64::total_cmp);
        squares.get(squares.len() / 2).map_or(FIRST_NOISE, |median| (median.max(0.0) / MEDIAN_SQUARE).sqrt())
    };
    (0..state.cameras.len()).into_par_iter().map(noise).collect()
}

pub(super) fn total_cost(state: &State, unknown: &[Unknown], seen_at: &[f64]) -> f64 {
    let costs: Vec<f64> = state.moments.par_iter().map(|moment| cost(state, moment, seen_at)).collect();
    let mut sum: f64 = costs.iter().sum();
    for (camera, unknown) in state.cameras.iter().zip(unknown) {
        sum += priors(camera, unknown).iter().map(|prior| (prior.off / prior.deviation).powi(2)).sum::<f64>();
    }
    sum
}

/// What is likely of a number without any image.
struct Prior {
    number: usize,
    /// The number less its likely value.
    off: f64,
    deviation: f64,
}

fn priors(camera: &FilmCamera, unknown: &Unknown) -> Vec<Prior> {
    let lens = &camera.lens;
    let usual = Lens::plain(lens.size, Lens::usual_focal(lens.size));
    let focal = 0.5 * (lens.focal.x * lens.focal.y).ln() - usual.focal.x.ln();
    let off = lens.principal - usual.principal;
    let deviation = PRINCIPAL_DEVIATION * lens.diagonal();
    let mut priors = vec![
        Prior { number: FOCAL, off: focal, deviation: FOCAL_DEVIATION },
        Prior { number: FOCAL + 1, off: (lens.focal.x / lens.focal.y).ln(), deviation: ASPECT_DEVIATION },
        Prior { number: PRINCIPAL, off: off.x, deviation },
        Prior { number: PRINCIPAL + 1, off: off.y, deviation },
    ];
    let coefficients = lens.coefficients.iter().zip(COEFFICIENT_DEVIATIONS).zip(FIRST_COEFFICIENT..);
    priors.extend(coefficients.map(|((off, deviation), number)| Prior { number, off: *off, deviation }));
    if let Some([likely, deviation]) = unknown.clock {
        priors.push(Prior { number: CLOCK, off: camera.clock - likely, deviation });
    }
    priors
}

/// The normal equations of all moments, with what eliminating the board's poses needs.
struct Reduced<'a> {
    active: &'a [usize],
    moments: Vec<Equations>,
    shared: DMatrix<f64>,
    gradient: DVector<f64>,
}

impl<'a> Reduced<'a> {
    fn of(state: &State, unknown: &[Unknown], seen_at: &[f64], active: &'a [usize]) -> Reduced<'a> {
        let moments: Vec<Equations> =
            state.moments.par_iter().map(|moment| equations(state, moment, seen_at)).collect();
        let count = CAMERA_NUMBERS * state.cameras.len();
        let mut shared = DMatrix::zeros(count, count);
        let mut gradient = DVector::zeros(count);
        for camera in moments.iter().flat_map(|equations| &equations.cameras) {
            let first = CAMERA_NUMBERS * camera.camera;
            let mut block = shared.view_mut((first, first), (CAMERA_NUMBERS, CAMERA_NUMBERS));
            block += camera.own;
            let mut part = gradient.rows_mut(first, CAMERA_NUMBERS);
            part += camera.gradient;
        }
        for (camera, (film, unknown)) in state.cameras.iter().zip(unknown).enumerate() {
            for prior in priors(film, unknown) {
                let row = CAMERA_NUMBERS * camera + prior.number;
                shared[(row, row)] += prior.deviation.powi(-2);
                gradient[row] += prior.off * prior.deviation.powi(-2);
            }
        }
        let shared = shared.select_rows(active).select_columns(active);
        Reduced { active, moments, shared, gradient: gradient.select_rows(active) }
    }

    /// Equations of the cameras' active numbers without the board's poses.
    fn eliminated(&self, damping: f64) -> Option<(DMatrix<f64>, DVector<f64>)> {
        let mut matrix = self.shared.clone();
        for k in 0..matrix.nrows() {
            matrix[(k, k)] *= 1.0 + damping;
        }
        let mut gradient = self.gradient.clone();
        for equations in &self.moments {
            let board = damped(equations, damping).try_inverse()?;
            for one in &equations.cameras {
                let pulled = one.mixed * board;
                let by_gradient = pulled * equations.gradient;
                for (i, row) in self.rows_of(one.camera) {
                    gradient[row] -= by_gradient[i];
                }
                for other in &equations.cameras {
                    let block = pulled * other.mixed.transpose();
                    for (i, row) in self.rows_of(one.camera) {
                        for (j, column) in self.rows_of(other.camera) {
                            matrix[(row, column)] -= block[(i, j)];
                        }
                    }
                }
            }
        }
        Some((matrix, gradient))
    }

    /// The active numbers of a camera: their places among its numbers, and among all active ones.
    fn rows_of(&self, camera: usize) -> impl Iterator<Item = (usize, usize)> {
        let numbered = self.active.iter().enumerate();
        numbered
            .filter_map(move |(row, number)| Some((number.checked_sub(CAMERA_NUMBERS * camera)?, row)))
            .filter(|(number, _)| *number < CAMERA_NUMBERS)
    }

    fn step(&self, state: &State, damping: f64) -> Option<State> {
        let (matrix, gradient) = self.eliminated(damping)?;
        let found = -matrix.cholesky()?.solve(&gradient);
        let mut step = DVector::zeros(CAMERA_NUMBERS * state.cameras.len());
        self.active.iter().zip(found.iter()).for_each(|(number, by)| step[*number] = *by);
        let camera = |(camera, film): (usize, &FilmCamera)| {
            let by = &step.as_slice()[CAMERA_NUMBERS * camera..][..CAMERA_NUMBERS];
            FilmCamera {
                lens: film.lens.moved(by),
                place: moved(&film.place, &by[PLACE..CLOCK]),
                clock: film.clock + by[CLOCK],
                noise: film.noise,
            }
        };
        let cameras = state.cameras.iter().enumerate().map(camera).collect();
        let moment = |(equations, moment): (&Equations, &Moment)| {
            let mut right = equations.gradient;
            for one in &equations.cameras {
                right += one.mixed.transpose() * step.fixed_rows::<CAMERA_NUMBERS>(CAMERA_NUMBERS * one.camera);
            }
            let by = -(damped(equations, damping).try_inverse()? * right);
            Some(Moment { board: moved(&moment.board, by.as_slice()), ..moment.clone() })
        };
        let moments = self.moments.iter().zip(&state.moments).map(moment).collect::<Option<_>>()?;
        Some(State { cameras, moments })
    }
}

fn damped(equations: &Equations, damping: f64) -> SMatrix<f64, BOARD_NUMBERS, BOARD_NUMBERS> {
    let mut matrix = equations.board;
    for k in 0..BOARD_NUMBERS {
        matrix[(k, k)] = matrix[(k, k)] * (1.0 + damping) + 1e-9;
    }
    matrix
}
