//! Errors of a tracker: its possible estimates of true poses.

use ghand_core::Pose;
use ghand_core::rotation::{axis_angle_from_rotation, rotation_from_axis_angle};
use glam::DVec3;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use crate::hand::anatomy::Anatomy;
use crate::normal::normal_vector;

/// Standard deviations of a tracker's errors.
pub(crate) struct PoseErrors {
    /// Each component of a finger joint's axis-angle, radians; the root has half of this.
    pub rotation: f64,
    /// Each component of the translation, metres.
    pub translation: f64,
}

impl PoseErrors {
    /// One error of each joint that moves, the root among them, and one of the translation.
    fn draw(&self, joints: &[usize], rng: &mut ChaCha8Rng) -> (Vec<DVec3>, DVec3) {
        let sigma = |joint: usize| if joint == 0 { self.rotation * 0.5 } else { self.rotation };
        let rotations = joints.iter().map(|&joint| normal_vector(rng, sigma(joint))).collect();
        (rotations, normal_vector(rng, self.translation))
    }
}

/// Estimates with errors that are independent in every frame. Joints that do not move have none.
pub(crate) fn noisy(anatomy: &Anatomy, poses: &[Pose], noise: &PoseErrors, seed: u64) -> Vec<Pose> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed ^ 0x9015E);
    let joints = moving(anatomy);
    let estimate = |pose: &Pose| {
        let mut estimate = pose.clone();
        let (rotations, translation) = noise.draw(&joints, &mut rng);
        joints.iter().zip(rotations).for_each(|(&joint, error)| estimate.rotations[joint] += error);
        estimate.translation += translation;
        estimate
    };
    poses.iter().map(estimate).collect()
}

/// Estimates with the same errors in every frame: each joint is rotated in its parent's axes. Joints that do not move
/// have none.
pub(crate) fn biased(anatomy: &Anatomy, poses: &[Pose], bias: &PoseErrors, seed: u64) -> Vec<Pose> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed ^ 0xB1A5);
    let joints = moving(anatomy);
    let (rotations, translation) = bias.draw(&joints, &mut rng);
    let estimate = |pose: &Pose| {
        let mut estimate = pose.clone();
        for (&joint, error) in joints.iter().zip(&rotations) {
            let rotation = rotation_from_axis_angle(*error) * rotation_from_axis_angle(pose.rotations[joint]);
            estimate.rotations[joint] = axis_angle_from_rotation(&rotation);
        }
        estimate.translation += translation;
        estimate
    };
    poses.iter().map(estimate).collect()
}

/// The root and the joints of the fingers.
fn moving(anatomy: &Anatomy) -> Vec<usize> {
    std::iter::once(0).chain(anatomy.fingers.iter().flat_map(|finger| finger.joints)).collect()
}
