//! Avatars of networks on the device.
#![allow(clippy::neg_cmp_op_on_partial_ord, reason = "`!(error <= bound)` rejects NaN too")]

use ghand_avatar::deform::{DeformationBackward, Properties};
use ghand_avatar::properties::network::Normalization;
use ghand_avatar::reference::{PosedGaussians, pose_network};
use ghand_avatar::{Avatar, AvatarConfig, NetworkSizes, PropertyRates, PropertyTables, Scene};
use ghand_core::blend_shapes::CoefficientLayout;
use ghand_core::{HandModel, Pose};
use ghand_render::splat::Purpose;
use ghand_render::{AdapterChoice, Gpu, buffers};
use ghand_test_support::procedural_hand::ProceduralHand;
use glam::DVec3;

fn gpu() -> Gpu {
    Gpu::new(&AdapterChoice::from_env()).unwrap_or_else(|e| panic!("{e}"))
}

fn hand() -> HandModel {
    ProceduralHand { detail: 1, ..Default::default() }.build().unwrap()
}

fn config(network: Option<NetworkSizes>) -> AvatarConfig {
    AvatarConfig { uv_resolution: 32, coefficients: CoefficientLayout::PerComponent, network, ..Default::default() }
}

fn small() -> NetworkSizes {
    NetworkSizes {
        map_side: 32,
        encoder_channels: 2,
        feature_channels: 4,
        tensor_channels: 2,
        hidden: 8,
        ..NetworkSizes::quick()
    }
}

/// An avatar whose networks have weights as if trained: nothing is zero.
fn random_avatar(sizes: &NetworkSizes) -> Avatar {
    let mut avatar = Avatar::untrained(&hand(), &config(Some(sizes.clone())), [0.8, 0.6, 0.5], 1).unwrap();
    let PropertyTables::Network(tables) = &mut avatar.tables else { unreachable!() };
    let mut state = 1u32;
    for value in tables.parameters.iter_mut().flatten() {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        *value += ((state >> 8) as f32 / (1 << 24) as f32 - 0.5) * 0.3;
    }
    avatar
}

fn bent(angle: f64, joints: usize) -> Pose {
    let mut pose = Pose::rest(joints);
    pose.rotations.iter_mut().skip(1).for_each(|r| *r = DVec3::new(0.1, -0.2, 0.5) * angle);
    pose.translation = DVec3::new(0.0, 0.1, 0.4);
    pose
}

fn scene_of(gpu: &Gpu, avatar: &Avatar, poses: &[Pose], purpose: Purpose) -> Scene {
    let mut scene = Scene::new(gpu, &[avatar], purpose, poses.len(), [16, 16]).unwrap();
    poses.iter().enumerate().for_each(|(frame, pose)| scene.set_pose(gpu, 0, frame, pose).unwrap());
    scene
}

/// Runs the forward pass of a frame.
fn pose(gpu: &Gpu, scene: &mut Scene, frame: usize) {
    scene.set_frame(gpu, frame);
    let mut encoder = gpu.device.create_command_encoder(&Default::default());
    scene.avatars_mut()[0].encode(gpu, &mut encoder, None).unwrap();
    gpu.queue.submit([encoder.finish()]);
}

fn read_all(gpu: &Gpu, p: &Properties) -> Vec<Vec<f32>> {
    let n = p.sizes.gaussians;
    let rows = p.sizes.coefficients.rows() * p.sizes.bases;
    let sizes = [3 * p.sizes.bases, p.sizes.joints, rows, p.sizes.joints, 1, 3].map(|rows| rows * n);
    let all = [&p.shape_basis, &p.residual_weights, &p.coefficients, &p.regressor, &p.scale, &p.color];
    all.iter().zip(sizes).map(|(buffer, size)| buffers::read(gpu, buffer, size).unwrap()).collect()
}

fn properties(gpu: &Gpu, scene: &mut Scene, frame: usize) -> Vec<Vec<f32>> {
    pose(gpu, scene, frame);
    read_all(gpu, scene.avatars()[0].deformation.properties())
}

#[test]
fn untrained_networks_look_exactly_like_untrained_tables() {
    let gpu = gpu();
    let colors = |avatar: &mut Avatar| {
        let colors: Vec<_> = (0..avatar.template.len()).map(|p| [0.3, 0.5, (p % 7) as f64 / 8.0]).collect();
        avatar.tables.set_base_colors(&colors);
    };
    for sizes in [small(), NetworkSizes { normalization: Normalization::Batch, ..small() }] {
        let of = |network| {
            let mut avatar = Avatar::untrained(&hand(), &config(network), [0.8, 0.6, 0.5], 1).unwrap();
            colors(&mut avatar);
            let poses = [bent(0.7, avatar.template.joint_count())];
            properties(&gpu, &mut scene_of(&gpu, &avatar, &poses, Purpose::Images), 0)
        };
        let direct = of(None);
        let network = of(Some(sizes));
        assert!(direct[0].iter().any(|v| *v != 0.0) && direct[2].contains(&1.0));
        for (k, (a, b)) in direct.iter().zip(&network).enumerate() {
            assert_eq!(a.len(), b.len());
            // Two implementations of the same sigmoid.
            assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() <= 1e-6 * a.abs()), "property {k}");
        }
    }
}

