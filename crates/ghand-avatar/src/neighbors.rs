//! Which Gaussians are neighbours on the surface.

use std::collections::HashMap;

use glam::Vec3;
use rayon::prelude::*;

use crate::template::Template;

/// Most neighbours of a Gaussian.
pub const MOST_NEIGHBORS: usize = 6;
/// Neighbours are at most this many times the spacing apart: the hand's thinnest parts are several times as thick.
const FARTHEST: f32 = 2.5;

/// The neighbours of each Gaussian, `[MOST_NEIGHBORS][N]`: those among its nearest at rest that have it among theirs, so
/// that each pair occurs at both. A missing one is the Gaussian itself.
pub fn neighbors(template: &Template) -> Vec<u32> {
    let count = template.len();
    let at = |p: usize| Vec3::new(template.rest[p], template.rest[count + p], template.rest[2 * count + p]);
    let points: Vec<Vec3> = (0..count).map(at).collect();
    let reach = FARTHEST * template.spacings.iter().copied().fold(f32::MIN_POSITIVE, f32::max);
    let cell = |p: Vec3| (p / reach).floor().to_array().map(|c| c as i32);
    let mut cells: HashMap<[i32; 3], Vec<usize>> = HashMap::new();
    for (p, point) in points.iter().enumerate() {
        cells.entry(cell(*point)).or_default().push(p);
    }
    let nearest: Vec<Vec<usize>> = (0..count)
        .into_par_iter()
        .map(|p| {
            let [x, y, z] = cell(points[p]);
            let around = (0..27).filter_map(|i| cells.get(&[x + i % 3 - 1, y + i / 3 % 3 - 1, z + i / 9 - 1]));
            let distance = |q: &usize| points[p].distance_squared(points[*q]);
            let limit = (FARTHEST * template.spacings[p]).powi(2);
            let mut near: Vec<usize> = around.flatten().copied().filter(|q| *q != p && distance(q) <= limit).collect();
            near.sort_by(|a, b| distance(a).total_cmp(&distance(b)).then(a.cmp(b)));
            near.truncate(MOST_NEIGHBORS);
            near
        })
        .collect();
    let mut table: Vec<u32> = (0..MOST_NEIGHBORS).flat_map(|_| 0..count as u32).collect();
    for (p, near) in nearest.iter().enumerate() {
        let mutual = near.iter().filter(|q| nearest[**q].contains(&p));
        for (k, q) in mutual.enumerate() {
            table[k * count + p] = *q as u32;
        }
    }
    table
}

#[cfg(test)]
mod tests {
    use ghand_core::Side;
    use ghand_hand_model::builtin::builtin_hand;

    use super::*;

    #[test]
    fn neighbours_are_near_mutual_and_reach_almost_everywhere() {
        let template = Template::sample(&builtin_hand(Side::Right).unwrap(), 64).unwrap();
        let count = template.len();
        let table = neighbors(&template);
        let of = |p: usize| {
            (0..MOST_NEIGHBORS).map(|k| table[k * count + p] as usize).filter(|q| *q != p).collect::<Vec<_>>()
        };
        let place = |p: usize| Vec3::from([0, 1, 2].map(|c| template.rest[c * count + p]));
        let mut alone = 0;
        for p in 0..count {
            let near = of(p);
            alone += usize::from(near.len() < 3);
            for q in &near {
                assert!(of(*q).contains(&p), "{p} has {q} as neighbour, but not the other way round");
                assert!(place(p).distance(place(*q)) <= FARTHEST * template.spacings[p]);
            }
            let mut once = near.clone();
            once.sort_unstable();
            once.dedup();
            assert_eq!(once.len(), near.len(), "a pair occurs once");
        }
        assert!(alone * 20 < count, "{alone} of {count} have fewer than three neighbours");
    }
}
