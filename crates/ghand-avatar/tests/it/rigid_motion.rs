//! Rotating and translating the whole hand moves it rigidly.
#![allow(clippy::neg_cmp_op_on_partial_ord, reason = "`!(error <= bound)` rejects NaN too")]

use std::f64::consts::TAU;

use crate::common::{COUNT, JOINTS, random, random_avatar};
use ghand_avatar::{AvatarConfig, Scene};
use ghand_core::Pose;
use ghand_core::residual_skeleton::ResidualSkeleton;
use ghand_core::rotation::rotation_from_axis_angle;
use ghand_core::skinning::ResidualWeights;
use ghand_render::splat::Purpose;
use ghand_render::{AdapterChoice, Gpu, buffers};
use ghand_test_support::cases;
use glam::DVec3;

/// Metres. Coordinates of a random avatar reach about 0.5 m and are sums of about fifty products in f32, with a
/// rounding error of 3e-8 m each. The largest error on lavapipe is 1.2e-7 m.
const ROUNDING: f64 = 5e-7;

/// The posed Gaussians, `[7][COUNT]`: mean, scale, colour.
fn posed(gpu: &Gpu, scene: &mut Scene, pose: &Pose) -> Vec<f32> {
    scene.set_pose(gpu, 0, 0, pose).unwrap();
    let mut encoder = gpu.device.create_command_encoder(&Default::default());
    scene.avatars_mut()[0].encode(gpu, &mut encoder, None).unwrap();
    gpu.queue.submit([encoder.finish()]);
    buffers::read(gpu, scene.splatter().gaussians(), 7 * COUNT).unwrap()
}

fn vectors(seed: u64, count: usize, size: f32) -> Vec<DVec3> {
    random(seed, 3 * count, size).chunks_exact(3).map(|v| DVec3::new(v[0].into(), v[1].into(), v[2].into())).collect()
}

#[test]
fn root_motion_moves_all_gaussians_rigidly_and_keeps_sizes_and_colours() {
    let gpu = Gpu::new(&AdapterChoice::from_env()).unwrap_or_else(|e| panic!("{e}"));
    let count = cases(8, 40);
    for seed in 0..count {
        let config = AvatarConfig {
            shape_bases: 3,
            color_components: 2,
            residual_weights: [ResidualWeights::ZeroSum, ResidualWeights::Paper][seed as usize % 2],
            residual_skeleton: [ResidualSkeleton::Anchored, ResidualSkeleton::Paper][seed as usize / 2 % 2],
            ..Default::default()
        };
        let avatar = random_avatar(seed, &config);
        let mut scene = Scene::new(&gpu, &[&avatar], Purpose::Images, 1, [16, 16]).unwrap();
        let mut pose = Pose { rotations: vectors(1000 + seed, JOINTS, 1.5), translation: DVec3::ZERO };
        pose.rotations[0] = DVec3::ZERO;
        let before = posed(&gpu, &mut scene, &pose);

        let drawn = vectors(2000 + seed, 2, 1.0);
        // Angles cover a full turn and are rounded to f32, as the device receives them.
        let turn = (drawn[0].normalize() * TAU * (seed as f64 + 0.5) / count as f64).as_vec3().as_dvec3();
        pose.rotations[0] = turn;
        pose.translation = drawn[1] * 0.5;
        let after = posed(&gpu, &mut scene, &pose);

        let rotation = rotation_from_axis_angle(turn);
        let joint = avatar.template.joints[0];
        let point = |table: &[f32], p: usize| DVec3::from_array([0, 1, 2].map(|c| f64::from(table[c * COUNT + p])));
        for p in 0..COUNT {
            let expected = rotation * (point(&before, p) - joint) + joint + pose.translation;
            let error = (point(&after, p) - expected).length();
            assert!(error <= ROUNDING, "seed {seed}, {config:?}: Gaussian {p} is {error} m off");
        }
        assert!(before[3 * COUNT..] == after[3 * COUNT..], "seed {seed}: sizes or colours changed");
    }
}