#[test]
fn playing_and_training_give_the_same_properties_and_follow_the_pose() {
    let gpu = gpu();
    let avatar = random_avatar(&small());
    let joints = avatar.template.joint_count();
    let moved = Pose { translation: DVec3::new(1.0, 2.0, 3.0), ..bent(0.5, joints) };
    let poses = [bent(0.5, joints), bent(0.9, joints), moved];
    let mut played = scene_of(&gpu, &avatar, &poses, Purpose::Images);
    let mut trained = scene_of(&gpu, &avatar, &poses, Purpose::Gradients);
    let _backward = prepared(&gpu, &mut trained);
    let first = properties(&gpu, &mut played, 0);
    let second = properties(&gpu, &mut played, 1);
    assert_eq!(first[..2], second[..2], "shape bases and residual weights depend on no pose");
    for k in 2..6 {
        assert_ne!(first[k], second[k], "property {k}");
    }
    assert_eq!(properties(&gpu, &mut trained, 0), first);
    assert_eq!(properties(&gpu, &mut trained, 1), second);
    trained.avatars_mut()[0].model.trainable_mut().unwrap().expect_backward(false);
    assert_eq!(properties(&gpu, &mut trained, 0), first);
    assert_eq!(properties(&gpu, &mut trained, 1), second);
    // The cached part is still right after another pose, and where the hand is does not matter.
    assert_eq!(properties(&gpu, &mut played, 0), first);
    assert_eq!(properties(&gpu, &mut played, 2), first);
}

fn prepared(gpu: &Gpu, scene: &mut Scene) -> DeformationBackward {
    let (splatter, avatars) = scene.splatter_and_avatars_mut();
    let joints = avatars[0].deformation.properties().sizes.joints;
    avatars[0].prepare_training(gpu, splatter.d_gaussians(), &vec![1.0; joints]).unwrap()
}

/// Writes gradients of all properties, which do not cancel in sums over Gaussians, and runs the model's backward pass.
fn backward(gpu: &Gpu, scene: &mut Scene, backward: &DeformationBackward, size: f32) {
    let g = backward.gradients();
    for buffer in [&g.shape_basis, &g.residual_weights, &g.coefficients, &g.regressor, &g.scale, &g.color] {
        let values: Vec<f32> = (0..buffer.size() / 4).map(|i| size * ((i % 5) as f32 - 0.5)).collect();
        gpu.queue.write_buffer(buffer, 0, bytemuck::cast_slice(&values));
    }
    let mut encoder = gpu.device.create_command_encoder(&Default::default());
    scene.avatars_mut()[0].model.trainable_mut().unwrap().backward(gpu, &mut encoder).unwrap();
}

#[test]
fn gradients_of_several_views_and_poses_add_up() {
    let gpu = gpu();
    let avatar = random_avatar(&small());
    let joints = avatar.template.joint_count();
    let poses = [bent(0.5, joints), bent(0.9, joints)];
    // Which frame each view is of, and the size of its gradients; 0 if the frame is only measured.
    let gradients = |views: &[(usize, f32)]| {
        let mut scene = scene_of(&gpu, &avatar, &poses, Purpose::Gradients);
        let d = prepared(&gpu, &mut scene);
        for (frame, size) in views {
            scene.avatars_mut()[0].model.trainable_mut().unwrap().expect_backward(*size > 0.0);
            pose(&gpu, &mut scene, *frame);
            if *size > 0.0 {
                backward(&gpu, &mut scene, &d, *size);
            }
        }
        scene.avatars_mut()[0].model.trainable_mut().unwrap().parameter_gradients(&gpu).unwrap()
    };
    let (first, second) = (gradients(&[(0, 1.0)]), gradients(&[(1, 1.0)]));
    // What is measured between them does not count.
    let twice = gradients(&[(1, 0.0), (0, 1.0), (1, 0.0), (0, 2.0), (0, 0.0)]);
    let both = gradients(&[(0, 1.0), (1, 1.0)]);
    for (((first, second), twice), both) in first.iter().zip(&second).zip(&twice).zip(&both) {
        let size = first.1.iter().chain(&second.1).fold(0.0f32, |m, g| m.max(g.abs()));
        assert!(size > 0.0, "{}", first.0);
        for (i, first_value) in first.1.iter().enumerate() {
            assert!(!((twice.1[i] - 3.0 * first_value).abs() > 1e-4 * size), "{} {i}", first.0);
            assert!(!((both.1[i] - first_value - second.1[i]).abs() > 1e-4 * size), "{} {i}", first.0);
        }
    }
}

