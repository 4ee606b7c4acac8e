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
/// Start and least standard deviation of a bias, radians. Small: a constant error of the rotations and the template's
/// proportions explain the same contours. It grows where biases turn out larger: joints that a tracker sees elsewhere than the
/// template has them are off by several degrees in all frames.
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
    /// Standard deviation of a bias about each axis, radians.
    bias_deviation: f64,
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
            bias_deviation: BIAS,
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
        let mut means = vec![DVec3::ZERO; moving.len()];
        let variance = self.bias_deviation.powi(2);
        for (i, joint) in moving.iter().enumerate() {
            let unbiased = JointPrior { bias: DVec3::ZERO, ..self.joints[i].clone() };
            let offs: Vec<DVec3> = estimates
                .iter()
                .zip(given)
                .map(|(e, given)| self.difference(&unbiased, &e.pose, given, *joint))
                .collect();
            means[i] = offs.iter().sum::<DVec3>() / frames;
            let sure = frames * variance / (frames * variance + self.joints[i].noise.powi(2));
            self.joints[i].bias = sure * means[i];
            // The estimate moves away from the given rotation by what the images say; what they do not say is in the
            // covariance.
            let unseen: f64 = estimates.iter().map(|e| block(&e.covariance, 3 * i).trace() / 3.0).sum();
            let moved: f64 = offs.iter().map(|off| (*off - self.joints[i].bias).length_squared() / 3.0).sum();
            squares[i] = (unseen + moved) / frames;
        }
        // What the means of all joints vary beyond what noise makes of them.
        let excess = |(mean, joint): (&DVec3, &JointPrior)| mean.length_squared() / 3.0 - joint.noise.powi(2) / frames;
        let excess: f64 = means.iter().zip(&self.joints).map(excess).sum();
        self.bias_deviation = (excess / moving.len().max(1) as f64).max(BIAS.powi(2)).sqrt();
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

#[cfg(test)]
mod tests {
    use ghand_core::Side;
    use ghand_hand_model::builtin::builtin_hand;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    /// The largest biases of given poses, degrees, planted and measured: true rotations, given ones with noise of 4 degrees and a
    /// bias of up to `most` degrees, and estimates that are off by 1.
    fn biases(most: f64) -> [f64; 2] {
        let template = builtin_hand(Side::Right).unwrap();
        let moving = [0, 2, 3, 6, 7, 8];
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let mut normal = |degrees: f64| {
            let mut number = || (0..12).map(|_| rng.random::<f64>() - 0.5).sum::<f64>();
            degrees.to_radians() * DVec3::new(number(), number(), number())
        };
        let turned = |by: DVec3, rotation: DVec3| {
            axis_angle_from_rotation(&(rotation_from_axis_angle(by) * rotation_from_axis_angle(rotation)))
        };
        let planted: Vec<DVec3> =
            moving.iter().map(|_| normal(0.5 * most).clamp_length_max(most.to_radians())).collect();
        let (mut given, mut estimates) = (vec![], vec![]);
        for _ in 0..50 {
            let mut poses = [(); 2]
                .map(|()| Pose { rotations: vec![DVec3::ZERO; template.joint_count()], translation: DVec3::ZERO });
            for (joint, bias) in moving.iter().zip(&planted) {
                let truth = normal(20.0);
                poses[0].rotations[*joint] = turned(-*bias, turned(normal(4.0), truth));
                poses[1].rotations[*joint] = turned(normal(1.0), truth);
            }
            let [pose, estimate] = poses;
            given.push(pose);
            let count = 3 * moving.len() + 3;
            let covariance = DMatrix::from_diagonal_element(count, count, 1_f64.to_radians().powi(2));
            estimates.push(Estimate { pose: estimate, covariance });
        }
        let mut priors = Priors::new(&template, &moving, given.len());
        let given: Vec<&Pose> = given.iter().collect();
        for _ in 0..8 {
            priors.measure(&estimates, &given, &moving);
        }
        let largest = |all: &mut dyn Iterator<Item = DVec3>| all.map(|v| v.length()).fold(0.0, f64::max).to_degrees();
        let off = priors.joints.iter().zip(&planted).map(|(joint, planted)| joint.bias - *planted);
        println!("planted {most}: deviation {:.2}", priors.bias_deviation.to_degrees());
        [largest(&mut planted.iter().copied()), largest(&mut off.into_iter())]
    }

    #[test]
    fn biases_count_as_far_as_they_are_beyond_the_noise() {
        // The mean of 50 frames is off by 0.6 degrees about each axis. With a deviation of BIAS, most of the bias stays.
        let [planted, off] = biases(8.0);
        println!("planted {planted:.2} off {off:.2}");
        assert!(planted > 4.0 && off < 2.5, "planted {planted} off {off}");
        let [_, found] = biases(0.0);
        println!("found without any {found:.2}");
        assert!(found < 0.6, "{found}");
    }
}
