//! Motions from key frames: poses at chosen times, and a smooth way from each to the next.
//!
//! Between two keys each joint follows a cubic Bézier curve of rotations (Kim, Kim and Shin 1995, with cumulative
//! Bernstein polynomials): `q0 exp(b1 w1) exp(b2 w2) exp(b3 w3)`. It meets both keys, and its angular velocities there are
//! 3 `w1` and 3 `w3` per interval, in the joint's own axes. Both curves at a key have the same one, so that the motion has
//! no corners. It is the harmonic mean of the mean velocities before and after the key, component by component (Fritsch
//! and Butland 1984), and zero where these have opposite signs: a joint that turns about one axis never bends farther
//! than in its keys, and rests between two equal ones. The motion begins and ends at rest. Translations are cubic in the
//! same way.

use std::array::from_fn;

use ghand_core::Pose;
use ghand_core::rotation::{axis_angle_from_rotation, rotation_from_axis_angle};
use glam::{DMat3, DQuat, DVec3};

use crate::{PoseFrame, PoseSequence};

/// Times closer than this are the same, seconds.
const SAME_TIME_SECS: f64 = 1e-6;

/// A pose at a time.
#[derive(Debug, Clone, PartialEq)]
pub struct Key {
    /// Seconds from the beginning.
    pub seconds: f64,
    /// The pose.
    pub pose: Pose,
}

/// Keys in the order of their times, which differ.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct KeyFrames {
    keys: Vec<Key>,
}

impl KeyFrames {
    /// The keys in the order of their times.
    pub fn keys(&self) -> &[Key] {
        &self.keys
    }

    /// The key at a time.
    pub fn at(&self, seconds: f64) -> Option<usize> {
        self.keys.iter().position(|key| (key.seconds - seconds).abs() < SAME_TIME_SECS)
    }

    /// Sets the pose at a time, which must not be negative: changes the key there, or adds one. Returns its index.
    pub fn set(&mut self, seconds: f64, pose: Pose) -> usize {
        if let Some(index) = self.at(seconds) {
            self.keys[index].pose = pose;
            return index;
        }
        let index = self.keys.partition_point(|key| key.seconds < seconds);
        self.keys.insert(index, Key { seconds: seconds.max(0.0), pose });
        index
    }

    /// Moves a key to another time, unless there is one. Returns its new index.
    pub fn move_to(&mut self, index: usize, seconds: f64) -> usize {
        if index >= self.keys.len() || self.at(seconds).is_some() {
            return index;
        }
        let key = self.keys.remove(index);
        self.set(seconds, key.pose)
    }

    /// Removes a key.
    pub fn remove(&mut self, index: usize) {
        if index < self.keys.len() {
            self.keys.remove(index);
        }
    }

    /// The time of the last key, seconds.
    pub fn duration(&self) -> f64 {
        self.keys.last().map_or(0.0, |key| key.seconds)
    }

    /// The pose at a time in seconds; before the first key and after the last one their poses apply. `None` without keys.
    pub fn pose_at(&self, seconds: f64) -> Option<Pose> {
        if let Some(index) = self.at(seconds) {
            return self.keys.get(index).map(|key| key.pose.clone());
        }
        let next = self.keys.partition_point(|key| key.seconds < seconds);
        let Some(before) = next.checked_sub(1) else { return self.keys.first().map(|key| key.pose.clone()) };
        let (Some(from), Some(to)) = (self.keys.get(before), self.keys.get(next)) else {
            return self.keys.last().map(|key| key.pose.clone());
        };
        let interval = to.seconds - from.seconds;
        let part = (seconds - from.seconds) / interval;
        let rotation = |joint: usize| {
            let [start, end] = [before, next].map(|key| self.angular_velocity(key, joint) * interval);
            let [from, to] = [from, to].map(|key| quaternion(&key.pose, joint));
            axis_angle_from_rotation(&DMat3::from_quat(curve(from, to, start, end, part)))
        };
        let [start, end] = [before, next].map(|key| self.velocity(key) * interval);
        Some(Pose {
            rotations: (0..from.pose.rotations.len()).map(rotation).collect(),
            translation: cubic(from.pose.translation, to.pose.translation, start, end, part),
        })
    }

    /// The motion at a constant rate, from 0 to the last key; every key whose time is a whole number of frames is met.
    /// `None` without keys.
    pub fn sequence(&self, fps: f64, joint_names: &[String], shape: &[f64]) -> Option<PoseSequence> {
        let last = (self.duration() * fps - SAME_TIME_SECS).ceil().max(0.0) as usize;
        let frame = |number: usize| {
            let pose = self.pose_at(number as f64 / fps)?;
            Some(PoseFrame { id: format!("{number:04}"), pose, shape: shape.to_vec() })
        };
        let frames = (0..=last).map(frame).collect::<Option<Vec<_>>>()?;
        Some(PoseSequence { fps, joint_names: joint_names.to_vec(), frames, warnings: vec![] })
    }

