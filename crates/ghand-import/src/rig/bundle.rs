//! Refines cameras, clocks and the hand's lengths together with the hand's points at all moments (bundle adjustment).
//!
//! Levenberg and Marquardt's method; the points of each moment are eliminated by Schur's complement. The noise of the
//! landmarks starts large and is measured on the way, so that wrong landmarks and frames are told from right ones by
//! degrees. The same input gives the same bits for any number of threads.

use ghand_core::rotation::rotation_from_axis_angle;
use ghand_motion::image_landmarks::UsualFocal;
use glam::DVec3;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::equations::{
    CAMERA_NUMBERS, CLOCK, Equations, FIRST_BONE, FIRST_CAMERA, FOCAL, POINT_NUMBERS, Points, Problem, SIZE,
    first_points, scales, shared_numbers,
};
use super::lengths::BONES;
use super::points_factor::PointsFactor;
use super::{Moment, Rig, Unknowns};

/// Standard deviation of the logarithm of a bone's length beyond the hand's size: 5 % among people, and as much between
/// a tracker's idea of a joint and a model's.
const BONE_DEVIATION: f64 = 0.1;
/// Noise of landmarks at first, and its bounds, metres.
const FIRST_NOISE: f64 = 0.02;
const LEAST_NOISE: f64 = 2e-4;
const MOST_NOISE: f64 = 0.03;
/// The noise falls at most by this factor at once.
const NOISE_FALL: f64 = 0.7;
/// Steps of the method.
const STEPS: usize = 60;
/// Steps that lower the cost by less than this part, with a settled noise, end it.
const SMALL_CHANGE: f64 = 1e-5;
/// Damping at first, and the one at which no step helps.
const FIRST_DAMPING: f64 = 1e-3;
const MOST_DAMPING: f64 = 1e6;

/// A refined rig, and the standard deviation of a landmark's coordinate, metres at a hand of mean size. `focals` are the
/// likeliest focal lengths without any image.
pub fn refine(
    rig: &Rig,
    moments: &[Moment],
    lengths: &[f64; BONES.len()],
    unknowns: Unknowns,
    focals: &[UsualFocal],
) -> (Rig, f64) {
    let active = active(rig, unknowns);
    let seen_at = rig.offsets.clone();
    let mut rig = rig.clone();
    let mut points: Vec<Option<Points>> = moments.par_iter().map(|moment| first_points(moment, &rig.cameras)).collect();
    let mut noise = FIRST_NOISE;
    let mut damping = FIRST_DAMPING;
    for _ in 0..STEPS {
        let scales = scales(&rig, &points);
        let deviation = noise * rig.size;
        let problem = Problem { rig: &rig, lengths, noise: deviation, scales: &scales, seen_at: &seen_at };
        let [cost, squares, numbers] = total(&problem, moments, &points);
        let cost = cost + prior_cost(&rig, focals);
        let seen = points.iter().flatten().count();
        let free = numbers - (POINT_NUMBERS * seen) as f64 - active.len() as f64;
        let measured = (noise * (squares / free.max(0.1 * numbers).max(1.0)).sqrt()).clamp(LEAST_NOISE, MOST_NOISE);
        let reduced = Reduced::of(&problem, moments, &points, &active, focals);
        let mut stepped = None;
        while damping < MOST_DAMPING {
            if let Some((moved, moved_points)) = reduced.step(&rig, &points, &active, damping) {
                let problem = Problem { rig: &moved, ..problem };
                let moved_cost = total(&problem, moments, &moved_points)[0] + prior_cost(&moved, focals);
                if moved_cost < cost {
                    stepped = Some((moved, moved_points, moved_cost));
                    damping = (damping * 0.2).max(1e-9);
                    break;
                }
            }
            damping *= 5.0;
        }
        let next = measured.max(noise * NOISE_FALL);
        let is_settled = (next / noise - 1.0).abs() < 0.01;
        noise = next;
        match stepped {
            Some((moved, moved_points, moved_cost)) => {
                (rig, points) = (moved, moved_points);
                if is_settled && cost - moved_cost < SMALL_CHANGE * cost.abs() {
                    break;
                }
            }
            None if is_settled => break,
            None => damping = FIRST_DAMPING,
        }
    }
    (rig, noise)
}

