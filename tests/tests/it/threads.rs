//! Results do not depend on the number of threads.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use ghand_core::deformation::{DeformationInputs, deform, deform_vjp};
use ghand_core::posing::pose_hand;
use ghand_core::residual_skeleton::ResidualSkeleton;
use ghand_core::skinning::ResidualWeights;
use ghand_core::{HandModel, Pose};
use ghand_test_support::procedural_hand::ProceduralHand;
use glam::DVec3;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Points for several tasks, the last of which is not full.
const POINTS: usize = 7001;

fn uniform(rng: &mut ChaCha8Rng, n: usize) -> Vec<f64> {
    (0..n).map(|_| rng.random_range(-1.0..1.0)).collect()
}

fn vectors(rng: &mut ChaCha8Rng, n: usize) -> Vec<DVec3> {
    uniform(rng, 3 * n).chunks_exact(3).map(DVec3::from_slice).collect()
}

/// Asserts that `compute` gives the same bits in pools of 1, 2, 3 and 8 threads, three times each.
fn assert_same_bits(compute: impl Fn() -> Vec<f64> + Sync) {
    let mut first: Option<Vec<u64>> = None;
    for threads in [1, 2, 3, 8] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        for _ in 0..3 {
            let bits: Vec<u64> = pool.install(&compute).iter().map(|x| x.to_bits()).collect();
            assert!(*first.get_or_insert_with(|| bits.clone()) == bits, "{threads} threads give different bits");
        }
    }
}

fn flat(vectors: &[DVec3]) -> Vec<f64> {
    vectors.iter().flat_map(|v| v.to_array()).collect()
}

#[test]
fn posed_points_and_their_gradients_have_the_same_bits_on_any_number_of_threads() {
    let rng = &mut ChaCha8Rng::seed_from_u64(1);
    let joints = 25;
    let bases = 3;
    let parents: Vec<Option<usize>> = (0..joints).map(|k: usize| k.checked_sub(1).map(|last| last / 2)).collect();
    let rest_joints = vectors(rng, joints);
    let canonical = vectors(rng, POINTS);
    let [weights, residual_weights, regressor] = [0, 1, 2].map(|_| uniform(rng, joints * POINTS));
    let basis = vectors(rng, bases * POINTS);
    let coefficients = vectors(rng, bases * POINTS);
    let (d_posed, d_offsets) = (vectors(rng, POINTS), vectors(rng, POINTS));
    let pose = Pose { rotations: vectors(rng, joints), translation: DVec3::ONE };
    for residual_weights_mode in [ResidualWeights::Paper, ResidualWeights::ZeroSum] {
        for residual_skeleton_mode in [ResidualSkeleton::Paper, ResidualSkeleton::Anchored] {
            assert_same_bits(|| {
                let d = DeformationInputs {
                    parents: &parents,
                    joints: &rest_joints,
                    canonical: &canonical,
                    weights: &weights,
                    shape_basis: &basis,
                    blend_coefficients: &coefficients,
                    skeleton_regressor: &regressor,
                    residual_weights: &residual_weights,
                    residual_weights_mode,
                    residual_skeleton_mode,
                };
                let forward = deform(&d, &pose);
                let g = deform_vjp(&d, &pose, &forward, &d_posed, &d_offsets);
                let vectors = [
                    &forward.posed[..],
                    &forward.offsets,
                    &forward.residual_joints,
                    &g.canonical,
                    &g.joints,
                    &g.shape_basis,
                    &g.blend_coefficients,
                    &g.rotations(&pose),
                    &[g.translation],
                ];
                [flat(&vectors.concat()), g.skeleton_regressor, g.residual_weights].concat()
            });
        }
    }
}

#[test]
fn posed_hands_have_the_same_bits_on_any_number_of_threads() {
    let rng = &mut ChaCha8Rng::seed_from_u64(2);
    let plain = ProceduralHand::default().build().unwrap();
    let v = plain.vertices.len();
    let joints = plain.joint_count();
    assert!(v > 3000, "{v} vertices are one task");
    let model = HandModel {
        shape_directions: vectors(rng, 10 * v),
        pose_directions: vectors(rng, 9 * (joints - 1) * v),
        joint_regressor: (0..joints)
            .map(|_| (0..50).map(|_| (rng.random_range(0..v as u32), rng.random_range(-1.0..1.0))).collect())
            .collect(),
        ..plain
    };
    let shape = uniform(rng, 10);
    let pose = Pose { rotations: vectors(rng, joints), translation: DVec3::ONE };
    assert_same_bits(|| {
        let hand = pose_hand(&model, &shape, &pose).unwrap();
        flat(&[hand.vertices, hand.joints].concat())
    });
}
