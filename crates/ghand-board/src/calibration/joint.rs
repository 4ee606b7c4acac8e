//! All cameras together: moments at which several see the board place them and set their clocks.

use std::sync::Arc;

use ghand_capture::cameras::rigid::Rigid;
use glam::{DMat3, DVec3};
use rayon::prelude::*;

use super::bundle::{Adjusted, FIRST_NOISE, FilmCamera, Moment, SeenBoard, SeenPoint, State, Unknown, adjust};
use super::choice::different;
use super::diagonal;
use super::equations::cost;
use super::lens::{Coefficients, Lens};
use super::placing::{Alike, Pair, difference, pair, places};
use super::pose::board_pose;
use super::track::{MovingCorner, Track};
use crate::{BoardCamera, BoardError, BoardKind};

/// Images of each camera that are used whoever else sees the board, and with each other camera that sees it, too.
const OWN_VIEWS: usize = 24;
const LEAST_COMMON_VIEWS: usize = 8;
const COMMON_VIEWS: usize = 30;
/// Standard deviation of the clocks before the last step, seconds: half a frame and a little.
const CLOCK_DEVIATION: f64 = 0.025;
/// Rounds of interpolating corners by the clocks and refining these; clocks that change by less are found, seconds.
const ROUNDS: usize = 4;
const SMALL_CHANGE: f64 = 1e-4;

/// What all cameras saw.
pub(super) struct Cameras<'a> {
    pub cameras: &'a [BoardCamera],
    pub tracks: &'a [Track],
    pub kind: &'a BoardKind,
    /// Of each lens.
    pub coefficients: &'a [Coefficients],
}

/// Cameras as found.
pub(super) struct Solved {
    pub state: State,
    pub adjusted: Adjusted,
}

/// The board in one camera at a moment.
struct Sighting {
    camera: usize,
    corners: Vec<MovingCorner>,
    /// `camera_from_board`, and those in which it looks alike.
    alike: Alike,
}

/// Finds all cameras, from their lenses and clocks as found alone.
pub(super) fn solve_together(all: &Cameras, films: Vec<FilmCamera>) -> Result<Solved, BoardError> {
    let anchors = anchors(all, &films);
    let guesses: Vec<f64> = films.iter().map(|film| film.clock).collect();
    let unknown = |k: usize| Unknown {
        coefficients: all.coefficients[k],
        place: k > 0,
        clock: (k > 0).then_some([guesses[k], CLOCK_DEVIATION]),
    };
    let unknown: Vec<Unknown> = (0..films.len()).map(unknown).collect();
    let mut state = State { cameras: films, moments: vec![] };
    let mut adjusted = None;
    for round in 0..ROUNDS {
        let seen: Vec<Vec<Sighting>> =
            anchors.par_iter().map(|anchor| sightings(all, &state.cameras, *anchor)).collect();
        if round == 0 {
            place(all, &mut state.cameras, &seen)?;
        }
        let before: Vec<f64> = state.cameras.iter().map(|camera| camera.clock).collect();
        let rig = State { cameras: state.cameras.clone(), moments: vec![] };
        state.moments = seen.into_par_iter().filter_map(|sightings| moment(all, &rig, sightings)).collect();
        adjusted = Some(adjust(&mut state, &unknown));
        let changes = before.iter().zip(&state.cameras).map(|(before, camera)| (camera.clock - before).abs());
        if changes.fold(0.0, f64::max) < SMALL_CHANGE {
            break;
        }
    }
    // There is at least one round.
    let adjusted = adjusted.unwrap_or(Adjusted { cost: 0.0, covariance: None });
    Ok(Solved { state, adjusted })
}

/// Images around which moments are: camera and number.
fn anchors(all: &Cameras, films: &[FilmCamera]) -> Vec<(usize, usize)> {
    let of_camera = |camera: usize| {
        let (track, diagonal) = (&all.tracks[camera], diagonal(&all.cameras[camera]));
        let every: Vec<usize> = (0..track.views.len()).collect();
        let mut chosen = different(track, &every, OWN_VIEWS, all.kind, diagonal);
        let each = (COMMON_VIEWS / (films.len().max(2) - 1)).max(LEAST_COMMON_VIEWS);
        for other in (0..films.len()).filter(|other| *other != camera) {
            let later = films[other].clock - films[camera].clock;
            let common: Vec<usize> =
                every.iter().copied().filter(|k| all.tracks[other].at(track.times[*k] + later).is_some()).collect();
            chosen.extend(different(track, &common, each, all.kind, diagonal));
        }
        chosen.sort_unstable();
        chosen.dedup();
        chosen.into_iter().map(move |k| (camera, k))
    };
    (0..films.len()).flat_map(of_camera).collect()
}

/// What all cameras see when one of them took an image.
fn sightings(all: &Cameras, films: &[FilmCamera], (camera, view): (usize, usize)) -> Vec<Sighting> {
    let time = all.tracks[camera].times[view] - films[camera].clock;
    let sighting = |(camera, (track, film)): (usize, (&Track, &FilmCamera))| {
        let corners = track.at(time + film.clock)?;
        let alike = alike(&corners, &film.lens, all.kind)?;
        Some(Sighting { camera, corners, alike })
    };
    all.tracks.iter().zip(films).enumerate().filter_map(sighting).collect()
}

