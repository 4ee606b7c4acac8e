//! How the rotations of a finger's joints vary over a capture: one Gaussian per finger, measured from uncertain estimates.

use ghand_core::rotation::{axis_angle_from_rotation, rotation_from_axis_angle};
use ghand_core::{HandModel, Pose};
use glam::{DMat3, DVec3};
use nalgebra::{DMatrix, DVector, SymmetricEigen};
use rayon::prelude::*;

use super::inverse;

/// Least standard deviation along any direction, radians: joints that seem to be exact hinges, or to bend in an exact
/// proportion, do so only nearly.
const LEAST_SPREAD: f64 = 0.5_f64.to_radians();
/// A finger's joints are measured together if there are this many frames for each of their axes, else one by one.
const FRAMES_PER_AXIS: usize = 2;
/// Below this number of frames nothing is measured.
const LEAST_FRAMES: usize = 4;
/// Degrees of freedom of Student's distribution, which bounds the influence of estimates that have gone astray. Its
/// widths are about 0.77 of the standard deviations where none has.
const FREEDOM: f64 = 5.0;
/// Rounds of expectation and maximisation: widths far below the estimates' errors shrink slowly.
const ROUNDS: usize = 200;

/// A frame's estimate from its images and its given pose alone.
pub struct Estimate {
    pub pose: Pose,
    /// Covariance of its error: of the moving joints' rotations (a small one applied after them, in their parents' axes),
    /// then of the translation.
    pub covariance: DMatrix<f64>,
}

/// The joints of one finger, and the distribution of their rotation vectors.
#[derive(Debug, Clone)]
struct Group {
    /// Joints and their places among the moving ones.
    joints: Vec<(usize, usize)>,
    mean: DVector<f64>,
    information: DMatrix<f64>,
}

/// How the joints vary: all that move, except for the root, which turns freely.
#[derive(Debug, Clone)]
pub struct PoseSpread {
    groups: Vec<Group>,
}

impl PoseSpread {
    /// Nothing is known yet. `moving` are the joints that move, parents first.
    pub fn new(template: &HandModel, moving: &[usize], frames: usize) -> PoseSpread {
        let finger = |joint: usize| {
            let mut at = joint;
            while let Some(parent) = template.parents[at].filter(|parent| *parent > 0) {
                at = parent;
            }
            at
        };
        let mut groups: Vec<Vec<(usize, usize)>> = vec![];
        if frames >= LEAST_FRAMES {
            let below_root = moving.iter().enumerate().filter(|(_, joint)| **joint > 0);
            for (place, joint) in below_root.map(|(place, joint)| (place, *joint)) {
                match groups.iter_mut().find(|group| finger(group[0].0) == finger(joint)) {
                    Some(group) => group.push((joint, place)),
                    None => groups.push(vec![(joint, place)]),
                }
            }
        }
        let is_enough = |joints: &[(usize, usize)]| frames >= FRAMES_PER_AXIS * 3 * joints.len();
        let parts = groups.into_iter().flat_map(|group| {
            if is_enough(&group) { vec![group] } else { group.into_iter().map(|joint| vec![joint]).collect() }
        });
        let group = |joints: Vec<(usize, usize)>| {
            let size = 3 * joints.len();
            Group { joints, mean: DVector::zeros(size), information: DMatrix::zeros(size, size) }
        };
        PoseSpread { groups: parts.map(group).collect() }
    }

    /// Measures mean and covariance of every finger by maximum likelihood: an estimate is the true rotation, which has
    /// that distribution, with an error of the estimate's covariance. Sure estimates count for more.
    pub fn measure(&mut self, estimates: &[Estimate]) {
        self.groups.par_iter_mut().for_each(|group| group.measure(estimates));
    }

    /// Adds what is known to a frame's equations; `matrix` and `gradient` are those of its pose.
    pub fn add(&self, pose: &Pose, matrix: &mut DMatrix<f64>, gradient: &mut DVector<f64>) {
        for group in &self.groups {
            let turn = group.vector_by_step(pose);
            let pull = turn.transpose() * &group.information;
            let curvature = &pull * &turn;
            let slope = &pull * (group.vector(pose) - &group.mean);
            for (i, row) in group.parameters().enumerate() {
                gradient[row] += slope[i];
                group.parameters().enumerate().for_each(|(j, column)| matrix[(row, column)] += curvature[(i, j)]);
            }
        }
    }
}

