//! The complete deformation from properties and pose to posed points, including the pose response, in all settings of
//! both options.

use ghand_core::Pose;
use ghand_core::deformation::{DeformationInputs, Deformed, deform, deform_vjp};
use ghand_core::pose_response::{PoseResponse, UNLIMITED, pose_features, response_features_vjp};
use ghand_core::residual_skeleton::ResidualSkeleton;
use ghand_core::skeleton::rotations_vjp;
use ghand_core::skinning::ResidualWeights;
use glam::{DMat3, DVec3};
use proptest::prelude::Strategy;

use super::cases::{About, Case, cases, uniform};
use super::check::{Input, Problem, SLOPE, prove};
use super::dual::Scalar;
use super::reference::{self, Skin, vec3s};
use super::{ROTATION_STEP, depth, dvec3s, flat, largest};

struct Whole {
    case: Case,
    parents: Vec<Option<usize>>,
    weights: Vec<f64>,
    inputs: Vec<Input>,
    size: f64,
}

impl Whole {
    fn new(case: &Case) -> Whole {
        let rng = &mut case.rng();
        let n = case.points;
        let joints = case.joints;
        let bases = case.bases;
        let parents = case.parents(rng);
        let weights = case.weights(rng, n);
        let residual_weights = case.residual_weights(rng, n);
        let size = case.place.1;
        let canonical = case.points(rng, n);
        let rest_joints = case.points(rng, joints);
        let basis: Vec<f64> = uniform(rng, 3 * bases * n).iter().map(|x| x * size).collect();
        let coefficients = uniform(rng, 3 * bases * n);
        let regressor = uniform(rng, joints * n);
        let rotations = case.rotations(rng, joints);
        let translation = case.points(rng, 1);
        let bias = uniform(rng, bases);
        let gain = uniform(rng, bases * joints * 9);

        // Upper estimates. Coefficients move by gains times |R - I| <= 2 in each entry.
        let per_point = |values: &[f64]| {
            (0..n).map(|p| values.iter().skip(p).step_by(n).map(|w| w.abs()).sum::<f64>()).fold(0.0, f64::max)
        };
        let gains = 1.0 + per_point(&weights) * 18.0;
        let offset = bases as f64 * size * (1.0 + gains);
        let residual_joint = offset * n as f64 + largest(&rest_joints);
        let turned = per_point(&weights) + 2.0 * per_point(&residual_weights);
        let bones = depth(&parents) * (largest(&rest_joints) + residual_joint);
        let extent = largest(&canonical) + offset + bones;
        let posed = turned * extent + largest(&translation);
        let all_points = SLOPE * n as f64;
        let n_f = n as f64;
        let d_offset = 1.0 + SLOPE * turned + joints as f64 * all_points * turned;
        let response = n_f * d_offset * size;
        let inputs = vec![
            Input::new("canonical", canonical, extent, SLOPE * turned),
            Input::new("joints", rest_joints, extent, all_points * turned),
            Input::new("shape basis", basis, extent, d_offset * (1.0 + gains)),
            Input::new("blend coefficients", coefficients, extent / size, d_offset * size),
            Input::new("skeleton regressor", regressor, extent / offset.max(size), all_points * turned * offset),
            Input::new("residual weights", residual_weights, 1.0, SLOPE * extent),
            Input::new("rotations", rotations, ROTATION_STEP, all_points * turned * extent + response * 18.0),
            Input::new("translation", translation, extent, all_points),
            Input::new("bias", bias, extent / size, response),
            Input::new("gain", gain, extent / size, response * 2.0),
        ];
        Whole { case: case.clone(), parents, weights, inputs, size: posed }
    }

