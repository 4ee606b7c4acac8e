//! Quadrilaterals whose edges run along the edges of black squares that meet in corners.

use calib_targets_charuco::ChessCorner;
use glam::DVec2;
use nalgebra::Point2;

/// Only so many corners, the strongest ones, are searched: more than any board has.
const MOST_CORNERS: usize = 4000;
/// Shortest edge, pixels.
const SHORTEST: f64 = 5.0;
/// Most that an edge may turn from the direction of a corner's edges, radians: corners of a tag's cells are seen from its own
/// ones at 0.24 and more.
const MOST_TURN: f64 = 0.16;
/// The least sine of the angle between two edges.
const LEAST_SINE: f64 = 0.3;
/// The longest edge, relative to the shortest one.
const MOST_UNEVEN: f64 = 3.0;

/// A corner that is next to another one along one of its edges.
#[derive(Clone, Copy)]
struct Neighbor {
    corner: usize,
    direction: DVec2,
    distance: f64,
}

/// Corners, by number, of quadrilaterals, clockwise as seen.
pub(super) fn quads(corners: &[ChessCorner]) -> Vec<[usize; 4]> {
    let mut strongest: Vec<usize> = (0..corners.len()).collect();
    strongest.sort_by(|a, b| corners[*b].strength.total_cmp(&corners[*a].strength));
    strongest.truncate(MOST_CORNERS);
    let mut neighbors = vec![vec![]; corners.len()];
    for corner in &strongest {
        neighbors[*corner] = nearest(corners, &strongest, *corner);
    }
    let from = |start: usize| neighbors[start].iter().filter_map(|first| around(&neighbors, start, *first)).collect();
    // Each is found from each of its corners.
    strongest
        .into_iter()
        .flat_map(|start| -> Vec<[usize; 4]> { from(start) })
        .filter(|quad| quad[0] == least(quad))
        .collect()
}

fn least(quad: &[usize; 4]) -> usize {
    quad.iter().copied().min().unwrap_or_default()
}

/// The nearest corner along each of the four edges of a corner.
fn nearest(corners: &[ChessCorner], among: &[usize], of: usize) -> Vec<Neighbor> {
    let corner = &corners[of];
    let axes = corner.axes.map(|axis| DVec2::from_angle(axis.angle.into()));
    let mut found: [Option<Neighbor>; 4] = [None; 4];
    for other in among.iter().copied().filter(|other| *other != of) {
        let off = place(corners[other].position) - place(corner.position);
        let distance = off.length();
        if distance < SHORTEST {
            continue;
        }
        let direction = off / distance;
        let most = MOST_TURN.sin();
        let Some(axis) = axes.iter().position(|axis| axis.perp_dot(direction).abs() < most) else { continue };
        let its = corners[other]
            .axes
            .iter()
            .any(|axis| DVec2::from_angle(axis.angle.into()).perp_dot(direction).abs() < most);
        let slot = &mut found[2 * axis + usize::from(axes[axis].dot(direction) < 0.0)];
        if its && slot.is_none_or(|known| distance < known.distance) {
            *slot = Some(Neighbor { corner: other, direction, distance });
        }
    }
    found.into_iter().flatten().collect()
}

/// Four corners, if turning right three times leads back to the first one.
fn around(neighbors: &[Vec<Neighbor>], start: usize, first: Neighbor) -> Option<[usize; 4]> {
    let mut quad = [start; 4];
    let mut edge = first;
    let [mut shortest, mut longest] = [first.distance; 2];
    for slot in &mut quad[1..] {
        *slot = edge.corner;
        let right = |next: &&Neighbor| edge.direction.perp_dot(next.direction) > LEAST_SINE;
        let sine = |next: &Neighbor| edge.direction.perp_dot(next.direction);
        let next = *neighbors[edge.corner].iter().filter(right).max_by(|a, b| sine(a).total_cmp(&sine(b)))?;
        shortest = shortest.min(next.distance);
        longest = longest.max(next.distance);
        edge = next;
    }
    let is_closed = edge.corner == start && edge.direction.perp_dot(first.direction) > LEAST_SINE;
    (is_closed && longest < MOST_UNEVEN * shortest).then_some(quad)
}

fn place(position: Point2<f32>) -> DVec2 {
    DVec2::new(position.x.into(), position.y.into())
}
