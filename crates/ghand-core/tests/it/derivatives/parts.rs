//! Each stage of the deformation alone.

use ghand_core::blend_shapes::{blend_shapes, blend_shapes_vjp};
use ghand_core::pose_response::{PoseResponse, UNLIMITED, response_features, response_features_vjp};
use ghand_core::residual_skeleton::{ResidualSkeleton, residual_joints, residual_joints_vjp};
use ghand_core::rotation::{rotation_from_axis_angle, rotation_from_axis_angle_vjp};
use ghand_core::skeleton::{Affine, pose_skeleton, pose_skeleton_vjp, rotations_vjp};
use ghand_core::skinning::{ResidualWeights, Skinning, skin, skin_vjp};
use glam::{DMat3, DVec3};
use rand::RngExt;

use super::cases::{About, Case, cases, uniform};
use super::check::{Input, Problem, SLOPE, prove};
use super::dual::Scalar;
use super::reference::{self, Mat4, Skin, vec3s};
use super::{ROTATION_STEP, depth, dvec3s, flat, largest};

/// A matrix from its rows.
fn matrix(rows: &[f64]) -> DMat3 {
    DMat3::from_cols_slice(rows).transpose()
}

fn rows(matrices: &[DMat3]) -> Vec<f64> {
    matrices.iter().flat_map(|m| m.transpose().to_cols_array()).collect()
}

/// Affine maps from rows of four.
fn affines(flat: &[f64]) -> Vec<Affine> {
    let one = |m: &[f64]| Affine {
        linear: DMat3::from_cols_array_2d(&[[m[0], m[4], m[8]], [m[1], m[5], m[9]], [m[2], m[6], m[10]]]),
        translation: DVec3::new(m[3], m[7], m[11]),
    };
    flat.chunks_exact(12).map(one).collect()
}

fn flat_affines(maps: &[Affine]) -> Vec<f64> {
    maps.iter().flat_map(|m| (0..3).flat_map(|i| m.linear.row(i).extend(m.translation[i]).to_array())).collect()
}

fn mat4s<S: Scalar>(flat: &[S]) -> Vec<Mat4<S>> {
    flat.chunks_exact(12).map(|m| std::array::from_fn(|i| std::array::from_fn(|j| m[4 * i + j]))).collect()
}

#[derive(Clone, Copy, PartialEq)]
enum Stage {
    Rotation,
    Skeleton,
    Skin,
    BlendShapes,
    ResidualJoints,
    PoseResponse,
}

struct Part {
    stage: Stage,
    case: Case,
    parents: Vec<Option<usize>>,
    weights: Vec<f64>,
    /// Of the pose response.
    limits: Vec<[f64; 2]>,
    inputs: Vec<Input>,
    size: f64,
}

/// How far the limits of a response are from its terms. A term changes by less than 12 in the differences: by at most 2
/// x 9 steps of 2/3 in the gains. So a term stays on its side of a limit, where it is linear or constant.
const REACH: f64 = 20.0;

