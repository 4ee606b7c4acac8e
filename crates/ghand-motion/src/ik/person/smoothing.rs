//! Poses of a film, all frames together: a hand speeds up and slows down only so much between frames.
//!
//! The velocity of each unknown changes from one step to the next by a random amount, whose variance is [`AGILITY`] times
//! the time between. How agile this hand is, as a multiple of that, the film itself tells: of some values the one by which
//! frames that are left out are predicted best from their neighbours, or a larger one where the hand moves more than that
//! allows for. Where a finger is hidden, or one camera cannot tell its depth, the frames before and after do.
//!
//! The method is Gauss and Newton's over all frames. The root turns by small rotations after its own (world axes), so that
//! no rotation vector is far from zero.

use ghand_core::rotation::{axis_angle_from_rotation, rotation_from_axis_angle};
use glam::{DMat3, DVec3};

use super::frame::FrameFit;
use crate::ik::derivatives::left_jacobian;
use crate::ik::levenberg_marquardt::equations;
use crate::ik::{UNKNOWNS, WARM_STEPS, read, write};

/// What the variance of a velocity grows by in a second: of angles, rad^2/s^3, and of the hand's place, m^2/s^3. A finger
/// that bends and stretches by a radian in turns of 1.5 s has some 20.
const AGILITY: [f64; 2] = [10.0, 0.1];
/// The multiples of it that are tried. By the last one, pictures that have nothing to do with each other stay as they are.
const MULTIPLES: [f64; 6] = [0.01, 0.1, 1.0, 10.0, 100.0, 1e4];
/// Frames that are further apart than this, seconds, tell nothing of each other.
const LONGEST_GAP: f64 = 0.2;
/// Fewer frames than this in a row are left as they are; of more than so many, the equations would take too much memory.
const LEAST_FRAMES: usize = 5;
const MOST_FRAMES: usize = 1000;
/// Every so many frames one is left out to choose a multiple, of so many at most.
const LEFT_OUT_EVERY: usize = 4;
const MOST_TRIED: usize = 240;
/// Steps of all frames together, and of those that choose the multiple.
const STEPS: usize = 6;
const TRIED_STEPS: usize = 3;
/// A step that gains less than this part of the cost is the last one.
const SMALL_GAIN: f64 = 1e-4;
/// Attempts at a step, each more damped.
const ATTEMPTS: usize = 4;
const FIRST_DAMPING: f64 = 1e-3;
const MORE_DAMPING: f64 = 30.0;
/// Unknowns that are next to each other in the equations: those of a frame and of the two after it.
const BAND: usize = 3 * UNKNOWNS;

/// A frame of a film.
#[derive(Clone, Copy)]
pub(crate) struct FilmFrame<'a> {
    /// What was seen.
    pub fit: FrameFit<'a>,
    /// Seconds.
    pub time: f64,
    /// The pose by itself, then together with the others.
    pub x: [f64; UNKNOWNS],
    /// Whether what was seen does not count: its pose is that of its neighbours.
    is_left_out: bool,
}

impl<'a> FilmFrame<'a> {
    pub fn new(fit: FrameFit<'a>, time: f64, x: [f64; UNKNOWNS]) -> Self {
        FilmFrame { fit, time, x, is_left_out: false }
    }
}

/// Smooths the poses of frames in the order of their times. Returns the multiple of [`AGILITY`] that was chosen; `None` if
/// there are too few frames in a row.
pub(crate) fn smooth(frames: &mut [FilmFrame]) -> Option<f64> {
    let mut runs: Vec<&mut [FilmFrame]> = frames
        .chunk_by_mut(|a, b| b.time > a.time && b.time - a.time <= LONGEST_GAP)
        .flat_map(|run| run.chunks_mut(MOST_FRAMES))
        .filter(|run| run.len() >= LEAST_FRAMES)
        .collect();
    for run in &mut runs {
        retry_from_neighbours(run);
    }
    let longest = runs.iter().max_by_key(|run| run.len())?;
    let tried = &longest[..longest.len().min(MOST_TRIED)];
    let errors = MULTIPLES.map(|multiple| error_of_left_out(tried, multiple));
    let best = (0..MULTIPLES.len()).min_by(|a, b| errors[*a].total_cmp(&errors[*b]))?;
    let alone: f64 = tried.iter().map(|frame| frame.fit.cost(&frame.x)).sum();
    // What is smoothed away, and what is left of it, are one square for each unknown if both are as large as expected.
    let allows = |multiple: &&f64| {
        let mut together = tried.to_vec();
        minimize(&mut together, **multiple, TRIED_STEPS);
        total_cost(&together, **multiple) - alone < (tried.len() * UNKNOWNS) as f64
    };
    let multiple = *MULTIPLES[best..].iter().find(allows).unwrap_or(&MULTIPLES[MULTIPLES.len() - 1]);
    for run in runs {
        minimize(run, multiple, STEPS);
    }
    Some(multiple)
}

