//! Lengths of a random person's bones, beyond what the model's shape directions say.

use ghand_core::HandModel;
use ghand_hand_model::joints::names::{Finger, JointRole};
use glam::DVec3;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use crate::normal::truncated_normal;

/// Mean and standard deviation of the bones of 66 men and women, millimetres: metacarpal, proximal, middle and distal (A.
/// Buryanov and V. Kotiuk, "Proportions of hand segments", Int. J. Morphol. 28, 2010, table I). The thumb has no middle bone.
const PUBLISHED: [(Finger, [[f64; 2]; 4]); 5] = [
    (Finger::Thumb, [[46.2, 3.9], [31.6, 3.1], [21.7, 1.6], [21.7, 1.6]]),
    (Finger::Index, [[68.1, 6.3], [39.8, 4.9], [22.4, 2.5], [15.8, 2.3]]),
    (Finger::Middle, [[64.6, 5.4], [44.6, 3.8], [26.3, 3.0], [17.4, 1.9]]),
    (Finger::Ring, [[58.0, 5.1], [41.4, 3.9], [25.7, 3.3], [17.3, 2.2]]),
    (Finger::Little, [[53.7, 4.4], [32.7, 2.8], [18.1, 2.5], [16.0, 2.5]]),
];
/// Standard deviation of the size of a whole hand in the same table, relative: the least of any bone is 0.074, and all have
/// it in common. The shape directions draw it.
const SIZE: f64 = 0.06;

/// Standard deviation of the length of the bone that ends at a joint, relative, beyond the size of the hand.
fn deviation(role: JointRole) -> Option<f64> {
    let (finger, bone) = match role {
        JointRole::Bend(Finger::Thumb, 1) => return None,
        JointRole::Bend(Finger::Thumb, k) => (Finger::Thumb, usize::from(k) - 2),
        JointRole::Bend(finger, k) => (finger, usize::from(k) - 1),
        JointRole::Tip(finger) => (finger, 3),
        JointRole::Wrist | JointRole::Palm | JointRole::Metacarpal(_) => return None,
    };
    let (_, bones) = PUBLISHED.iter().find(|(known, _)| *known == finger)?;
    let [mean, deviation] = bones[bone];
    Some(((deviation / mean).powi(2) - SIZE * SIZE).sqrt())
}

/// The model with the metacarpals and phalanges of a random person, the same for the same seed: each length independent,
/// with `spread` times the published standard deviation, within two of them. Flesh between two joints shifts in proportion,
/// that beyond a bone's end with it; thicknesses stay.
pub(crate) fn with_random_bones(model: &HandModel, seed: u64, spread: f64) -> HandModel {
    let mut rng = ChaCha8Rng::seed_from_u64(seed ^ 0xB09E);
    let roles = JointRole::of_joints(&model.joint_names);
    let mut shifts = vec![DVec3::ZERO; model.joint_count()];
    for (k, parent) in model.parents.iter().enumerate() {
        let Some(parent) = *parent else { continue };
        let logarithm = roles[k].and_then(deviation).map_or(0.0, |d| spread * d * truncated_normal(&mut rng));
        shifts[k] = shifts[parent] + (model.joints[k] - model.joints[parent]) * logarithm.exp_m1();
    }
    let only_child = |k: usize| {
        let mut children = (0..model.joint_count()).filter(|child| model.parents[*child] == Some(k));
        children.next().filter(|_| children.next().is_none())
    };
    let children: Vec<Option<usize>> = (0..model.joint_count()).map(only_child).collect();
    let shift = |k: usize, vertex: DVec3| {
        let Some(child) = children[k] else { return shifts[k] };
        let bone = model.joints[child] - model.joints[k];
        let along = (vertex - model.joints[k]).dot(bone) / bone.length_squared();
        shifts[k].lerp(shifts[child], if along.is_finite() { along.clamp(0.0, 1.0) } else { 0.0 })
    };
    let vertices = (model.vertices.iter().enumerate())
        .map(|(v, vertex)| {
            let weights = model.vertex_weights(v).iter().enumerate().filter(|(_, weight)| **weight > 0.0);
            *vertex + weights.map(|(k, weight)| *weight * shift(k, *vertex)).sum::<DVec3>()
        })
        .collect();
    let joints = model.joints.iter().zip(&shifts).map(|(joint, shift)| *joint + *shift).collect();
    HandModel { vertices, joints, ..model.clone() }
}

#[cfg(test)]
mod tests {
    use ghand_core::Side;
    use ghand_hand_model::builtin::builtin_hand;

    use super::*;

    #[test]
    fn bones_differ_as_much_as_published_and_thicknesses_do_not() {
        let model = builtin_hand(Side::Right).unwrap().without_blend_shapes();
        let find = |name: &str| model.joint_names.iter().position(|known| known == name).unwrap();
        let [knuckle, next] = ["index-finger-phalanx-proximal", "index-finger-phalanx-intermediate"].map(find);
        let length = |hand: &HandModel| hand.joints[next].distance(hand.joints[knuckle]);
        let changes: Vec<f64> =
            (0..400).map(|seed| (length(&with_random_bones(&model, seed, 1.0)) / length(&model)).ln()).collect();
        let mean = changes.iter().sum::<f64>() / 400.0;
        let deviation = (changes.iter().map(|change| (change - mean).powi(2)).sum::<f64>() / 399.0).sqrt();
        // 4.9 of 39.8 mm, less the size of the hand; within two standard deviations 0.88 of it is left.
        let published = 0.88 * ((4.9_f64 / 39.8).powi(2) - 0.0036).sqrt();
        assert!((deviation / published - 1.0).abs() < 0.12 && mean.abs() < 0.02, "{deviation} {published} {mean}");

        assert_eq!(with_random_bones(&model, 3, 0.0).vertices, model.vertices);
        for seed in 0..20 {
            let hand = with_random_bones(&model, seed, 1.0);
            assert_ne!(hand.joints, model.joints);
            // No triangle turns over, and none collapses.
            for face in &model.faces {
                let normal = |vertices: &[DVec3]| {
                    let [a, b, c] = face.map(|v| vertices[v as usize]);
                    (b - a).cross(c - a)
                };
                let (before, after) = (normal(&model.vertices), normal(&hand.vertices));
                assert!(before.dot(after) > 0.25 * before.length_squared(), "{seed} {face:?}");
            }
        }
    }
}
