//! How the hand of footage moves: fingers from one shape to another, the forearm about its own axis so that cameras see
//! the palm and the back, the wrist, and the elbow on the desk. Slow and fast moments follow each other.

use ghand_core::Pose;
use ghand_core::rotation::{axis_angle_from_rotation, rotation_from_axis_angle};
use glam::DVec3;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::hand::anatomy::Anatomy;
use crate::hand::trajectory::Gestures;

/// The elbow where it usually is, and the wrist's distance from it, metres. The world's origin is about the middle of
/// the hand then.
pub(crate) const ELBOW: DVec3 = DVec3::new(0.0, 0.33, 0.0);
const FOREARM: f64 = 0.25;
/// Shapes of the fingers, and keys of the arm, each second on average; and those of a hand that is held nearly still.
const GESTURES: f64 = 1.3;
const ARM_KEYS: f64 = 0.7;
const STILL_GESTURES: f64 = 0.4;
const STILL_ARM_KEYS: f64 = 0.4;
/// How far the arm of a hand that is held still moves relative to another's.
const STILL_PART: f64 = 0.15;
/// Rotations about the forearm's axis at which the back and the palm face the cameras, radians.
const BACK: f64 = 0.1;
const PALM: f64 = 2.9;
/// Largest changes of the arm: that rotation, how far the forearm leans, radians; the elbow, metres; the wrist's
/// flexion and deviation, radians.
const TURN: f64 = 0.6;
const LEAN: f64 = 0.22;
const SHIFT: DVec3 = DVec3::new(0.06, 0.015, 0.04);
const FLEXION: f64 = 0.4;
const DEVIATION: f64 = 0.18;
/// The speed of time in waves, relative to its mean: size, seconds, phase in turns.
const WAVES: [(f64, f64, f64); 2] = [(0.5, 4.1, 0.1), (0.35, 2.3, 0.6)];
/// Clocks may start so many seconds before the time 0.
const BEFORE: f64 = 2.0;

/// Keys of the arm: turn, leans about x and z, elbow, flexion, deviation.
type ArmKey = [f64; 8];

/// A motion of a right hand.
pub(crate) struct Motion {
    gestures: Gestures,
    arm: Vec<ArmKey>,
    /// Shapes and keys per second.
    rates: [f64; 2],
    phase: f64,
}

impl Motion {
    /// A random motion from a little before the time 0 until `seconds`.
    pub(crate) fn random(anatomy: &Anatomy, seconds: f64, is_still: bool, seed: u64) -> Motion {
        let mut rng = ChaCha8Rng::seed_from_u64(seed ^ 0xA4A);
        let rates = if is_still { [STILL_GESTURES, STILL_ARM_KEYS] } else { [GESTURES, ARM_KEYS] };
        let phase = rng.random::<f64>();
        let count = |rate: f64| (rate * (seconds + 2.0 * BEFORE)) as usize + 6;
        let first = (rng.random::<f64>() * 9.0) as usize;
        let gestures = Gestures::random(anatomy, first, count(rates[0]), &mut rng);
        let part = if is_still { STILL_PART } else { 1.0 };
        let mut shows_palm = rng.random::<f64>() < 0.5;
        let arm = (0..count(rates[1]))
            .map(|_| {
                shows_palm ^= !is_still && rng.random::<f64>() < 0.6;
                let mut even = |size: f64| part * size * (2.0 * rng.random::<f64>() - 1.0);
                let turn = if shows_palm { PALM } else { BACK } + even(TURN);
                let leans = [even(LEAN), even(LEAN)];
                let elbow = SHIFT.to_array().map(&mut even);
                [turn, leans[0], leans[1], elbow[0], elbow[1], elbow[2], even(FLEXION), even(DEVIATION)]
            })
            .collect();
        Motion { gestures, arm, rates, phase }
    }