/// The board's pose `camera_from_board`, and those in which it looks alike.
pub(super) fn alike(corners: &[MovingCorner], lens: &Lens, kind: &BoardKind) -> Option<Alike> {
    let seen = corners.iter().filter_map(|corner| Some((kind.corner(corner.number), lens.ray(corner.pixel)?)));
    let (places, rays): (Vec<_>, Vec<_>) = seen.unzip();
    let (pose, _) = board_pose(&places, &rays)?;
    Some(kind.symmetries().iter().map(|symmetry| pose.after(&turn(kind, symmetry))).collect())
}

/// The map of the board to itself that takes each corner's place to that of the corner which a symmetry has for it.
fn turn(kind: &BoardKind, symmetry: &[usize]) -> Rigid {
    let place = |number: usize| symmetry.get(number).map_or(DVec3::ZERO, |to| kind.corner(*to));
    let axes = |place: &dyn Fn(usize) -> DVec3| {
        let [x, y] = [1, kind.corners()[0]].map(|number| (place(number) - place(0)) / kind.side());
        DMat3::from_cols(x, y, x.cross(y))
    };
    // An AprilGrid's corners are counted upwards.
    let rotation = axes(&place) * axes(&|number| kind.corner(number)).transpose();
    Rigid { rotation, translation: place(0) - rotation * kind.corner(0) }
}

/// Places the cameras by pairs that see the board at the same moments.
fn place(all: &Cameras, films: &mut [FilmCamera], seen: &[Vec<Sighting>]) -> Result<(), BoardError> {
    let find = |a: usize, b: usize| -> Option<Pair> {
        let of = |sightings: &Vec<Sighting>| {
            let alike = |camera: usize| sightings.iter().find(|s| s.camera == camera).map(|s| &s.alike);
            Some((*alike(a)?.first()?, alike(b)?.clone()))
        };
        pair(&seen.iter().filter_map(of).collect::<Vec<_>>())
    };
    let count = films.len();
    let mut pairs = vec![vec![None; count]; count];
    for (a, b) in (0..count).flat_map(|a| (0..a).map(move |b| (b, a))) {
        let found = find(a, b);
        pairs[a][b] = found;
        pairs[b][a] = found.map(|pair| Pair { pose: pair.pose.inverse(), ..pair });
    }
    let found = places(&pairs);
    if let Some(lost) = found.iter().position(Option::is_none) {
        let connected = all.cameras.iter().zip(&found).filter(|(_, place)| place.is_some());
        let others: Vec<&str> = connected.map(|(camera, _)| camera.id.as_str()).collect();
        let camera = all.cameras[lost].id.clone();
        return Err(BoardError::NotTogether { camera, others: others.join(" or ") });
    }
    films.iter_mut().zip(found).for_each(|(film, place)| film.place = place.unwrap_or(Rigid::IDENTITY));
    Ok(())
}

/// A moment: all corners numbered as the first camera that sees it does, and the board's pose that fits best.
fn moment(all: &Cameras, rig: &State, sightings: Vec<Sighting>) -> Option<Moment> {
    let first = sightings.first()?;
    let in_world = |sighting: &Sighting, pose: &Rigid| rig.cameras[sighting.camera].place.inverse().after(pose);
    let wanted = in_world(first, first.alike.first()?);
    let symmetries = all.kind.symmetries();
    let mut boards = vec![];
    let mut seen = vec![];
    for sighting in &sightings {
        let alike = sighting.alike.iter().map(|pose| in_world(sighting, pose)).zip(&symmetries);
        let (board, symmetry) = alike.min_by(|a, b| difference(&a.0, &wanted).total_cmp(&difference(&b.0, &wanted)))?;
        boards.push(board);
        let point = |corner: &MovingCorner| {
            // Which number the corner gets.
            let number = symmetry.iter().position(|from| *from == corner.number)?;
            let MovingCorner { pixel, velocity, slack, .. } = *corner;
            Some(SeenPoint { place: all.kind.corner(number), pixel, velocity, slack })
        };
        let points = sighting.corners.iter().filter_map(point).collect();
        seen.push(SeenBoard { camera: sighting.camera, points });
    }
    let seen: Arc<[SeenBoard]> = seen.into();
    let clocks: Vec<f64> = rig.cameras.iter().map(|camera| camera.clock).collect();
    let mut rough = State { cameras: rig.cameras.clone(), moments: vec![] };
    rough.cameras.iter_mut().for_each(|camera| camera.noise = FIRST_NOISE);
    let moment = |board: Rigid| Moment { board, seen: seen.clone() };
    let fitting = boards.into_iter().map(|board| (cost(&rough, &moment(board), &clocks), board));
    let (_, board) = fitting.min_by(|a, b| a.0.total_cmp(&b.0))?;
    Some(moment(board))
}
