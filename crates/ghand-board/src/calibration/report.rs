//! What was found, how sure it is, and what the user should know of it.

use glam::DVec2;
use nalgebra::{DMatrix, Matrix3, SMatrix};

use super::bundle::FilmCamera;
use super::equations::{CAMERA_NUMBERS, CLOCK, PLACE, squares};
use super::joint::{Cameras, Solved};
use super::lens::{FOCAL, PRINCIPAL};
use super::{BoardCalibration, CalibratedCamera, StandardErrors};
use crate::BoardCamera;

/// Cells along the longer edge of an image that corners are counted in.
const CELLS: f64 = 8.0;
/// What is told: a part of the image without corners, and standard errors of the focal length, of the direction (radians),
/// of the place (metres), and of the clock (seconds).
const LITTLE_COVERAGE: f64 = 0.4;
const UNSURE_FOCAL: f64 = 0.01;
const UNSURE_ROTATION: f64 = 0.005;
const UNSURE_PLACE: f64 = 0.003;
const UNSURE_CLOCK: f64 = 0.008;
/// A clock that differs by more from the given one is told, seconds.
const OTHER_CLOCK: f64 = 0.1;
/// Corners that are off by more than this many times the noise, and half the distance that is told, do not fit; from this part
/// of them on it is told.
const MISFIT: f64 = 6.0;
const MANY_MISFITS: f64 = 0.15;
/// A median distance of corners that is told, relative to the image's diagonal: a pixel of 640 x 480.
const LARGE_RESIDUAL: f64 = 1.0 / 800.0;

/// The calibration with what is to be told.
pub(super) fn report(all: &Cameras, solved: &Solved) -> BoardCalibration {
    let mut remarks: Vec<String> = all.kind.assumption().into_iter().collect();
    let mut cameras = vec![];
    for (k, (camera, film)) in all.cameras.iter().zip(&solved.state.cameras).enumerate() {
        let (residual, views, misfits) = residual(solved, k);
        let found = CalibratedCamera {
            lens: film.lens.at(&camera.id, &film.place),
            clock: film.clock,
            residual,
            views,
            coverage: coverage(camera),
            errors: errors(solved.adjusted.covariance.as_ref(), k, film),
        };
        tell(&found, all.cameras.len() > 1, film.lens.diagonal(), &mut remarks);
        if let Some(given) = camera.clock.filter(|given| k > 0 && (film.clock - given).abs() > OTHER_CLOCK) {
            let off = film.clock - given;
            remarks.push(format!(
                "{}: its clock differs from the given one by {off:+.2} s, as the board's movements say",
                camera.id
            ));
        }
        if misfits > MANY_MISFITS {
            remarks.push(format!(
                "{}: {:.0}% of the board's corners do not fit the others: the camera moved, its clock is wrong, or the board is \
                 not flat",
                camera.id,
                100.0 * misfits
            ));
        }
        cameras.push(found);
    }
    BoardCalibration { cameras, remarks }
}

/// The median distance of a camera's corners, pixels, the number of moments that it sees, and the part of the corners that
/// do not fit.
fn residual(solved: &Solved, camera: usize) -> (f64, usize, f64) {
    let clocks: Vec<f64> = solved.state.cameras.iter().map(|camera| camera.clock).collect();
    let mut found = vec![];
    let mut views = 0;
    let mut misfits = 0;
    let film = &solved.state.cameras[camera];
    let most = (MISFIT * film.noise).max(0.5 * LARGE_RESIDUAL * film.lens.diagonal());
    for moment in &solved.state.moments {
        for board in moment.seen.iter().filter(|board| board.camera == camera) {
            let squares = squares(&solved.state, moment, board, &clocks);
            let pairs = squares.iter().zip(&board.points);
            misfits += pairs.filter(|(square, point)| square.sqrt() > most + MISFIT * point.slack).count();
            found.extend(squares);
            views += 1;
        }
    }
    found.sort_by(f64::total_cmp);
    (found.get(found.len() / 2).map_or(0.0, |square| square.sqrt()), views, misfits as f64 / found.len().max(1) as f64)
}

