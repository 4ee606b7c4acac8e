//! Fewer points where fewer are enough.

use std::collections::BTreeMap;

use super::SurfaceSamples;

/// Points of a block are one piece of skin if they are at most so many times their spacing apart; texels of two charts that
/// meet in a block are not.
const FARTHEST: f64 = 4.0;

impl SurfaceSamples {
    /// One point instead of up to four in each block of 2x2 texels (rows and columns `2k` and `2k + 1`) whose points may all
    /// be merged and are one piece of skin: the first of them, whose spacing becomes that of the whole block. `may_merge` has
    /// a value for each point.
    ///
    /// # Panics
    /// If `may_merge` has another length.
    #[must_use]
    pub fn merged(&self, may_merge: &[bool]) -> SurfaceSamples {
        assert_eq!(may_merge.len(), self.len(), "a value for each point");
        let mut blocks: BTreeMap<[u32; 2], Vec<usize>> = BTreeMap::new();
        for (point, texel) in self.texels.iter().enumerate() {
            blocks.entry([texel / self.resolution / 2, texel % self.resolution / 2]).or_default().push(point);
        }
        let mut spacings = self.spacings.clone();
        let mut kept = vec![true; self.len()];
        for points in blocks.values() {
            let [first, others @ ..] = points.as_slice() else { continue };
            let reach = FARTHEST * points.iter().map(|p| self.spacings[*p]).fold(0.0, f64::max);
            let is_near = |p: &usize| self.positions[*p].distance(self.positions[*first]) <= reach;
            if points.iter().all(|p| may_merge[*p] && is_near(p)) {
                spacings[*first] = points.iter().map(|p| self.spacings[*p].powi(2)).sum::<f64>().sqrt();
                others.iter().for_each(|p| kept[*p] = false);
            }
        }
        let kept: Vec<usize> = (0..self.len()).filter(|p| kept[*p]).collect();
        let row = |values: &[f64]| kept.iter().map(|p| values[*p]).collect::<Vec<_>>();
        SurfaceSamples {
            resolution: self.resolution,
            joint_count: self.joint_count,
            texels: kept.iter().map(|p| self.texels[*p]).collect(),
            faces: kept.iter().map(|p| self.faces[*p]).collect(),
            barycentric: kept.iter().map(|p| self.barycentric[*p]).collect(),
            positions: kept.iter().map(|p| self.positions[*p]).collect(),
            normals: kept.iter().map(|p| self.normals[*p]).collect(),
            weights: self.weights.chunks_exact(self.len().max(1)).flat_map(row).collect(),
            spacings: row(&spacings),
            overlaps: self.overlaps,
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

    use crate::surface::sample_surface;
    use ghand_test_support::procedural_hand::ProceduralHand;

    #[test]
    fn merged_points_cover_the_same_skin_and_are_some_of_the_points() {
        let model = ProceduralHand::default().build().unwrap();
        let samples = sample_surface(&model, 128).unwrap();
        let n = samples.len();
        assert_eq!(samples.merged(&vec![false; n]), samples);
        // The half on one side.
        let may_merge: Vec<bool> = samples.positions.iter().map(|p| p.z > 0.0).collect();
        let wanted = may_merge.iter().filter(|may| **may).count();
        let merged = samples.merged(&may_merge);
        let fewer = (n - merged.len()) as f64 / wanted as f64;
        // Three of four, but for blocks at the borders of charts and of that half.
        assert!((0.65..0.75).contains(&fewer), "{fewer} of them are gone");
        let area = |spacings: &[f64]| spacings.iter().map(|s| s * s).sum::<f64>();
        assert!((area(&merged.spacings) / area(&samples.spacings) - 1.0).abs() < 1e-12);
        let m = merged.len();
        let mut coarse = 0;
        for k in 0..m {
            let at = samples.texels.binary_search(&merged.texels[k]).unwrap();
            assert_eq!(merged.positions[k], samples.positions[at]);
            assert_eq!(merged.faces[k], samples.faces[at]);
            assert!((0..merged.joint_count).all(|j| merged.weights[j * m + k] == samples.weights[j * n + at]));
            let is_coarse = merged.spacings[k] != samples.spacings[at];
            assert!(may_merge[at] || !is_coarse);
            coarse += usize::from(is_coarse);
        }
        assert!(coarse > 200);
    }

    #[test]
    fn texels_of_two_charts_are_not_merged() {
        let model = ProceduralHand::default().build().unwrap();
        let mut samples = sample_surface(&model, 32).unwrap();
        let all = vec![true; samples.len()];
        let before = samples.merged(&all).len();
        // The last point of a full block moves far away.
        let side = samples.resolution;
        let has = |texel: u32| samples.texels.binary_search(&texel);
        let is_first = |texel: &u32| (texel / side).is_multiple_of(2) && (texel % side).is_multiple_of(2);
        let full = samples
            .texels
            .iter()
            .copied()
            .filter(is_first)
            .find(|texel| [texel + 1, texel + side, texel + side + 1].iter().all(|other| has(*other).is_ok()));
        let last = has(full.unwrap() + side + 1).unwrap();
        samples.positions[last].x += 1.0;
        assert_eq!(samples.merged(&all).len(), before + 3);
    }
}