/// A finger that has gone astray in one frame is tried again from where it was before and after.
fn retry_from_neighbours(run: &mut [FilmFrame]) {
    for k in 1..run.len() - 1 {
        let mut best = (run[k].fit.cost(&run[k].x), run[k].x);
        for other in [run[k - 1].x, run[k + 1].x] {
            let tried = run[k].fit.solve(other, WARM_STEPS);
            if tried.0 < best.0 {
                best = tried;
            }
        }
        run[k].x = best.1;
    }
}

/// How badly frames that are left out are predicted by the others.
fn error_of_left_out(run: &[FilmFrame], multiple: f64) -> f64 {
    let mut frames = run.to_vec();
    let left_out = |k: usize| k % LEFT_OUT_EVERY == LEFT_OUT_EVERY / 2;
    for (k, frame) in frames.iter_mut().enumerate() {
        frame.is_left_out = left_out(k);
    }
    minimize(&mut frames, multiple, TRIED_STEPS);
    frames.iter().filter(|frame| frame.is_left_out).map(|frame| frame.fit.sighting_cost(&frame.x)).sum()
}

/// Steps to the most probable poses of a run.
fn minimize(run: &mut [FilmFrame], multiple: f64, steps: usize) {
    let mut cost = total_cost(run, multiple);
    let mut damping = FIRST_DAMPING;
    for _ in 0..steps {
        let (band, gradient) = normal_equations(run, multiple);
        let mut gained = None;
        for _ in 0..ATTEMPTS {
            let Some(step) = solve(&band, &gradient, damping) else { break };
            let mut tried = run.to_vec();
            for (frame, step) in tried.iter_mut().zip(step.chunks_exact(UNKNOWNS)) {
                follow(frame, step);
            }
            let tried_cost = total_cost(&tried, multiple);
            if tried_cost < cost {
                run.copy_from_slice(&tried);
                gained = Some(cost - tried_cost);
                cost = tried_cost;
                damping /= MORE_DAMPING;
                break;
            }
            damping *= MORE_DAMPING;
        }
        if gained.is_none_or(|gain| gain < SMALL_GAIN * cost) {
            break;
        }
    }
}

fn total_cost(run: &[FilmFrame], multiple: f64) -> f64 {
    let seen = |frame: &FilmFrame| {
        if frame.is_left_out { frame.fit.prior(&frame.x) } else { frame.fit.cost(&frame.x) }
    };
    let jumps: f64 = run
        .windows(3)
        .map(|three| {
            let bend = Bend::of(three, multiple);
            bend.change
                .iter()
                .zip(bend.information)
                .map(|(change, information)| information * change * change)
                .sum::<f64>()
        })
        .sum();
    run.iter().map(seen).sum::<f64>() + jumps
}

/// How the velocities change at the middle one of three frames.
struct Bend {
    change: [f64; UNKNOWNS],
    information: [f64; UNKNOWNS],
    /// How much the change is moved by the unknowns of each of the three.
    moves: [f64; 3],
}

impl Bend {
    fn of(three: &[FilmFrame], multiple: f64) -> Bend {
        let [before, after] = [three[1].time - three[0].time, three[2].time - three[1].time];
        let moves = [1.0 / before, -1.0 / before - 1.0 / after, 1.0 / after];
        let mut change: [f64; UNKNOWNS] =
            std::array::from_fn(|k| (0..3).map(|frame| moves[frame] * three[frame].x[k]).sum());
        let [first, middle, last] = [0, 1, 2].map(|k| rotation_from_axis_angle(read(&three[k].x, 0)));
        let turned = |from: DMat3, to: DMat3| axis_angle_from_rotation(&(to * from.transpose()));
        write(&mut change, 0, turned(middle, last) / after - turned(first, middle) / before);
        let variance = multiple * 0.5 * (before + after);
        let place = 1.0 / (variance * AGILITY[1]);
        let angle = 1.0 / (variance * AGILITY[0]);
        Bend { change, information: std::array::from_fn(|k| if (3..6).contains(&k) { place } else { angle }), moves }
    }
}

