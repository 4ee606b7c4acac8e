//! Lenses, places and clocks of cameras from what they saw of the board.

mod bundle;
mod checks;
mod choice;
mod clocks;
mod equations;
mod homography;
mod intrinsics;
mod joint;
mod lens;
mod placing;
mod pose;
mod report;
mod track;

use ghand_capture::cameras::list::LensCamera;
use rayon::prelude::*;

use crate::{BoardCamera, BoardError, BoardKind};
use bundle::FilmCamera;
use checks::{check_seen, check_views};
use choice::different;
use clocks::Signal;
use intrinsics::{lens_alone, pose_in};
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
    set_clocks(&mut films, cameras, &tracks, kind)?;
    let all = Cameras { cameras, tracks: &tracks, kind, coefficients: &coefficients };
    let solved = solve_together(&all, films)?;
    Ok(report::report(&all, &solved))
}

fn diagonal(camera: &BoardCamera) -> f64 {
    f64::from(camera.size[0]).hypot(f64::from(camera.size[1]))
}

/// Clocks as given, or by how the board moves.
fn set_clocks(
    films: &mut [FilmCamera],
    cameras: &[BoardCamera],
    tracks: &[Track],
    kind: &BoardKind,
) -> Result<(), BoardError> {
    let given = |(k, camera): (usize, &BoardCamera)| if k == 0 { Some(0.0) } else { camera.clock };
    let mut clocks: Vec<Option<f64>> = cameras.iter().enumerate().map(given).collect();
    if clocks.iter().any(Option::is_none) {
        let middle = (0.5 * kind.size()).extend(0.0);
        let signal = |(film, track): (&FilmCamera, &Track)| {
            let poses: Vec<_> =
                track.views.iter().map(|view| pose_in(view, &film.lens, kind).map(|(pose, _)| pose)).collect();
            Signal::of(track, &poses, middle)
        };
        let signals: Vec<Signal> = films.par_iter().zip(tracks).map(signal).collect();
        // The one that is surest is found first, and others by it, too.
        while clocks.iter().any(Option::is_none) {
            let unknown = (0..clocks.len()).filter(|k| clocks[*k].is_none());
            let by = |k: usize| {
                let known = clocks.iter().enumerate().filter_map(|(j, clock)| Some((j, (*clock)?)));
                let found = known.filter_map(|(j, clock)| {
                    let (offset, agreement) = signals[j].offset_to(&signals[k])?;
                    Some((agreement, k, clock + offset))
                });
                found.max_by(|a, b| a.0.total_cmp(&b.0))
            };
            match unknown.filter_map(by).max_by(|a, b| a.0.total_cmp(&b.0)) {
                Some((_, k, clock)) => clocks[k] = Some(clock),
                None => {
                    let first = clocks.iter().position(Option::is_none).and_then(|k| cameras.get(k));
                    let camera = first.map_or(String::new(), |camera| camera.id.clone());
                    return Err(BoardError::UnknownClock { camera });
                }
            }
        }
    }
    films.iter_mut().zip(clocks).for_each(|(film, clock)| film.clock = clock.unwrap_or(0.0));
    Ok(())
}
