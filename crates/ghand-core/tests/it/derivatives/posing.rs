//! Hand models in any shape and pose: shape and pose blend shapes, joints from the shaped surface, skinning.

use ghand_core::posing::{ShapedHand, pose_hand, pose_hand_vjp, shape_hand, shape_hand_vjp};
use ghand_core::{HandModel, Pose, Side};
use glam::DVec3;
use rand::RngExt;

use super::cases::{About, Case, cases, uniform};
use super::check::{Input, Problem, SLOPE, prove};
use super::dual::Scalar;
use super::reference::{self, Skin, vec3s};
use super::{ROTATION_STEP, depth, dvec3s, flat, largest};

/// A random hand model in a random shape, and in a random pose if `posed`.
struct Hand {
    case: Case,
    model: HandModel,
    inputs: Vec<Input>,
    size: f64,
    posed: bool,
}

impl Hand {
    fn new(case: &Case, posed: bool) -> Hand {
        let rng = &mut case.rng();
        let v = case.points;
        let joints = case.joints;
        let shapes = case.bases;
        let size = case.place.1;
        let parents = case.parents(rng);
        let vertices = case.points(rng, v);
        let rest_joints = case.points(rng, joints);
        // Some models have no pose blend shapes. Joints are regressed, or have directions of their own, or do not
        // follow the shape.
        let corrective = if rng.random_range(0..3) == 0 { 0 } else { 9 * (joints - 1) };
        let scaled = |values: Vec<f64>| -> Vec<f64> { values.iter().map(|x| x * 0.1 * size).collect() };
        let shape_directions = dvec3s(&scaled(uniform(rng, 3 * shapes * v)));
        let pose_directions = dvec3s(&scaled(uniform(rng, 3 * corrective * v)));
        let regressed = rng.random_range(0..3) != 0;
        let row = |rng: &mut rand_chacha::ChaCha8Rng| -> Vec<(u32, f64)> {
            let count = rng.random_range(0..2 * v);
            (0..count).map(|_| (rng.random_range(0..v as u32), rng.random_range(-0.5..1.0))).collect()
        };
        let joint_regressor = if regressed { (0..joints).map(|_| row(rng)).collect() } else { vec![] };
        let own = if !regressed && rng.random_range(0..3) != 0 { shapes } else { 0 };
        let joint_directions = dvec3s(&scaled(uniform(rng, 3 * own * joints)));
        let columns = case.weights(rng, v);
        let weights: Vec<f64> = (0..v * joints).map(|at| columns[at % joints * v + at / joints]).collect();
        let shape: Vec<f64> = (0..shapes)
            .map(|_| if case.shape == 10.0 { [-10.0, 10.0][rng.random_range(0..2)] } else { case.shape })
            .collect();
        let rotations = case.rotations(rng, joints);
        let translation = case.points(rng, 1);

        // Upper estimates. Correctives move by entries of R - I, each at most 2; nine per joint.
        let turned = (0..v).map(|i| weights[i * joints..][..joints].iter().map(|w| w.abs()).sum()).fold(0.0, f64::max);
        let shaped = largest(&vertices) + 0.1 * size * largest(&shape) * shapes as f64;
        let corrected = shaped + 0.1 * size * 2.0 * corrective as f64;
        let regressor_sum = |row: &Vec<(u32, f64)>| row.iter().map(|(_, w)| w.abs()).sum::<f64>();
        let pull = joint_regressor.iter().map(regressor_sum).fold(0.0, f64::max);
        let moved = 0.1 * size * largest(&shape) * own as f64;
        let joint_extent = largest(&rest_joints) + pull * shaped + moved;
        let extent = corrected + 2.0 * depth(&parents) * joint_extent;
        let out = (1.0 + turned) * extent + largest(&translation);
        let all = SLOPE * (v as f64 * turned + joints as f64);
        let d_vertex = SLOPE * turned + all * pull * joints as f64;
        let inputs = vec![
            Input::new("shape", shape, extent / size, (d_vertex * v as f64 + all * own as f64) * 0.1 * size),
            Input::new("vertices", flat(&dvec3s(&vertices)), extent, d_vertex),
            Input::new("rotations", rotations, ROTATION_STEP, all * (extent + 0.1 * size * 18.0)),
            Input::new("translation", translation, extent, SLOPE * (v + joints) as f64),
        ];
        let model = HandModel {
            name: "random".into(),
            side: Side::Right,
            joint_names: vec![String::new(); joints],
            parents,
            joints: dvec3s(&rest_joints),
            vertices: dvec3s(&vertices),
            faces: vec![],
            uvs: vec![],
            face_uvs: vec![],
            weights,
            shape_directions,
            shape_names: vec![],
            pose_directions,
            joint_regressor,
            joint_directions,
            pose_space: None,
            source_vertices: vec![],
        };
        let inputs = if posed { inputs } else { inputs[..2].to_vec() };
        Hand { case: case.clone(), model, inputs, size: out, posed }
    }

