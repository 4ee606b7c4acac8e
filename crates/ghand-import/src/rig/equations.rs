//! Errors of one moment and how they change with everything unknown: the normal equations of a Gauss-Newton step.

use ghand_core::Camera;
use glam::{DMat3, DVec3};
use nalgebra::{DMatrix, DVector};

use super::lengths::BONES;
use super::noise::cost_and_weight;
use super::{LANDMARKS, Moment, Rig};

/// Numbers of a moment's points.
pub(super) const POINT_NUMBERS: usize = 3 * LANDMARKS;
/// Numbers of a camera: turn, shift, logarithm of the focal length, correction of the clock.
pub(super) const CAMERA_NUMBERS: usize = 8;
/// Place of the focal length and of the clock in a camera's numbers.
pub(super) const FOCAL: usize = 6;
pub(super) const CLOCK: usize = 7;
/// Place of the logarithm of the hand's size and of the bones in the shared numbers.
pub(super) const SIZE: usize = 0;
pub(super) const FIRST_BONE: usize = 1;
pub(super) const FIRST_CAMERA: usize = FIRST_BONE + BONES.len();

/// A point nearer to a camera than this, relative to the hand's size, is not seen by it, metres.
const NEAREST: f64 = 0.01;
/// Standard deviation of a bone's length between frames, metres at a hand of mean size. Much less than the noise of landmarks:
/// errors that lengths may follow make all of them longer.
const BONE_PLAY: f64 = 0.001;
/// The cost of a landmark that is behind its camera, in squares of the noise.
const BEHIND: f64 = 1e4;

/// How many shared numbers a rig has.
pub(super) fn shared_numbers(cameras: usize) -> usize {
    FIRST_CAMERA + CAMERA_NUMBERS * cameras
}

/// The points of a hand at one moment, world.
pub(crate) type Points = [DVec3; LANDMARKS];

/// Normal equations of one moment.
pub(super) struct Equations {
    /// Of the points.
    pub points: DMatrix<f64>,
    /// Between points and shared numbers.
    pub mixed: DMatrix<f64>,
    /// Of the shared numbers.
    pub shared: DMatrix<f64>,
    /// Gradients of half the cost.
    pub points_gradient: DVector<f64>,
    pub shared_gradient: DVector<f64>,
}

/// Receives each error in units of the noise: its numbers, and for each of them the derivatives by single unknowns (points
/// first, then shared numbers).
trait Sink {
    fn error(&mut self, numbers: &[f64], derivatives: &[Vec<(usize, f64)>]);
}

struct Cost {
    cost: f64,
    weighted_squares: f64,
    numbers: f64,
}

impl Sink for Cost {
    fn error(&mut self, numbers: &[f64], _: &[Vec<(usize, f64)>]) {
        let squared = numbers.iter().map(|e| e * e).sum();
        let (cost, weight) = cost_and_weight(squared, numbers.len() as f64);
        self.cost += cost;
        self.weighted_squares += weight * squared;
        self.numbers += numbers.len() as f64;
    }
}

impl Sink for Equations {
    fn error(&mut self, numbers: &[f64], derivatives: &[Vec<(usize, f64)>]) {
        let (_, weight) = cost_and_weight(numbers.iter().map(|e| e * e).sum(), numbers.len() as f64);
        for (error, row) in numbers.iter().zip(derivatives) {
            for &(i, di) in row {
                match i.checked_sub(POINT_NUMBERS) {
                    None => self.points_gradient[i] += weight * di * error,
                    Some(i) => self.shared_gradient[i] += weight * di * error,
                }
                for &(j, dj) in row {
                    let product = weight * di * dj;
                    match (i.checked_sub(POINT_NUMBERS), j.checked_sub(POINT_NUMBERS)) {
                        (None, None) => self.points[(i, j)] += product,
                        (None, Some(j)) => self.mixed[(i, j)] += product,
                        (Some(i), Some(j)) => self.shared[(i, j)] += product,
                        (Some(_), None) => {}
                    }
                }
            }
        }
    }
}

/// What the errors of a moment depend on, beside its points.
#[derive(Clone, Copy)]
pub(super) struct Problem<'a> {
    pub rig: &'a Rig,
    /// Lengths of the mean hand's bones, metres.
    pub lengths: &'a [f64; BONES.len()],
    /// Standard deviation of a landmark's coordinate, units of length.
    pub noise: f64,
    /// How many pixels of each camera a unit of length at the hand is, by moment and camera.
    pub scales: &'a [Vec<f64>],
    /// The clocks' corrections for which the views are; for others they move as fast as they do then.
    pub seen_at: &'a [f64],
}