impl Group {
    /// The places of its axes among a frame's unknowns.
    fn parameters(&self) -> impl Iterator<Item = usize> {
        self.joints.iter().flat_map(|(_, place)| 3 * place..3 * place + 3)
    }

    fn vector(&self, pose: &Pose) -> DVector<f64> {
        let numbers = self.joints.iter().flat_map(|(joint, _)| shortest(pose.rotations[*joint]).to_array());
        DVector::from_iterator(3 * self.joints.len(), numbers)
    }

    /// Derivative of the rotation vectors by small rotations applied after them.
    fn vector_by_step(&self, pose: &Pose) -> DMatrix<f64> {
        let size = 3 * self.joints.len();
        let mut derivative = DMatrix::zeros(size, size);
        for (i, (joint, _)) in self.joints.iter().enumerate() {
            let block = vector_by_step(shortest(pose.rotations[*joint]));
            derivative
                .fixed_view_mut::<3, 3>(3 * i, 3 * i)
                .copy_from(&nalgebra::Matrix3::from_column_slice(&block.to_cols_array()));
        }
        derivative
    }

    fn measure(&mut self, estimates: &[Estimate]) {
        let size = 3 * self.joints.len();
        let places: Vec<usize> = self.parameters().collect();
        let vectors: Vec<DVector<f64>> = estimates.iter().map(|e| self.vector(&e.pose)).collect();
        let errors: Vec<DMatrix<f64>> = (estimates.iter())
            .map(|e| {
                let turn = self.vector_by_step(&e.pose);
                let block = DMatrix::from_fn(size, size, |i, j| e.covariance[(places[i], places[j])]);
                &turn * block * turn.transpose()
            })
            .collect();
        let frames = estimates.len() as f64;
        let mean = vectors.iter().sum::<DVector<f64>>() / frames;
        let mut covariance: DMatrix<f64> =
            vectors.iter().map(|v| (v - &mean) * (v - &mean).transpose()).sum::<DMatrix<f64>>() / frames;
        self.mean = mean;
        for _ in 0..ROUNDS {
            let weights: Vec<DMatrix<f64>> = errors.iter().map(|error| inverse(&(&covariance + error))).collect();
            let trust: Vec<f64> = (weights.iter().zip(&vectors))
                .map(|(weight, vector)| {
                    let off = vector - &self.mean;
                    (FREEDOM + size as f64) / (FREEDOM + off.dot(&(weight * &off)))
                })
                .collect();
            let total = inverse(&weights.iter().zip(&trust).map(|(w, trust)| w * *trust).sum());
            let weighted = weights.iter().zip(&vectors).zip(&trust).map(|((w, v), trust)| w * v * *trust);
            self.mean = total * weighted.sum::<DVector<f64>>();
            // Mean and covariance of the true rotations, given what is known so far.
            let expected = weights.iter().zip(&vectors).zip(&trust).map(|((weight, vector), trust)| {
                let off = &covariance * weight * (vector - &self.mean);
                (&off * off.transpose() + &covariance - &covariance * weight * &covariance) * *trust
            });
            covariance = expected.sum::<DMatrix<f64>>() / trust.iter().sum::<f64>();
            covariance = 0.5 * (&covariance + covariance.transpose());
        }
        let mut eigen = SymmetricEigen::new(covariance);
        eigen.eigenvalues.iter_mut().for_each(|spread| *spread = spread.max(LEAST_SPREAD.powi(2)).recip());
        self.information = eigen.recompose();
    }
}

/// The rotation vector of at most half a turn.
fn shortest(v: DVec3) -> DVec3 {
    if v.length() > std::f64::consts::PI { axis_angle_from_rotation(&rotation_from_axis_angle(v)) } else { v }
}

/// Derivative of a rotation vector by a small rotation applied after it: the inverse of the left Jacobian.
fn vector_by_step(v: DVec3) -> DMat3 {
    let cross = DMat3::from_cols(v.cross(DVec3::X), v.cross(DVec3::Y), v.cross(DVec3::Z));
    let squared = v.length_squared();
    let angle = squared.sqrt();
    let second =
        if squared < 1e-4 { 1.0 / 12.0 + squared / 720.0 } else { (1.0 - 0.5 * angle / (0.5 * angle).tan()) / squared };
    DMat3::IDENTITY - 0.5 * cross + second * (cross * cross)
}

