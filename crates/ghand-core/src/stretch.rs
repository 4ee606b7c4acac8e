//! How far skinning moves neighbours on a surface apart or together. The sizes of Gaussians follow, so that no gaps open between
//! them where a bent knuckle stretches the skin.

use glam::DVec3;
use rayon::prelude::*;

use crate::parallel::CHUNK;

/// Smallest and largest factor.
pub const LIMITS: [f64; 2] = [0.5, 2.0];

/// Factors on the standard deviations of N Gaussians: the root mean square distance from a Gaussian's neighbours when posed
/// by that at rest, within [`LIMITS`]; 1 without neighbours. `neighbors` has indices `[any number][N]`, a missing one is the
/// Gaussian itself; `rest` and `posed` are places before and after skinning, metres, N.
pub fn stretch(neighbors: &[u32], rest: &[DVec3], posed: &[DVec3]) -> Vec<f64> {
    let count = rest.len();
    let squared = |places: &[DVec3], p: usize| -> f64 {
        neighbors.iter().skip(p).step_by(count.max(1)).map(|q| places[*q as usize].distance_squared(places[p])).sum()
    };
    let factor = |p: usize| {
        let before = squared(rest, p);
        if before > 0.0 { (squared(posed, p) / before).sqrt().clamp(LIMITS[0], LIMITS[1]) } else { 1.0 }
    };
    (0..count).into_par_iter().with_min_len(CHUNK).map(factor).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Neighbours of points in a row: that before and that after.
    fn row(count: u32) -> Vec<u32> {
        let before = (0..count).map(|p| p.saturating_sub(1));
        before.chain((0..count).map(|p| (p + 1).min(count - 1))).collect()
    }

    #[test]
    fn a_row_stretches_and_shrinks_with_its_distances_within_limits() {
        let rest: Vec<DVec3> = (0..6).map(|i| DVec3::X * f64::from(i)).collect();
        let at = |x: [f64; 6]| x.map(|x| DVec3::new(0.0, x, 5.0)).to_vec();
        assert_eq!(stretch(&row(6), &rest, &at([0.0, 1.0, 2.0, 3.0, 4.0, 5.0])), [1.0; 6], "it turns");
        let pulled = stretch(&row(6), &rest, &at([0.0, 0.2, 1.0, 2.5, 12.5, 13.5]));
        let between = |a: f64, b: f64| ((a * a + b * b) / 2.0).sqrt();
        assert_eq!(pulled, [0.5, between(0.2, 0.8), between(0.8, 1.5), 2.0, 2.0, 1.0]);
    }

    #[test]
    fn one_without_neighbours_keeps_its_size() {
        assert_eq!(stretch(&[0, 0], &[DVec3::ZERO; 1], &[DVec3::X]), [1.0]);
        assert_eq!(
            stretch(&[1, 0], &[DVec3::ZERO; 2], &[DVec3::X, DVec3::Y]),
            [1.0; 2],
            "nor where all lie at one place"
        );
        assert!(stretch(&[], &[], &[]).is_empty());
    }
}
