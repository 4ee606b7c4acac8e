//! The whole path from properties and pose to posed points, its hand-derived gradient against central differences.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a test fails by panicking")]
#![allow(clippy::neg_cmp_op_on_partial_ord, reason = "`!(error <= bound)` rejects NaN too")]

use ghand_core::blend_shapes::{blend_shapes, blend_shapes_vjp};
use ghand_core::pose_response::{PoseResponse, rotation_features, rotation_features_vjp};
use ghand_core::residual_skeleton::{ResidualSkeleton, residual_joints, residual_joints_vjp};
use ghand_core::skeleton::{pose_skeleton, pose_skeleton_vjp, rotations_vjp};
use ghand_core::skinning::{ResidualWeights, Skinning, skin, skin_vjp};
use glam::DVec3;
use rand::{RngExt, SeedableRng};

const POINTS: usize = 7;
const BASES: usize = 3;
const PARENTS: [Option<usize>; 5] = [None, Some(0), Some(1), Some(0), Some(3)];
const JOINTS: usize = PARENTS.len();

/// All inputs of the path as one flat vector, so that one loop differentiates everything.
#[derive(Clone)]
struct Inputs {
    flat: Vec<f64>,
    rest: Vec<DVec3>,
    weights: Vec<f64>,
    joints: Vec<DVec3>,
    loss: Vec<DVec3>,
    skeleton: ResidualSkeleton,
    residual: ResidualWeights,
}

/// Sizes of the parts of the flat vector: S, bias, gain, residual weights, regressor, pose, translation.
const PARTS: [usize; 7] =
    [BASES * POINTS * 3, BASES, BASES * JOINTS * 9, JOINTS * POINTS, JOINTS * POINTS, JOINTS * 3, 3];

impl Inputs {
    fn random(seed: u64, angle: f64, skeleton: ResidualSkeleton, residual: ResidualWeights) -> Inputs {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
        let mut flat: Vec<f64> = (0..PARTS.iter().sum()).map(|_| rng.random_range(-1.0..1.0)).collect();
        let pose_start: usize = PARTS[..5].iter().sum();
        for v in &mut flat[pose_start..pose_start + PARTS[5]] {
            *v *= angle;
        }
        let mut vectors = |n| -> Vec<DVec3> {
            (0..n).map(|_| DVec3::from_array(std::array::from_fn(|_| rng.random_range(-1.0..1.0)))).collect()
        };
        let (rest, joints, loss) = (vectors(POINTS), vectors(JOINTS), vectors(POINTS));
        let mut weights: Vec<f64> = (0..JOINTS * POINTS).map(|_| rng.random_range(0.0..1.0)).collect();
        for p in 0..POINTS {
            let sum: f64 = (0..JOINTS).map(|k| weights[k * POINTS + p]).sum();
            (0..JOINTS).for_each(|k| weights[k * POINTS + p] /= sum);
        }
        Inputs { flat, rest, weights, joints, loss, skeleton, residual }
    }

    fn part(&self, part: usize) -> &[f64] {
        let start: usize = PARTS[..part].iter().sum();
        &self.flat[start..start + PARTS[part]]
    }

    fn loss_and_gradient(&self) -> (f64, Vec<f64>) {
        let vec3 = |s: &[f64]| s.chunks_exact(3).map(DVec3::from_slice).collect::<Vec<_>>();
        let shape_basis = vec3(self.part(0));
        let response = PoseResponse { bias: self.part(1).to_vec(), gain: self.part(2).to_vec() };
        let (residual_weights, regressor) = (self.part(3), self.part(4));
        let rotations = vec3(self.part(5));
        let translation = DVec3::from_slice(self.part(6));

        let chain = pose_skeleton(&PARENTS, &self.joints, &rotations);
        let features: Vec<_> = chain.local.iter().map(rotation_features).collect();
        let values = response.evaluate(&self.weights, &features, POINTS);
        let coefficients: Vec<DVec3> = values.iter().map(|v| DVec3::splat(*v)).collect();
        let offsets = blend_shapes(&shape_basis, &coefficients, POINTS);
        let moved: Vec<DVec3> = self.rest.iter().zip(&offsets).map(|(x, d)| *x + *d).collect();
        let residual_at = residual_joints(regressor, &offsets, &self.joints, self.skeleton);
        let residual_chain = pose_skeleton(&PARENTS, &residual_at, &rotations);
        let skinning = Skinning {
            rest: &moved,
            weights: &self.weights,
            residual_weights,
            bones: &chain.posed_from_rest,
            residual_bones: &residual_chain.posed_from_rest,
            translation,
            mode: self.residual,
        };
        let posed = skin(&skinning);
        let loss = posed.iter().zip(&self.loss).map(|(x, w)| x.dot(*w)).sum();

        let d = skin_vjp(&skinning, &self.loss);
        let d_residual_chain = pose_skeleton_vjp(&PARENTS, &residual_at, &residual_chain, &d.residual_bones, &[]);
        let (d_regressor, mut d_offsets) = residual_joints_vjp(regressor, &offsets, &d_residual_chain.joints);
        d_offsets.iter_mut().zip(&d.rest).for_each(|(a, b)| *a += *b);
        let (d_basis, d_coefficients) = blend_shapes_vjp(&shape_basis, &coefficients, &d_offsets);
        let d_values: Vec<f64> = d_coefficients.iter().map(|c| c.element_sum()).collect();
        let (d_response, d_features) = response.evaluate_vjp(&self.weights, &features, &d_values, POINTS);
        let d_chain = pose_skeleton_vjp(&PARENTS, &self.joints, &chain, &d.bones, &[]);
        let d_local: Vec<_> = (0..JOINTS)
            .map(|k| d_chain.local[k] + d_residual_chain.local[k] + rotation_features_vjp(&d_features[k]))
            .collect();
        let d_rotations = rotations_vjp(&rotations, &d_local);

        let mut gradient = Vec::new();
        let push3 = |v: &[DVec3], out: &mut Vec<f64>| v.iter().for_each(|x| out.extend(x.to_array()));
        push3(&d_basis, &mut gradient);
        gradient.extend(&d_response.bias);
        gradient.extend(&d_response.gain);
        gradient.extend(&d.residual_weights);
        gradient.extend(&d_regressor);
        push3(&d_rotations, &mut gradient);
        push3(&[d.translation], &mut gradient);
        (loss, gradient)
    }
}