/// The part of an image's cells in which corners were seen.
fn coverage(camera: &BoardCamera) -> f64 {
    let size = DVec2::from_array(camera.size.map(f64::from));
    let counts = (size * CELLS / size.max_element()).round().max(DVec2::ONE);
    let [columns, rows] = counts.to_array().map(|count| count as usize);
    let mut seen = vec![false; columns * rows];
    for corner in camera.views.iter().flat_map(|view| &view.corners) {
        let cell = (corner.pixel / size * counts).floor();
        if cell.cmpge(DVec2::ZERO).all() && cell.cmplt(counts).all() {
            seen[cell.y as usize * columns + cell.x as usize] = true;
        }
    }
    seen.iter().filter(|seen| **seen).count() as f64 / seen.len() as f64
}

fn errors(covariance: Option<&DMatrix<f64>>, camera: usize, film: &FilmCamera) -> StandardErrors {
    let Some(covariance) = covariance else {
        let unknown = f64::INFINITY;
        return StandardErrors {
            focal: unknown,
            principal: unknown,
            rotation: unknown,
            place: unknown,
            clock: unknown,
        };
    };
    let first = CAMERA_NUMBERS * camera;
    let deviation = |number: usize| covariance[(first + number, first + number)].max(0.0).sqrt();
    // The centre of projection moves by -R^T (shift + [t]x turn).
    let t = film.place.translation;
    let mut by_place = SMatrix::<f64, 3, 6>::zeros();
    let across = Matrix3::new(0.0, -t.z, t.y, t.z, 0.0, -t.x, -t.y, t.x, 0.0);
    by_place.fixed_view_mut::<3, 3>(0, 0).copy_from(&across);
    by_place.fixed_view_mut::<3, 3>(0, 3).copy_from(&Matrix3::identity());
    let of_place = covariance.fixed_view::<6, 6>(first + PLACE, first + PLACE);
    StandardErrors {
        focal: deviation(FOCAL),
        principal: deviation(PRINCIPAL).max(deviation(PRINCIPAL + 1)),
        rotation: (0..3).map(|k| deviation(PLACE + k).powi(2)).sum::<f64>().sqrt(),
        place: (by_place * of_place * by_place.transpose()).trace().max(0.0).sqrt(),
        clock: deviation(CLOCK),
    }
}

fn tell(found: &CalibratedCamera, has_others: bool, diagonal: f64, remarks: &mut Vec<String>) {
    let id = &found.lens.camera.id;
    let errors = &found.errors;
    if errors.focal > UNSURE_FOCAL {
        remarks.push(format!(
            "{id}: its focal length is uncertain by {:.1}%: the board is tilted too little or seen too seldom; show it near, \
             tilted by some 40 degrees to each side",
            100.0 * errors.focal
        ));
    }
    if found.coverage < LITTLE_COVERAGE {
        remarks.push(format!(
            "{id}: the board was seen in {:.0}% of the image only: elsewhere the lens's distortion is a guess; move the board \
             to all borders",
            100.0 * found.coverage
        ));
    }
    if found.residual > LARGE_RESIDUAL * diagonal {
        remarks.push(format!(
            "{id}: corners of the board are off by {:.1} pixels: it is not flat, moved too fast, or the camera moved",
            found.residual
        ));
    }
    if has_others && (errors.rotation > UNSURE_ROTATION || errors.place > UNSURE_PLACE) {
        remarks.push(format!(
            "{id}: its place is uncertain by {:.1} mm and {:.2} degrees: show the board to it and another camera at once for \
             longer",
            1e3 * errors.place,
            errors.rotation.to_degrees()
        ));
    }
    if has_others && errors.clock > UNSURE_CLOCK {
        remarks.push(format!(
            "{id}: the board moves too little to tell its clock: it is uncertain by {:.0} ms",
            1e3 * errors.clock
        ));
    }
}
