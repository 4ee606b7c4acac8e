//! An avatar's Gaussians as other programs move them: each by at most four bones, from where they are at rest. What ghand
//! does beside (local components, residual weights, light) is missing.

use ghand_core::Pose;
use ghand_core::skeleton::pose_skeleton;
use ghand_render::splat::SplatModel;
use glam::{DQuat, DVec3};

use crate::avatar::Avatar;
use crate::scene_files::SplatScene;

/// Bones of a Gaussian.
pub const BONES: usize = 4;

/// The bones that move each Gaussian, N.
#[derive(Debug, Clone, PartialEq)]
pub struct FourBones {
    /// The joints, the one with the largest weight first; 0 where the weight is 0.
    pub joints: Vec<[u16; BONES]>,
    /// Their weights, which sum to 1.
    pub weights: Vec<[f32; BONES]>,
}

/// A rigid motion as a dual quaternion: a rotation, and half the translation times it.
#[derive(Debug, Clone, Copy)]
struct DualQuat {
    real: DQuat,
    dual: DQuat,
}

impl DualQuat {
    fn new(rotation: DQuat, translation: DVec3) -> DualQuat {
        DualQuat {
            real: rotation,
            dual: DQuat::from_xyzw(translation.x, translation.y, translation.z, 0.0) * rotation * 0.5,
        }
    }
}

impl FourBones {
    /// The four bones with the largest skinning weights.
    pub fn of(avatar: &Avatar) -> FourBones {
        let template = &avatar.template;
        let count = template.len();
        let of = |p: usize| {
            let mut bound: Vec<(u16, f32)> =
                (0..template.joint_count()).map(|k| (k as u16, template.weights[k * count + p].max(0.0))).collect();
            bound.sort_by(|a, b| b.1.total_cmp(&a.1));
            bound.resize(BONES, (0, 0.0));
            let sum: f32 = bound.iter().map(|(_, weight)| weight).sum();
            // A Gaussian without weights stays with the first joint.
            let weight = |k: usize| if sum > 0.0 { bound[k].1 / sum } else { f32::from(u8::from(k == 0)) };
            let joint = |k: usize| if weight(k) > 0.0 { bound[k].0 } else { 0 };
            (std::array::from_fn(joint), std::array::from_fn(weight))
        };
        let (joints, weights) = (0..count).map(of).unzip();
        FourBones { joints, weights }
    }

    /// The weights as bytes that sum to 255.
    pub fn bytes(&self) -> Vec<[u8; BONES]> {
        let bytes = |weights: &[f32; BONES]| {
            let mut bytes = weights.map(|weight| (weight * 255.0).round() as u8);
            // The largest takes what rounding leaves.
            let others: u8 = bytes[1..].iter().fold(0, |sum, byte| sum.saturating_add(*byte));
            bytes[0] = 255 - others;
            bytes
        };
        self.weights.iter().map(bytes).collect()
    }

    /// A scene of these Gaussians at rest, moved to a pose by dual quaternions, as Spark's `SplatSkinning` does. The pose
    /// must have a rotation for each joint of the avatar.
    pub fn posed(&self, rest: &SplatScene, avatar: &Avatar, pose: &Pose) -> SplatScene {
        let template = &avatar.template;
        let chain = pose_skeleton(&template.parents, &template.joints, &pose.rotations);
        let bones: Vec<DualQuat> = (chain.posed_from_rest.iter())
            .map(|bone| DualQuat::new(DQuat::from_mat3(&bone.linear), bone.translation + pose.translation))
            .collect();
        let bytes = self.bytes();
        let moved: Vec<(DQuat, DVec3)> =
            self.joints.iter().zip(&bytes).map(|(joints, weights)| blend(&bones, joints, weights)).collect();
        let model = rest.model();
        let first = model.rotation_row();
        let at = |row: usize, i: usize| f64::from(rest.table[model.index(row, i, rest.count)]);
        let mut posed = rest.clone();
        for (i, (rotation, translation)) in moved.iter().enumerate().take(rest.count) {
            let place = *rotation * DVec3::new(at(0, i), at(1, i), at(2, i)) + *translation;
            let own = DQuat::from_xyzw(at(first + 1, i), at(first + 2, i), at(first + 3, i), at(first, i));
            let turned = *rotation * own;
            let mut set = |row: usize, value: f64| posed.table[model.index(row, i, rest.count)] = value as f32;
            (0..SplatModel::SCALE_ROW).for_each(|axis| set(axis, place[axis]));
            [turned.w, turned.x, turned.y, turned.z].into_iter().enumerate().for_each(|(k, v)| set(first + k, v));
        }
        posed
    }
}

