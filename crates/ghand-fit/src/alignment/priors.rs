//! What is known about poses before contours are looked at, with widths measured from the capture itself.
//!
//! The given poses are true ones with an error: per joint a constant part (the bias) and noise. The true rotations of a
//! finger's joints vary together over the capture's frames: a hinge hardly varies about two of its axes, and the last two
//! joints bend together. Noise and bias are moments of the poses found so far and of their uncertainty; `spread.rs` has
//! how the fingers vary.

use ghand_core::rotation::{axis_angle_from_rotation, rotation_from_axis_angle};
use ghand_core::{HandModel, Pose};
use glam::{DMat3, DVec3};
use nalgebra::{DMatrix, DVector, Matrix3};

use super::spread::{Estimate, PoseSpread};

/// Start of the noise of given rotations, radians, and of translations, metres, per axis.
const NOISE: f64 = 4.0_f64.to_radians();
const TRANSLATION_NOISE: f64 = 0.002;
/// A joint's own noise counts as if so many frames had shown the noise of all joints.
const POOLED_FRAMES: f64 = 20.0;
/// Standard deviation of a bias, radians. Small: a constant error of the rotations and the template's proportions explain
/// the same contours.
const BIAS: f64 = 0.3_f64.to_radians();
/// Least noise, radians and metres.
const LEAST_NOISE: f64 = 0.3_f64.to_radians();
const LEAST_TRANSLATION_NOISE: f64 = 0.0001;

/// The prior of one joint.
#[derive(Debug, Clone)]
struct JointPrior {
    /// Noise of the given rotations about each axis, radians.
    noise: f64,
    /// Constant error of the given rotations: true = exp(bias) given.
    bias: DVec3,
}

/// The prior of a capture's poses.
#[derive(Debug, Clone)]
pub struct Priors {
    joints: Vec<JointPrior>,
    translation_noise: f64,
    /// How the true rotations vary.
    pub spread: PoseSpread,
}

impl Priors {
    /// Before anything is measured: no bias, the noise of a usual tracker, no knowledge of the joints.
    pub fn new(template: &HandModel, moving: &[usize], frames: usize) -> Priors {
        let joint = JointPrior { noise: NOISE, bias: DVec3::ZERO };
        Priors {
            joints: vec![joint; moving.len()],
            translation_noise: TRANSLATION_NOISE,
            spread: PoseSpread::new(template, moving, frames),
        }
    }

    /// Adds the given pose's part to a frame's equations; `matrix` and `gradient` are those of its pose.
    pub fn add_given(
        &self,
        pose: &Pose,
        given: &Pose,
        moving: &[usize],
        matrix: &mut DMatrix<f64>,
        gradient: &mut DVector<f64>,
    ) {
        for (i, (joint, prior)) in moving.iter().zip(&self.joints).enumerate() {
            let information = DMat3::IDENTITY * prior.noise.powi(-2);
            let off = self.difference(prior, pose, given, *joint);
            add(matrix, gradient, 3 * i, information, off);
        }
        let information = DMat3::IDENTITY * self.translation_noise.powi(-2);
        add(matrix, gradient, 3 * moving.len(), information, pose.translation - given.translation);
    }

    /// Rotation vector from the given rotation, without its bias, to that of a pose.
    fn difference(&self, prior: &JointPrior, pose: &Pose, given: &Pose, joint: usize) -> DVec3 {
        let centre = rotation_from_axis_angle(prior.bias) * rotation_from_axis_angle(given.rotations[joint]);
        axis_angle_from_rotation(&(rotation_from_axis_angle(pose.rotations[joint]) * centre.transpose()))
    }

    /// Measures bias, noise and spread again from estimates of all frames.
    pub fn measure(&mut self, estimates: &[Estimate], given: &[&Pose], moving: &[usize]) {
        let frames = estimates.len() as f64;
        let mut squares = vec![0.0; moving.len()];
        for (i, joint) in moving.iter().enumerate() {
            let unbiased = JointPrior { bias: DVec3::ZERO, ..self.joints[i].clone() };
            let offs: Vec<DVec3> = estimates
                .iter()
                .zip(given)
                .map(|(e, given)| self.difference(&unbiased, &e.pose, given, *joint))
                .collect();
            let mean = offs.iter().sum::<DVec3>() / frames;
            let sure = frames * BIAS.powi(2) / (frames * BIAS.powi(2) + self.joints[i].noise.powi(2));
            self.joints[i].bias = sure * mean;
            // The estimate moves away from the given rotation by what the images say; what they do not say is in the
            // covariance.
            let unseen: f64 = estimates.iter().map(|e| block(&e.covariance, 3 * i).trace() / 3.0).sum();
            let moved: f64 = offs.iter().map(|off| (*off - self.joints[i].bias).length_squared() / 3.0).sum();
            squares[i] = (unseen + moved) / frames;
        }
        let pooled = squares.iter().sum::<f64>() / squares.len().max(1) as f64;
        for (joint, own) in self.joints.iter_mut().zip(&squares) {
            let square = (frames * own + POOLED_FRAMES * pooled) / (frames + POOLED_FRAMES);
            joint.noise = square.sqrt().max(LEAST_NOISE);
        }
        let at = 3 * moving.len();
        let translations = estimates.iter().zip(given).map(|(e, given)| {
            (block(&e.covariance, at).trace() + e.pose.translation.distance_squared(given.translation)) / 3.0
        });
        self.translation_noise = (translations.sum::<f64>() / frames).sqrt().max(LEAST_TRANSLATION_NOISE);
        self.spread.measure(estimates);
    }
}

fn block(matrix: &DMatrix<f64>, at: usize) -> Matrix3<f64> {
    matrix.fixed_view::<3, 3>(at, at).into()
}

/// Adds half of off . information . off, where the step moves `off` as it is.
fn add(matrix: &mut DMatrix<f64>, gradient: &mut DVector<f64>, at: usize, information: DMat3, off: DVec3) {
    let pull = (information * off).to_array();
    for row in 0..3 {
        gradient[at + row] += pull[row];
        for column in 0..3 {
            matrix[(at + row, at + column)] += information.col(column)[row];
        }
    }
}
