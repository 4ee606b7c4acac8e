//! Inverse kinematics: fits the pose of a hand to 21 landmarks.
//!
//! Landmarks are MediaPipe's: wrist; thumb base (carpometacarpal), knuckle, hinge, tip; and for the index, middle, ring
//! and little finger knuckle, two hinges and tip. They represent the wrist, the three joints of each finger, and the
//! fingertips: a skeleton's tip joint, else the skin's outermost point along the last bone ([`RestSkeleton::tips`]).
//!
//! The fit minimises `sum |p_i - landmark_i|^2 / s^2 + sum ((c_j - mean_j) / spread_j)^2` over the root's rotation, the
//! translation and three angles for each of the 15 finger joints, c: flexion, abduction and twist, the components of the
//! joint's axis-angle vector along its axes ([`RestSkeleton::axes`]). Projection keeps them in the joint's range
//! (`limits`). One more term per finger couples the last hinge to the one before. `s` is the
//! residual itself, within bounds: if the landmarks fit a hand exactly, the second sum has no weight; if they are
//! noisy, it decides what they leave open. The minimum is found by Levenberg and Marquardt's method.
//!
//! A first frame starts from the palm's orientation, once with straight and once with bent fingers, and the better
//! result is used; other frames start from the previous frame. [`HandIk::reach`] (`reach`) bends one finger to a point.
//!
//! [`person`] fits one hand to all frames at once, and bears single wrong landmarks.

mod derivatives;
mod levenberg_marquardt;
mod limits;
pub(crate) mod person;
mod reach;

use ghand_core::Pose;
use ghand_core::rotation::axis_angle_from_rotation;
use ghand_core::skeleton::{Chain, pose_skeleton};
use ghand_hand_model::joints::axes::JointAxes;
use ghand_hand_model::joints::names::{Finger, JointRole};
use glam::{DMat3, DVec3};

use crate::rest_skeleton::RestSkeleton;

/// Number of landmarks of a hand.
pub const LANDMARK_COUNT: usize = 21;
use derivatives::{Square, add, settle_root};
use levenberg_marquardt::{Problem, minimize};
use limits::{Coupling, Range, couplings, ranges};

/// Unknowns: the root's axis-angle, the translation, three angles for each of 15 joints.
pub(crate) const UNKNOWNS: usize = 6 + 3 * 15;

/// Most steps from a cold and from a warm start.
const COLD_STEPS: usize = 60;
const WARM_STEPS: usize = 20;

/// A warm start that ends further than this from the landmarks (metres, root mean square) is tried again from cold
/// ones: the hand jumped, or a finger took a wrong turn.
const LOST: f64 = 0.008;

/// A first start that ends nearer than this does not need a second one, metres.
const FOUND: f64 = 0.001;

/// How much bones may differ from the model's, beyond the size of the whole hand.
const BONE_RANGE: (f64, f64) = (0.75, 1.33);

/// Fewer frames than this determine the size of a hand, but not the lengths of its bones.
const FRAMES_FOR_BONES: usize = 10;

/// Pairs of landmarks joined by a bone, starting at the wrist.
pub const BONES: [(usize, usize); 20] = [
    (0, 1),
    (1, 2),
    (2, 3),
    (3, 4),
    (0, 5),
    (5, 6),
    (6, 7),
    (7, 8),
    (0, 9),
    (9, 10),
    (10, 11),
    (11, 12),
    (0, 13),
    (13, 14),
    (14, 15),
    (15, 16),
    (0, 17),
    (17, 18),
    (18, 19),
    (19, 20),
];

/// A hand that can be fitted to landmarks.
#[derive(Debug, Clone)]
pub struct HandIk {
    /// Number of the skeleton's own joints; missing tips follow them.
    joint_count: usize,
    parents: Vec<Option<usize>>,
    /// Rest positions, metres.
    joints: Vec<DVec3>,
    /// The joint at each landmark.
    landmarks: [usize; LANDMARK_COUNT],
    /// The joints that bend, with their axes.
    hinges: Vec<(usize, JointAxes)>,
    /// Of each angle of each of `hinges`.
    ranges: Vec<Range>,
    couplings: Vec<Coupling>,
}

/// A fitted pose.
#[derive(Debug, Clone, PartialEq)]
pub struct IkSolution {
    /// The pose, one rotation for each joint of the skeleton.
    pub pose: Pose,
    /// Root mean square distance of the landmarks from their joints, metres.
    pub residual: f64,
    /// Number of steps tried.
    pub steps: usize,
}

