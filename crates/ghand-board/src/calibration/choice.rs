//! Images to calibrate from: the board at different places of the image, distances and tilts, and nearly still.

use glam::DVec2;

use super::track::{Track, outline};
use crate::BoardKind;

/// The board moves by this part of the image's diagonal in a second where an image counts half.
const HALF_SPEED: f64 = 0.15;

/// At most `count` of some images, by number, that differ most.
pub(super) fn different(track: &Track, among: &[usize], count: usize, kind: &BoardKind, diagonal: f64) -> Vec<usize> {
    let candidate = |k: &usize| {
        let outline = outline(track.views.get(*k)?, kind)?.map(|pixel| pixel / diagonal);
        let stillness = 1.0 / (1.0 + (track.speed(*k) / (HALF_SPEED * diagonal)).powi(2));
        Some((*k, outline, stillness))
    };
    let candidates: Vec<(usize, [DVec2; 4], f64)> = among.iter().filter_map(candidate).collect();
    let mut nearest = vec![1.0f64; candidates.len()];
    let mut chosen = vec![];
    while chosen.len() < count.min(candidates.len()) {
        let value = |k: usize| nearest[k] * candidates[k].2;
        let Some(best) = (0..candidates.len()).max_by(|a, b| value(*a).total_cmp(&value(*b))) else { break };
        if value(best) <= 0.0 {
            break;
        }
        chosen.push(candidates[best].0);
        for (distance, (_, outline, _)) in nearest.iter_mut().zip(&candidates) {
            let off: f64 = outline.iter().zip(&candidates[best].1).map(|(a, b)| a.distance(*b)).sum();
            *distance = distance.min(off / 4.0);
        }
    }
    chosen.sort_unstable();
    chosen
}
