//! Hand models in any shape and pose against the second implementation: shape and pose blend shapes, joints from the
//! shaped surface, skinning. Values only: posed hands have no derivative of their own.

use ghand_core::posing::{pose_hand, shape_hand};
use ghand_core::{HandModel, Pose, Side};
use glam::DVec3;
use rand::RngExt;

use super::cases::{Case, cases, uniform};
use super::check::{EXACT, runner};
use super::reference::{self, Skin, vec3s};
use super::{depth, dvec3s, flat, largest};

/// A random hand model in a random shape and pose.
struct Hand {
    model: HandModel,
    shape: Vec<f64>,
    pose: Pose,
    /// Upper estimate of the results and of the terms that are summed in them.
    size: f64,
}

impl Hand {
    fn new(case: &Case) -> Hand {
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
        let pose = Pose { rotations: dvec3s(&rotations), translation: DVec3::from_slice(&translation) };
        Hand { model, shape, pose, size: out }
    }

    fn shaped_reference(&self) -> [Vec<[f64; 3]>; 2] {
        let model = &self.model;
        let mut vertices = vec3s(&flat(&model.vertices));
        reference::add_directions(&mut vertices, &self.shape, &arrays(&model.shape_directions));
        let mut joints = vec3s(&flat(&model.joints));
        if !model.joint_directions.is_empty() {
            reference::add_directions(&mut joints, &self.shape, &arrays(&model.joint_directions));
        }
        for (joint, row) in joints.iter_mut().zip(&model.joint_regressor) {
            *joint = row
                .iter()
                .fold([0.0; 3], |sum, &(i, w)| reference::add3(sum, reference::scale3(vertices[i as usize], w)));
        }
        [vertices, joints]
    }

    fn posed_reference(&self) -> [Vec<[f64; 3]>; 2] {
        let model = &self.model;
        let [mut vertices, joints] = self.shaped_reference();
        let local: Vec<[f64; 9]> = arrays(&self.pose.rotations).into_iter().map(reference::rotation).collect();
        if !model.pose_directions.is_empty() {
            let entries = local.iter().skip(1).flat_map(|r| (0..9).map(move |e| r[e] - f64::from(e % 4 == 0)));
            let features: Vec<f64> = entries.collect();
            reference::add_directions(&mut vertices, &features, &arrays(&model.pose_directions));
        }
        let (world, bones) = reference::chain(&model.parents, &joints, &local);
        let (v, n) = (vertices.len(), joints.len());
        let translation = self.pose.translation.to_array();
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
        [posed, joints]
    }
}

fn arrays(vectors: &[DVec3]) -> Vec<[f64; 3]> {
    vectors.iter().map(DVec3::to_array).collect()
}

/// Checks that the vertices and joints of `found` and `right` agree in random cases, and that a slightly wrong one
/// would not.
fn agree(found: impl Fn(&Hand) -> [Vec<DVec3>; 2], right: impl Fn(&Hand) -> [Vec<[f64; 3]>; 2]) {
    let outcome = runner().run(&cases(), |case| {
        let hand = Hand::new(&case);
        let mut found = flat(&found(&hand).concat());
        let right = right(&hand).concat().into_flattened();
        assert_eq!(found.len(), right.len());
        let error = |found: &[f64]| {
            let apart: Vec<f64> = found.iter().zip(&right).map(|(a, b)| a - b).collect();
            largest(&apart)
        };
        let bound = EXACT * hand.size;
        assert!(error(&found) <= bound, "{} for {}", error(&found), hand.size);
        let at = case.seed as usize % found.len();
        for wrong in [2.1 * bound, f64::NAN] {
            found[at] += wrong;
            assert!(!(error(&found) <= bound), "a wrong value passes");
        }
        Ok(())
    });
    outcome.unwrap_or_else(|problem| panic!("{problem}"));
}

#[test]
fn posed_hands_are_right_in_any_shape() {
    agree(
        |hand| {
            let posed = pose_hand(&hand.model, &hand.shape, &hand.pose).unwrap();
            [posed.vertices, posed.joints]
        },
        Hand::posed_reference,
    );
}

#[test]
fn shaped_hands_are_right() {
    agree(
        |hand| {
            let shaped = shape_hand(&hand.model, &hand.shape).unwrap();
            [shaped.vertices, shaped.joints]
        },
        Hand::shaped_reference,
    );
}