fn rates(step: u64) -> PropertyRates {
    PropertyRates {
        step,
        shape_basis: 1.0,
        residual_weights: 0.0,
        regressor: 1.0,
        scale: 1.0,
        color: 1.0,
        color_components: 1.0,
        response: 1.0,
        networks: 1e-3,
        feature_tensor: 0.0,
    }
}

#[test]
fn an_update_changes_what_has_a_rate_and_the_next_frame_shows_it() {
    let gpu = gpu();
    let avatar = random_avatar(&NetworkSizes { normalization: Normalization::Batch, ..small() });
    let poses = [bent(0.5, avatar.template.joint_count())];
    let run = || {
        let mut scene = scene_of(&gpu, &avatar, &poses, Purpose::Gradients);
        let d = prepared(&gpu, &mut scene);
        let before = properties(&gpu, &mut scene, 0);
        for step in 1..=3 {
            pose(&gpu, &mut scene, 0);
            backward(&gpu, &mut scene, &d, 1e-3);
            let mut encoder = gpu.device.create_command_encoder(&Default::default());
            scene.avatars_mut()[0].model.trainable_mut().unwrap().update(&gpu, &mut encoder, &rates(step)).unwrap();
        }
        assert_ne!(properties(&gpu, &mut scene, 0), before);
        scene.avatars()[0].model.trainable().unwrap().tables(&gpu).unwrap()
    };
    let (PropertyTables::Network(before), PropertyTables::Network(after)) = (&avatar.tables, run()) else {
        unreachable!()
    };
    let changed: Vec<bool> = before.parameters.iter().zip(&after.parameters).map(|(a, b)| a != b).collect();
    // The feature tensor and the four layers of the residual weights, with their biases.
    assert_eq!(changed.iter().filter(|changed| !**changed).count(), 1 + 8);
    assert_ne!(before.running_norms, after.running_norms);
    assert_eq!(PropertyTables::Network(after), run(), "the same again, bit for bit");
}

#[test]
fn constant_colors_are_those_of_the_base_in_every_pose() {
    let gpu = gpu();
    let mut avatar = random_avatar(&small());
    let count = avatar.template.len();
    avatar.tables.set_constant_colors(&vec![[0.25, 0.5, 0.75]; count]);
    let poses = [bent(0.9, avatar.template.joint_count())];
    let color = properties(&gpu, &mut scene_of(&gpu, &avatar, &poses, Purpose::Images), 0).remove(5);
    for (c, expected) in [0.25, 0.5, 0.75].into_iter().enumerate() {
        assert!(color[c * count..(c + 1) * count].iter().all(|v| (v - expected).abs() < 1e-6));
    }
}

#[test]
fn posed_gaussians_agree_with_the_twin() {
    let gpu = gpu();
    for normalization in [Normalization::Instance, Normalization::Batch] {
        let mut avatar = random_avatar(&NetworkSizes { normalization, ..small() });
        let pose = bent(0.7, avatar.template.joint_count());
        let PropertyTables::Network(tables) = &mut avatar.tables else { unreachable!() };
        // So that the pose is seen in the colours.
        let of_colors = tables.parameter_names().into_iter().map(|name| name.starts_with("color."));
        let of_colors = tables.parameters.iter_mut().zip(of_colors).filter(|(_, of_colors)| *of_colors);
        of_colors.for_each(|(values, _)| values.iter_mut().for_each(|value| *value *= 6.0));
        for [means, variances] in &mut tables.running_norms {
            means.iter_mut().enumerate().for_each(|(c, mean)| *mean = 0.05 * c as f32 - 0.1);
            variances.iter_mut().enumerate().for_each(|(c, variance)| *variance = 0.1 + 0.2 * c as f32);
        }
        let mut scene = scene_of(&gpu, &avatar, std::slice::from_ref(&pose), Purpose::Images);
        scene.run_frame(&gpu, |_, _| {}).unwrap();
        let length = scene.splatter().options().model.rows() * avatar.template.len();
        let table: Vec<f32> = buffers::read(&gpu, scene.splatter().gaussians(), length).unwrap();
        let got: Vec<f64> = table.iter().map(|v| f64::from(*v)).collect();
        let PropertyTables::Network(tables) = &avatar.tables else { unreachable!() };
        let exact = pose_network(&avatar, tables, &pose).unwrap();
        let got = PosedGaussians::from_table(&got, avatar.config.gaussians);
        let still = pose_network(&avatar, tables, &bent(0.0, avatar.template.joint_count())).unwrap();
        let largest = |a: &[DVec3], b: &[DVec3]| a.iter().zip(b).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max);
        assert!(largest(&got.means, &exact.means) < 1e-5, "{normalization:?}: {}", largest(&got.means, &exact.means));
        assert!(largest(&got.colors, &exact.colors) < 1e-4, "{normalization:?}");
        assert!(got.scales.iter().zip(&exact.scales).all(|(a, b)| (a - b).abs() < 1e-4 * b), "{normalization:?}");
        assert!(largest(&still.colors, &exact.colors) > 1e-3, "the pose changes nothing");
    }
}
