//! Which hand a model is, from its shape and from names.

use ghand_core::Side;
use glam::DVec3;

use crate::joints::names::{Finger, JointRole, side_in_name};

/// Heights above the palm that are more than the unevenness of a flat hand, relative to the distance from the wrist to
/// the middle knuckle.
const LEAST_HEIGHT: f64 = 0.03;

/// The side on which the thumb and the bent fingers lie before the palm; `None` where the joints are unknown or in one
/// plane. `roles` and rest positions are those of the joints, the first one the wrist's.
///
/// The direction from wrist to middle finger, crossed with that from index to little finger, points out of the palm of a
/// right hand and out of the back of a left one.
pub(crate) fn side_of_shape(roles: &[Option<JointRole>], joints: &[DVec3]) -> Option<Side> {
    let at = |role| joints.get(roles.iter().position(|known| *known == Some(role))?).copied();
    let bend = |finger, k| at(JointRole::Bend(finger, k));
    let [index, middle, little] = [Finger::Index, Finger::Middle, Finger::Little].map(|finger| bend(finger, 1));
    let (wrist, index, middle) = (*joints.first()?, index?, middle.or(index)?);
    let little = little.or_else(|| bend(Finger::Ring, 1))?;
    let forward = middle - wrist;
    let out = forward.cross(little - index).try_normalize()?;
    let height = |from: DVec3, to: DVec3| (to - from).dot(out) / forward.length();
    let thumb: Vec<f64> =
        [1, 2, 3].into_iter().filter_map(|k| Some(height(0.5 * (index + little), bend(Finger::Thumb, k)?))).collect();
    let fingers = [Finger::Index, Finger::Middle, Finger::Ring, Finger::Little];
    let end = |finger| at(JointRole::Tip(finger)).or_else(|| bend(finger, 3));
    let bent: Vec<f64> = fingers.into_iter().filter_map(|f| Some(height(bend(f, 1)?, end(f)?))).collect();
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len().max(1) as f64;
    let before_palm = mean(&thumb) + mean(&bent);
    if before_palm > LEAST_HEIGHT {
        Some(Side::Right)
    } else if before_palm < -LEAST_HEIGHT {
        Some(Side::Left)
    } else {
        None
    }
}

/// The side of a hand with that shape; `names` are those that may tell it, the most reliable first. What is assumed or
/// contradicts is a warning.
pub(crate) fn decide<'a>(
    shape: Option<Side>,
    names: impl IntoIterator<Item = &'a str>,
    warnings: &mut Vec<String>,
) -> Side {
    let named = names.into_iter().find_map(|name| Some((name, side_in_name(name)?)));
    match (shape, named) {
        (Some(shape), Some((name, side))) if side != shape => {
            warnings.push(format!(
                "is read as a {shape} hand: thumb and fingers are on the side of a {shape} hand's palm, although \
                 {name:?} says {side}; rename it, or mirror the hand"
            ));
            shape
        }
        (Some(side), _) | (None, Some((_, side))) => side,
        (None, None) => {
            warnings.push("neither names nor joints show which hand it is; it is read as a right hand".into());
            Side::Right
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::builtin::builtin_hand;
    use ghand_test_support::procedural_hand::ProceduralHand;

    fn shape(model: &ghand_core::HandModel) -> Option<Side> {
        side_of_shape(&JointRole::of_joints(&model.joint_names), &model.joints)
    }

    #[test]
    fn the_shape_of_flat_and_of_bent_hands_shows_their_side() {
        let right = builtin_hand(Side::Right).unwrap();
        let procedural = ProceduralHand::default().build().unwrap();
        for model in [right, builtin_hand(Side::Left).unwrap(), procedural.mirrored(), procedural] {
            assert_eq!(shape(&model), Some(model.side), "{}", model.name);
            let fist = crate::named_poses::named_pose("fist", &model).unwrap();
            let posed = ghand_core::posing::pose_hand(&model.without_blend_shapes(), &[], &fist).unwrap();
            let bent = ghand_core::HandModel { joints: posed.joints, ..model.clone() };
            assert_eq!(shape(&bent), Some(model.side), "fist of {}", model.name);
        }
    }

    #[test]
    fn joints_in_one_plane_show_no_side_and_names_decide() {
        let mut model = builtin_hand(Side::Left).unwrap();
        model.joints.iter_mut().for_each(|joint| joint.x = 0.0);
        assert_eq!(shape(&model), None);
        let mut warnings = vec![];
        assert_eq!(decide(None, ["leftover", "hand_l", "right"], &mut warnings), Side::Left);
        assert_eq!(decide(Some(Side::Left), ["l_hand"], &mut warnings), Side::Left);
        assert!(warnings.is_empty());
        assert_eq!(decide(Some(Side::Right), ["hand_l"], &mut warnings), Side::Right);
        assert_eq!(decide(None, ["ring"], &mut warnings), Side::Right);
        assert!(
            warnings[0].contains("\"hand_l\" says left") && warnings[1].contains("read as a right"),
            "{warnings:?}"
        );
    }
}
