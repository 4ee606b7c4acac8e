//! A hand with more joints than MANO, reduced to MANO's.

use ghand_core::HandModel;
use glam::DVec3;

use super::{JOINT_NAMES, PARENTS};
use crate::joints::names::JointRole;
use crate::joints::regressor::follow_skin;

/// The same hand with MANO's 16 joints in MANO's order ([`JOINT_NAMES`]): metacarpals of fingers and tips are merged
/// into their parents, and the joints follow the skin, as MANO's files require.
///
/// Weights of a merged joint are added to its parent's; its pose correctives are dropped. Shape directions stay, but
/// the joints' own displacements are replaced by a regressor. `None` if the names do not identify the wrist and the
/// three joints of each finger.
pub fn in_mano_layout(model: &HandModel) -> Option<HandModel> {
    let roles = JointRole::of_joints(&model.joint_names);
    let sources: Vec<usize> = JOINT_NAMES
        .iter()
        .map(|name| {
            roles
                .iter()
                .position(|role| *role == if *name == "wrist" { Some(JointRole::Wrist) } else { JointRole::of(name) })
        })
        .collect::<Option<_>>()?;
    let mut reduced = HandModel {
        joint_names: JOINT_NAMES.map(String::from).to_vec(),
        parents: PARENTS.to_vec(),
        joints: sources.iter().map(|&joint| model.joints[joint]).collect(),
        weights: merged_weights(model, &sources),
        pose_directions: kept_correctives(model, &sources),
        joint_directions: vec![],
        joint_regressor: vec![],
        pose_space: None,
        ..model.clone()
    };
    follow_skin(&mut reduced);
    Some(reduced)
}

/// Weights `[V][16]`: each joint's own and those of the merged joints below it.
fn merged_weights(model: &HandModel, sources: &[usize]) -> Vec<f64> {
    let kept = |joint: usize| sources.iter().position(|&source| source == joint);
    let targets: Vec<usize> = (0..model.joint_count())
        .map(|joint| std::iter::successors(Some(joint), |&j| model.parents[j]).find_map(kept).unwrap_or(0))
        .collect();
    let mut weights = vec![0.0; model.vertices.len() * sources.len()];
    for (v, row) in weights.chunks_exact_mut(sources.len()).enumerate() {
        targets.iter().zip(model.vertex_weights(v)).for_each(|(&target, weight)| row[target] += weight);
    }
    weights
}

/// Pose correctives of the joints that stay, in their new order.
fn kept_correctives(model: &HandModel, sources: &[usize]) -> Vec<DVec3> {
    if model.pose_directions.is_empty() {
        return vec![];
    }
    let of_joint = 9 * model.vertices.len();
    let rows = |joint: usize| &model.pose_directions[(joint - 1) * of_joint..joint * of_joint];
    sources.iter().skip(1).flat_map(|&joint| rows(joint)).copied().collect()
}

#[cfg(test)]
mod tests {
    use ghand_core::posing::pose_hand;
    use ghand_core::{Pose, Side};

    use super::*;
    use crate::builtin::builtin_hand;
    use crate::joints::names::{Finger, finger_joints};

    #[test]
    fn the_reduced_hand_poses_as_the_whole_one_where_merged_joints_do_not_turn() {
        let whole = builtin_hand(Side::Right).unwrap();
        let reduced = in_mano_layout(&whole).unwrap();
        reduced.validate().unwrap();
        assert_eq!((reduced.joint_count(), reduced.shape_count()), (16, whole.shape_count()));
        let (mut of_whole, mut of_reduced) = (Pose::rest(25), Pose::rest(16));
        for (i, finger) in Finger::ALL.into_iter().enumerate() {
            let [all, kept] = [&whole, &reduced].map(|model| finger_joints(finger, model).unwrap());
            for k in 0..3 {
                let turn = DVec3::new(0.1 * i as f64, 0.3 - 0.1 * k as f64, 0.7);
                (of_whole.rotations[all[k]], of_reduced.rotations[kept[k]]) = (turn, turn);
            }
        }
        let shape = [0.0; 10];
        let [a, b] = [(&whole, &of_whole), (&reduced, &of_reduced)].map(|(m, p)| pose_hand(m, &shape, p).unwrap());
        let apart = a.vertices.iter().zip(&b.vertices).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max);
        assert!(apart < 1e-8, "{apart} m");
        assert!(a.vertices.iter().zip(&whole.vertices).any(|(a, b)| a.distance(*b) > 0.02), "the pose moves the hand");
    }

    #[test]
    fn a_hand_without_finger_names_has_no_such_layout() {
        let mut model = builtin_hand(Side::Right).unwrap();
        model.joint_names.iter_mut().for_each(|name| *name = "bone".into());
        assert!(in_mano_layout(&model).is_none());
    }
}
