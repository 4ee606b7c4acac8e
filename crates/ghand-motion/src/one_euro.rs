//! Smooths the poses of a noisy tracker with the 1€ filter (Casiez, Roussel and Vogel, CHI 2012).
//!
//! It is a low-pass filter whose cutoff frequency grows with speed: a hand at rest does not tremble, and a fast one
//! hardly lags. Each joint's rotation and the hand's position are filtered by themselves; differences of rotations are
//! rotation vectors, so that no axis is preferred.

use std::f64::consts::TAU;

use ghand_core::Pose;
use ghand_core::rotation::{axis_angle_from_rotation, rotation_from_axis_angle};
use glam::{DMat3, DQuat, DVec3};

use crate::pose_sequence::{PoseFrame, between};

/// Cutoff at rest, Hz: a tremble of 10 Hz is reduced to a tenth.
const CUTOFF_AT_REST: f64 = 1.0;
/// How much the cutoff grows with speed: Hz for each rad/s. A finger closes at about 10 rad/s, and then lags by 20 ms.
const CUTOFF_PER_TURN_RATE: f64 = 0.7;
/// The same for positions, Hz for each m/s: a hand is waved at about 1 m/s.
const CUTOFF_PER_SPEED: f64 = 7.0;
/// Cutoff of the speed itself, Hz, as its authors recommend.
const CUTOFF_OF_SPEED: f64 = 1.0;
/// After a longer gap than this, seconds, the tracker had lost the hand: the filter begins again.
const LONGEST_GAP: f64 = 0.5;
/// Frames that arrive together are treated as this far apart, seconds.
const SHORTEST_STEP: f64 = 1e-3;

/// Smooths poses that come one after the other.
#[derive(Debug, Clone, Default)]
pub struct PoseFilter {
    last: Option<State>,
}

#[derive(Debug, Clone)]
struct State {
    seconds: f64,
    rotations: Vec<Channel<DQuat>>,
    translation: Channel<DVec3>,
}

impl PoseFilter {
    /// The smoothed pose at a time, seconds from any beginning. The first pose, one after a gap and one of another
    /// skeleton stay as they are.
    pub fn smooth(&mut self, pose: &Pose, seconds: f64) -> Pose {
        let rotations = || pose.rotations.iter().map(|v| DQuat::from_mat3(&rotation_from_axis_angle(*v)).normalize());
        let fits = |last: &State| {
            last.rotations.len() == pose.rotations.len() && (0.0..=LONGEST_GAP).contains(&(seconds - last.seconds))
        };
        let Some(last) = self.last.as_mut().filter(|last| fits(last)) else {
            let rotations = rotations().map(Channel::new).collect();
            self.last = Some(State { seconds, rotations, translation: Channel::new(pose.translation) });
            return pose.clone();
        };
        let step = (seconds - last.seconds).max(SHORTEST_STEP);
        last.seconds = seconds;
        let smoothed = last.rotations.iter_mut().zip(rotations());
        Pose {
            rotations: smoothed
                .map(|(channel, rotation)| channel.smooth(rotation, step, CUTOFF_PER_TURN_RATE))
                .map(|rotation| axis_angle_from_rotation(&DMat3::from_quat(rotation)))
                .collect(),
            translation: last.translation.smooth(pose.translation, step, CUTOFF_PER_SPEED),
        }
    }

    /// Forgets the poses so far.
    pub fn reset(&mut self) {
        self.last = None;
    }
}

/// Frames of a constant rate, smoothed forwards and backwards, so that they do not lag.
pub(crate) fn smoothed(frames: &[PoseFrame], fps: f64) -> Vec<PoseFrame> {
    let pass = |order: &mut dyn Iterator<Item = &PoseFrame>| -> Vec<Pose> {
        let mut filter = PoseFilter::default();
        order.enumerate().map(|(k, frame)| filter.smooth(&frame.pose, k as f64 / fps)).collect()
    };
    let forwards = pass(&mut frames.iter());
    let backwards = pass(&mut frames.iter().rev());
    let poses = forwards.iter().zip(backwards.iter().rev()).map(|(a, b)| between(a, b, 0.5));
    frames.iter().zip(poses).map(|(frame, pose)| PoseFrame { pose, ..frame.clone() }).collect()
}

/// A value that moves along vectors.
trait Moving: Copy {
    /// The vector from here to there.
    fn to(self, there: Self) -> DVec3;
    /// The value at the end of a vector from here.
    fn moved(self, by: DVec3) -> Self;
}

impl Moving for DVec3 {
    fn to(self, there: DVec3) -> DVec3 {
        there - self
    }

    fn moved(self, by: DVec3) -> DVec3 {
        self + by
    }
}