/// The rotation and translation of a weighted sum of bones.
fn blend(bones: &[DualQuat], joints: &[u16; BONES], weights: &[u8; BONES]) -> (DQuat, DVec3) {
    let mut real = DQuat::from_xyzw(0.0, 0.0, 0.0, 0.0);
    let mut dual = real;
    for (joint, weight) in joints.iter().zip(weights) {
        let Some(bone) = bones.get(usize::from(*joint)).filter(|_| *weight > 0) else { continue };
        // Both signs are the same rotation; the nearer one is blended.
        let sign = if real.dot(bone.real) < 0.0 { -1.0 } else { 1.0 };
        real += bone.real * (sign * f64::from(*weight));
        dual += bone.dual * (sign * f64::from(*weight));
    }
    let length = real.length();
    if length == 0.0 {
        return (DQuat::IDENTITY, DVec3::ZERO);
    }
    let real = real * (1.0 / length);
    let moved = dual * (2.0 / length) * real.conjugate();
    (real, DVec3::new(moved.x, moved.y, moved.z))
}

#[cfg(test)]
mod tests {
    use ghand_test_support::procedural_hand::ProceduralHand;

    use super::*;
    use crate::posed_hand::PosedHand;
    use crate::template::{AvatarConfig, GaussianShape};

    fn avatar() -> Avatar {
        let model = ProceduralHand { detail: 1, ..Default::default() }.build().unwrap();
        let config = AvatarConfig { uv_resolution: 64, gaussians: GaussianShape::Flat, ..Default::default() };
        Avatar::untrained(&model, &config, [0.8, 0.5, 0.4], 3).unwrap()
    }

    #[test]
    fn weights_are_those_of_the_four_strongest_bones() {
        let avatar = avatar();
        let bones = FourBones::of(&avatar);
        let n = avatar.template.len();
        assert_eq!((bones.joints.len(), bones.weights.len()), (n, n));
        for (p, (joints, weights)) in bones.joints.iter().zip(&bones.weights).enumerate() {
            assert!((weights.iter().sum::<f32>() - 1.0).abs() < 1e-5 && weights.windows(2).all(|w| w[0] >= w[1]));
            let own = |k: u16| avatar.template.weights[usize::from(k) * n + p];
            let largest = (0..avatar.template.joint_count() as u16).map(own).fold(0.0, f32::max);
            assert_eq!(own(joints[0]), largest);
        }
        assert!(bones.bytes().iter().all(|bytes| bytes.iter().map(|b| u32::from(*b)).sum::<u32>() == 255));
    }

    #[test]
    fn a_hand_that_moves_as_a_whole_is_exact_and_a_fist_nearly() {
        let avatar = avatar();
        let rest = Pose::rest(avatar.model.joint_count());
        let bones = FourBones::of(&avatar);
        let at_rest = PosedHand::splats_on_host(&avatar, &rest).unwrap();
        let distances = |pose: &Pose| {
            let posed = bones.posed(&at_rest, &avatar, pose);
            let exact = PosedHand::splats_on_host(&avatar, pose).unwrap();
            let distances: Vec<f64> = posed.means().zip(exact.means()).map(|(a, b)| a.distance(b)).collect();
            let turned = |scene: &SplatScene, i: usize| {
                let [w, x, y, z] = [6, 7, 8, 9].map(|row| f64::from(scene.row(row).nth(i).unwrap()));
                DQuat::from_xyzw(x, y, z, w) * DVec3::Z
            };
            let normals = (0..posed.count).step_by(37).map(|i| turned(&posed, i).distance(turned(&exact, i)));
            (distances.iter().sum::<f64>() / distances.len() as f64, normals.fold(0.0, f64::max))
        };
        let mut whole = rest.clone();
        whole.rotations[0] = DVec3::new(0.4, -1.9, 0.8);
        whole.translation = DVec3::new(0.1, 0.2, -0.3);
        let (mean, normal) = distances(&whole);
        assert!(mean < 1e-6 && normal < 1e-5, "{mean} {normal}");
        let mut bent = rest.clone();
        bent.rotations[1..].fill(DVec3::new(0.0, 0.0, 0.5));
        let (mean, _) = distances(&bent);
        // Linear blending, which ghand does, flattens what dual quaternions do not.
        assert!(mean > 1e-6 && mean < 1e-3, "{mean}");
    }
}