/// A row of `BAND` numbers for each unknown: from the diagonal on, to the right.
type Band = Vec<[f64; BAND]>;

/// The equations of all frames for the steps: the root's small rotation, then the other unknowns.
fn normal_equations(run: &[FilmFrame], multiple: f64) -> (Band, Vec<f64>) {
    let mut band: Band = vec![[0.0; BAND]; run.len() * UNKNOWNS];
    let mut gradient = vec![0.0; run.len() * UNKNOWNS];
    for (k, frame) in run.iter().enumerate() {
        let (matrix, own) = frame_equations(frame);
        for i in 0..UNKNOWNS {
            gradient[k * UNKNOWNS + i] += own[i];
            (i..UNKNOWNS).for_each(|j| band[k * UNKNOWNS + i][j - i] += matrix[i][j]);
        }
    }
    for (k, three) in run.windows(3).enumerate() {
        let bend = Bend::of(three, multiple);
        for unknown in 0..UNKNOWNS {
            for a in 0..3 {
                let row = (k + a) * UNKNOWNS + unknown;
                let felt = bend.information[unknown] * bend.moves[a];
                gradient[row] += felt * bend.change[unknown];
                (a..3).for_each(|b| band[row][(b - a) * UNKNOWNS] += felt * bend.moves[b]);
            }
        }
    }
    (band, gradient)
}

/// Of one frame by itself, with the root's small rotation in place of the change of its rotation vector.
fn frame_equations(frame: &FilmFrame) -> (Vec<[f64; UNKNOWNS]>, [f64; UNKNOWNS]) {
    let seen = if frame.is_left_out { frame.fit.without_sightings() } else { frame.fit };
    let (matrix, mut gradient, _) = equations(&seen, &frame.x, 1.0);
    let mut matrix = matrix.to_vec();
    let back = left_jacobian(read(&frame.x, 0)).inverse();
    let mixed = back.transpose() * read(&gradient, 0);
    write(&mut gradient, 0, mixed);
    for row in &mut matrix {
        let mixed = back.transpose() * read(row, 0);
        write(row, 0, mixed);
    }
    let columns: [[f64; UNKNOWNS]; 3] = std::array::from_fn(|k| matrix[k]);
    for (k, row) in matrix.iter_mut().take(3).enumerate() {
        *row = std::array::from_fn(|j| (0..3).map(|i| back.col(k)[i] * columns[i][j]).sum());
    }
    (matrix, gradient)
}

fn follow(frame: &mut FilmFrame, step: &[f64]) {
    let mut x = frame.x;
    let root = rotation_from_axis_angle(-DVec3::from_slice(step)) * rotation_from_axis_angle(read(&x, 0));
    x.iter_mut().zip(step).skip(3).for_each(|(value, step)| *value -= step);
    write(&mut x, 0, axis_angle_from_rotation(&root));
    frame.fit.keep_in_range(&mut x);
    frame.x = x;
}

/// The solution of `(A + damping diag(A)) step = gradient` by Cholesky's factorisation; `None` if A is not positive.
fn solve(band: &Band, gradient: &[f64], damping: f64) -> Option<Vec<f64>> {
    // The factor's transpose, rows from the diagonal to the right.
    let mut upper = band.clone();
    let count = upper.len();
    for row in &mut upper {
        row[0] *= 1.0 + damping;
    }
    let mut step = gradient.to_vec();
    for i in 0..count {
        let pivot = upper[i][0];
        if pivot.is_nan() || pivot <= 0.0 {
            return None;
        }
        let scale = pivot.sqrt().recip();
        upper[i].iter_mut().for_each(|value| *value *= scale);
        step[i] *= scale;
        let row = upper[i];
        for k in 1..BAND.min(count - i) {
            let factor = row[k];
            if factor != 0.0 {
                step[i + k] -= factor * step[i];
                upper[i + k].iter_mut().zip(&row[k..]).for_each(|(value, other)| *value -= factor * other);
            }
        }
    }
    for i in (0..count).rev() {
        let known: f64 = (1..BAND.min(count - i)).map(|k| upper[i][k] * step[i + k]).sum();
        step[i] = (step[i] - known) / upper[i][0];
    }
    step.iter().all(|value| value.is_finite()).then_some(step)
}

#[cfg(test)]
mod tests;