/// The shared numbers that are unknown.
fn active(rig: &Rig, unknowns: Unknowns) -> Vec<usize> {
    let mut active: Vec<usize> = (FIRST_BONE..FIRST_CAMERA).collect();
    if unknowns.size {
        active.push(SIZE);
    }
    for camera in 0..rig.cameras.len() {
        let first = FIRST_CAMERA + CAMERA_NUMBERS * camera;
        if unknowns.places && camera > 0 {
            active.extend(first..first + FOCAL);
        }
        if unknowns.focals {
            active.push(first + FOCAL);
        }
        if unknowns.clocks && camera > 0 {
            active.push(first + CLOCK);
        }
    }
    active.sort_unstable();
    active
}

fn total(problem: &Problem, moments: &[Moment], points: &[Option<Points>]) -> [f64; 3] {
    let costs: Vec<[f64; 3]> = (moments.par_iter().zip(points).enumerate())
        .filter_map(|(k, (moment, points))| points.as_ref().map(|points| problem.cost(k, moment, points)))
        .collect();
    costs.iter().fold([0.0; 3], |sum, cost| std::array::from_fn(|k| sum[k] + cost[k]))
}

fn prior_cost(rig: &Rig, focals: &[UsualFocal]) -> f64 {
    let bones: f64 = rig.bones.iter().map(|bone| (bone / BONE_DEVIATION).powi(2)).sum();
    let zooms = zooms(rig, focals);
    let mean = zooms.iter().sum::<f64>() / zooms.len() as f64;
    let spread = UsualFocal::spread(focals);
    let cost = |(zoom, usual): (&f64, &UsualFocal)| (zoom / usual.deviation).powi(2) + ((zoom - mean) / spread).powi(2);
    bones + zooms.iter().zip(focals).map(cost).sum::<f64>()
}

/// Logarithms of the focal lengths relative to the usual ones.
fn zooms(rig: &Rig, focals: &[UsualFocal]) -> Vec<f64> {
    rig.cameras.iter().zip(focals).map(|(camera, usual)| (camera.focal.x / usual.pixels).ln()).collect()
}

/// The normal equations of all moments, with what eliminating their points needs.
struct Reduced {
    moments: Vec<Option<Equations>>,
    shared: DMatrix<f64>,
    gradient: DVector<f64>,
}

impl Reduced {
    fn of(
        problem: &Problem,
        moments: &[Moment],
        points: &[Option<Points>],
        active: &[usize],
        focals: &[UsualFocal],
    ) -> Reduced {
        let of_moment = |(k, (moment, points)): (usize, (&Moment, &Option<Points>))| {
            let all = problem.equations(k, moment, points.as_ref()?);
            Some(Equations {
                mixed: all.mixed.select_columns(active),
                shared: all.shared.select_rows(active).select_columns(active),
                shared_gradient: all.shared_gradient.select_rows(active),
                ..all
            })
        };
        let moments: Vec<Option<Equations>> = moments.par_iter().zip(points).enumerate().map(of_moment).collect();
        let mut shared = DMatrix::zeros(active.len(), active.len());
        let mut gradient = DVector::zeros(active.len());
        for equations in moments.iter().flatten() {
            shared += &equations.shared;
            gradient += &equations.shared_gradient;
        }
        let zooms = zooms(problem.rig, focals);
        let mean = zooms.iter().sum::<f64>() / zooms.len() as f64;
        let place = |number: usize| active.iter().position(|other| *other == number);
        for (k, bone) in problem.rig.bones.iter().enumerate() {
            if let Some(row) = place(FIRST_BONE + k) {
                shared[(row, row)] += BONE_DEVIATION.powi(-2);
                gradient[row] += bone * BONE_DEVIATION.powi(-2);
            }
        }
        let spread = UsualFocal::spread(focals).powi(-2);
        for (camera, (zoom, usual)) in zooms.iter().zip(focals).enumerate() {
            let Some(row) = place(FIRST_CAMERA + CAMERA_NUMBERS * camera + FOCAL) else { continue };
            let weight = usual.deviation.powi(-2);
            shared[(row, row)] += weight + spread;
            gradient[row] += zoom * weight + (zoom - mean) * spread;
            for other in 0..zooms.len() {
                if let Some(column) = place(FIRST_CAMERA + CAMERA_NUMBERS * other + FOCAL) {
                    shared[(row, column)] -= spread / zooms.len() as f64;
                }
            }
        }
        Reduced { moments, shared, gradient }
    }