    /// Ids of the frames of a sequence that are at keys, in order.
    pub fn ids_in(&self, sequence: &PoseSequence) -> Vec<String> {
        let seconds = |number: usize| number as f64 / sequence.fps;
        let frames = sequence.frames.iter().enumerate().filter(|(number, _)| self.at(seconds(*number)).is_some());
        frames.map(|(_, frame)| frame.id.clone()).collect()
    }

    /// The keys at the frames of a sequence with these ids; others are ignored. `None` without any.
    pub fn of_sequence(sequence: &PoseSequence, ids: &[String]) -> Option<KeyFrames> {
        let mut keys = KeyFrames::default();
        for (number, frame) in sequence.frames.iter().enumerate().filter(|(_, frame)| ids.contains(&frame.id)) {
            keys.set(number as f64 / sequence.fps, frame.pose.clone());
        }
        (!keys.keys.is_empty()).then_some(keys)
    }

    /// Angular velocity of a joint at a key in the joint's own axes, radians per second.
    fn angular_velocity(&self, index: usize, joint: usize) -> DVec3 {
        self.slope(index, |from, to| logarithm(quaternion(from, joint).inverse() * quaternion(to, joint)))
    }

    /// Velocity of the hand at a key, metres per second.
    fn velocity(&self, index: usize) -> DVec3 {
        self.slope(index, |from, to| to.translation - from.translation)
    }

    /// The common velocity of both curves at a key; `step` is the way from one pose to another.
    fn slope(&self, index: usize, step: impl Fn(&Pose, &Pose) -> DVec3) -> DVec3 {
        let key = |index: Option<usize>| self.keys.get(index?);
        let (Some(before), Some(here), Some(after)) =
            (key(index.checked_sub(1)), key(Some(index)), key(index.checked_add(1)))
        else {
            return DVec3::ZERO;
        };
        let [earlier, later] = [here.seconds - before.seconds, after.seconds - here.seconds];
        let [arriving, leaving] = [step(&before.pose, &here.pose) / earlier, step(&here.pose, &after.pose) / later]
            .map(|slope| slope.to_array());
        DVec3::from(from_fn(|axis| harmonic_mean([arriving[axis], leaving[axis]], [earlier, later])))
    }
}

/// The weighted harmonic mean of two slopes over intervals of these lengths that keeps a cubic curve between its ends; zero
/// for slopes of opposite signs.
fn harmonic_mean([a, b]: [f64; 2], [first, second]: [f64; 2]) -> f64 {
    if a * b <= 0.0 {
        return 0.0;
    }
    let (w, v) = (first + 2.0 * second, 2.0 * first + second);
    (w + v) / (w / a + v / b)
}

fn quaternion(pose: &Pose, joint: usize) -> DQuat {
    let rotation = pose.rotations.get(joint).copied().unwrap_or_default();
    DQuat::from_mat3(&rotation_from_axis_angle(rotation)).normalize()
}

/// The shorter rotation as an axis-angle vector.
fn logarithm(rotation: DQuat) -> DVec3 {
    let rotation = if rotation.w < 0.0 { -rotation } else { rotation };
    rotation.to_scaled_axis()
}

/// A curve of rotations with these angular velocities at its ends, in units of the whole interval.
fn curve(from: DQuat, to: DQuat, start: DVec3, end: DVec3, part: f64) -> DQuat {
    let exp = |vector: DVec3| DQuat::from_scaled_axis(vector);
    let [first, third] = [start / 3.0, end / 3.0];
    let second = logarithm(exp(first).inverse() * from.inverse() * to * exp(third).inverse());
    let rest = 1.0 - part;
    // Cumulative Bernstein polynomials.
    let [b1, b2, b3] = [1.0 - rest.powi(3), part.powi(2) * (3.0 - 2.0 * part), part.powi(3)];
    (from * exp(b1 * first) * exp(b2 * second) * exp(b3 * third)).normalize()
}