    /// The crate's outputs, and its gradients if those of the outputs are given.
    fn run(&self, inputs: &[&[f64]], d_outputs: &[f64]) -> (Deformed, Vec<Vec<f64>>) {
        let &[canonical, joints, basis, coefficients, regressor, residual_weights, rotations, translation, bias, gain] =
            inputs
        else {
            panic!("ten inputs")
        };
        let n = self.case.points;
        let pose = Pose { rotations: dvec3s(rotations), translation: DVec3::from_slice(translation) };
        let features = pose_features(&pose);
        // The derivative of limits is tested with the response alone.
        let limits = vec![UNLIMITED; gain.len() / 9];
        let response = PoseResponse { bias: bias.to_vec(), gain: gain.to_vec(), limits };
        let values = response.evaluate(&self.weights, &features, n);
        let coefficients: Vec<DVec3> = dvec3s(coefficients).iter().zip(&values).map(|(c, v)| *c + *v).collect();
        let canonical = dvec3s(canonical);
        let joints = dvec3s(joints);
        let basis = dvec3s(basis);
        let d = DeformationInputs {
            parents: &self.parents,
            joints: &joints,
            canonical: &canonical,
            weights: &self.weights,
            shape_basis: &basis,
            blend_coefficients: &coefficients,
            skeleton_regressor: regressor,
            residual_weights,
            residual_weights_mode: if self.case.zero_sum { ResidualWeights::ZeroSum } else { ResidualWeights::Paper },
            residual_skeleton_mode: if self.case.anchored {
                ResidualSkeleton::Anchored
            } else {
                ResidualSkeleton::Paper
            },
        };
        let forward = deform(&d, &pose);
        if d_outputs.is_empty() {
            return (forward, vec![]);
        }
        let (d_posed, d_offsets) = d_outputs.split_at(3 * n);
        let g = deform_vjp(&d, &pose, &forward, &dvec3s(d_posed), &dvec3s(d_offsets));
        let d_values: Vec<f64> = g.blend_coefficients.iter().map(|c| c.element_sum()).collect();
        let (d_response, d_features) = response.evaluate_vjp(&self.weights, &features, &d_values, n);
        let d_response_local = response_features_vjp(&d_features);
        let d_local: Vec<DMat3> = g.local.iter().zip(d_response_local).map(|(l, d)| *l + d).collect();
        let gradients = vec![
            flat(&g.canonical),
            flat(&g.joints),
            flat(&g.shape_basis),
            flat(&g.blend_coefficients),
            g.skeleton_regressor,
            g.residual_weights,
            flat(&rotations_vjp(&pose.rotations, &d_local)),
            flat(&[g.translation]),
            d_response.bias,
            d_response.gain,
        ];
        (forward, gradients)
    }
}

impl Problem for Whole {
    fn case(&self) -> &Case {
        &self.case
    }

    fn about(&self) -> &[About] {
        use About::*;
        &[Angle, Place, Rig, Weights, Residuals, ZeroSum, Anchored]
    }

    fn inputs(&self) -> &[Input] {
        &self.inputs
    }

    fn size(&self) -> f64 {
        self.size
    }

    fn reference<S: Scalar>(&self, inputs: &[&[S]]) -> Vec<S> {
        let &[canonical, joints, basis, coefficients, regressor, residual_weights, rotations, translation, bias, gain] =
            inputs
        else {
            panic!("ten inputs")
        };
        let n = self.case.points;
        let joints = vec3s(joints);
        let local: Vec<[S; 9]> = vec3s(rotations).into_iter().map(reference::rotation).collect();
        let values = reference::pose_response(bias, gain, &[], &self.weights, &local, n);
        let coefficients: Vec<_> = vec3s(coefficients).iter().zip(values).map(|(c, v)| c.map(|x| x + v)).collect();
        let offsets = reference::offsets(&vec3s(basis), &coefficients, n);
        let rest: Vec<_> = vec3s(canonical).iter().zip(&offsets).map(|(x, o)| reference::add3(*x, *o)).collect();
        let residual_joints = reference::residual_joints(regressor, &offsets, &joints, self.case.anchored);
        let posed = Skin {
            rest: &rest,
            weights: &self.weights,
            residual_weights,
            bones: &reference::chain(&self.parents, &joints, &local).1,
            residual_bones: &reference::chain(&self.parents, &residual_joints, &local).1,
            translation: [translation[0], translation[1], translation[2]],
            zero_sum: self.case.zero_sum,
        }
        .posed();
        [posed, offsets].concat().into_flattened()
    }

    fn outputs(&self, inputs: &[&[f64]]) -> Vec<f64> {
        let forward = self.run(inputs, &[]).0;
        flat(&[forward.posed, forward.offsets].concat())
    }

    fn gradients(&self, d_outputs: &[f64]) -> Vec<Vec<f64>> {
        self.run(&self.drawn(), d_outputs).1
    }
}

fn prove_settings(name: &str, zero_sum: bool, anchored: bool) {
    let cases = cases().prop_map(move |case| Case { zero_sum, anchored, ..case });
    prove(name, cases, Whole::new);
}

#[test]
fn the_deformation_is_right_with_zero_sum_weights_and_an_anchored_residual_skeleton() {
    prove_settings("deform: ZeroSum, Anchored", true, true);
}

#[test]
fn the_deformation_is_right_with_zero_sum_weights_and_the_papers_residual_skeleton() {
    prove_settings("deform: ZeroSum, Paper", true, false);
}

#[test]
fn the_deformation_is_right_with_the_papers_weights_and_an_anchored_residual_skeleton() {
    prove_settings("deform: Paper, Anchored", false, true);
}

#[test]
fn the_deformation_is_right_with_the_papers_weights_and_residual_skeleton() {
    prove_settings("deform: Paper, Paper", false, false);
}
