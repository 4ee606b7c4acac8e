//! Size and bone lengths of a person's hand: the hand model's own shape directions, and what they leave of each bone.

use ghand_core::posing::shape_hand;
use ghand_core::{HandModel, Side};
use glam::DVec3;

use crate::PoseError;
use crate::ik::{BONES, HandIk};
use crate::rest_skeleton::RestSkeleton;

/// Standard deviation of a shape parameter before any landmark is seen: models count them in deviations.
const SHAPE_DEVIATION: f64 = 1.0;

/// Standard deviation of the logarithm of a bone's length beyond the shape. Lengths of people's phalanges differ by
/// about 5 % beyond the size of the hand (Buryanov and Kotiuk 2010), and a tracker's idea of a joint differs by some
/// millimetres from a model's, which is as much again of a bone of 40 mm.
const BONE_DEVIATION: f64 = 0.1;

/// Degrees of freedom of the distribution of bones' lengths.
const BONE_FREEDOM: f64 = 4.0;

/// Standard deviation of the logarithm of the size of a hand whose model has no shape directions for it: a child's hand
/// has 0.6 times the length of an adult's.
const SIZE_DEVIATION: f64 = 0.5;

/// A shape direction that moves no joint further than this per unit, metres, says nothing about lengths.
const LEAST_MOVE: f64 = 1e-5;

/// Steps of the differences that stand for derivatives.
const STEP: f64 = 1e-4;

/// The hands that a model can be.
#[derive(Debug, Clone)]
pub(crate) struct Proportions {
    /// The model's own, with its fingertips.
    hand: HandIk,
    /// Displacement of each joint of `hand` per unit of each shape parameter that moves any, metres.
    directions: Vec<(usize, Vec<DVec3>)>,
    /// Number of the model's shape parameters.
    shape_count: usize,
    /// How far before the end of the finger its landmark is, metres.
    tip_inset: f64,
    /// Landmarks that lie beside their joints and move with the palm, and where: in the axes of the skeleton, parts of the
    /// palm's length.
    beside: Vec<(usize, DVec3)>,
}

impl Proportions {
    /// The hands of a model, seen by a tracker whose landmarks of the fingertips lie `tip_inset` metres inside the
    /// finger, and of the palm `beside` the joints, as in [`FitOptions`](crate::image_landmarks::FitOptions).
    ///
    /// # Errors
    /// As in [`RestSkeleton::of`].
    pub fn new(model: &HandModel, tip_inset: f64, beside: &[(usize, DVec3)]) -> Result<Proportions, PoseError> {
        let rig = RestSkeleton::of(model)?;
        let hand = HandIk::new(&rig);
        let beside = in_skeleton(beside, &rig);
        // Tips that are no joints are vertices.
        let nearest = |tip: &DVec3| {
            let vertices = model.vertices.iter().enumerate();
            vertices.min_by(|a, b| a.1.distance_squared(*tip).total_cmp(&b.1.distance_squared(*tip))).map(|(v, _)| v)
        };
        let tips: Vec<Option<usize>> = hand.joints.iter().skip(hand.joint_count).map(nearest).collect();
        let places = |shape: &[f64]| -> Result<Vec<DVec3>, PoseError> {
            let shaped = shape_hand(model, shape).map_err(|error| PoseError::HandModel(error.into()))?;
            let tips = tips.iter().map(|tip| tip.and_then(|v| shaped.vertices.get(v).copied()).unwrap_or_default());
            Ok(shaped.joints.into_iter().chain(tips).collect())
        };
        let none = places(&[])?;
        let mut directions = vec![];
        for k in 0..model.shape_count() {
            let mut shape = vec![0.0; k + 1];
            shape[k] = 1.0;
            let moves: Vec<DVec3> = places(&shape)?.iter().zip(&none).map(|(one, none)| *one - *none).collect();
            if moves.iter().any(|by| by.distance(moves[0]) > LEAST_MOVE) {
                directions.push((k, moves));
            }
        }
        Ok(Proportions { hand, directions, shape_count: model.shape_count(), tip_inset, beside })
    }

    /// Whether the model has a shape for the size of a hand; without one, the size is a parameter of its own.
    pub fn has_shape(&self) -> bool {
        !self.directions.is_empty()
    }

    /// Number of parameters: the shape's that move joints, or the logarithm of the size; then the logarithm of the length
    /// of each of [`BONES`] beyond that.
    pub fn count(&self) -> usize {
        self.own_count() + BONES.len()
    }

    /// Number of parameters before the bones'.
    pub fn own_count(&self) -> usize {
        self.directions.len().max(1)
    }

    /// Standard deviation of a parameter before any landmark is seen.
    pub fn deviation(&self, parameter: usize) -> f64 {
        match parameter {
            k if k >= self.own_count() => BONE_DEVIATION,
            _ if self.has_shape() => SHAPE_DEVIATION,
            _ => SIZE_DEVIATION,
        }
    }