impl Part {
    fn new(stage: Stage, case: &Case) -> Part {
        let rng = &mut case.rng();
        let n = case.points;
        let joints = case.joints;
        let bases = case.bases;
        let metres = case.place.1;
        let parents = case.parents(rng);
        let weights = case.weights(rng, n);
        let points = n as f64;
        let mut limits = vec![];
        let (inputs, size) = match stage {
            Stage::Rotation => (vec![Input::new("rotation", case.rotations(rng, 1), ROTATION_STEP, 9.0 * SLOPE)], 1.0),
            Stage::Skeleton => {
                let at = case.points(rng, joints);
                let extent = largest(&at) * 2.0 * depth(&parents);
                // Nine numbers of a rotation; the three of a translation are each the difference of two places.
                let all = SLOPE * 15.0 * joints as f64;
                let rotations = case.rotations(rng, joints);
                let inputs = vec![
                    // Beside rotations of a small angle, a small step of joints changes less than rounding does.
                    Input::new("joints", at, 1.0 + extent, all),
                    Input::new("rotations", rotations, ROTATION_STEP, all * (1.0 + extent)),
                ];
                (inputs, 1.0 + 2.0 * extent)
            }
            Stage::Skin => {
                let rest = case.points(rng, n);
                let translation = case.points(rng, 1);
                let extent = 1.0 + 3.0 * largest(&rest);
                let bones = uniform(rng, 12 * joints);
                let residual_bones = uniform(rng, 12 * joints);
                let residual_weights = case.residual_weights(rng, n);
                let turned = joints as f64 * (largest(&weights) + 2.0 * largest(&residual_weights));
                let inputs = vec![
                    Input::new("rest", rest, extent, 3.0 * SLOPE * turned),
                    Input::new("residual weights", residual_weights, 1.0, 6.0 * SLOPE * extent),
                    Input::new("bones", bones, 1.0, SLOPE * points * turned * extent),
                    Input::new("residual bones", residual_bones, 1.0, SLOPE * points * turned * extent),
                    Input::new("translation", translation, extent, SLOPE * points),
                ];
                (inputs, turned * extent + extent)
            }
            Stage::BlendShapes => {
                let basis = uniform(rng, 3 * bases * n).iter().map(|x| x * metres).collect();
                let inputs = vec![
                    Input::new("shape basis", basis, metres, SLOPE),
                    Input::new("blend coefficients", uniform(rng, 3 * bases * n), 1.0, SLOPE * metres),
                ];
                (inputs, metres * (1 + bases) as f64)
            }
            Stage::ResidualJoints => {
                let offsets: Vec<f64> = uniform(rng, 3 * n).iter().map(|x| x * metres).collect();
                let rest = case.points(rng, joints);
                let extent = largest(&rest) + points * metres;
                let inputs = vec![
                    Input::new("skeleton regressor", uniform(rng, joints * n), extent / metres, 3.0 * SLOPE * metres),
                    Input::new("offsets", offsets, extent, SLOPE * joints as f64),
                    Input::new("joints", rest, extent, SLOPE),
                ];
                (inputs, extent)
            }
            Stage::PoseResponse => {
                let all = SLOPE * points * largest(&weights).max(1.0);
                // Any matrices will do.
                let inputs = vec![
                    Input::new("bias", uniform(rng, bases), 1.0, all),
                    Input::new("gain", uniform(rng, 9 * bases * joints), 1.0, 2.0 * all),
                    Input::new("local rotations", uniform(rng, 9 * joints), 1.0, (1 + bases) as f64 * all),
                ];
                let rotations: Vec<[f64; 9]> = inputs[2].values.as_chunks::<9>().0.to_vec();
                let terms = reference::response_terms(&inputs[1].values, &rotations);
                // A root's term is 0 and stays 0 with any limits.
                let mut around = |term: f64| match rng.random_range(0..4) {
                    0 => UNLIMITED,
                    1 => [term - REACH, term + REACH],
                    2 => [term + REACH, term + 2.0 * REACH],
                    _ => [term - 2.0 * REACH, term - REACH],
                };
                limits = terms.into_iter().map(&mut around).collect();
                // A term is at most 18, and held at most REACH away from that.
                (inputs, 1.0 + (18.0 + REACH) * (joints as f64) * largest(&weights))
            }
        };
        Part { stage, case: case.clone(), parents, weights, limits, inputs, size }
    }

    fn residual_skeleton(&self) -> ResidualSkeleton {
        if self.case.anchored { ResidualSkeleton::Anchored } else { ResidualSkeleton::Paper }
    }

    /// The crate's skinning with borrowed inputs.
    fn with_skinning<T>(&self, inputs: &[&[f64]], then: impl FnOnce(&Skinning) -> T) -> T {
        then(&Skinning {
            rest: &dvec3s(inputs[0]),
            weights: &self.weights,
            residual_weights: inputs[1],
            bones: &affines(inputs[2]),
            residual_bones: &affines(inputs[3]),
            translation: DVec3::from_slice(inputs[4]),
            mode: if self.case.zero_sum { ResidualWeights::ZeroSum } else { ResidualWeights::Paper },
        })
    }

    /// The crate's pose response and the features it depends on.
    fn response(&self, inputs: &[&[f64]]) -> (PoseResponse, Vec<[f64; 9]>) {
        let local: Vec<DMat3> = inputs[2].chunks_exact(9).map(matrix).collect();
        let response = PoseResponse { bias: inputs[0].to_vec(), gain: inputs[1].to_vec(), limits: self.limits.clone() };
        (response, response_features(&local))
    }
}

impl Problem for Part {
    fn case(&self) -> &Case {
        &self.case
    }

    fn about(&self) -> &[About] {
        use About::*;
        match self.stage {
            Stage::Rotation => &[Angle],
            Stage::Skeleton => &[Angle, Place, Rig],
            Stage::Skin => &[Place, Rig, Weights, Residuals, ZeroSum],
            Stage::BlendShapes => &[Place],
            Stage::ResidualJoints => &[Place, Rig, Anchored],
            Stage::PoseResponse => &[Rig, Weights],
        }
    }

    fn inputs(&self) -> &[Input] {
        &self.inputs
    }

    fn size(&self) -> f64 {
        self.size
    }

