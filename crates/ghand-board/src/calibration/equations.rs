//! Errors of one moment and how they change with everything unknown: the normal equations of a Gauss-Newton step.

use nalgebra::{SMatrix, SVector};

use super::bundle::{Moment, SeenBoard, SeenPoint, State};
use super::lens::LENS_NUMBERS;

/// Numbers of a camera: its lens, its turn and shift, its clock.
pub(super) const CAMERA_NUMBERS: usize = LENS_NUMBERS + 7;
/// Place of turn, shift and clock in a camera's numbers.
pub(super) const PLACE: usize = LENS_NUMBERS;
pub(super) const CLOCK: usize = LENS_NUMBERS + 6;
/// Numbers of the board's pose: turn and shift.
pub(super) const BOARD_NUMBERS: usize = 6;

/// Squares of errors, in those of the noise, from which on they count less.
const OUTLIER: f64 = 9.0;
/// The square of the error of a corner behind its camera, in squares of the noise.
const BEHIND: f64 = 1e6;

/// Normal equations of one moment.
pub(super) struct Equations {
    /// Of the board's pose.
    pub board: SMatrix<f64, BOARD_NUMBERS, BOARD_NUMBERS>,
    /// Gradient of half the cost by it.
    pub gradient: SVector<f64, BOARD_NUMBERS>,
    /// Of the cameras that see it.
    pub cameras: Vec<OfCamera>,
}

/// The part of one camera.
pub(super) struct OfCamera {
    pub camera: usize,
    pub own: SMatrix<f64, CAMERA_NUMBERS, CAMERA_NUMBERS>,
    /// Between its numbers and those of the board's pose.
    pub mixed: SMatrix<f64, CAMERA_NUMBERS, BOARD_NUMBERS>,
    pub gradient: SVector<f64, CAMERA_NUMBERS>,
}

/// The cost of a squared error, and the weight of its square, by Cauchy's distribution.
fn cost_and_weight(squared: f64) -> (f64, f64) {
    (OUTLIER * (squared / OUTLIER).ln_1p(), 1.0 / (1.0 + squared / OUTLIER))
}

/// The squared errors of corners, square pixels.
pub(super) fn squares(state: &State, moment: &Moment, board: &SeenBoard, seen_at: &[f64]) -> Vec<f64> {
    let camera = &state.cameras[board.camera];
    let later = camera.clock - seen_at[board.camera];
    let square = |point: &SeenPoint| {
        let at = camera.place.apply(moment.board.apply(point.place));
        let seen = point.pixel + point.velocity * later;
        camera.lens.project(at).map_or(f64::INFINITY, |projected| projected.pixel.distance_squared(seen))
    };
    board.points.iter().map(square).collect()
}

/// The cost of a moment.
pub(super) fn cost(state: &State, moment: &Moment, seen_at: &[f64]) -> f64 {
    let mut sum = 0.0;
    for board in moment.seen.iter() {
        let noise = state.cameras[board.camera].noise;
        for (point, square) in board.points.iter().zip(squares(state, moment, board, seen_at)) {
            let variance = noise * noise + point.slack * point.slack;
            sum += cost_and_weight((square / variance).min(BEHIND)).0;
        }
    }
    sum
}

/// The normal equations of a moment.
pub(super) fn equations(state: &State, moment: &Moment, seen_at: &[f64]) -> Equations {
    let mut all = Equations { board: SMatrix::zeros(), gradient: SVector::zeros(), cameras: vec![] };
    for board in moment.seen.iter() {
        let camera = &state.cameras[board.camera];
        let later = camera.clock - seen_at[board.camera];
        let mut of_camera = OfCamera {
            camera: board.camera,
            own: SMatrix::zeros(),
            mixed: SMatrix::zeros(),
            gradient: SVector::zeros(),
        };
        for point in &board.points {
            let on_board = moment.board.rotation * point.place;
            let world = on_board + moment.board.translation;
            let turned = camera.place.rotation * world;
            let Some(projected) = camera.lens.project(turned + camera.place.translation) else { continue };
            let error = projected.pixel - (point.pixel + point.velocity * later);
            let variance = camera.noise * camera.noise + point.slack * point.slack;
            let weight = cost_and_weight(error.length_squared() / variance).1 / variance;
            for axis in 0..2 {
                let by_point = projected.by_point[axis];
                let by_world = camera.place.rotation.transpose() * by_point;
                let mut own = SVector::<f64, CAMERA_NUMBERS>::zeros();
                own.as_mut_slice()[..LENS_NUMBERS].copy_from_slice(&projected.by_lens[axis]);
                own.as_mut_slice()[PLACE..PLACE + 3].copy_from_slice(&turned.cross(by_point).to_array());
                own.as_mut_slice()[PLACE + 3..CLOCK].copy_from_slice(&by_point.to_array());
                own[CLOCK] = -point.velocity[axis];
                let turn = on_board.cross(by_world);
                let pose =
                    SVector::<f64, BOARD_NUMBERS>::from([turn.x, turn.y, turn.z, by_world.x, by_world.y, by_world.z]);
                let weighted = own * weight;
                of_camera.own += weighted * own.transpose();
                of_camera.mixed += weighted * pose.transpose();
                of_camera.gradient += weighted * error[axis];
                all.board += pose * pose.transpose() * weight;
                all.gradient += pose * (weight * error[axis]);
            }
        }
        all.cameras.push(of_camera);
    }
    all
}