#[cfg(test)]
mod tests {
    use ghand_core::Side;
    use ghand_hand_model::builtin::builtin_hand;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    #[test]
    fn the_derivative_of_rotation_vectors_is_that_of_small_rotations() {
        for v in [DVec3::ZERO, DVec3::new(1e-3, -2e-3, 5e-4), DVec3::new(0.7, -1.1, 0.4), DVec3::new(0.0, 2.9, 0.3)] {
            let step = 1e-6;
            for axis in [DVec3::X, DVec3::Y, DVec3::Z] {
                let turned = |by: f64| {
                    axis_angle_from_rotation(&(rotation_from_axis_angle(axis * by) * rotation_from_axis_angle(v)))
                };
                let found = (turned(step) - turned(-step)) / (2.0 * step);
                assert!(found.distance(vector_by_step(v) * axis) < 1e-8, "{v} {axis}");
            }
        }
    }

    #[test]
    fn hinges_and_proportions_are_found_under_larger_errors() {
        // A finger of two hinges, the second bending 0.6 times as far, with errors of 4 degrees on each axis; in half
        // of the frames the first axis is hardly seen.
        let template = builtin_hand(Side::Right).unwrap();
        let [middle, last] = ["index-finger-phalanx-intermediate", "index-finger-phalanx-distal"]
            .map(|name| template.joint_names.iter().position(|n| n == name).unwrap());
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let mut normal = || (0..12).map(|_| rng.random::<f64>() - 0.5).sum::<f64>();
        let frames = 60;
        let axis = DVec3::new(0.6, 0.0, 0.8);
        let mut truth = vec![];
        let estimates: Vec<Estimate> = (0..frames)
            .map(|frame| {
                let sd = if frame % 2 == 0 { [2.0, 2.0, 2.0] } else { [8.0, 4.0, 4.0] }.map(f64::to_radians);
                let bend = 0.7 + 0.4 * normal();
                truth.push(bend);
                let mut pose = Pose { rotations: vec![DVec3::ZERO; template.joint_count()], translation: DVec3::ZERO };
                for (joint, factor) in [(middle, 1.0), (last, 0.6)] {
                    let error = DVec3::from([0, 1, 2].map(|k| sd[k] * normal()));
                    pose.rotations[joint] = axis_angle_from_rotation(
                        &(rotation_from_axis_angle(error) * rotation_from_axis_angle(axis * (factor * bend))),
                    );
                }
                let numbers = sd.iter().chain(&sd).map(|s| s * s).chain([1e-6; 3]);
                Estimate { pose, covariance: DMatrix::from_diagonal(&DVector::from_iterator(9, numbers)) }
            })
            .collect();
        let mut spread = PoseSpread::new(&template, &[middle, last], frames);
        assert_eq!(spread.groups.len(), 1, "enough frames to measure both joints together");
        spread.measure(&estimates);
        let widths = SymmetricEigen::new(spread.groups[0].information.clone())
            .eigenvalues
            .map(|i| i.sqrt().recip().to_degrees());
        let mut widths: Vec<f64> = widths.iter().copied().collect();
        widths.sort_by(f64::total_cmp);
        println!("standard deviations {widths:.2?} degrees");
        // One direction varies, with 0.4 |(1, 0.6)| = 27 degrees, which is 21 as a width of Student's distribution; nothing
        // else does by a third of the errors.
        assert!(widths[4] < 1.5 && (17.0..25.0).contains(&widths[5]), "{widths:?}");
        // Poses that follow come out far nearer to the truth.
        let mut errors = [0.0, 0.0];
        for (estimate, bend) in estimates.iter().zip(&truth) {
            let mut matrix = inverse(&estimate.covariance);
            let mut gradient = DVector::zeros(9);
            spread.add(&estimate.pose, &mut matrix, &mut gradient);
            let step = -(inverse(&matrix) * gradient);
            let off = |moved: f64| {
                let at = estimate.pose.rotations[last];
                let step = DVec3::new(step[3], step[4], step[5]) * moved;
                let turned = axis_angle_from_rotation(&(rotation_from_axis_angle(step) * rotation_from_axis_angle(at)));
                turned.distance(axis * (0.6 * bend))
            };
            errors[0] += off(0.0);
            errors[1] += off(1.0);
        }
        assert!(errors[1] < 0.4 * errors[0], "{errors:?}");
        // Few frames: joint by joint; hardly any: nothing.
        assert_eq!(PoseSpread::new(&template, &[0, middle, last], 11).groups.len(), 2);
        assert!(PoseSpread::new(&template, &[0, middle, last], 3).groups.is_empty());
    }
}