    /// The pose at a time, and the rotation of the forearm against the hand, axis-angle; seconds, radians.
    pub(crate) fn at(&self, anatomy: &Anatomy, joint_count: usize, time: f64) -> (Pose, DVec3) {
        let [gesture, key] = self.rates.map(|rate| rate * self.warped(time + BEFORE));
        let mut pose = self.gestures.pose(anatomy, joint_count, gesture as usize, gesture.fract());
        let [turn, lean_x, lean_z, x, y, z, flexion, deviation] = self.arm_at(key);
        let rotation = |x: f64, y: f64, z: f64| rotation_from_axis_angle(DVec3::new(x, y, z));
        let forearm = rotation(lean_x, 0.0, 0.0) * rotation(0.0, 0.0, lean_z) * rotation(0.0, turn, 0.0);
        // The back of the hand faces +X, its width is along Z.
        let wrist = DVec3::new(deviation, 0.0, flexion);
        let place = ELBOW + DVec3::new(x, y, z) + forearm * (FOREARM * DVec3::NEG_Y);
        if let Some(root) = pose.rotations.first_mut() {
            *root = axis_angle_from_rotation(&(forearm * rotation_from_axis_angle(wrist)));
        }
        pose.translation = place - anatomy.wrist;
        (pose, -wrist)
    }

    /// Time that passes slowly and fast.
    fn warped(&self, time: f64) -> f64 {
        let wave = |(size, seconds, phase): (f64, f64, f64)| {
            let turns = std::f64::consts::TAU / seconds;
            size * (turns * time + std::f64::consts::TAU * (phase + self.phase)).sin() / turns
        };
        // Its waves are at most a second.
        (time + WAVES.into_iter().map(wave).sum::<f64>()).max(0.0)
    }

    /// Catmull-Rom spline through the keys.
    fn arm_at(&self, at: f64) -> ArmKey {
        let key = |i: usize| &self.arm[(at as usize + i).saturating_sub(1).min(self.arm.len() - 1)];
        let keys = [key(0), key(1), key(2), key(3)];
        let t = at.fract();
        std::array::from_fn(|k| {
            let [a, b, c, d] = keys.map(|key| key[k]);
            b + 0.5 * t * (c - a + t * (2.0 * a - 5.0 * b + 4.0 * c - d + t * (3.0 * (b - c) + d - a)))
        })
    }
}

#[cfg(test)]
mod tests {
    use ghand_core::Side;
    use ghand_hand_model::builtin::builtin_hand;

    use super::*;

    /// Poses of a motion, 120 each second.
    fn poses(is_still: bool) -> Vec<Pose> {
        let hand = builtin_hand(Side::Right).unwrap();
        let anatomy = Anatomy::of(&hand);
        let motion = Motion::random(&anatomy, 30.0, is_still, 4);
        (0..3600).map(|k| motion.at(&anatomy, hand.joint_count(), f64::from(k) / 120.0).0).collect()
    }

    #[test]
    fn a_motion_shows_palm_and_back_at_different_speeds_and_without_jumps() {
        let poses = poses(false);
        // Where the back of the hand faces.
        let backs: Vec<DVec3> =
            poses.iter().map(|pose| rotation_from_axis_angle(pose.rotations[0]) * DVec3::X).collect();
        let part = |towards: f64| backs.iter().filter(|back| back.x * towards > 0.7).count() as f64 / 3600.0;
        assert!(part(1.0) > 0.2 && part(-1.0) > 0.2, "back {} palm {}", part(1.0), part(-1.0));
        let mut speeds: Vec<f64> = backs.windows(2).map(|pair| pair[0].angle_between(pair[1]) * 120.0).collect();
        speeds.sort_by(f64::total_cmp);
        assert!(speeds[3598] < 12.0, "{} radians per second", speeds[3598]);
        assert!(speeds[360] < 0.3 && speeds[3240] > 2.0, "{} {}", speeds[360], speeds[3240]);
        let steps = poses.windows(2).map(|pair| pair[0].translation.distance(pair[1].translation));
        assert!(steps.fold(0.0, f64::max) < 0.01);
    }

    #[test]
    fn a_hand_that_is_held_still_moves_little() {
        let poses = poses(true);
        let first = poses[0].translation;
        assert!(poses.iter().all(|pose| pose.translation.distance(first) < 0.06));
    }
}
