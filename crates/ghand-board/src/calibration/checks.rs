//! Whether cameras see the board often enough, and whether it is the right one.

use super::track::Track;
use crate::{BoardCamera, BoardError, BoardKind};

/// Images with the board that a camera needs at least.
const LEAST_VIEWS: usize = 5;
/// Another board is told if this part of the images with squares show the same one, and at least so many.
const SAME_PART: f64 = 0.5;
const LEAST_SAME: usize = 3;

/// Fails if a camera has too few images with the board; says so if it sees another one.
pub(super) fn check_seen(camera: &BoardCamera, kind: &BoardKind) -> Result<(), BoardError> {
    if camera.views.len() >= LEAST_VIEWS {
        return Ok(());
    }
    let with_squares = camera.views.len() + camera.others.iter().map(|(_, count)| count).sum::<usize>();
    if let Some((corners, count)) = camera.others.iter().max_by_key(|(_, count)| *count)
        && *count >= LEAST_SAME
        && *count as f64 >= SAME_PART * with_squares as f64
    {
        let [across, down] = *corners;
        let is_same = *corners == kind.corners() || [down, across] == kind.corners();
        let camera = camera.id.clone();
        return Err(match (kind.markers().is_some(), is_same) {
            (true, true) => BoardError::OtherMarkers { camera, kind: kind.to_string() },
            (true, false) => {
                let found = format!("{} x {} squares", across + 1, down + 1);
                BoardError::OtherBoard { camera, found, kind: kind.to_string() }
            }
            (false, _) => {
                let found = format!("{across} x {down} inner corners");
                BoardError::OtherBoard { camera, found, kind: kind.to_string() }
            }
        });
    }
    if camera.views.is_empty() {
        let images = camera.images;
        return Err(BoardError::NeverSeen { camera: camera.id.clone(), images, kind: kind.to_string() });
    }
    Err(too_few(camera, camera.views.len(), kind))
}

/// Fails if too few of a camera's images show enough of the board.
pub(super) fn check_views(camera: &BoardCamera, track: &Track, kind: &BoardKind) -> Result<(), BoardError> {
    if track.views.len() < LEAST_VIEWS { Err(too_few(camera, track.views.len(), kind)) } else { Ok(()) }
}

fn too_few(camera: &BoardCamera, views: usize, kind: &BoardKind) -> BoardError {
    BoardError::TooFewViews { camera: camera.id.clone(), views, needed: LEAST_VIEWS, kind: kind.to_string() }
}
