//! Bends one finger so that a landmark of it reaches a point, as little as possible from the pose that it had.
//!
//! It is the same fit as that of all landmarks, with three differences: only one landmark counts, only the joints between
//! it and the palm move, and the prior's means are the angles of the held pose instead of likely ones. The limits are
//! the anatomical ones, without the margins for a tracker's errors and without fingers that bend backwards.

use ghand_core::Pose;
use ghand_core::skeleton::{Chain, pose_skeleton};
use ghand_hand_model::joints::limits::{AngleRange, JointLimits};
use ghand_hand_model::joints::names::{Finger, JointRole};
use glam::{DMat3, DVec3};

use super::derivatives::{Square, add};
use super::levenberg_marquardt::{Problem, minimize};
use super::limits::{Coupling, Range, ranges};
use super::{COLD_STEPS, FOUND, HandIk, UNKNOWNS, read};

/// A pull bends no joint further backwards than this, radians, unless it was: a little more than straight.
const LEAST_FLEXION: f64 = -0.15;

/// How much more a finger is bent at the second start than it was, radians.
const BEND: f64 = 0.4;

/// Unknowns before the angles: the hand does not move, so they stay 0.
const FIXED: usize = 6;

impl HandIk {
    /// The pose `held` with the finger of a landmark bent so that the landmark is as near to `target` (metres, world) as
    /// the joints' limits allow, and the joints as near to those of `held` as that allows. With a line of `sight` (a unit
    /// vector, world) the landmark may be anywhere before or behind the target. An angle of `held` beyond its limit may
    /// stay there. During a pull, `held` should be the pose at its beginning: then the result does not depend on the way.
    ///
    /// The other fingers, the palm and the hand's place stay exactly. `held` itself is returned for landmarks of the palm,
    /// for a pose that does not fit the skeleton, and for a target that is not finite.
    pub fn reach(&self, held: &Pose, landmark: usize, target: DVec3, sight: Option<DVec3>) -> Pose {
        let moving = self.moving_hinges(landmark);
        if moving.is_empty() || !target.is_finite() || held.rotations.len() != self.joint_count {
            return held.clone();
        }
        let angles = self.angles(held);
        let mut rotations = held.rotations.clone();
        rotations.resize(self.joints.len(), DVec3::ZERO);
        let sight = sight.unwrap_or_default();
        let pull = Pull {
            hand: self,
            landmark,
            target: target - held.translation,
            seen: DMat3::IDENTITY - DMat3::from_cols(sight * sight.x, sight * sight.y, sight * sight.z),
            rotations,
            ranges: self.ranges_around(&angles),
            couplings: self.couplings.iter().map(|coupling| coupling.around(&angles)).collect(),
            moving,
        };
        let mut start = [0.0; UNKNOWNS];
        start[FIXED..].copy_from_slice(&angles);
        let (mut x, _) = minimize(&pull, start, COLD_STEPS);
        if pull.squares(&x) > FOUND * FOUND {
            // A straight finger does not show which way it bends: once more from a bent one.
            for &hinge in &pull.moving {
                let range = &pull.ranges[3 * hinge];
                start[FIXED + 3 * hinge] = (range.mean + BEND).clamp(range.low, range.high);
            }
            let (other, _) = minimize(&pull, start, COLD_STEPS);
            if pull.squares(&other) < pull.squares(&x) {
                x = other;
            }
        }
        let mut pose = held.clone();
        for &hinge in &pull.moving {
            let (joint, axes) = self.hinges[hinge];
            pose.rotations[joint] = axes.rotation(read(&x, FIXED + 3 * hinge));
        }
        pose
    }

    /// The hinges between the palm and a landmark, as indices.
    pub(super) fn moving_hinges(&self, landmark: usize) -> Vec<usize> {
        let Some(&end) = self.landmarks.get(landmark) else { return Vec::new() };
        let above = |joint: usize| std::iter::successors(self.parents[end], |j| self.parents[*j]).any(|j| j == joint);
        (0..self.hinges.len()).filter(|hinge| above(self.hinges[*hinge].0)).collect()
    }

    /// The three angles of every hinge.
    fn angles(&self, pose: &Pose) -> Vec<f64> {
        self.hinges.iter().flat_map(|(joint, axes)| axes.angles(pose.rotations[*joint]).to_array()).collect()
    }