/// Largest error of a gradient against central differences, relative to the largest entry of the part.
fn worst_error(inputs: &Inputs, gradient: &[f64]) -> f64 {
    let mut worst: f64 = 0.0;
    let mut at = 0;
    for size in PARTS {
        let scale = gradient[at..at + size].iter().fold(1e-3, |m: f64, g| m.max(g.abs()));
        for (i, analytic) in gradient.iter().enumerate().skip(at).take(size) {
            let step = 1e-5;
            let shifted = |h: f64| {
                let mut other = inputs.clone();
                other.flat[i] += h;
                other.loss_and_gradient().0
            };
            let numeric = (shifted(step) - shifted(-step)) / (2.0 * step);
            let error = (analytic - numeric).abs() / scale;
            if !(error <= worst) {
                worst = error;
            }
        }
        at += size;
    }
    worst
}

#[test]
fn the_gradient_of_the_whole_path_agrees_with_central_differences() {
    for skeleton in [ResidualSkeleton::Paper, ResidualSkeleton::Anchored] {
        for residual in [ResidualWeights::Paper, ResidualWeights::ZeroSum] {
            for (seed, angle) in [(1, 0.0), (2, 1e-7), (3, 0.3), (4, 1.0), (5, 4.0)] {
                let inputs = Inputs::random(seed, angle, skeleton, residual);
                let worst = worst_error(&inputs, &inputs.loss_and_gradient().1);
                assert!(worst <= 1e-7, "{skeleton:?} {residual:?} angle {angle}: relative error {worst}");
            }
        }
    }
}

#[test]
fn the_comparison_rejects_a_wrong_gradient() {
    let inputs = Inputs::random(9, 0.5, ResidualSkeleton::Anchored, ResidualWeights::ZeroSum);
    let (_, mut gradient) = inputs.loss_and_gradient();
    for part in 0..PARTS.len() {
        let at: usize = PARTS[..part].iter().sum();
        let right = gradient[at];
        gradient[at] += 1e-2;
        assert!(!(worst_error(&inputs, &gradient) <= 1e-5), "part {part} is not checked");
        gradient[at] = right;
    }
}

#[test]
fn without_residual_weights_corrected_skinning_is_plain_skinning() {
    let mut inputs = Inputs::random(11, 0.7, ResidualSkeleton::Anchored, ResidualWeights::ZeroSum);
    inputs.flat.fill(0.0);
    let rotations: Vec<DVec3> = inputs.loss.iter().take(JOINTS).copied().collect();
    let chain = pose_skeleton(&PARENTS, &inputs.joints, &rotations);
    let zeros = vec![0.0; JOINTS * POINTS];
    let posed = skin(&Skinning {
        rest: &inputs.rest,
        weights: &inputs.weights,
        residual_weights: &zeros,
        bones: &chain.posed_from_rest,
        residual_bones: &chain.posed_from_rest,
        translation: DVec3::ZERO,
        mode: ResidualWeights::ZeroSum,
    });
    for (p, x) in inputs.rest.iter().enumerate() {
        let expected: DVec3 =
            (0..JOINTS).map(|k| chain.posed_from_rest[k].apply(*x) * inputs.weights[k * POINTS + p]).sum();
        assert!((posed[p] - expected).length() < 1e-14);
    }
}

#[test]
fn the_rest_pose_is_the_identity_with_zero_sum_weights_and_swells_with_the_papers() {
    let inputs = Inputs::random(12, 0.0, ResidualSkeleton::Anchored, ResidualWeights::ZeroSum);
    let chain = pose_skeleton(&PARENTS, &inputs.joints, &[DVec3::ZERO; JOINTS]);
    let mut skinning = Skinning {
        rest: &inputs.rest,
        weights: &inputs.weights,
        residual_weights: inputs.part(3),
        bones: &chain.posed_from_rest,
        residual_bones: &chain.posed_from_rest,
        translation: DVec3::ZERO,
        mode: ResidualWeights::ZeroSum,
    };
    let zero_sum = skin(&skinning);
    assert!(zero_sum.iter().zip(&inputs.rest).all(|(a, b)| (*a - *b).length() < 1e-13));
    skinning.mode = ResidualWeights::Paper;
    assert!(skin(&skinning).iter().zip(&inputs.rest).any(|(a, b)| (*a - *b).length() > 0.1));
}