    /// Shared equations without the points: matrix, gradient.
    fn eliminated(&self, damping: f64) -> Option<(DMatrix<f64>, DVector<f64>)> {
        let one = |equations: &Option<Equations>| {
            let Some(equations) = equations else { return Some(None) };
            let factor = PointsFactor::of(damped(&equations.points, damping))?;
            let mut mixed = equations.mixed.clone();
            let mut gradient = equations.points_gradient.clone();
            factor.solve_lower(&mut mixed);
            factor.solve_lower(&mut gradient);
            let transposed = mixed.transpose();
            Some(Some((&transposed * mixed, transposed * gradient)))
        };
        let parts: Vec<_> = self.moments.par_iter().map(one).collect();
        let mut matrix = damped(&self.shared, damping);
        let mut gradient = self.gradient.clone();
        for part in parts {
            if let Some((by_matrix, by_gradient)) = part? {
                matrix -= by_matrix;
                gradient -= by_gradient;
            }
        }
        Some((matrix, gradient))
    }

    fn step(
        &self,
        rig: &Rig,
        points: &[Option<Points>],
        active: &[usize],
        damping: f64,
    ) -> Option<(Rig, Vec<Option<Points>>)> {
        let (matrix, gradient) = self.eliminated(damping)?;
        let step = -matrix.cholesky()?.solve(&gradient);
        let moved = |(equations, points): (&Option<Equations>, &Option<Points>)| {
            let (Some(equations), Some(points)) = (equations, points) else { return Some(None) };
            let mut by = -(&equations.points_gradient + &equations.mixed * &step);
            let factor = PointsFactor::of(damped(&equations.points, damping))?;
            factor.solve_lower(&mut by);
            factor.solve_upper(&mut by);
            Some(Some(std::array::from_fn(|k| points[k] + DVec3::new(by[3 * k], by[3 * k + 1], by[3 * k + 2]))))
        };
        let points = self.moments.par_iter().zip(points).map(moved).collect::<Option<Vec<_>>>()?;
        Some((moved_rig(rig, active, &step), points))
    }
}

fn damped(matrix: &DMatrix<f64>, damping: f64) -> DMatrix<f64> {
    let mut damped = matrix.clone();
    for k in 0..matrix.nrows() {
        damped[(k, k)] += damping * matrix[(k, k)] + 1e-12;
    }
    damped
}

fn moved_rig(rig: &Rig, active: &[usize], step: &DVector<f64>) -> Rig {
    let mut all = vec![0.0; shared_numbers(rig.cameras.len())];
    active.iter().zip(step.iter()).for_each(|(number, by)| all[*number] = *by);
    let mut rig = rig.clone();
    rig.size *= all[SIZE].exp();
    rig.bones.iter_mut().zip(&all[FIRST_BONE..]).for_each(|(bone, by)| *bone += by);
    for (k, camera) in rig.cameras.iter_mut().enumerate() {
        let by = &all[FIRST_CAMERA + CAMERA_NUMBERS * k..][..CAMERA_NUMBERS];
        camera.rotation = rotation_from_axis_angle(DVec3::from_slice(by)) * camera.rotation;
        camera.translation += DVec3::from_slice(&by[3..]);
        camera.focal *= by[FOCAL].exp();
        rig.offsets[k] += by[CLOCK];
    }
    rig
}
