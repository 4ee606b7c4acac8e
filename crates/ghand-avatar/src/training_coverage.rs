//! How much training saw of an avatar, as colours.

use ghand_render::viridis::viridis;

use crate::avatar::Avatar;

/// Powers of ten below the median and above it that have colours of their own. What is below saw next to nothing: from a
/// hundredth of the median down, neighbours decide.
const DECADES: [f64; 2] = [3.0, 1.0];

impl Avatar {
    /// The avatar in colours of how much training saw each Gaussian, in no light and the same in all poses: dark violet for
    /// what it never saw, then Viridis by the logarithm of its weight, from a thousandth of the median to ten times as much.
    /// `None` if the avatar does not know.
    pub fn colored_by_seen(&self) -> Option<Avatar> {
        let colors = self.seen_colors()?;
        let mut avatar = Avatar { light: None, ..self.clone() };
        avatar.tables.set_constant_colors(&colors);
        Some(avatar)
    }

    /// The colours of [`Avatar::colored_by_seen`], N, display values.
    pub fn seen_colors(&self) -> Option<Vec<[f64; 3]>> {
        self.seen.as_deref().map(colors)
    }
}

fn colors(seen: &[f32]) -> Vec<[f64; 3]> {
    let mut sorted: Vec<f32> = seen.iter().copied().filter(|weight| *weight > 0.0).collect();
    sorted.sort_by(f32::total_cmp);
    let median = sorted.get(sorted.len() / 2).map_or(1.0, |median| f64::from(*median));
    let [below, above] = DECADES;
    // The logarithm of 0 is -infinity, which has the first colour.
    let value = |weight: &f32| ((f64::from(*weight) / median).log10() + below) / (below + above);
    seen.iter().map(|weight| viridis(value(weight)).to_array()).collect()
}

#[cfg(test)]
mod tests {
    use ghand_test_support::procedural_hand::ProceduralHand;

    use super::*;
    use crate::light::{AvatarLight, Light};
    use crate::properties::PropertyTables;
    use crate::template::AvatarConfig;

    #[test]
    fn colors_go_by_the_logarithm_relative_to_the_median() {
        let colors = colors(&[0.0, 1e-9, 0.002, 2.0, 2.0, 2.0, 20.0, 500.0]);
        let expected = [0.0, 0.0, 0.0, 0.75, 0.75, 0.75, 1.0, 1.0].map(viridis);
        for (color, expected) in colors.iter().zip(expected) {
            assert!(expected.distance((*color).into()) < 1e-6, "{color:?} instead of {expected}");
        }
        assert_eq!(super::colors(&[0.0; 3]), [viridis(0.0).to_array(); 3]);
    }

    #[test]
    fn what_training_saw_is_shown_unlit_and_the_same_in_all_poses() {
        let model = ProceduralHand { detail: 1, ..Default::default() }.build().unwrap();
        let config = AvatarConfig { uv_resolution: 16, color_components: 2, ..Default::default() };
        let mut avatar = Avatar::untrained(&model, &config, [0.8, 0.6, 0.5], 0).unwrap();
        let samples = ghand_hand_model::surface::sample_surface(&model, 16).unwrap();
        avatar.light = Some(AvatarLight::new(Light::studio(), None, &samples));
        assert_eq!(avatar.colored_by_seen(), None);
        let count = avatar.template.len();
        avatar.seen = Some((0..count).map(|p| p as f32).collect());
        let shown = avatar.colored_by_seen().unwrap();
        assert_eq!(shown.light, None);
        let (PropertyTables::Direct(tables), PropertyTables::Direct(before)) = (&shown.tables, &avatar.tables) else {
            unreachable!()
        };
        let (colors, components) = tables.appearance[count..].split_at(3 * count);
        assert!(components.len() == 6 * count && components.iter().all(|c| *c == 0.0));
        assert!(colors[2 * count] > colors[3 * count - 1] && colors[count] < colors[2 * count - 1], "violet to yellow");
        assert_eq!((&tables.shape_basis, &tables.response), (&before.shape_basis, &before.response));
    }
}