impl HandIk {
    /// The hand of a skeleton.
    pub fn new(rig: &RestSkeleton) -> HandIk {
        let mut parents = rig.parents.clone();
        let mut joints = rig.joints.clone();
        let mut landmarks = [0; LANDMARK_COUNT];
        let mut hinges = Vec::new();
        let mut all_ranges = Vec::new();
        for (f, finger) in Finger::ALL.into_iter().enumerate() {
            let mut last = 0;
            for k in 1..=3u8 {
                // Every skeleton with a rest pose has all of them.
                last = rig.joint(JointRole::Bend(finger, k)).unwrap_or(0);
                landmarks[4 * f + usize::from(k)] = last;
                hinges.push((last, rig.axes.get(last).copied().unwrap_or(JointAxes::OF_MODEL)));
                all_ranges.extend(ranges(finger, k));
            }
            landmarks[4 * f + 4] = rig.joint(JointRole::Tip(finger)).unwrap_or_else(|| {
                parents.push(Some(last));
                joints.push(rig.tip(finger).copied().unwrap_or_default());
                joints.len() - 1
            });
        }
        HandIk {
            joint_count: rig.joints.len(),
            parents,
            joints,
            landmarks,
            hinges,
            ranges: all_ranges,
            couplings: couplings(),
        }
    }

    /// Positions of the landmarks of a pose: the output of a perfect tracker.
    pub fn landmarks(&self, pose: &Pose) -> [DVec3; LANDMARK_COUNT] {
        let mut rotations = pose.rotations.clone();
        rotations.resize(self.joints.len(), DVec3::ZERO);
        let chain = pose_skeleton(&self.parents, &self.joints, &rotations);
        self.landmarks.map(|joint| chain.world[joint].translation + pose.translation)
    }

    /// The same hand with the size of the observed hand, and with its bone lengths if there are enough frames: medians
    /// over all frames. Rotations that fit it also apply to the model.
    pub fn fitted(&self, frames: &[[DVec3; LANDMARK_COUNT]]) -> HandIk {
        let rest = self.landmarks.map(|joint| self.joints[joint]);
        let ratio = |&(from, to): &(usize, usize)| {
            let seen = frames.iter().map(|points| points[from].distance(points[to]));
            median(seen.filter(|length| length.is_finite()).collect()) / rest[from].distance(rest[to])
        };
        let ratios = BONES.map(|bone| ratio(&bone));
        let size = median(ratios.into_iter().filter(|ratio| ratio.is_finite() && *ratio > 0.0).collect());
        if !(size.is_finite() && size > 0.0) {
            return self.clone();
        }
        let (low, high) = (BONE_RANGE.0 * size, BONE_RANGE.1 * size);
        let of_bone = |ratio: f64| {
            if frames.len() >= FRAMES_FOR_BONES && ratio.is_finite() { ratio.clamp(low, high) } else { size }
        };
        let wrist = rest[0];
        // Joints that are not landmarks (metacarpals, the palm) are only scaled.
        let mut joints: Vec<DVec3> = self.joints.iter().map(|joint| wrist + size * (*joint - wrist)).collect();
        for ((from, to), ratio) in BONES.into_iter().zip(ratios) {
            joints[self.landmarks[to]] = joints[self.landmarks[from]] + of_bone(ratio) * (rest[to] - rest[from]);
        }
        HandIk { joints, ..self.clone() }
    }

    /// The pose that fits landmarks (metres) best, starting from the pose of the previous frame if there is one. `None`
    /// if a landmark is not finite, or if wrist, index and little knuckle do not span a plane.
    pub fn solve(&self, landmarks: &[DVec3; LANDMARK_COUNT], before: Option<&Pose>) -> Option<IkSolution> {
        if landmarks.iter().any(|point| !point.is_finite()) {
            return None;
        }
        let root = self.palm_rotation(landmarks)?;
        let fit = Fit { hand: self, landmarks };
        let mut steps = 0;
        let mut run = |start: [f64; UNKNOWNS], most: usize| {
            let (x, taken) = minimize(&fit, start, most);
            steps += taken;
            (fit.residual(&x), x)
        };
        let warm = before.map(|pose| run(self.unknowns(pose), WARM_STEPS));
        let best = match warm {
            Some(best) if best.0 <= LOST => best,
            _ => {
                let translation = landmarks[0] - self.joints[self.landmarks[0]];
                let mut best = run(self.start(root, translation, 0.0), COLD_STEPS);
                if best.0.is_nan() || best.0 > FOUND {
                    let other = run(self.start(root, translation, 0.8), COLD_STEPS);
                    best = if other.0 < best.0 { other } else { best };
                }
                match warm {
                    Some(warm) if warm.0 < best.0 => warm,
                    _ => best,
                }
            }
        };
        let (residual, x) = best;
        residual.is_finite().then(|| IkSolution { pose: self.pose(&x), residual, steps })
    }

