//! Numbers of a scene that probably contradict its format.

use ghand_render::splat::SplatModel;
use glam::DVec3;

use super::SplatScene;

impl SplatScene {
    /// Sentences on numbers that probably contradict the format: sizes that are not logarithms, opacities that are not
    /// logits.
    pub fn suspicions(&self) -> Vec<String> {
        let mut found = vec![];
        if let Some(extent) = self.extent().filter(|extent| self.has_plain_sizes(*extent)) {
            found.push(format!(
                "the scales are all small positive numbers, so as logarithms they mean Gaussians larger than half the \
                 scene, which is {extent:.3} wide; they are probably sizes: store their logarithms"
            ));
        }
        if self.has_plain_opacities() {
            found.push(
                "the opacities are all from 0 to 1, so as logits they mean that everything is half transparent; they are \
                 probably opacities: store their logits, ln(a / (1 - a))"
                    .into(),
            );
        }
        found
    }

    /// The diagonal of the box around the centres; `None` if that is a point.
    fn extent(&self) -> Option<f64> {
        let places = self.means().filter(|place| place.is_finite());
        let (low, high) = places.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(l, h), p| (l.min(p), h.max(p)));
        let extent = (high - low).length();
        (extent.is_finite() && extent > 0.0).then_some(extent)
    }

    fn has_plain_sizes(&self, extent: f64) -> bool {
        let rows = SplatModel::SCALE_ROW..SplatModel::SCALE_ROW + 3;
        let mut scales: Vec<f64> =
            rows.flat_map(|row| self.row(row)).map(f64::from).filter(|scale| scale.is_finite()).collect();
        if !scales.iter().all(|scale| *scale >= 0.0) || scales.iter().all(|scale| *scale == 0.0) {
            return false;
        }
        let middle = scales.len() / 2;
        let median = *scales.select_nth_unstable_by(middle, f64::total_cmp).1;
        median.exp() > 0.5 * extent && median < 0.5 * extent
    }

    fn has_plain_opacities(&self) -> bool {
        let opacities: Vec<f32> = self.row(self.model().opacity_row()).filter(|value| value.is_finite()).collect();
        let within = opacities.iter().all(|value| (0.0..=1.0).contains(value));
        within && opacities.iter().any(|value| *value > 0.0)
    }
}

#[cfg(test)]
mod tests {
    use crate::scene_files::Antialiasing;

    use super::*;

    /// Gaussians on a line of this length with these scales and opacities.
    fn scene(length: f32, scale: impl Fn(usize) -> f32, opacity: impl Fn(usize) -> f32) -> SplatScene {
        let count = 20;
        let table = SplatModel::trained(0).table(count, |row, i| match row {
            0 => length * i as f32 / (count - 1) as f32,
            3..6 => scale(i + row),
            6 => 1.0,
            10 => opacity(i),
            _ => 0.0,
        });
        SplatScene { degree: 0, count, table, antialias: Antialiasing::Off }
    }

    #[test]
    fn plain_sizes_and_opacities_are_suspected() {
        let tiny = |i: usize| 1e-3 * (1 + i % 3) as f32;
        let logarithm = |i: usize| tiny(i).ln();
        let part = |i: usize| i as f32 / 20.0;
        let logit = |i: usize| i as f32 - 4.0;
        let told = |scene: SplatScene| scene.suspicions().join("; ");
        assert_eq!(told(scene(0.2, logarithm, logit)), "");
        let sizes = told(scene(0.2, tiny, logit));
        assert!(sizes.contains("scales") && sizes.contains("0.200 wide") && !sizes.contains("opacities"), "{sizes}");
        let opacities = told(scene(0.2, logarithm, part));
        assert!(opacities.contains("logits") && !opacities.contains("scales"), "{opacities}");
        assert!(told(scene(0.2, tiny, |_| 1.0)).contains("scales") && told(scene(0.2, tiny, part)).contains("logits"));
        // In millimetres, sizes of some millimetres have positive logarithms.
        assert_eq!(told(scene(200.0, |i| 0.2 + 0.01 * i as f32, logit)), "");
        // Of equal Gaussians of size 1 and opacity 0.5 all numbers are 0.
        assert_eq!(told(scene(10.0, |_| 0.0, |_| 0.0)), "");
        // One Gaussian may be as large as it likes.
        assert_eq!(told(scene(0.0, tiny, logit)), "");
    }
}
