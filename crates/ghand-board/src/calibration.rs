//! Lenses, places and clocks of cameras from what they saw of the board.

mod bundle;
mod checks;
mod choice;
mod clocks;
mod equations;
pub(crate) mod homography;
mod intrinsics;
mod joint;
mod lens;
mod placing;
mod pose;
mod report;
mod signal;
mod track;

use ghand_capture::cameras::list::LensCamera;
use rayon::prelude::*;

use crate::{BoardCamera, BoardError, BoardKind};
use bundle::FilmCamera;
use checks::{check_gap, check_seen, check_views};
use choice::different;
use clocks::clocks;
use intrinsics::lens_alone;
use joint::{Cameras, solve_together};
use lens::Coefficients;
use track::Track;

/// Images of a camera from which its lens is found first.
const LENS_VIEWS: usize = 40;
/// A median error of corners beyond this part of the image's diagonal means that they are not such a board's.
const MOST_ERROR: f64 = 0.005;

/// Cameras calibrated by a board.
#[derive(Debug, Clone, PartialEq)]
pub struct BoardCalibration {
    /// In the given order.
    pub cameras: Vec<CalibratedCamera>,
    /// What the user should know, one sentence each.
    pub remarks: Vec<String>,
}

/// One camera, and how sure it is.
#[derive(Debug, Clone, PartialEq)]
pub struct CalibratedCamera {
    /// Lens and place, metres; the first camera is at the world's origin and looks along z, x to the right, y down.
    pub lens: LensCamera,
    /// What to add to the first camera's time to have this one's, seconds.
    pub clock: f64,
    /// Median distance of the corners from where they should be, pixels.
    pub residual: f64,
    /// Moments with the board in this camera from which it was calibrated.
    pub views: usize,
    /// The part of the image in which corners were seen, `[0, 1]`.
    pub coverage: f64,
    /// How sure the numbers are.
    pub errors: StandardErrors,
}

/// Standard deviations of a camera's numbers, as the errors of corners and their arrangement tell; infinite where the
/// images do not tell a number.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StandardErrors {
    /// Of the focal length, relative to it.
    pub focal: f64,
    /// Of the principal point, pixels: of each coordinate, the larger one.
    pub principal: f64,
    /// Of the camera's direction, radians; 0 for the first camera.
    pub rotation: f64,
    /// Of its place, metres; 0 for the first camera.
    pub place: f64,
    /// Of its clock, seconds; 0 for the first camera.
    pub clock: f64,
}

/// Calibrates cameras that stand still, from what they saw of a board that was moved about.
///
/// # Errors
/// [`BoardError`], one sentence with the remedy: a camera never sees the board, sees another one, or too little of it; cameras
/// do not see it at the same time; a clock is not known and the board's movements do not tell it.
pub fn calibrate(kind: &BoardKind, cameras: &[BoardCamera]) -> Result<BoardCalibration, BoardError> {
    for camera in cameras {
        check_seen(camera, kind)?;
        check_gap(camera, kind)?;
    }
    let tracks: Vec<Track> = cameras.iter().map(|camera| Track::of(camera, kind)).collect();
    for (camera, track) in cameras.iter().zip(&tracks) {
        check_views(camera, track, kind)?;
    }
    let alone = |(camera, track): (&BoardCamera, &Track)| {
        let all: Vec<usize> = (0..track.views.len()).collect();
        let chosen = different(track, &all, LENS_VIEWS, kind, diagonal(camera));
        let found = lens_alone(track, &chosen, camera.size, kind);
        let error = found.as_ref().map_or(f64::INFINITY, |(film, _)| film.noise);
        found.filter(|_| error < MOST_ERROR * diagonal(camera)).ok_or_else(|| BoardError::NoFit {
            camera: camera.id.clone(),
            error: format!("{error:.1}"),
            kind: kind.to_string(),
        })
    };
    let found: Vec<(FilmCamera, Coefficients)> =
        cameras.par_iter().zip(&tracks).map(alone).collect::<Result<_, _>>()?;
    let (mut films, coefficients): (Vec<FilmCamera>, Vec<Coefficients>) = found.into_iter().unzip();
    let all = Cameras { cameras, tracks: &tracks, kind, coefficients: &coefficients };
    let clocks = clocks(&all, &films)?;
    films.iter_mut().zip(clocks).for_each(|(film, clock)| film.clock = clock);
    let solved = solve_together(&all, films)?;
    Ok(report::report(&all, &solved))
}

fn diagonal(camera: &BoardCamera) -> f64 {
    f64::from(camera.size[0]).hypot(f64::from(camera.size[1]))
}
