//! Motion of the hand: smooth trajectories through natural hand shapes.

use std::f64::consts::PI;

use ghand_core::rotation::rotation_from_axis_angle;
use ghand_core::{HandModel, Pose};
use glam::{DMat3, DQuat, DVec3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::anatomy::{Anatomy, Finger};

/// A gesture, in numbers that can be interpolated.
#[derive(Debug, Clone)]
struct Gesture {
    /// For each finger: bend of its three joints, radians (of the thumb: the base, then the two hinges).
    bends: Vec<[f64; 3]>,
    /// For each finger: sideways turn at the base, radians, about the back's normal.
    spreads: Vec<f64>,
    /// Axis-angle of the root, radians.
    root: DVec3,
    /// Metres.
    translation: DVec3,
}

/// How far each finger is closed (0 to 1), in the order of [`Anatomy::fingers`], in well-known hand shapes.
const SHAPES: [[f64; 5]; 9] = [
    [0.02, 0.0, 0.05, 0.0, 0.0],
    [0.95, 1.0, 0.95, 1.0, 0.8],
    [0.05, 0.95, 0.9, 0.95, 0.7],
    [0.05, 0.05, 0.95, 0.95, 0.8],
    [0.25, 0.25, 0.35, 0.3, 0.2],
    [0.55, 0.5, 0.6, 0.55, 0.5],
    [0.5, 0.15, 0.1, 0.1, 0.55],
    [0.9, 0.9, 0.1, 0.9, 0.1],
    [0.15, 0.5, 0.8, 0.7, 0.3],
];

/// Bends of the thumb's joints where it is closed, radians.
const LARGEST_BENDS_OF_THUMB: [f64; 3] = [0.45, 0.50, 0.80];
/// How much farther than another hand's a person's fingers close.
const HUMAN_BEND: f64 = 1.15;
/// The part of the angle between fingers that is gone where their knuckles are bent at right angles.
const CONVERGENCE: f64 = 0.5;

fn between(rng: &mut ChaCha8Rng, low: f64, high: f64) -> f64 {
    low + (high - low) * rng.random::<f64>()
}

impl Gesture {
    fn random(anatomy: &Anatomy, shape: usize, rng: &mut ChaCha8Rng) -> Gesture {
        let closed = SHAPES[shape % SHAPES.len()];
        let spread = between(rng, -0.6, 1.0);
        let mut gesture = Gesture { bends: vec![], spreads: vec![], root: DVec3::ZERO, translation: DVec3::ZERO };
        for (i, finger) in anatomy.fingers.iter().enumerate() {
            let closed = (closed[i % 5] + between(rng, -0.07, 0.07)).clamp(0.0, 1.0);
            // The hinges of one finger share a tendon: they bend together, but not exactly equally.
            let vary = |rng: &mut ChaCha8Rng, angle: f64| angle * between(rng, 0.92, 1.08);
            gesture.bends.push(if finger.is_thumb {
                [vary(rng, 0.45 * closed), vary(rng, 0.5 * closed), vary(rng, 0.05 + 0.75 * closed)]
            } else {
                [vary(rng, 1.15 * closed), vary(rng, 0.04 + 1.40 * closed), vary(rng, 0.03 + 0.85 * closed)]
            });
            // Fingers at the edge spread most; closed fingers cannot.
            // A wrist that is at the origin up to rounding should not change the motions.
            let wrist = if anatomy.folded_thumb.is_some() { anatomy.wrist.z } else { 0.0 };
            let across = finger.points[0].z - wrist;
            let side = if finger.is_thumb { 0.0 } else { across / (0.035 * anatomy.scale) };
            gesture.spreads.push(0.12 * spread * side * (1.0 - closed) + between(rng, -0.02, 0.02));
        }
        let direction = |rng: &mut ChaCha8Rng| DVec3::from_array([0; 3].map(|_| between(rng, -1.0, 1.0)));
        gesture.root = direction(rng) * (20.0 * PI / 180.0 / 3f64.sqrt());
        gesture.translation = direction(rng) * (0.02 / 3f64.sqrt());
        gesture
    }

    /// Catmull-Rom spline through four gestures, `t` in `[0, 1]` from the second to the third.
    fn between(g: [&Gesture; 4], t: f64) -> Gesture {
        let spline = |[a, b, c, d]: [f64; 4]| {
            b + 0.5 * t * (c - a + t * (2.0 * a - 5.0 * b + 4.0 * c - d + t * (3.0 * (b - c) + d - a)))
        };
        let vector =
            |f: &dyn Fn(&Gesture) -> DVec3| DVec3::from_array([0, 1, 2].map(|axis| spline(g.map(|g| f(g)[axis]))));
        let count = g[0].bends.len();
        // A spline overshoots; hinges do not bend backwards.
        let bend = |i: usize, k: usize| spline(g.map(|g| g.bends[i][k])).max(-0.05);
        Gesture {
            bends: (0..count).map(|i| [bend(i, 0), bend(i, 1), bend(i, 2)]).collect(),
            spreads: (0..count).map(|i| spline(g.map(|g| g.spreads[i]))).collect(),
            root: vector(&|g| g.root),
            translation: vector(&|g| g.translation),
        }
    }

    fn pose(&self, anatomy: &Anatomy, joint_count: usize) -> Pose {
        let mut pose = Pose::rest(joint_count);
        pose.translation = self.translation;
        if let Some(root) = pose.rotations.first_mut() {
            *root = self.root;
        }
        for (i, finger) in anatomy.fingers.iter().enumerate() {
            let rotations = match &anatomy.folded_thumb {
                None => self.mannequin_finger(finger, i),
                Some(folded) if finger.is_thumb => self.human_thumb(finger, folded, i),
                Some(_) => self.human_finger(finger, i),
            };
            finger.joints.iter().zip(rotations).for_each(|(&joint, rotation)| pose.rotations[joint] = rotation);
        }
        pose
    }

    /// Rotations of finger `i` of a hand that is not the built-in one.
    fn mannequin_finger(&self, finger: &Finger, i: usize) -> [DVec3; 3] {
        [0, 1, 2].map(|k| {
            let mut turn = rotation_from_axis_angle(finger.bend_axis(k) * self.bends[i][k]);
            if k == 0 {
                turn = rotation_from_axis_angle(finger.dorsal * -self.spreads[i]) * turn;
            }
            if k == 0 && finger.is_thumb {
                // Opposition: the thumb swings across the palm and turns its pad towards the fingers.
                let closed = self.bends[i][0] / LARGEST_BENDS_OF_THUMB[0];
                turn = rotation_from_axis_angle(DVec3::new(0.1, -0.35, 0.35) * closed) * turn;
            }
            axis_angle(turn)
        })
    }

    /// Rotations of finger `i` of a hand whose fingers fan out at rest: they converge as they close, and close farther.
    fn human_finger(&self, finger: &Finger, i: usize) -> [DVec3; 3] {
        let bends = self.bends[i].map(|bend| bend * HUMAN_BEND);
        let bone = finger.direction(0);
        let fan = bone.z.atan2(-bone.y);
        let spread = self.spreads[i] - CONVERGENCE * fan * (bends[0] / std::f64::consts::FRAC_PI_2);
        let base = rotation_from_axis_angle(finger.dorsal * -spread)
            * rotation_from_axis_angle(finger.bend_axis(0) * bends[0]);
        [axis_angle(base), finger.bend_axis(1) * bends[1], finger.bend_axis(2) * bends[2]]
    }

    /// Rotations of the thumb, finger `i`, of a hand whose folded thumb is known.
    fn human_thumb(&self, finger: &Finger, folded: &[DVec3; 3], i: usize) -> [DVec3; 3] {
        let part = |k: usize| HUMAN_BEND * self.bends[i][k] / LARGEST_BENDS_OF_THUMB[k];
        let base =
            rotation_from_axis_angle(finger.dorsal * -self.spreads[i]) * rotation_from_axis_angle(folded[0] * part(0));
        [axis_angle(base), folded[1] * part(1), folded[2] * part(2)]
    }
}

fn axis_angle(rotation: DMat3) -> DVec3 {
    DQuat::from_mat3(&rotation).to_scaled_axis()
}

/// The natural motion of a synthetic capture's training frames, for a right hand whose joint names identify the three
/// joints of each finger. Other joints, such as metacarpals and tips, stay at rest.
pub fn natural_motion(model: &HandModel, count: usize, seed: u64) -> Vec<Pose> {
    trajectory(&Anatomy::of(model), model.joint_count(), count, seed)
}

/// Hand shapes, one after the other, and what is between them.
pub(crate) struct Gestures(Vec<Gesture>);

impl Gestures {
    /// Random variants of the well-known shapes in their order, from the shape `first` on.
    pub(crate) fn random(anatomy: &Anatomy, first: usize, count: usize, rng: &mut ChaCha8Rng) -> Gestures {
        Gestures((first..first + count).map(|i| Gesture::random(anatomy, i, rng)).collect())
    }

    /// The pose a part `t` of the way from one shape to the next.
    pub(crate) fn pose(&self, anatomy: &Anatomy, joint_count: usize, shape: usize, t: f64) -> Pose {
        let key = |i: usize| &self.0[(shape + i).saturating_sub(1).min(self.0.len() - 1)];
        Gesture::between([key(0), key(1), key(2), key(3)], t).pose(anatomy, joint_count)
    }
}

/// A smooth trajectory of `count` frames through hand shapes, about three frames from one to the next.
pub(crate) fn trajectory(anatomy: &Anatomy, joint_count: usize, count: usize, seed: u64) -> Vec<Pose> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let gestures = Gestures::random(anatomy, 0, count.div_ceil(3) + 3, &mut rng);
    (0..count).map(|frame| gestures.pose(anatomy, joint_count, frame / 3, (frame % 3) as f64 / 3.0)).collect()
}

/// `count` single poses, mixtures of two hand shapes each, which are not on any trajectory of [`trajectory`].
pub(crate) fn single_poses(anatomy: &Anatomy, joint_count: usize, count: usize, seed: u64) -> Vec<Pose> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed ^ 0x7E57);
    (0..count)
        .map(|i| {
            let a = Gesture::random(anatomy, 2 * i + 4, &mut rng);
            let b = Gesture::random(anatomy, 5 * i + 2, &mut rng);
            let mix = between(&mut rng, 0.25, 0.75);
            Gesture::between([&a, &a, &b, &b], mix).pose(anatomy, joint_count)
        })
        .collect()
}