    fn with_vertices(&self, vertices: &[f64]) -> HandModel {
        HandModel { vertices: dvec3s(vertices), ..self.model.clone() }
    }
}

fn pose_of(rotations: &[f64], translation: &[f64]) -> Pose {
    Pose { rotations: dvec3s(rotations), translation: DVec3::from_slice(translation) }
}

impl Problem for Hand {
    fn case(&self) -> &Case {
        &self.case
    }

    fn about(&self) -> &[About] {
        use About::*;
        if self.posed { &[Angle, Place, Rig, Weights, Shape] } else { &[Place, Rig, Shape] }
    }

    fn inputs(&self) -> &[Input] {
        &self.inputs
    }

    fn size(&self) -> f64 {
        self.size
    }

    fn reference<S: Scalar>(&self, inputs: &[&[S]]) -> Vec<S> {
        let model = &self.model;
        let directions = |d: &[DVec3]| -> Vec<[f64; 3]> { d.iter().map(DVec3::to_array).collect() };
        let mut vertices = vec3s(inputs[1]);
        reference::add_directions(&mut vertices, inputs[0], &directions(&model.shape_directions));
        let mut joints: Vec<[S; 3]> = model.joints.iter().map(|j| j.to_array().map(S::constant)).collect();
        if !model.joint_directions.is_empty() {
            reference::add_directions(&mut joints, inputs[0], &directions(&model.joint_directions));
        }
        for (joint, row) in joints.iter_mut().zip(&model.joint_regressor) {
            *joint = row.iter().fold([reference::zero(); 3], |sum, &(i, w)| {
                reference::add3(sum, reference::scale3(vertices[i as usize], S::constant(w)))
            });
        }
        if !self.posed {
            return [vertices, joints].concat().into_flattened();
        }
        let local: Vec<[S; 9]> = vec3s(inputs[2]).into_iter().map(reference::rotation).collect();
        if !model.pose_directions.is_empty() {
            let entries =
                local.iter().skip(1).flat_map(|r| (0..9).map(move |e| r[e] - S::constant(f64::from(e % 4 == 0))));
            let features: Vec<S> = entries.collect();
            reference::add_directions(&mut vertices, &features, &directions(&model.pose_directions));
        }
        let (world, bones) = reference::chain(&model.parents, &joints, &local);
        let (v, n) = (vertices.len(), joints.len());
        let translation = [inputs[3][0], inputs[3][1], inputs[3][2]];
        let posed = Skin {
            rest: &vertices,
            weights: &(0..v * n).map(|at| model.weights[at % v * n + at / v]).collect::<Vec<_>>(),
            residual_weights: &[],
            bones: &bones,
            residual_bones: &[],
            translation,
            zero_sum: false,
        }
        .posed();
        let joints = world.iter().map(|g| reference::add3([g[0][3], g[1][3], g[2][3]], translation)).collect();
        [posed, joints].concat().into_flattened()
    }

    fn outputs(&self, inputs: &[&[f64]]) -> Vec<f64> {
        let model = self.with_vertices(inputs[1]);
        if self.posed {
            let hand = pose_hand(&model, inputs[0], &pose_of(inputs[2], inputs[3])).unwrap();
            flat(&[hand.vertices, hand.joints].concat())
        } else {
            let shaped = shape_hand(&model, inputs[0]).unwrap();
            flat(&[shaped.vertices, shaped.joints].concat())
        }
    }

    fn gradients(&self, d_outputs: &[f64]) -> Vec<Vec<f64>> {
        let (d_vertices, d_joints) = d_outputs.split_at(3 * self.case.points);
        let (d_vertices, d_joints) = (dvec3s(d_vertices), dvec3s(d_joints));
        let inputs = self.drawn();
        if self.posed {
            let pose = pose_of(inputs[2], inputs[3]);
            let hand = pose_hand(&self.model, inputs[0], &pose).unwrap();
            let g = pose_hand_vjp(&self.model, &pose, &hand, &d_vertices, &d_joints);
            vec![g.shape, flat(&g.vertices), flat(&g.rotations), flat(&[g.translation])]
        } else {
            let (shape, vertices) = shape_hand_vjp(&self.model, &ShapedHand { vertices: d_vertices, joints: d_joints });
            vec![shape, flat(&vertices)]
        }
    }
}

#[test]
fn posed_hands_are_right_in_any_shape() {
    prove("pose_hand", cases(), |case| Hand::new(case, true));
}

#[test]
fn shaped_hands_are_right() {
    prove("shape_hand", cases(), |case| Hand::new(case, false));
}