    /// Ranges of all angles, which contain `angles`, as the likely ones.
    fn ranges_around(&self, angles: &[f64]) -> Vec<Range> {
        let joints = Finger::ALL.into_iter().flat_map(|finger| (1..=3u8).map(move |joint| (finger, joint)));
        let limits = joints.flat_map(|(finger, joint)| {
            let mut anatomical = JointLimits::of(JointRole::Bend(finger, joint)).ranges();
            // Seen from the back or the palm, a finger that bends backwards at its knuckle and forwards at its hinges is
            // as short as one that makes a fist; only the latter is meant.
            anatomical[0].low = anatomical[0].low.max(LEAST_FLEXION);
            anatomical.into_iter().zip(ranges(finger, joint))
        });
        let around = |((limit, likely), angle): ((AngleRange, Range), &f64)| Range {
            low: limit.low.min(*angle),
            high: limit.high.max(*angle),
            mean: *angle,
            ..likely
        };
        limits.zip(angles).map(around).collect()
    }
}

impl Coupling {
    /// The same coupling, satisfied by `angles`: a pull begins without a jump.
    fn around(&self, angles: &[f64]) -> Coupling {
        Coupling { offset: angles[self.of] - self.ratio * angles[self.with], ..*self }
    }
}

/// A landmark that is pulled to a target.
struct Pull<'a> {
    hand: &'a HandIk,
    landmark: usize,
    /// Without the hand's translation.
    target: DVec3,
    /// Takes from an error what is along the line of sight: a projection.
    seen: DMat3,
    /// Of all joints, including tips; those of the moving ones are unknown.
    rotations: Vec<DVec3>,
    ranges: Vec<Range>,
    couplings: Vec<Coupling>,
    /// Indices of the hinges that move.
    moving: Vec<usize>,
}

impl Pull<'_> {
    fn chain(&self, x: &[f64; UNKNOWNS]) -> Chain {
        let mut rotations = self.rotations.clone();
        for &hinge in &self.moving {
            let (joint, axes) = self.hand.hinges[hinge];
            rotations[joint] = axes.rotation(read(x, FIXED + 3 * hinge));
        }
        pose_skeleton(&self.hand.parents, &self.hand.joints, &rotations)
    }

    fn error(&self, chain: &Chain) -> DVec3 {
        self.seen * (chain.world[self.hand.landmarks[self.landmark]].translation - self.target)
    }
}

impl Problem for Pull<'_> {
    fn ranges(&self) -> &[Range] {
        &self.ranges
    }

    fn couplings(&self) -> &[Coupling] {
        &self.couplings
    }

    fn squares(&self, x: &[f64; UNKNOWNS]) -> f64 {
        self.error(&self.chain(x)).length_squared()
    }

    fn normal_equations(&self, x: &[f64; UNKNOWNS]) -> (Square, [f64; UNKNOWNS]) {
        let chain = self.chain(x);
        let mut row = self.hand.landmark_derivatives(&chain, x).swap_remove(self.landmark);
        row.retain(|(unknown, _)| *unknown >= FIXED);
        let mut matrix = Box::new([[0.0; UNKNOWNS]; UNKNOWNS]);
        let mut vector = [0.0; UNKNOWNS];
        add(&row, &self.seen, self.error(&chain), &mut matrix, &mut vector);
        (matrix, vector)
    }

    fn settle(&self, _: &mut [f64; UNKNOWNS]) {}
}

#[cfg(test)]
mod tests {
    use ghand_core::HandModel;
    use ghand_hand_model::joints::axes::JointAxes;
    use ghand_hand_model::named_poses::{POSE_NAMES, named_pose};

    use super::*;
    use crate::RestSkeleton;
    use crate::test_hands::hands;

    /// Landmarks of the fingers that reach: hinges and tips.
    const ENDS: [usize; 15] = [2, 3, 4, 6, 7, 8, 10, 11, 12, 14, 15, 16, 18, 19, 20];

    fn ik(model: &HandModel) -> HandIk {
        HandIk::new(&RestSkeleton::of(model).unwrap())
    }

    fn named(model: &HandModel, name: &str) -> Pose {
        Pose { translation: DVec3::new(0.3, -0.2, 0.1), ..named_pose(name, model).unwrap() }
    }

