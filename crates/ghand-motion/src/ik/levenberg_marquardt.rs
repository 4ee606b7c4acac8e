//! The Levenberg-Marquardt method for least squares inside a box, with a prior whose weight follows the residual.

use super::derivatives::Square;
use super::limits::{Coupling, Range};
use super::{LANDMARK_COUNT, UNKNOWNS};

/// Bounds of the residual that weights the prior, metres: exact landmarks still leave the twist of a straight finger
/// open, and a large residual in the first steps is not noise.
const LEAST_SIGMA: f64 = 1e-4;
const MOST_SIGMA: f64 = 0.01;

/// Steps smaller than this, radians or metres, have no visible effect.
const SMALL_STEP: f64 = 1e-5;

/// An almost undamped step that reduces the sum by less than this fraction is the last one.
const SMALL_GAIN: f64 = 1e-4;

/// Damping, as a fraction of the diagonal: at first, and when no step helps any more.
const FIRST_DAMPING: f64 = 1e-3;
const MOST_DAMPING: f64 = 1e8;

/// Least squares over [`UNKNOWNS`]; the last unknowns have one range each.
pub(super) trait Problem {
    /// Ranges of the last unknowns.
    fn ranges(&self) -> &[Range];
    /// Couplings among the last unknowns.
    fn couplings(&self) -> &[Coupling];
    /// Sum of the squared errors, square metres, or of what takes their place.
    fn squares(&self, x: &[f64; UNKNOWNS]) -> f64;
    /// Variance of an error, in the unit of `squares`, by which the prior is weighted.
    fn variance(&self, squares: f64) -> f64 {
        (squares / LANDMARK_COUNT as f64).clamp(LEAST_SIGMA * LEAST_SIGMA, MOST_SIGMA * MOST_SIGMA)
    }
    /// `J^T J` and `J^T e`.
    fn normal_equations(&self, x: &[f64; UNKNOWNS]) -> (Square, [f64; UNKNOWNS]);
    /// Replaces the unknowns by an equivalent vector, if one is better.
    fn settle(&self, x: &mut [f64; UNKNOWNS]);
}

/// The sum of the prior's squares, without their weight.
pub(super) fn prior(problem: &impl Problem, x: &[f64; UNKNOWNS]) -> f64 {
    let angles = &x[UNKNOWNS - problem.ranges().len()..];
    let alone = angles.iter().zip(problem.ranges()).map(|(c, range)| ((c - range.mean) / range.spread).powi(2));
    let coupled = problem.couplings().iter().map(|c| (c.error(angles) / c.spread).powi(2));
    alone.sum::<f64>() + coupled.sum::<f64>()
}

/// Matrix and gradient with the prior, and which unknowns are at a bound that they would leave: those stay, and have no
/// equation.
pub(super) fn equations(
    problem: &impl Problem,
    x: &[f64; UNKNOWNS],
    variance: f64,
) -> (Square, [f64; UNKNOWNS], [bool; UNKNOWNS]) {
    let ranges = problem.ranges();
    let couplings = problem.couplings();
    let free = UNKNOWNS - ranges.len();
    let (mut matrix, mut gradient) = problem.normal_equations(x);
    for (k, range) in ranges.iter().enumerate() {
        let weight = variance / (range.spread * range.spread);
        matrix[free + k][free + k] += weight;
        gradient[free + k] += weight * (x[free + k] - range.mean);
    }
    for c in couplings {
        let weight = variance / (c.spread * c.spread);
        let of = free + c.of;
        let with = free + c.with;
        let error = c.error(&x[free..]);
        matrix[of][of] += weight;
        matrix[with][with] += weight * c.ratio * c.ratio;
        matrix[of][with] -= weight * c.ratio;
        matrix[with][of] -= weight * c.ratio;
        gradient[of] += weight * error;
        gradient[with] -= weight * c.ratio * error;
    }
    let mut stays = [false; UNKNOWNS];
    for (k, range) in ranges.iter().enumerate() {
        let at = free + k;
        let value = x[free + k];
        if (value <= range.low && gradient[at] > 0.0) || (value >= range.high && gradient[at] < 0.0) {
            for other in 0..UNKNOWNS {
                matrix[at][other] = 0.0;
                matrix[other][at] = 0.0;
            }
            matrix[at][at] = 1.0;
            gradient[at] = 0.0;
            stays[at] = true;
        }
    }
    (matrix, gradient, stays)
}