    /// The rotation that takes the palm at rest to the palm of the landmarks.
    fn palm_rotation(&self, landmarks: &[DVec3; LANDMARK_COUNT]) -> Option<DMat3> {
        let rest = self.landmarks.map(|joint| self.joints[joint]);
        let frame = |points: &[DVec3; LANDMARK_COUNT]| {
            let forward = (0.5 * (points[9] + points[13]) - points[0]).try_normalize()?;
            let across = (points[17] - points[5]).reject_from_normalized(forward).try_normalize()?;
            // For landmarks on a line only rounding errors remain.
            let width = (points[17] - points[5]).reject_from_normalized(forward).length();
            (width > 1e-6 && width.is_finite()).then(|| DMat3::from_cols(forward, across, forward.cross(across)))
        };
        Some(frame(landmarks)? * frame(&rest)?.transpose())
    }

    fn start(&self, root: DMat3, translation: DVec3, bend: f64) -> [f64; UNKNOWNS] {
        let mut x = [0.0; UNKNOWNS];
        write(&mut x, 0, axis_angle_from_rotation(&root));
        write(&mut x, 3, translation);
        for (k, (_, range)) in self.hinges.iter().zip(self.ranges.chunks_exact(3)).enumerate() {
            let bent = if k < 3 { 0.5 * bend } else { bend };
            x[6 + 3 * k] = bent.clamp(range[0].low, range[0].high);
        }
        x
    }

    /// The unknowns of a pose, clamped to the ranges.
    fn unknowns(&self, pose: &Pose) -> [f64; UNKNOWNS] {
        let rotation = |joint: usize| pose.rotations.get(joint).copied().unwrap_or_default();
        let mut x = [0.0; UNKNOWNS];
        write(&mut x, 0, rotation(0));
        write(&mut x, 3, pose.translation);
        for (k, (joint, axes)) in self.hinges.iter().enumerate() {
            write(&mut x, 6 + 3 * k, axes.angles(rotation(*joint)));
        }
        for (value, range) in x.iter_mut().skip(6).zip(&self.ranges) {
            *value = value.clamp(range.low, range.high);
        }
        x
    }

    /// Rotations of all joints, including tips.
    fn rotations(&self, x: &[f64; UNKNOWNS]) -> Vec<DVec3> {
        let mut rotations = vec![DVec3::ZERO; self.joints.len()];
        rotations[0] = read(x, 0);
        for (k, (joint, axes)) in self.hinges.iter().enumerate() {
            rotations[*joint] = axes.rotation(read(x, 6 + 3 * k));
        }
        rotations
    }

    fn pose(&self, x: &[f64; UNKNOWNS]) -> Pose {
        let mut rotations = self.rotations(x);
        rotations.truncate(self.joint_count);
        Pose { rotations, translation: read(x, 3) }
    }
}

fn read(x: &[f64; UNKNOWNS], at: usize) -> DVec3 {
    DVec3::new(x[at], x[at + 1], x[at + 2])
}

fn write(x: &mut [f64; UNKNOWNS], at: usize, v: DVec3) {
    (x[at], x[at + 1], x[at + 2]) = (v.x, v.y, v.z);
}

pub(crate) fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}

/// A hand and its target landmarks.
struct Fit<'a> {
    hand: &'a HandIk,
    landmarks: &'a [DVec3; LANDMARK_COUNT],
}

impl Fit<'_> {
    fn errors(&self, chain: &Chain, x: &[f64; UNKNOWNS]) -> [DVec3; LANDMARK_COUNT] {
        let places = self.hand.places(chain, x);
        std::array::from_fn(|i| places[i] - self.landmarks[i])
    }

    /// Root mean square distance, metres.
    fn residual(&self, x: &[f64; UNKNOWNS]) -> f64 {
        (self.squares(x) / LANDMARK_COUNT as f64).sqrt()
    }
}

impl Problem for Fit<'_> {
    fn ranges(&self) -> &[Range] {
        &self.hand.ranges
    }

    fn couplings(&self) -> &[Coupling] {
        &self.hand.couplings
    }

    fn squares(&self, x: &[f64; UNKNOWNS]) -> f64 {
        self.errors(&self.hand.chain(x), x).iter().map(|e| e.length_squared()).sum()
    }

    fn normal_equations(&self, x: &[f64; UNKNOWNS]) -> (Square, [f64; UNKNOWNS]) {
        let chain = self.hand.chain(x);
        let errors = self.errors(&chain, x);
        let mut matrix = Box::new([[0.0; UNKNOWNS]; UNKNOWNS]);
        let mut vector = [0.0; UNKNOWNS];
        for (row, error) in self.hand.landmark_derivatives(&chain, x).iter().zip(errors) {
            add(row, &DMat3::IDENTITY, error, &mut matrix, &mut vector);
        }
        (matrix, vector)
    }

    fn settle(&self, x: &mut [f64; UNKNOWNS]) {
        settle_root(x);
    }
}

#[cfg(test)]
mod tests;