    fn reference<S: Scalar>(&self, inputs: &[&[S]]) -> Vec<S> {
        let n = self.case.points;
        match self.stage {
            Stage::Rotation => reference::rotation(vec3s(inputs[0])[0]).to_vec(),
            Stage::Skeleton => {
                let local: Vec<[S; 9]> = vec3s(inputs[1]).into_iter().map(reference::rotation).collect();
                let (_, bones) = reference::chain(&self.parents, &vec3s(inputs[0]), &local);
                bones.as_flattened().as_flattened().to_vec()
            }
            Stage::Skin => Skin {
                rest: &vec3s(inputs[0]),
                weights: &self.weights,
                residual_weights: inputs[1],
                bones: &mat4s(inputs[2]),
                residual_bones: &mat4s(inputs[3]),
                translation: vec3s(inputs[4])[0],
                zero_sum: self.case.zero_sum,
            }
            .posed()
            .into_flattened(),
            Stage::BlendShapes => reference::offsets(&vec3s(inputs[0]), &vec3s(inputs[1]), n).into_flattened(),
            Stage::ResidualJoints => {
                let offsets = vec3s(inputs[1]);
                let joints = vec3s(inputs[2]);
                reference::residual_joints(inputs[0], &offsets, &joints, self.case.anchored).into_flattened()
            }
            Stage::PoseResponse => {
                let local: Vec<[S; 9]> = inputs[2].chunks_exact(9).map(|r| std::array::from_fn(|i| r[i])).collect();
                reference::pose_response(inputs[0], inputs[1], &self.limits, &self.weights, &local, n)
            }
        }
    }

    fn outputs(&self, inputs: &[&[f64]]) -> Vec<f64> {
        let n = self.case.points;
        match self.stage {
            Stage::Rotation => rows(&[rotation_from_axis_angle(DVec3::from_slice(inputs[0]))]),
            Stage::Skeleton => {
                let chain = pose_skeleton(&self.parents, &dvec3s(inputs[0]), &dvec3s(inputs[1]));
                flat_affines(&chain.posed_from_rest)
            }
            Stage::Skin => flat(&self.with_skinning(inputs, skin)),
            Stage::BlendShapes => flat(&blend_shapes(&dvec3s(inputs[0]), &dvec3s(inputs[1]), n)),
            Stage::ResidualJoints => {
                flat(&residual_joints(inputs[0], &dvec3s(inputs[1]), &dvec3s(inputs[2]), self.residual_skeleton()))
            }
            Stage::PoseResponse => {
                let (response, features) = self.response(inputs);
                response.evaluate(&self.weights, &features, n)
            }
        }
    }

    fn gradients(&self, d_outputs: &[f64]) -> Vec<Vec<f64>> {
        let n = self.case.points;
        let inputs = self.drawn();
        match self.stage {
            Stage::Rotation => {
                let v = DVec3::from_slice(inputs[0]);
                vec![rotation_from_axis_angle_vjp(v, &matrix(d_outputs)).to_array().to_vec()]
            }
            Stage::Skeleton => {
                let joints = dvec3s(inputs[0]);
                let rotations = dvec3s(inputs[1]);
                let chain = pose_skeleton(&self.parents, &joints, &rotations);
                let g = pose_skeleton_vjp(&self.parents, &joints, &chain, &affines(d_outputs));
                vec![flat(&g.joints), flat(&rotations_vjp(&rotations, &g.local))]
            }
            Stage::Skin => {
                let g = self.with_skinning(&inputs, |s| skin_vjp(s, &dvec3s(d_outputs)));
                let bones = flat_affines(&g.bones);
                let residual_bones = flat_affines(&g.residual_bones);
                vec![flat(&g.rest), g.residual_weights, bones, residual_bones, flat(&[g.translation])]
            }
            Stage::BlendShapes => {
                let (basis, coefficients) =
                    blend_shapes_vjp(&dvec3s(inputs[0]), &dvec3s(inputs[1]), &dvec3s(d_outputs));
                vec![flat(&basis), flat(&coefficients)]
            }
            Stage::ResidualJoints => {
                let (regressor, offsets) = residual_joints_vjp(inputs[0], &dvec3s(inputs[1]), &dvec3s(d_outputs));
                // As documented: the anchored joints move with the rest joints, the paper's do not.
                let d_joints = if self.case.anchored { d_outputs.to_vec() } else { vec![0.0; d_outputs.len()] };
                vec![regressor, flat(&offsets), d_joints]
            }
            Stage::PoseResponse => {
                let (response, features) = self.response(&inputs);
                let (d, d_features) = response.evaluate_vjp(&self.weights, &features, d_outputs, n);
                vec![d.bias, d.gain, rows(&response_features_vjp(&d_features))]
            }
        }
    }
}

#[test]
fn rotations_are_right() {
    prove("rotation_from_axis_angle", cases(), |case| Part::new(Stage::Rotation, case));
}

#[test]
fn skeletons_are_right() {
    prove("pose_skeleton", cases(), |case| Part::new(Stage::Skeleton, case));
}

#[test]
fn skinning_is_right() {
    prove("skin", cases(), |case| Part::new(Stage::Skin, case));
}

#[test]
fn blend_shapes_are_right() {
    prove("blend_shapes", cases(), |case| Part::new(Stage::BlendShapes, case));
}

#[test]
fn residual_skeletons_are_right() {
    prove("residual_joints", cases(), |case| Part::new(Stage::ResidualJoints, case));
}

#[test]
fn pose_responses_are_right() {
    prove("pose_response", cases(), |case| Part::new(Stage::PoseResponse, case));
}