    /// Twice the negative logarithm of the probability of a parameter, and the weight of its square. Bones have Student's
    /// distribution: a model may have a joint in the wrong place, for which a shape must not make up.
    pub fn prior(&self, parameter: usize, value: f64) -> (f64, f64) {
        let variance = self.deviation(parameter).powi(2);
        let ratio = value * value / variance;
        if parameter < self.own_count() {
            return (ratio, 1.0 / variance);
        }
        let strength = BONE_FREEDOM + 1.0;
        (strength * (ratio / BONE_FREEDOM).ln_1p(), strength / (BONE_FREEDOM + ratio) / variance)
    }

    /// The shape parameters of the model; empty if none is determined.
    pub fn shape(&self, parameters: &[f64]) -> Vec<f64> {
        if !self.has_shape() {
            return vec![];
        }
        let mut shape = vec![0.0; self.shape_count];
        for ((k, _), value) in self.directions.iter().zip(parameters) {
            shape[*k] = *value;
        }
        shape
    }

    /// The parameters of a shape.
    #[cfg(test)]
    pub fn parameters_of(&self, shape: &[f64]) -> Vec<f64> {
        let mut parameters = vec![0.0; self.count()];
        for ((k, _), value) in self.directions.iter().zip(&mut parameters) {
            *value = shape.get(*k).copied().unwrap_or(0.0);
        }
        parameters
    }

    /// The parameters without the bones' own lengths: what the model's shape can express.
    pub fn without_bones(&self, parameters: &[f64]) -> Vec<f64> {
        let mut parameters = parameters.to_vec();
        parameters.iter_mut().skip(self.own_count()).for_each(|bone| *bone = 0.0);
        parameters
    }

    /// The hand of these parameters, as the tracker sees it.
    pub fn hand(&self, parameters: &[f64]) -> HandIk {
        let mut rest = self.hand.joints.clone();
        for ((_, moves), value) in self.directions.iter().zip(parameters) {
            rest.iter_mut().zip(moves).for_each(|(joint, by)| *joint += *by * *value);
        }
        let (own, bones) = parameters.split_at(self.own_count());
        if let (false, [size]) = (self.has_shape(), own) {
            let wrist = rest[0];
            rest.iter_mut().for_each(|joint| *joint = wrist + (*joint - wrist) * size.exp());
        }
        let at = self.hand.landmarks;
        for tip in (4..at.len()).step_by(4) {
            let bone = rest[at[tip]] - rest[at[tip - 1]];
            rest[at[tip]] -= bone.normalize_or_zero() * self.tip_inset.min(0.5 * bone.length());
        }
        let mut joints = rest.clone();
        for ((from, to), length) in BONES.into_iter().zip(bones) {
            joints[at[to]] = joints[at[from]] + (rest[at[to]] - rest[at[from]]) * length.exp();
        }
        let mut hand = HandIk { joints, ..self.hand.clone() };
        let palm = hand.joints[at[9]].distance(hand.joints[at[0]]);
        for (landmark, offset) in &self.beside {
            // A joint that does not bend.
            hand.landmarks[*landmark] = hand.joints.len();
            hand.parents.push(Some(0));
            hand.joints.push(hand.joints[at[*landmark]] + *offset * palm);
        }
        hand
    }

    /// How each joint of [`Self::hand`] moves with each parameter, metres per unit.
    pub fn derivatives(&self, parameters: &[f64]) -> Vec<Vec<DVec3>> {
        let at = |k: usize, by: f64| {
            let mut moved = parameters.to_vec();
            moved[k] += by;
            self.hand(&moved).joints
        };
        let derivative = |k: usize| {
            let (high, low) = (at(k, STEP), at(k, -STEP));
            high.iter().zip(&low).map(|(high, low)| (*high - *low) / (2.0 * STEP)).collect()
        };
        (0..parameters.len()).map(derivative).collect()
    }

    /// The joint at a landmark.
    #[cfg(test)]
    pub fn joint_of(&self, landmark: usize) -> usize {
        self.hand.landmarks[landmark]
    }

    /// Length of each of [`BONES`] at rest, from joint to joint, metres.
    pub fn lengths(&self, hand: &HandIk) -> [f64; BONES.len()] {
        let rest = self.hand.landmarks.map(|joint| hand.joints[joint]);
        BONES.map(|(from, to)| rest[from].distance(rest[to]))
    }
}

/// Offsets of landmarks in the axes of a right hand's palm, for the hand of a skeleton and in its axes.
pub fn in_skeleton(beside: &[(usize, DVec3)], rig: &RestSkeleton) -> Vec<(usize, DVec3)> {
    let across = if rig.side == Side::Right { 1.0 } else { -1.0 };
    let palm = rig.frames.first().copied().unwrap_or_default();
    beside.iter().map(|(landmark, at)| (*landmark, palm * DVec3::new(across * at.x, at.y, at.z))).collect()
}
