//! Takes one hand out of what the same skeleton moves: an arm, a body, another hand.

use std::collections::BTreeMap;

use glam::DVec3;

use super::raw_mesh::{Outside, RawMesh};

/// The longest hand with its forearm, metres. A longer mesh is more than one.
const LONGEST_HAND: f64 = 0.5;
/// How far the skin that follows the arm is kept beyond the wrist, relative to the distance from wrist to fingertips.
const STUB: f64 = 0.35;
/// Most names in a warning.
const MOST_NAMES: usize = 6;

/// Removes vertices that mostly follow other joints than the hand's, except for a stub of the arm; a mesh that is no
/// longer than a hand with its forearm stays whole if it is the only hand. What is left of other joints' weights goes to
/// the wrist. `joints` are the hand's rest positions, the wrist first; `name` names joints of the skeleton. Returns which
/// vertices are left.
pub(super) fn cut(
    mesh: &mut RawMesh,
    joints: &[DVec3],
    is_only_hand: bool,
    name: impl Fn(usize) -> String,
    warnings: &mut Vec<String>,
) -> Vec<bool> {
    if mesh.outside.iter().all(|outside| outside.total() == 0.0) {
        return vec![true; mesh.positions.len()];
    }
    let n_b = joints.len();
    let wrist = joints.first().copied().unwrap_or_default();
    let reach = joints.iter().map(|joint| joint.distance(wrist)).fold(0.0, f64::max);
    let stays_whole = is_only_hand && extent(&mesh.positions) <= LONGEST_HAND;
    let is_kept = |(outside, position): (&Outside, &DVec3)| {
        let near = outside.arm > outside.body && position.distance(wrist) <= STUB * reach;
        stays_whole || outside.total() <= 0.5 || near
    };
    let mut keep: Vec<bool> = mesh.outside.iter().zip(&mesh.positions).map(is_kept).collect();
    if keep.contains(&false) {
        let mut has_triangle = vec![false; keep.len()];
        let whole = mesh.triangles.iter().filter(|triangle| triangle.iter().all(|v| keep[*v as usize]));
        whole.flatten().for_each(|v| has_triangle[*v as usize] = true);
        keep = has_triangle;
    }
    let removed: Vec<&Outside> = mesh.outside.iter().zip(&keep).filter(|(_, keep)| !**keep).map(|(o, _)| o).collect();
    let merged: Vec<&Outside> =
        mesh.outside.iter().zip(&keep).filter(|(o, keep)| **keep && o.total() > 0.5).map(|(o, _)| o).collect();
    if !removed.is_empty() {
        warnings.push(format!(
            "{} of {} vertices follow joints that are not of this hand, or belong to their triangles; they are not read",
            removed.len(),
            keep.len()
        ));
    }
    if !merged.is_empty() {
        warnings.push(format!(
            "{} vertices of the arm follow the wrist instead of {}; bending them apart is not possible",
            merged.len(),
            names_of(&merged, &name)
        ));
    }
    for (row, outside) in mesh.weights.chunks_exact_mut(n_b).zip(&mesh.outside) {
        if let Some(wrist) = row.first_mut() {
            *wrist += outside.total();
        }
    }
    if keep.contains(&false) {
        mesh.retain(&keep, n_b);
    }
    keep
}

/// Names, the first ones of many.
pub(super) fn listed(names: &[String]) -> String {
    let more = names.len().saturating_sub(MOST_NAMES);
    let first = names[..names.len() - more].join(", ");
    if more == 0 { first } else { format!("{first} and {more} more") }
}

/// The longest edge of the box around points.
fn extent(points: &[DVec3]) -> f64 {
    let low = points.iter().copied().fold(DVec3::INFINITY, DVec3::min);
    let high = points.iter().copied().fold(DVec3::NEG_INFINITY, DVec3::max);
    (high - low).max_element()
}

/// Names of the joints that vertices follow most, those of the most vertices first.
fn names_of(vertices: &[&Outside], name: &impl Fn(usize) -> String) -> String {
    let mut counts: BTreeMap<usize, usize> = BTreeMap::new();
    vertices.iter().filter_map(|o| o.heaviest).for_each(|(joint, _)| *counts.entry(joint).or_default() += 1);
    let mut joints: Vec<(usize, usize)> = counts.into_iter().collect();
    joints.sort_by_key(|&(joint, count)| (std::cmp::Reverse(count), joint));
    listed(&joints.iter().map(|&(joint, _)| name(joint)).collect::<Vec<_>>())
}
