//! Pose correctives for any rigged hand whose joints' names identify the fingers.

use ghand_core::HandModel;
use glam::DVec3;

use super::volume::keep_volume;
use super::{BendingChain, Skin, pose_directions};
use crate::joints::axes::{THUMB_TOWARDS_BACK, fingertip};
use crate::joints::hand_directions::{HandDirections, hand_directions};
use crate::joints::names::{Finger, JointRole, finger_joints};

/// Vertices this near to the cross-section of a joint measure the finger's width there, metres.
const SECTION: f64 = 0.004;
/// The palm of a coarse mesh has few vertices around a knuckle: the section becomes thicker until it has this many, up to
/// so many times.
const LEAST_VERTICES: usize = 4;
const THICKER: [f64; 3] = [1.0, 1.5, 2.25];
/// Half width of a finger where no vertex is near a joint's cross-section, metres.
const USUAL_RADIUS: f64 = 0.009;
/// Weight of nearness against skinning weights in deciding to which finger the skin of the palm belongs.
const NEARNESS: f64 = 0.1;
/// Cosine of the angle between the bones of a finger that is straight: 40 degrees.
const STRAIGHT: f64 = 0.766;

/// Pose directions `[9 (n_b - 1)][V]`, metres, that keep the volume of bent joints; `None` if the names of the joints do
/// not identify the three joints of each finger. The rest pose must be roughly flat.
pub fn fit_pose_directions(model: &HandModel) -> Option<Vec<DVec3>> {
    let (chains, shares) = chains(model)?;
    let pose_directions = pose_directions(&model.vertices, &model.weights, &chains, &shares, Skin::Fleshy);
    let mut corrected = HandModel { pose_directions, ..model.clone() };
    keep_volume(&mut corrected, &chains, &shares).ok()?;
    Some(corrected.pose_directions)
}

/// The model with its own pose correctives or, if it has none, with some that let skin turn with a bent joint instead of being
/// blended: no hand has the dents of blending, while bulges differ from hand to hand. As it is if its joints' names do not
/// identify the fingers, or if these are bent at rest.
pub fn with_turned_skin(model: &HandModel) -> HandModel {
    let mut corrected = model.clone();
    if model.pose_directions.is_empty()
        && let Some((chains, shares)) = chains(model)
        && chains.iter().all(is_straight)
    {
        corrected.pose_directions = pose_directions(&model.vertices, &model.weights, &chains, &shares, Skin::Turned);
    }
    corrected
}

/// The fingers, and how much of each vertex belongs to each.
fn chains(model: &HandModel) -> Option<(Vec<BendingChain>, Vec<Vec<f64>>)> {
    let directions = hand_directions(model)?;
    let chains: Option<Vec<BendingChain>> =
        Finger::ALL.into_iter().map(|finger| chain(model, finger, &directions)).collect();
    let chains = chains?;
    let shares = shares(model, &chains);
    Some((chains, shares))
}

/// Whether the bones of a finger are nearly in line at rest.
fn is_straight(chain: &BendingChain) -> bool {
    let bones: Vec<DVec3> = chain.points[1..].windows(2).map(|bone| (bone[1] - bone[0]).normalize_or_zero()).collect();
    bones.windows(2).all(|pair| pair[0].dot(pair[1]) > STRAIGHT)
}

fn chain(model: &HandModel, finger: Finger, hand: &HandDirections) -> Option<BendingChain> {
    let joints = finger_joints(finger, model)?;
    let roles = JointRole::of_joints(&model.joint_names);
    let tip_joint = roles.iter().position(|role| *role == Some(JointRole::Tip(finger)));
    let [first, middle, last] = joints.map(|k| model.joints[k]);
    let before = model.parents[joints[0]].map_or(first - hand.forward, |k| model.joints[k]);
    let is_thumb = finger == Finger::Thumb;
    let mut chain = BendingChain {
        joints,
        beyond: tip_joint.into_iter().collect(),
        points: [before, first, middle, last, fingertip(model, &roles, finger)?],
        radii: [USUAL_RADIUS; 3],
        // Fingers close towards the palm, the thumb's outer joints mostly across it.
        closing: if is_thumb { hand.across - THUMB_TOWARDS_BACK * hand.back } else { -hand.back },
        is_thumb,
    };
    chain.radii = std::array::from_fn(|k| radius(model, &chain, k));
    Some(chain)
}

/// Mean distance of the skin from joint `k` of a chain, across the finger.
fn radius(model: &HandModel, chain: &BendingChain, k: usize) -> f64 {
    let center = chain.points[k + 1];
    // Across the bone that the finger has to itself: the knuckle's other bone lies in the palm.
    let along = (chain.points[k + 2] - center).normalize();
    let own = |i: usize| -> f64 { chain.joints.iter().map(|&j| model.vertex_weights(i)[j]).sum() };
    let near = (0..model.vertices.len()).filter(|&i| own(i) > 0.25).map(|i| model.vertices[i] - center);
    let near: Vec<DVec3> = near.collect();
    let section = |thicker: f64| -> Vec<f64> {
        let within = near.iter().filter(|p| p.dot(along).abs() < SECTION * thicker);
        within.map(|p| p.reject_from(along).length()).collect()
    };
    let sections = THICKER.map(section);
    let distances = sections.iter().find(|section| section.len() >= LEAST_VERTICES).or(sections.last());
    distances.filter(|d| !d.is_empty()).map_or(USUAL_RADIUS, |d| d.iter().sum::<f64>() / d.len() as f64)
}

/// How much of each vertex belongs to each chain, `[V][chains]`; rows sum to 1. By skinning weights, and on the palm by
/// nearness.
fn shares(model: &HandModel, chains: &[BendingChain]) -> Vec<Vec<f64>> {
    let nearness = |p: DVec3, chain: &BendingChain| {
        let distance = chain.points.windows(2).map(|bone| distance_from_bone(p, bone[0], bone[1]));
        distance.fold(f64::INFINITY, f64::min).max(1e-4).powi(-4)
    };
    let row = |i: usize| -> Vec<f64> {
        let weights = model.vertex_weights(i);
        let near: Vec<f64> = chains.iter().map(|chain| nearness(model.vertices[i], chain)).collect();
        let near_sum: f64 = near.iter().sum();
        let own = |chain: &BendingChain| -> f64 { chain.joints.iter().chain(&chain.beyond).map(|&j| weights[j]).sum() };
        let parts: Vec<f64> =
            chains.iter().zip(&near).map(|(chain, near)| own(chain) + NEARNESS * near / near_sum).collect();
        let sum: f64 = parts.iter().sum();
        parts.iter().map(|part| part / sum).collect()
    };
    (0..model.vertices.len()).map(row).collect()
}

fn distance_from_bone(p: DVec3, a: DVec3, b: DVec3) -> f64 {
    let along = b - a;
    let t = ((p - a).dot(along) / along.length_squared().max(1e-12)).clamp(0.0, 1.0);
    p.distance(a + along * t)
}
