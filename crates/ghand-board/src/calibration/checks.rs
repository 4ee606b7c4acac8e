//! Whether cameras see the board often enough, and whether it is the right one.

use super::track::Track;
use crate::{BoardCamera, BoardError, BoardKind, BoardView, SeenCorner};

/// Images with the board that a camera needs at least.
const LEAST_VIEWS: usize = 5;
/// Another board is told if this part of the images with squares show the same one, and at least so many.
const SAME_PART: f64 = 0.5;
const LEAST_SAME: usize = 3;
/// Gaps between tags, relative to their side, are found with about a tenth of this error.
const MOST_GAP_ERROR: f64 = 0.02;

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
        if kind.tags().is_some() {
            return Err(BoardError::OtherTags { camera, found: [across / 2, down / 2], kind: kind.to_string() });
        }
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

/// Fails if the gaps between an AprilGrid's tags are not as wide as they are said to be.
pub(super) fn check_gap(camera: &BoardCamera, kind: &BoardKind) -> Result<(), BoardError> {
    let Some(said) = kind.tags().map(|tags| tags.gap) else { return Ok(()) };
    let mut seen: Vec<f64> = camera.views.iter().flat_map(|view| gaps(view, kind)).collect();
    seen.sort_by(f64::total_cmp);
    let Some(gap) = seen.get(seen.len() / 2).filter(|gap| (**gap - said).abs() > MOST_GAP_ERROR) else { return Ok(()) };
    let [found, said] = [*gap, said].map(|gap| (100.0 * gap).round() as u32);
    Err(BoardError::OtherGap { camera: camera.id.clone(), found, said, kind: kind.to_string() })
}

/// Gaps between neighbours in a row of tags, relative to their side: the cross-ratio of their four corners on a line does
/// not depend on the view.
fn gaps(view: &BoardView, kind: &BoardKind) -> Vec<f64> {
    let [columns, _] = kind.corners();
    let gap = |four: &[SeenCorner]| {
        let first = four[0].number;
        let is_row =
            four[3].number == first + 3 && (first % columns).is_multiple_of(2) && first % columns + 3 < columns;
        let [a, b, c, d] = [0, 1, 2, 3].map(|k| four[k].pixel);
        let ratio = a.distance(c) * b.distance(d) / (b.distance(c) * a.distance(d));
        let gap = (ratio / (ratio - 1.0)).sqrt() - 1.0;
        (is_row && gap.is_finite()).then_some(gap)
    };
    view.corners.windows(4).filter_map(gap).collect()
}

/// Fails if too few of a camera's images show enough of the board.
pub(super) fn check_views(camera: &BoardCamera, track: &Track, kind: &BoardKind) -> Result<(), BoardError> {
    if track.views.len() < LEAST_VIEWS { Err(too_few(camera, track.views.len(), kind)) } else { Ok(()) }
}

fn too_few(camera: &BoardCamera, views: usize, kind: &BoardKind) -> BoardError {
    BoardError::TooFewViews { camera: camera.id.clone(), views, needed: LEAST_VIEWS, kind: kind.to_string() }
}