impl Moving for DQuat {
    fn to(self, there: DQuat) -> DVec3 {
        let turn = self.inverse() * there;
        // The shorter of the two ways round.
        (if turn.w < 0.0 { -turn } else { turn }).to_scaled_axis()
    }

    fn moved(self, by: DVec3) -> DQuat {
        (self * DQuat::from_scaled_axis(by)).normalize()
    }
}

/// The filter of one value.
#[derive(Debug, Clone)]
struct Channel<T> {
    smoothed: T,
    velocity: DVec3,
}

impl<T: Moving> Channel<T> {
    fn new(value: T) -> Channel<T> {
        Channel { smoothed: value, velocity: DVec3::ZERO }
    }

    fn smooth(&mut self, value: T, step: f64, cutoff_per_speed: f64) -> T {
        let way = self.smoothed.to(value);
        self.velocity += weight(CUTOFF_OF_SPEED, step) * (way / step - self.velocity);
        let cutoff = CUTOFF_AT_REST + cutoff_per_speed * self.velocity.length();
        self.smoothed = self.smoothed.moved(weight(cutoff, step) * way);
        self.smoothed
    }
}

/// Weight of a new value in an exponential mean with this cutoff, Hz, for steps in seconds.
fn weight(cutoff: f64, step: f64) -> f64 {
    1.0 / (1.0 + 1.0 / (TAU * cutoff * step))
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::test_hands::vector;

    const STEP: f64 = 1.0 / 30.0;

    fn pose(rotation: DVec3, translation: DVec3) -> Pose {
        Pose { rotations: vec![rotation], translation }
    }

    #[test]
    fn a_hand_at_rest_trembles_less() {
        let mut random = ChaCha8Rng::seed_from_u64(3);
        let mut filter = PoseFilter::default();
        // Where the two axis-angle vectors of a rotation meet, the filter must not jump between them.
        let rest = DVec3::new(0.0, std::f64::consts::PI, 0.0);
        let turned =
            |by: DVec3| axis_angle_from_rotation(&(rotation_from_axis_angle(rest) * rotation_from_axis_angle(by)));
        let off = |rotation: DVec3| {
            let rotation = rotation_from_axis_angle(rest).transpose() * rotation_from_axis_angle(rotation);
            axis_angle_from_rotation(&rotation).length_squared()
        };
        let mut before = 0.0;
        let mut after = 0.0;
        let mut place = 0.0;
        for k in 0..300 {
            let noisy = pose(turned(vector(&mut random, 0.08)), vector(&mut random, 0.004));
            let smooth = filter.smooth(&noisy, f64::from(k) * STEP);
            if k >= 60 {
                before += off(noisy.rotations[0]);
                after += off(smooth.rotations[0]);
                place += smooth.translation.length_squared() / noisy.translation.length_squared().max(1e-9);
            }
        }
        // The trembling is reduced to less than half, its square to less than a quarter.
        assert!(after < 0.25 * before, "{after} of {before}");
        assert!(place.is_finite());
    }

    #[test]
    fn a_fast_finger_hardly_lags_and_arrives() {
        let mut filter = PoseFilter::default();
        let speed = 10.0;
        let mut lag: f64 = 0.0;
        for k in 0..=6 {
            let angle = speed * STEP * f64::from(k);
            let smooth = filter.smooth(&pose(DVec3::X * angle, DVec3::ZERO), f64::from(k) * STEP);
            lag = (angle - smooth.rotations[0].x) / speed;
        }
        assert!((0.0..0.045).contains(&lag), "it lags by {lag} s");
        let end = DVec3::X * speed * STEP * 6.0;
        let mut last = DVec3::ZERO;
        for k in 7..45 {
            last = filter.smooth(&pose(end, DVec3::ZERO), f64::from(k) * STEP).rotations[0];
        }
        assert!(last.distance(end) < 1e-3, "{last} instead of {end}");
    }

    #[test]
    fn a_gap_or_another_skeleton_begins_again() {
        let mut filter = PoseFilter::default();
        filter.smooth(&pose(DVec3::ZERO, DVec3::ZERO), 0.0);
        let other = pose(DVec3::X, DVec3::Y);
        assert_ne!(filter.clone().smooth(&other, 0.1), other);
        assert_eq!(filter.clone().smooth(&other, 1.0), other);
        assert_eq!(filter.clone().smooth(&other, -1.0), other);
        assert_eq!(filter.smooth(&Pose::rest(2), 0.1), Pose::rest(2));
        let at_once = filter.smooth(&Pose { rotations: vec![DVec3::X; 2], ..Pose::rest(2) }, 0.1);
        assert!(at_once.rotations.iter().all(|rotation| rotation.is_finite()));
    }
}
