//! The hands of a skeleton: one, both of a body, or none that names identify.

use std::collections::HashMap;

use ::gltf::Gltf;
use ghand_core::Side;

use super::Source;
use super::skeleton::Skeleton;
use super::webxr::{WEBXR_JOINTS, webxr_order, webxr_parent};
use crate::HandModelError;
use crate::joints::names::{Finger, JointRole, Limb, fingers, limb, side_in_name};

/// Fewer fingers below one joint are a part of a hand.
const LEAST_FINGERS: u32 = 3;
/// How far above the joint of all fingers the wrist may be: that may be the palm's.
const MOST_STEPS_TO_WRIST: usize = 2;

/// The joints of one hand, parents before their children.
pub(super) struct Hand {
    /// Joints of the skeleton, the wrist first.
    pub joints: Vec<usize>,
    /// Parents, as places in `joints`.
    pub parents: Vec<Option<usize>>,
    /// Joints of the skeleton next to the wrist, of the arm.
    pub arm: Vec<usize>,
}

/// The hands of a skeleton, in the order of its joints.
pub(super) fn hands(skeleton: &Skeleton, source: &Source) -> Result<Vec<Hand>, HandModelError> {
    if let Some(order) = webxr_order(&skeleton.nodes) {
        let parents = (0..WEBXR_JOINTS.len()).map(webxr_parent).collect();
        let arm = arm(skeleton, &skeleton.parents, &order);
        return Ok(vec![Hand { joints: order, parents, arm }]);
    }
    let parents = with_parents_by_name(skeleton);
    let order = skeleton.order(&parents, source)?;
    let below = fingers_below(skeleton, &parents, &order);
    let is_hand = |joint: usize| below[joint].count_ones() >= LEAST_FINGERS;
    let mut is_inner = vec![false; parents.len()];
    order.iter().filter(|joint| is_hand(**joint)).filter_map(|joint| parents[*joint]).for_each(|p| is_inner[p] = true);
    let palms: Vec<usize> = (0..parents.len()).filter(|&joint| is_hand(joint) && !is_inner[joint]).collect();
    let above = |joint: usize| std::iter::successors(Some(joint), |&joint| parents[joint]);
    let is_of_other = |joint: usize, palm: usize| {
        palms.iter().any(|&other| other != palm && above(other).any(|ancestor| ancestor == joint))
    };
    let hand = |&palm: &usize| {
        let own = above(palm).take_while(|&joint| !is_of_other(joint, palm));
        let all_fingers =
            own.clone().find(|&joint| below[joint] == own.clone().fold(0, |all, joint| all | below[joint]));
        let wrist = wrist_above(skeleton, own.skip_while(|joint| Some(*joint) != all_fingers)).unwrap_or(palm);
        let of_hand: Vec<usize> = order.iter().copied().filter(|&joint| above(joint).any(|j| j == wrist)).collect();
        let arm = arm(skeleton, &parents, &of_hand);
        Hand::of(of_hand, &parents, arm)
    };
    Ok(palms.iter().map(hand).collect())
}

impl Hand {
    /// All joints of a skeleton whose names identify no hand.
    pub(super) fn whole(skeleton: &Skeleton, source: &Source) -> Result<Hand, HandModelError> {
        let roots: Vec<&str> = skeleton
            .parents
            .iter()
            .zip(&skeleton.nodes)
            .filter(|(parent, _)| parent.is_none())
            .map(|(_, node)| node.name().unwrap_or("unnamed"))
            .collect();
        let order = skeleton.order(&skeleton.parents, source)?;
        if roots.len() != 1 {
            let problem = format!(
                "has {} root joints ({}); use WebXR's joint names, or parent all joints to the wrist",
                roots.len(),
                roots[..roots.len().min(4)].join(", ")
            );
            return Err(source.invalid("skin", problem));
        }
        Ok(Hand::of(order, &skeleton.parents, vec![]))
    }

    fn of(joints: Vec<usize>, skeleton_parents: &[Option<usize>], arm: Vec<usize>) -> Hand {
        let place: HashMap<usize, usize> = joints.iter().enumerate().map(|(k, &joint)| (joint, k)).collect();
        let parents = joints.iter().map(|&joint| place.get(&skeleton_parents[joint]?).copied()).collect();
        Hand { joints, parents, arm }
    }

