//! Which Gaussians are neighbours on the surface.

use ghand_core::statistics::median;
use glam::Vec3;
use rayon::prelude::*;

use crate::template::Template;

/// Most neighbours of a Gaussian.
pub const MOST_NEIGHBORS: usize = 6;
/// Neighbours are at most this many times the spacing apart: the hand's thinnest parts are several times as thick.
const FARTHEST: f32 = 2.5;
/// Spacings count at most as this many times their median, and so many Gaussians around one are looked at: a file in which all
/// lie at one place, or one has all space, is opened in time.
const LARGEST_SPACING: f32 = 4.0;
const MOST_CANDIDATES: usize = 2000;

/// The neighbours of each Gaussian, `[MOST_NEIGHBORS][N]`: those among its nearest at rest that have it among theirs, so
/// that each pair occurs at both. A missing one is the Gaussian itself.
pub fn neighbors(template: &Template) -> Vec<u32> {
    let count = template.len();
    let at = |p: usize| Vec3::new(template.rest[p], template.rest[count + p], template.rest[2 * count + p]);
    let points: Vec<Vec3> = (0..count).map(at).collect();
    let spacing = (median(template.spacings.iter().map(|s| f64::from(*s))) as f32).max(f32::MIN_POSITIVE);
    let radius = |p: usize| FARTHEST * template.spacings[p].min(LARGEST_SPACING * spacing);
    // Cells in the order of their places, so that those beside each other along z are one piece of the list.
    let cell = |p: Vec3| (p / (FARTHEST * spacing)).floor().to_array().map(|c| c.clamp(-1e6, 1e6) as i32);
    let mut cells: Vec<([i32; 3], usize)> = points.iter().enumerate().map(|(p, point)| (cell(*point), p)).collect();
    cells.par_sort_unstable();
    let nearest: Vec<Vec<usize>> = (0..count)
        .into_par_iter()
        .map(|p| {
            let [low, high] = [-1.0, 1.0].map(|side| cell(points[p] + side * radius(p)));
            let piece = |(x, y): (i32, i32)| {
                let start = cells.partition_point(|(c, _)| *c < [x, y, low[2]]);
                cells[start..].iter().take_while(move |(c, _)| *c <= [x, y, high[2]]).map(|(_, q)| *q)
            };
            let columns = (low[0]..=high[0]).flat_map(|x| (low[1]..=high[1]).map(move |y| (x, y)));
            let around = columns.flat_map(piece).take(MOST_CANDIDATES).filter(|q| *q != p);
            let near = around.map(|q| (points[p].distance_squared(points[q]), q));
            let mut near: Vec<(f32, usize)> = near.filter(|(squared, _)| *squared <= radius(p).powi(2)).collect();
            near.sort_by(|(a, p), (b, q)| a.total_cmp(b).then(p.cmp(q)));
            near.into_iter().take(MOST_NEIGHBORS).map(|(_, q)| q).collect()
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
    fn a_hostile_template_takes_no_longer() {
        let mut template = Template::sample(&builtin_hand(Side::Right).unwrap(), 256).unwrap();
        template.rest.fill(1e-3);
        template.spacings[0] = 1e6;
        template.rest[1] = -1e30;
        template.rest[2] = 2e6;
        assert!(template.len() > 20_000);
        let table = neighbors(&template);
        assert!(table.iter().all(|q| (*q as usize) < template.len()));
    }

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