/// The same curve of points.
fn cubic(from: DVec3, to: DVec3, start: DVec3, end: DVec3, part: f64) -> DVec3 {
    let rest = 1.0 - part;
    let [first, third] = [start / 3.0, end / 3.0];
    let second = to - from - first - third;
    from + (1.0 - rest.powi(3)) * first + part.powi(2) * (3.0 - 2.0 * part) * second + part.powi(3) * third
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pose(rotation: DVec3, x: f64) -> Pose {
        Pose { rotations: vec![rotation, -0.5 * rotation], translation: DVec3::X * x }
    }

    /// Keys at uneven times, in rotations about changing axes.
    fn keys() -> KeyFrames {
        let mut keys = KeyFrames::default();
        for (seconds, rotation, x) in [
            (1.0, DVec3::new(0.4, 1.1, -0.3), 0.1),
            (0.0, DVec3::ZERO, 0.0),
            (1.4, DVec3::new(1.2, 1.4, 0.2), 0.3),
            (3.0, DVec3::new(-0.6, 2.2, 0.9), 0.2),
        ] {
            keys.set(seconds, pose(rotation, x));
        }
        keys
    }

    fn apart(a: &Pose, b: &Pose) -> f64 {
        let turn = |joint| logarithm(quaternion(a, joint).inverse() * quaternion(b, joint)).length();
        turn(0).max(turn(1)).max(a.translation.distance(b.translation))
    }

    #[test]
    fn keys_are_sorted_met_exactly_and_hold_at_both_ends() {
        let keys = keys();
        assert_eq!(keys.keys().iter().map(|key| key.seconds).collect::<Vec<_>>(), [0.0, 1.0, 1.4, 3.0]);
        for key in keys.keys() {
            assert_eq!(keys.pose_at(key.seconds).as_ref(), Some(&key.pose));
            for beside in [-1e-5, 1e-5] {
                assert!(apart(&keys.pose_at(key.seconds + beside).unwrap(), &key.pose) < 1e-4);
            }
        }
        assert_eq!(keys.pose_at(-1.0), keys.pose_at(0.0));
        assert_eq!(keys.pose_at(9.0), keys.pose_at(3.0));
        assert_eq!(KeyFrames::default().pose_at(0.0), None);
    }

    #[test]
    fn the_velocity_does_not_jump_at_a_key() {
        let keys = keys();
        let h = 1e-4;
        for key in &keys.keys()[1..3] {
            let here = &key.pose;
            let at = |seconds: f64| keys.pose_at(key.seconds + seconds).unwrap();
            for joint in 0..2 {
                let step = |a: &Pose, b: &Pose| logarithm(quaternion(a, joint).inverse() * quaternion(b, joint)) / h;
                let (before, after) = (step(&at(-h), here), step(here, &at(h)));
                // The difference of one-sided quotients is h times an acceleration of a few radians per second squared.
                assert!((before - after).length() < 5e-3, "{before} {after}");
                assert!(before.length() > 0.1, "the test needs motion: {before}");
            }
            let (before, after) = (here.translation - at(-h).translation, at(h).translation - here.translation);
            assert!((before - after).length() / h < 5e-3);
        }
        for end in [0.0, 3.0 - h] {
            assert!(apart(&keys.pose_at(end).unwrap(), &keys.pose_at(end + h).unwrap()) / h < 5e-3);
        }
    }

    #[test]
    fn a_hinge_stays_between_its_keys_and_rests_between_equal_ones() {
        let axis = DVec3::new(1.0, 2.0, -2.0) / 3.0;
        let mut keys = KeyFrames::default();
        for (seconds, angle) in [(0.0, 0.2), (0.3, 1.5), (1.5, 1.5), (1.6, 0.9), (3.0, 0.1)] {
            keys.set(seconds, pose(axis * angle, angle));
        }
        let mut before = f64::NEG_INFINITY;
        for k in 0..=300 {
            let now = keys.pose_at(0.01 * f64::from(k)).unwrap();
            let angle = axis.dot(now.rotations[0]);
            assert!(angle > 0.1 - 1e-9 && angle < 1.5 + 1e-9, "{angle}");
            assert!((now.rotations[0] - axis * angle).length() < 1e-9 && (now.translation.x - angle).abs() < 1e-9);
            if (30..=150).contains(&k) {
                assert!((angle - 1.5).abs() < 1e-9);
            }
            assert!(k > 30 || angle >= before, "it turns back before its key");
            before = angle;
        }
    }

    #[test]
    fn keys_are_changed_moved_and_removed() {
        let mut keys = keys();
        let fist = pose(DVec3::Z, 0.0);
        assert_eq!(keys.set(1.0, fist.clone()), 1);
        assert_eq!(keys.keys().len(), 4);
        assert_eq!(keys.move_to(1, 2.0), 2);
        assert_eq!(keys.pose_at(2.0), Some(fist));
        // There is one already.
        assert_eq!(keys.move_to(2, 3.0), 2);
        keys.remove(2);
        keys.remove(7);
        assert_eq!(keys.keys().iter().map(|key| key.seconds).collect::<Vec<_>>(), [0.0, 1.4, 3.0]);
    }

    #[test]
    fn the_motion_at_a_constant_rate_meets_the_keys() {
        let keys = keys();
        let sequence = keys.sequence(10.0, &["a".into(), "b".into()], &[]).unwrap();
        assert_eq!((sequence.frames.len(), sequence.duration()), (31, 3.0));
        for key in keys.keys() {
            assert!(apart(&sequence.pose_at(key.seconds).unwrap(), &key.pose) < 1e-9);
        }
        assert_eq!(keys.ids_in(&sequence), ["0000", "0010", "0014", "0030"]);
        let again = KeyFrames::of_sequence(&sequence, &keys.ids_in(&sequence)).unwrap();
        for (again, key) in again.keys().iter().zip(keys.keys()) {
            assert!((again.seconds - key.seconds).abs() < 1e-9 && apart(&again.pose, &key.pose) < 1e-9);
        }
        assert!(KeyFrames::of_sequence(&sequence, &["none".into()]).is_none());
    }
}
