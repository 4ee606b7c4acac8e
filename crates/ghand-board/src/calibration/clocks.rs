//! Clocks that are not given: of the times at which the board moves alike, the one at which cameras also see it at the same
//! place. Good to a frame or so; the bundle adjustment then finds the rest.

use ghand_capture::cameras::rigid::Rigid;
use rayon::prelude::*;

use super::bundle::FilmCamera;
use super::intrinsics::pose_in;
use super::joint::{Cameras, alike};
use super::placing::{Alike, Pair, pair};
use super::signal::Signal;
use crate::BoardError;

/// Moments at which two cameras' boards are compared, and how many must support the same place of the cameras.
const MOMENTS: usize = 60;
const LEAST_SUPPORT: usize = 8;
const LEAST_PART: f64 = 0.7;

/// What to add to the first camera's time to have each one's, seconds: as given, or as the board tells.
pub(super) fn clocks(all: &Cameras, films: &[FilmCamera]) -> Result<Vec<f64>, BoardError> {
    let given = all.cameras.iter().enumerate().map(|(k, camera)| if k == 0 { Some(0.0) } else { camera.clock });
    let mut clocks: Vec<Option<f64>> = given.collect();
    if clocks.iter().all(Option::is_some) {
        return Ok(clocks.into_iter().flatten().collect());
    }
    let middle = (0.5 * all.kind.size()).extend(0.0);
    let signal = |(film, track): (&FilmCamera, &super::track::Track)| {
        let poses: Vec<Option<Rigid>> =
            track.views.iter().map(|view| pose_in(view, &film.lens, all.kind).map(|(pose, _)| pose)).collect();
        Signal::of(track, &poses, middle)
    };
    let signals: Vec<Signal> = films.par_iter().zip(all.tracks).map(signal).collect();
    // Those that most moments support are found first, and others by them, too.
    while clocks.iter().any(Option::is_none) {
        let mut best: Option<(usize, usize, f64)> = None;
        for unknown in (0..clocks.len()).filter(|k| clocks[*k].is_none()) {
            for (known, clock) in clocks.iter().enumerate().filter_map(|(k, clock)| Some((k, (*clock)?))) {
                for offset in signals[known].offsets_to(&signals[unknown]) {
                    let support = support(all, films, (known, unknown), offset);
                    if support >= LEAST_SUPPORT && best.is_none_or(|(most, ..)| support > most) {
                        best = Some((support, unknown, clock + offset));
                    }
                }
            }
        }
        let Some((_, found, clock)) = best else {
            let lost = all.cameras.iter().zip(&clocks).find(|(_, clock)| clock.is_none());
            let camera = lost.map_or(String::new(), |(camera, _)| camera.id.clone());
            return Err(BoardError::UnknownClock { camera });
        };
        clocks[found] = Some(clock);
    }
    Ok(clocks.into_iter().flatten().collect())
}

/// How many moments support a difference of two cameras' clocks, seconds: then the board moves rigidly in both. 0 if many do
/// not.
fn support(all: &Cameras, films: &[FilmCamera], (first, second): (usize, usize), offset: f64) -> usize {
    let times = &all.tracks[first].times;
    let common: Vec<f64> = times.iter().copied().filter(|t| all.tracks[second].at(t + offset).is_some()).collect();
    let moment = |time: &f64| -> Option<(Rigid, Alike)> {
        let of = |camera: usize, time: f64| alike(&all.tracks[camera].at(time)?, &films[camera].lens, all.kind);
        Some((*of(first, *time)?.first()?, of(second, time + offset)?))
    };
    let few = common.iter().step_by(common.len().div_ceil(MOMENTS).max(1));
    let moments: Vec<(Rigid, Alike)> = few.filter_map(moment).collect();
    match pair(&moments) {
        Some(Pair { support, .. }) if support as f64 >= LEAST_PART * moments.len() as f64 => support,
        _ => 0,
    }
}
