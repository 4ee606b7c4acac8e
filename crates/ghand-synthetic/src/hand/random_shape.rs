//! A random person's shape of the built-in hand.

use ghand_core::posing::shape_hand;
use ghand_core::{HandModel, InvalidHandModel};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::random_bones::with_random_bones;
use crate::normal::truncated_normal;

/// Standard deviation of each shape direction, in its unit.
///
/// Girth, wrist and the `macro` directions are as in the population of `assets/human-hand`. The three lengths are not:
/// that population's hands differ in length mostly by age, by up to a tenth within two standard deviations, and their
/// fingers hardly differ from each other at all (0.06 and 0.05). Here lengths differ by up to about 6 % as a whole, and
/// those of the fingers by up to as much again, as adults' do; single bones differ beside that (`random_bones.rs`).
const DEVIATIONS: [(&str, f64); 10] = [
    ("finger-length", 0.5),
    ("finger-diameter", 0.32),
    ("finger-distance", 0.5),
    ("hand-scale", 0.6),
    ("wrist-circumference", 0.84),
    ("macro-1", 1.0),
    ("macro-2", 1.0),
    ("macro-3", 1.0),
    ("macro-4", 1.0),
    ("macro-5", 1.0),
];
/// A shape of the model (`n_s` weights), the same for the same seed: independent normal numbers within two standard
/// deviations ([`DEVIATIONS`]); 0 for directions of other names.
fn random_shape(model: &HandModel, seed: u64) -> Vec<f64> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed ^ 0x4A7D);
    let drawn = DEVIATIONS.map(|(name, deviation)| (name, deviation * truncated_normal(&mut rng)));
    let weight = |name: &String| drawn.iter().find(|(known, _)| known == name).map_or(0.0, |(_, weight)| *weight);
    model.shape_names.iter().map(weight).collect()
}

/// The model in [`random_shape`] and with [random bones](with_random_bones), without blend shapes.
///
/// # Errors
/// As for [`shape_hand`].
pub(crate) fn random_hand(model: &HandModel, seed: u64, bone_spread: f64) -> Result<HandModel, InvalidHandModel> {
    let shaped = shape_hand(model, &random_shape(model, seed))?;
    let hand = HandModel { vertices: shaped.vertices, joints: shaped.joints, ..model.without_blend_shapes() };
    Ok(with_random_bones(&hand, seed, bone_spread))
}

#[cfg(test)]
mod tests {
    use ghand_core::Side;
    use ghand_hand_model::builtin::builtin_hand;

    use super::*;

    #[test]
    fn shapes_differ_from_the_template_and_from_each_other_within_bounds() {
        let model = builtin_hand(Side::Right).unwrap();
        let shapes: Vec<Vec<f64>> = (0..200).map(|seed| random_shape(&model, seed)).collect();
        assert!(shapes.windows(2).all(|pair| pair[0] != pair[1]));
        for (k, (name, deviation)) in DEVIATIONS.iter().enumerate() {
            assert_eq!(&model.shape_names[k], name);
            let largest = shapes.iter().map(|shape| shape[k].abs()).fold(0.0, f64::max);
            // Of 200 numbers some are beyond one and a half deviations, with a probability of 1 - 2e-11.
            assert!((1.5 * deviation..=2.0 * deviation).contains(&largest), "{name}: {largest}");
        }
        let middle = model.joint_names.iter().position(|name| name == "middle-finger-tip").unwrap();
        let reach = |joints: &[glam::DVec3]| joints[middle].distance(joints[0]);
        let changes: Vec<f64> = (shapes.iter())
            .map(|shape| reach(&shape_hand(&model, shape).unwrap().joints) / reach(&model.joints) - 1.0)
            .collect();
        assert!(changes.iter().all(|change| change.abs() < 0.11), "{changes:?}");
        assert!(changes.iter().any(|change| *change > 0.04) && changes.iter().any(|change| *change < -0.04));
    }
}