    #[test]
    fn a_landmark_reaches_its_place_in_another_pose_and_only_its_finger_moves() {
        for model in hands() {
            let ik = ik(&model);
            let from = named(&model, "relaxed");
            for name in ["rest", "spread", "victory", "fist"] {
                let places = ik.landmarks(&named(&model, name));
                for end in ENDS {
                    let pose = ik.reach(&from, end, places[end], None);
                    // Named poses may be beyond what is healthy.
                    let error = ik.landmarks(&pose)[end].distance(places[end]);
                    assert!(error < 0.012, "{} {name} {end}: {:.1} mm", model.name, error * 1e3);
                    let own = ik.moving_hinges(end);
                    let moved: Vec<usize> = own.iter().map(|hinge| ik.hinges[*hinge].0).collect();
                    for (joint, (a, b)) in pose.rotations.iter().zip(&from.rotations).enumerate() {
                        assert!(a == b || moved.contains(&joint), "{} {name} {end}: joint {joint}", model.name);
                    }
                    assert_eq!(pose.translation, from.translation);
                }
            }
        }
    }

    #[test]
    fn a_pull_begins_without_a_jump() {
        for model in hands() {
            let ik = ik(&model);
            for name in POSE_NAMES {
                let held = named(&model, name);
                for end in ENDS {
                    let same = ik.reach(&held, end, ik.landmarks(&held)[end], None);
                    let off = |(a, b): (&DVec3, &DVec3)| a.distance(*b).to_degrees();
                    let worst = same.rotations.iter().zip(&held.rotations).map(off).fold(0.0, f64::max);
                    assert!(worst < 1e-6, "{} {name} {end}: {worst} degrees", model.name);
                }
            }
        }
    }

    #[test]
    fn a_fingertip_pulled_towards_the_palm_bends_the_whole_finger() {
        for model in hands() {
            let ik = ik(&model);
            let [forward, back, across] = RestSkeleton::of(&model).unwrap().palm().unwrap();
            for name in ["rest", "relaxed"] {
                let held = named(&model, name);
                // From the back of the hand and a little from either side.
                for sight in [back, (back + 0.2 * across).normalize(), (back - 0.2 * across).normalize()] {
                    let target = ik.landmarks(&held)[12] - 0.05 * forward;
                    let pose = ik.reach(&held, 12, target, Some(sight));
                    let off = (ik.landmarks(&pose)[12] - target).reject_from_normalized(sight).length();
                    assert!(off < 1e-3, "{} {name}: {off}", model.name);
                    let flexions = |pose: &Pose| [6, 7, 8].map(|hinge| ik.angles(pose)[3 * hinge]);
                    for (after, before) in flexions(&pose).iter().zip(flexions(&held)) {
                        assert!(*after > before, "{} {name}: {after} after {before}", model.name);
                    }
                }
            }
        }
    }

    #[test]
    fn limits_hold_for_any_target() {
        for model in hands() {
            let ik = ik(&model);
            let held = named(&model, "rest");
            for end in ENDS {
                for target in [DVec3::ZERO, DVec3::X * 0.5, DVec3::NEG_Y * 3.0, DVec3::splat(1e6)] {
                    let pose = ik.reach(&held, end, target, None);
                    for (range, angle) in ik.ranges_around(&ik.angles(&held)).iter().zip(ik.angles(&pose)) {
                        assert!(
                            (range.low - 1e-9..=range.high + 1e-9).contains(&angle),
                            "{} {end} {target}: {angle} is not in {range:?}",
                            model.name
                        );
                    }
                }
            }
        }
    }

    #[test]
    fn what_cannot_be_pulled_stays() {
        let model = &hands()[0];
        let ik = ik(model);
        let pose = named(model, "ok");
        let target = DVec3::splat(0.1);
        for landmark in [0, 1, 5, 9, 13, 17, 21] {
            assert_eq!(ik.reach(&pose, landmark, target, None), pose, "{landmark}");
        }
        assert_eq!(ik.reach(&pose, 8, DVec3::NAN, None), pose);
        assert_eq!(ik.reach(&Pose::rest(3), 8, target, None), Pose::rest(3));
        assert_ne!(ik.reach(&pose, 8, target, None), pose);
        assert_eq!(ik.hinges.first().map(|(_, axes)| *axes == JointAxes::OF_MODEL), Some(false));
    }
}