    pub(super) fn names(&self, skeleton: &Skeleton) -> Vec<String> {
        self.joints.iter().map(|&joint| skeleton.names[joint].clone()).collect()
    }

    /// Names of the nodes above the wrist, the nearest first.
    pub(super) fn names_above(&self, skeleton: &Skeleton, file: &Gltf) -> Vec<String> {
        self.joints.first().map_or(vec![], |&wrist| skeleton.names_above(file, wrist))
    }
}

/// The joint above the wrist, and those below it that are not the hand's.
fn arm(skeleton: &Skeleton, parents: &[Option<usize>], hand: &[usize]) -> Vec<usize> {
    let Some(top) = hand.first().and_then(|&wrist| parents[wrist]) else { return vec![] };
    // The tree of a WebXR hand may have a cycle.
    let above = |joint: usize| std::iter::successors(Some(joint), |&joint| parents[joint]).take(parents.len());
    let is_of_arm = |joint: &usize| !hand.contains(joint) && above(*joint).any(|ancestor| ancestor == top);
    (0..skeleton.names.len()).filter(is_of_arm).collect()
}

/// Fingers whose joints are a joint or below it, one bit each.
fn fingers_below(skeleton: &Skeleton, parents: &[Option<usize>], order: &[usize]) -> Vec<u32> {
    let bit = |finger: Option<Finger>| {
        finger.and_then(|own| Finger::ALL.iter().position(|f| *f == own)).map_or(0, |k| 1 << k)
    };
    let mut below: Vec<u32> = fingers(&skeleton.names).into_iter().map(bit).collect();
    for &joint in order.iter().rev() {
        if let Some(parent) = parents[joint] {
            below[parent] |= below[joint];
        }
    }
    below
}

/// The wrist by its name, from the joint of all fingers upwards; else the hand; else that joint.
fn wrist_above(skeleton: &Skeleton, upwards: impl Iterator<Item = usize>) -> Option<usize> {
    let near: Vec<usize> = upwards.take(MOST_STEPS_TO_WRIST + 1).collect();
    let find = |wanted: Limb| near.iter().copied().find(|&joint| limb(&skeleton.names[joint]) == Some(wanted));
    find(Limb::Wrist).or_else(|| find(Limb::Hand)).or(near.first().copied())
}

/// The skeleton's parents, and for joints that are beside each other, those that their names tell: some programs keep
/// all joints of a hand as siblings.
fn with_parents_by_name(skeleton: &Skeleton) -> Vec<Option<usize>> {
    let mut parents = skeleton.parents.clone();
    let roots: Vec<usize> = (0..parents.len()).filter(|&joint| parents[joint].is_none()).collect();
    for side in [None, Some(Side::Left), Some(Side::Right)] {
        let own: Vec<usize> = roots.iter().copied().filter(|&k| side_in_name(&skeleton.names[k]) == side).collect();
        let names: Vec<String> = own.iter().map(|&joint| skeleton.names[joint].clone()).collect();
        let roles = JointRole::of_any_joints(&names);
        let at = |role: JointRole| Some(own[roles.iter().position(|known| *known == Some(role))?]);
        let hand = || own.iter().copied().find(|&joint| limb(&skeleton.names[joint]) == Some(Limb::Hand));
        let Some(wrist) = at(JointRole::Wrist).or_else(hand) else { continue };
        for (&joint, role) in own.iter().zip(&roles) {
            parents[joint] = match role {
                Some(JointRole::Palm | JointRole::Metacarpal(_)) => Some(wrist),
                Some(JointRole::Bend(finger, 1)) => at(JointRole::Metacarpal(*finger)).or(Some(wrist)),
                Some(JointRole::Bend(finger, k)) => at(JointRole::Bend(*finger, k - 1)),
                Some(JointRole::Tip(finger)) => at(JointRole::Bend(*finger, 3)),
                Some(JointRole::Wrist) | None => None,
            };
        }
    }
    parents
}