/// The unknowns at the minimum near `start`, and the number of steps tried, at most `most`.
pub(super) fn minimize(problem: &impl Problem, start: [f64; UNKNOWNS], most: usize) -> ([f64; UNKNOWNS], usize) {
    let ranges = problem.ranges();
    let free = UNKNOWNS - ranges.len();
    let mut x = start;
    let mut squares = problem.squares(&x);
    let mut damping = FIRST_DAMPING;
    let mut steps = 0;
    'outer: while steps < most && squares.is_finite() {
        let variance = problem.variance(squares);
        let cost = squares + variance * prior(problem, &x);
        let (matrix, gradient, _) = equations(problem, &x, variance);
        loop {
            steps += 1;
            let mut tried = x;
            let mut largest = 0.0f64;
            if let Some(step) = damped_step(&matrix, &gradient, damping) {
                for (value, step) in tried.iter_mut().zip(&step) {
                    *value -= step;
                }
                for (value, range) in tried[free..].iter_mut().zip(ranges) {
                    *value = value.clamp(range.low, range.high);
                }
                largest = tried.iter().zip(&x).fold(0.0, |most: f64, (a, b)| most.max((a - b).abs()));
            }
            let tried_squares = problem.squares(&tried);
            let tried_cost = tried_squares + variance * prior(problem, &tried);
            if tried_cost < cost {
                let settled = damping <= FIRST_DAMPING && cost - tried_cost < SMALL_GAIN * cost;
                problem.settle(&mut tried);
                (x, squares) = (tried, tried_squares);
                damping = (damping * 0.2).max(1e-9);
                if settled || largest < SMALL_STEP {
                    break 'outer;
                }
                break;
            }
            damping *= 5.0;
            if steps >= most || damping > MOST_DAMPING || largest < SMALL_STEP {
                break 'outer;
            }
        }
    }
    (x, steps)
}

/// The solution of `(A + damping diag(A)) step = gradient` by Cholesky factorisation; `None` if the matrix is not
/// positive.
fn damped_step(
    matrix: &[[f64; UNKNOWNS]; UNKNOWNS],
    gradient: &[f64; UNKNOWNS],
    damping: f64,
) -> Option<[f64; UNKNOWNS]> {
    let mut lower = Box::new([[0.0; UNKNOWNS]; UNKNOWNS]);
    for i in 0..UNKNOWNS {
        for j in 0..=i {
            let mut sum = matrix[i][j];
            if i == j {
                // Landmarks are in metres: unknowns that no landmark determines must stay bounded.
                sum += damping * (sum + 1e-9);
            }
            sum -= lower[i][..j].iter().zip(&lower[j][..j]).map(|(a, b)| a * b).sum::<f64>();
            if i == j {
                if sum.is_nan() || sum <= 0.0 {
                    return None;
                }
                lower[i][i] = sum.sqrt();
            } else {
                lower[i][j] = sum / lower[j][j];
            }
        }
    }
    let mut step = *gradient;
    for i in 0..UNKNOWNS {
        let sum: f64 = lower[i][..i].iter().zip(&step[..i]).map(|(a, b)| a * b).sum();
        step[i] = (step[i] - sum) / lower[i][i];
    }
    for i in (0..UNKNOWNS).rev() {
        let sum: f64 = (i + 1..UNKNOWNS).map(|j| lower[j][i] * step[j]).sum();
        step[i] = (step[i] - sum) / lower[i][i];
    }
    step.iter().all(|value| value.is_finite()).then_some(step)
}
