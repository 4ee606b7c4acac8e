//! The lens of one camera, from its own images of the board.

use std::sync::Arc;

use ghand_capture::cameras::rigid::Rigid;
use glam::DVec2;

use super::bundle::{
    Adjusted, FIRST_NOISE, FilmCamera, Moment, SeenBoard, SeenPoint, State, Unknown, adjust, total_cost,
};
use super::lens::{Coefficients, Lens};
use super::pose::board_pose;
use super::track::{Corners, Track};
use crate::BoardKind;

/// Focal lengths that are tried first, relative to the image's longer edge.
const FIRST_FOCALS: [f64; 12] = [0.35, 0.45, 0.55, 0.65, 0.75, 0.85, 1.0, 1.2, 1.5, 2.0, 3.0, 5.0];
/// k3 must lower the cost by this much to be worth it.
const WORTH: f64 = 40.0;
/// A lens must have seen this part of its image without distortion.
const LEAST_VISIBLE: f64 = 0.97;

/// The lens, and how many of its coefficients the images tell.
pub(super) fn lens_alone(
    track: &Track,
    chosen: &[usize],
    size: [u32; 2],
    kind: &BoardKind,
) -> Option<(FilmCamera, Coefficients)> {
    let views: Vec<&Corners> = chosen.iter().map(|k| &track.views[*k]).collect();
    let edge = f64::from(size[0].max(size[1]));
    let error = |focal: f64| {
        let lens = Lens::plain(size, focal);
        let mut errors: Vec<f64> =
            views.iter().filter_map(|view| Some(pose_in(view, &lens, kind)?.1 * focal)).collect();
        errors.sort_by(f64::total_cmp);
        // Of few that can be explained, none may be right.
        if 2 * errors.len() < views.len() { f64::INFINITY } else { errors[errors.len() / 2] }
    };
    let focals = FIRST_FOCALS.map(|focal| focal * edge);
    let (_, focal) = (focals.into_iter().map(|focal| (error(focal), focal))).min_by(|a, b| a.0.total_cmp(&b.0))?;
    let lens = Lens::plain(size, focal);
    let moment = |view: &&Corners| {
        let points: Vec<SeenPoint> = (view.iter().enumerate())
            .filter_map(|(number, pixel)| {
                Some(SeenPoint { place: kind.corner(number), pixel: (*pixel)?, velocity: DVec2::ZERO, slack: 0.0 })
            })
            .collect();
        let board = pose_in(view, &lens, kind)?.0;
        Some(Moment { board, seen: Arc::new([SeenBoard { camera: 0, points }]) })
    };
    let moments: Vec<Moment> = views.iter().filter_map(moment).collect();
    let camera = FilmCamera { lens, place: Rigid::IDENTITY, clock: 0.0, noise: FIRST_NOISE };
    let start = State { cameras: vec![camera], moments };
    let unknown = |coefficients| [Unknown { coefficients, place: false, clock: None }];
    let solved = |coefficients: Coefficients, start: &State| {
        let mut state = start.clone();
        let Adjusted { cost, .. } = adjust(&mut state, &unknown(coefficients));
        let is_sound = state.cameras[0].lens.visible_part() >= LEAST_VISIBLE;
        (state, cost, is_sound)
    };
    let mut coefficients = Coefficients::Four;
    let (mut state, _, mut is_sound) = solved(coefficients, &start);
    for fewer in [Coefficients::First, Coefficients::None] {
        if is_sound {
            break;
        }
        coefficients = fewer;
        (state, _, is_sound) = solved(coefficients, &start);
    }
    if coefficients == Coefficients::Four {
        // With the same noise, costs compare.
        let (more, cost, is_sound) = solved(Coefficients::Five, &state);
        let mut fewer = state.clone();
        fewer.cameras[0].noise = more.cameras[0].noise;
        if is_sound && total_cost(&fewer, &unknown(coefficients), &[0.0]) - cost > WORTH {
            (state, coefficients) = (more, Coefficients::Five);
        }
    }
    Some((state.cameras.pop()?, coefficients))
}

/// The board's pose `camera_from_board` in an image, and the median error of rays.
pub(super) fn pose_in(view: &Corners, lens: &Lens, kind: &BoardKind) -> Option<(Rigid, f64)> {
    let seen = view.iter().enumerate().filter_map(|(number, pixel)| Some((kind.corner(number), lens.ray((*pixel)?)?)));
    let (places, rays): (Vec<_>, Vec<_>) = seen.unzip();
    board_pose(&places, &rays)
}