impl Problem<'_> {
    /// Cost; sum of weighted squares; count of numbers.
    pub fn cost(&self, number: usize, moment: &Moment, points: &Points) -> [f64; 3] {
        let mut cost = Cost { cost: 0.0, weighted_squares: 0.0, numbers: 0.0 };
        self.errors(number, moment, points, &mut cost);
        [cost.cost, cost.weighted_squares, cost.numbers]
    }

    pub fn equations(&self, number: usize, moment: &Moment, points: &Points) -> Equations {
        let count = shared_numbers(self.rig.cameras.len());
        let mut equations = Equations {
            points: DMatrix::zeros(POINT_NUMBERS, POINT_NUMBERS),
            mixed: DMatrix::zeros(POINT_NUMBERS, count),
            shared: DMatrix::zeros(count, count),
            points_gradient: DVector::zeros(POINT_NUMBERS),
            shared_gradient: DVector::zeros(count),
        };
        self.errors(number, moment, points, &mut equations);
        equations
    }

    fn errors(&self, moment_number: usize, moment: &Moment, points: &Points, sink: &mut impl Sink) {
        let Problem { rig, lengths, noise, scales, seen_at } = *self;
        for (number, (view, camera)) in moment.iter().zip(&rig.cameras).enumerate() {
            let Some(view) = view else { continue };
            let deviation = noise * scales[moment_number][number];
            let later = rig.offsets[number] - seen_at[number];
            let first = POINT_NUMBERS + FIRST_CAMERA + CAMERA_NUMBERS * number;
            for (landmark, (seen, velocity)) in view.pixels.iter().zip(&view.velocities).enumerate() {
                let turned = camera.rotation * points[landmark];
                let at = turned + camera.translation;
                if at.z < NEAREST * rig.size {
                    sink.error(&[BEHIND.sqrt(), 0.0], &[vec![], vec![]]);
                    continue;
                }
                let error = (project(camera, at) - (*seen + *velocity * later)) / deviation;
                let scale = camera.focal / at.z / deviation;
                let rows = [
                    DVec3::new(scale.x, 0.0, -scale.x * at.x / at.z),
                    DVec3::new(0.0, scale.y, -scale.y * at.y / at.z),
                ];
                let from_principal = (project(camera, at) - camera.principal) / deviation;
                let derivatives = [0, 1].map(|axis| {
                    let by_point = camera.rotation.transpose() * rows[axis];
                    // The turn w moves the point by w x turned.
                    let by_turn = turned.cross(rows[axis]);
                    let mut row = Vec::with_capacity(3 + CAMERA_NUMBERS);
                    row.extend((0..3).map(|k| (3 * landmark + k, by_point[k])));
                    row.extend((0..3).map(|k| (first + k, by_turn[k])));
                    row.extend((0..3).map(|k| (first + 3 + k, rows[axis][k])));
                    row.push((first + FOCAL, from_principal[axis]));
                    row.push((first + CLOCK, -velocity[axis] / deviation));
                    row
                });
                sink.error(&error.to_array(), &derivatives);
            }
        }
        for (k, ((from, to), mean)) in BONES.into_iter().zip(lengths).enumerate() {
            let bone = points[to] - points[from];
            let along = bone.normalize_or_zero();
            let length = rig.size * mean * rig.bones[k].exp();
            let deviation = BONE_PLAY * rig.size;
            let mut row = Vec::with_capacity(8);
            row.extend((0..3).map(|axis| (3 * to + axis, along[axis] / deviation)));
            row.extend((0..3).map(|axis| (3 * from + axis, -along[axis] / deviation)));
            row.push((POINT_NUMBERS + SIZE, -length / deviation));
            row.push((POINT_NUMBERS + FIRST_BONE + k, -length / deviation));
            sink.error(&[(bone.length() - length) / deviation], &[row]);
        }
    }
}

fn project(camera: &Camera, at: DVec3) -> glam::DVec2 {
    at.truncate() / at.z * camera.focal + camera.principal
}

/// How many pixels of each camera a unit of length at each moment's hand is. They stay the same during a step: errors that are
/// measured by the hand's depth would move the hand away.
pub(super) fn scales(rig: &Rig, points: &[Option<Points>]) -> Vec<Vec<f64>> {
    let of_moment = |points: &Option<Points>| {
        let middle = points.map_or(DVec3::ZERO, |points| points.iter().sum::<DVec3>() / LANDMARKS as f64);
        let scale = |camera: &Camera| camera.focal.x / camera.camera_from_world(middle).z.max(NEAREST * rig.size);
        rig.cameras.iter().map(scale).collect()
    };
    points.iter().map(of_moment).collect()
}

/// Points where the lines of sight cross; where only one camera sees the hand, or lines are nearly parallel, nearer to what
/// the tracker guesses. `None` where no camera sees it.
pub(crate) fn first_points(moment: &Moment, cameras: &[Camera]) -> Option<Points> {
    /// How much a guess counts beside a line of sight.
    const GUESS_WEIGHT: f64 = 0.01;
    let mut matrices = [DMat3::ZERO; LANDMARKS];
    let mut vectors = [DVec3::ZERO; LANDMARKS];
    for (view, camera) in moment.iter().zip(cameras) {
        let Some(guess) = view.as_ref().and_then(|view| super::start::points_in_camera(view, camera)) else { continue };
        let Some(view) = view else { continue };
        let world_from_camera = camera.rotation.transpose();
        let center = camera.center();
        for k in 0..LANDMARKS {
            let ray = ((view.pixels[k] - camera.principal) / camera.focal).extend(1.0).normalize();
            let ray = world_from_camera * ray;
            let across = DMat3::IDENTITY - DMat3::from_cols(ray * ray.x, ray * ray.y, ray * ray.z);
            let guess = world_from_camera * (guess[k] - camera.translation);
            matrices[k] += across + DMat3::IDENTITY * GUESS_WEIGHT;
            vectors[k] += across * center + guess * GUESS_WEIGHT;
        }
    }
    let points: Points = std::array::from_fn(|k| matrices[k].inverse() * vectors[k]);
    points.iter().all(|point| point.is_finite()).then_some(points)
}
