//! The pose pipeline on the device, forward and backward, against the f64 mathematics of `ghand-core`.
#![allow(clippy::neg_cmp_op_on_partial_ord, reason = "`!(error <= bound)` rejects NaN too")]

use crate::common::{COUNT, JOINTS, random, random_avatar, tables_of};
use ghand_avatar::deform::CoefficientLayout;
use ghand_avatar::reference::{DirectTwin, PosedGaussians};
use ghand_avatar::{Avatar, AvatarConfig, PropertyTables, Scene};
use ghand_core::Pose;
use ghand_core::pose_response::pose_features;
use ghand_core::residual_skeleton::ResidualSkeleton;
use ghand_core::skinning::ResidualWeights;
use ghand_render::penalty::Penalty;
use ghand_render::splat::Purpose;
use ghand_render::{AdapterChoice, Gpu, buffers};
use ghand_test_support::procedural_hand::ProceduralHand;
use glam::DVec3;

const OFFSET_WEIGHT: f32 = 0.7;
const SCALE_WEIGHT: f32 = 0.3;

/// Results of either side, flattened: the posed table, then the gradients of the five tables and of the pose.
struct Outcome {
    parts: Vec<(String, Vec<f64>)>,
}

fn widen(values: &[f32]) -> Vec<f64> {
    values.iter().map(|v| f64::from(*v)).collect()
}

fn on_device(gpu: &Gpu, avatar: &Avatar, pose: &Pose, d_gaussians: &[f32]) -> Outcome {
    let mut scene = Scene::new(gpu, &[avatar], Purpose::Gradients, 2, [16, 16]).unwrap();
    let (splatter, avatars) = scene.splatter_and_avatars_mut();
    let gaussians = splatter.gaussians();
    let on_device = splatter.d_gaussians();
    let posed = &mut avatars[0];
    let backward = posed.prepare_training(gpu, on_device, &[1.0; JOINTS]).unwrap();
    let properties = posed.deformation.properties();
    let d = backward.gradients();
    let mut offset_penalty = Penalty::new(gpu, posed.deformation.offsets(), backward.d_offsets(), 3 * COUNT);
    let mut scale_penalty = Penalty::new(gpu, &properties.scale, &d.scale, COUNT);
    offset_penalty.set_weight(gpu, OFFSET_WEIGHT);
    scale_penalty.set_weight(gpu, SCALE_WEIGHT);
    posed.set_pose(gpu, 1, pose).unwrap();
    posed.deformation.set_frame(gpu, 1);
    gpu.queue.write_buffer(on_device, 0, bytemuck::cast_slice(d_gaussians));
    let mut encoder = gpu.device.create_command_encoder(&Default::default());
    posed.encode(gpu, &mut encoder, None).unwrap();
    backward.encode_point_gradients(&mut encoder);
    offset_penalty.encode(&mut encoder);
    scale_penalty.encode(&mut encoder);
    backward.encode_property_gradients(&mut encoder);
    posed.model.trainable_mut().unwrap().backward(gpu, &mut encoder).unwrap();
    backward.encode_pose_gradient(&mut encoder);
    gpu.queue.submit([encoder.finish()]);
    let table: Vec<f32> = buffers::read(gpu, gaussians, 7 * COUNT).unwrap();
    let d_pose: Vec<f32> = buffers::read(gpu, backward.d_pose(), 3 * JOINTS + 3).unwrap();
    let mut parts = vec![("posed".to_owned(), widen(&table))];
    parts.extend(
        posed
            .model
            .trainable_mut()
            .unwrap()
            .parameter_gradients(gpu)
            .unwrap()
            .iter()
            .map(|(name, d)| (name.clone(), widen(d))),
    );
    parts.push(("pose".to_owned(), widen(&d_pose)));
    Outcome { parts }
}

fn in_f64(avatar: &Avatar, pose: &Pose, d_gaussians: &[f32]) -> Outcome {
    let twin = DirectTwin::new(avatar).unwrap();
    let posed = twin.pose(pose);
    let d = PosedGaussians::from_table(&widen(d_gaussians), avatar.config.gaussians);
    let gradients = twin.gradients(pose, &posed, &d, [OFFSET_WEIGHT.into(), SCALE_WEIGHT.into()]);
    let mut parts = vec![("posed".to_owned(), posed.gaussians.table())];
    parts.extend(gradients.tables.map(|(name, d)| (name.to_owned(), d)));
    parts.push(("pose".to_owned(), gradients.pose));
    Outcome { parts }
}

/// L2 error relative to the norm of the exact values, but at least 0.1: near the rest pose some gradients vanish.
fn relative_error(a: &[f64], b: &[f64]) -> f64 {
    assert_eq!(a.len(), b.len());
    let difference: f64 = a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum();
    let norm: f64 = b.iter().map(|b| b * b).sum();
    (difference / norm.max(0.01)).sqrt()
}

/// Asserts that some terms of the response are at a limit and some are not.
fn assert_some_are_limited(avatar: &Avatar, pose: &Pose) {
    let response = tables_of(avatar).pose_response(avatar.config.channels());
    let features = pose_features(pose);
    let free = response.unlimited_terms(&features);
    let held = response.joint_terms(&features);
    // Except the root, whose term is constant.
    let limited = free.iter().zip(&held).enumerate().filter(|(i, (a, b))| i % JOINTS != 0 && a != b).count();
    assert!((5..free.len() - 10).contains(&limited), "{limited} of {} terms are limited", free.len());
}

#[test]
fn the_device_agrees_with_the_exact_mathematics_forward_and_backward() {
    let gpu = Gpu::new(&AdapterChoice::from_env()).unwrap_or_else(|e| panic!("{e}"));
    for coefficients in [CoefficientLayout::PerBasis, CoefficientLayout::PerComponent] {
        for residual_weights in [ResidualWeights::Paper, ResidualWeights::ZeroSum] {
            for (residual_skeleton, plain_skinning) in [
                (ResidualSkeleton::Paper, false),
                (ResidualSkeleton::Anchored, false),
                (ResidualSkeleton::Anchored, true),
            ] {
                let config = AvatarConfig {
                    shape_bases: 3,
                    coefficients,
                    color_components: 2,
                    residual_weights,
                    residual_skeleton,
                    plain_skinning,
                    ..Default::default()
                };
                let avatar = random_avatar(0, &config);
                let angles: &[f64] = match coefficients {
                    CoefficientLayout::PerBasis => &[0.0, 1e-6, 0.7, 3.0],
                    CoefficientLayout::PerComponent => &[0.7],
                };
                for &angle in angles {
                    let values = widen(&random(9, 3 * JOINTS + 3, 1.0));
                    let vectors: Vec<DVec3> = values.chunks_exact(3).map(DVec3::from_slice).collect();
                    let pose = Pose {
                        // Rounded to f32, so that both sides start from the same numbers.
                        rotations: vectors[..JOINTS].iter().map(|v| (*v * angle).as_vec3().as_dvec3()).collect(),
                        translation: vectors[JOINTS] * 0.1,
                    };
                    if angle == 0.7 {
                        assert_some_are_limited(&avatar, &pose);
                    }
                    let d_gaussians = random(10, 7 * COUNT, 1.0);
                    let device = on_device(&gpu, &avatar, &pose, &d_gaussians);
                    let exact = in_f64(&avatar, &pose, &d_gaussians);
                    assert_eq!(
                        exact.parts.iter().filter(|(_, d)| d.is_empty()).count(),
                        2 * usize::from(plain_skinning)
                    );
                    for ((name, a), (twins, b)) in device.parts.iter().zip(&exact.parts) {
                        assert_eq!(name, twins);
                        let error = relative_error(a, b);
                        assert!(
                            error <= 2e-5,
                            "{residual_weights:?} {residual_skeleton:?} angle {angle} {name}: {error}"
                        );
                        let mut wrong = b.clone();
                        let Some(last) = wrong.len().checked_sub(1) else { continue };
                        wrong[last] += 1e-4 + 1e-3 * b.iter().map(|v| v * v).sum::<f64>().sqrt();
                        assert!(!(relative_error(a, &wrong) <= 2e-5), "{name} is not compared");
                    }
                }
            }
        }
    }
}

/// Where a sigmoid is almost 1, its derivative must not be computed from it: few digits are left.
#[test]
fn gradients_of_saturated_colors_and_sizes_keep_their_digits() {
    let gpu = Gpu::new(&AdapterChoice::from_env()).unwrap_or_else(|e| panic!("{e}"));
    let mut avatar = random_avatar(0, &AvatarConfig { shape_bases: 3, color_components: 2, ..Default::default() });
    let PropertyTables::Direct(tables) = &mut avatar.tables else { unreachable!() };
    // Size and base colours.
    tables.appearance[..4 * COUNT].iter_mut().for_each(|logit| *logit += 13.0);
    let pose = Pose::rest(JOINTS);
    let d_gaussians = random(10, 7 * COUNT, 1.0);
    let [device, exact] = [on_device(&gpu, &avatar, &pose, &d_gaussians), in_f64(&avatar, &pose, &d_gaussians)];
    let of_appearance = |outcome: &Outcome| {
        let (_, values) = outcome.parts.iter().find(|(name, _)| name == "appearance").unwrap();
        values.chunks_exact(COUNT).map(<[f64]>::to_vec).collect::<Vec<_>>()
    };
    for (row, (a, b)) in of_appearance(&device).iter().zip(&of_appearance(&exact)).enumerate() {
        let difference: f64 = a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum();
        let norm: f64 = b.iter().map(|b| b * b).sum();
        assert!(norm > 0.0 && (difference / norm).sqrt() <= 2e-5, "row {row}: {difference:e} of {norm:e}");
    }
}

#[test]
fn plain_skinning_is_skinning_with_residual_terms_of_zero_without_their_tables() {
    let gpu = Gpu::new(&AdapterChoice::from_env()).unwrap_or_else(|e| panic!("{e}"));
    let config = AvatarConfig { shape_bases: 3, color_components: 2, ..Default::default() };
    let mut corrected = random_avatar(0, &config);
    let mut plain = corrected.clone();
    plain.config.plain_skinning = true;
    let PropertyTables::Direct(tables) = &mut corrected.tables else { unreachable!() };
    tables.residual_weights.fill(0.0);
    tables.regressor.fill(0.0);
    let PropertyTables::Direct(tables) = &mut plain.tables else { unreachable!() };
    (tables.residual_weights, tables.regressor) = (vec![], vec![]);
    let vectors: Vec<DVec3> = widen(&random(9, 3 * JOINTS, 1.0)).chunks_exact(3).map(DVec3::from_slice).collect();
    let pose = Pose { rotations: vectors, translation: DVec3::ZERO };
    let d_gaussians = random(10, 7 * COUNT, 1.0);
    let [corrected, plain] = [&corrected, &plain].map(|avatar| on_device(&gpu, avatar, &pose, &d_gaussians));
    for ((name, corrected), (_, plain)) in corrected.parts.iter().zip(&plain.parts) {
        match name.as_str() {
            "residual_weights" | "skeleton_regressor" => assert!(plain.is_empty() && !corrected.is_empty()),
            _ => assert!(relative_error(plain, corrected) < 1e-6, "{name}"),
        }
    }

    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.ghand");
    let model = ProceduralHand::default().build().unwrap();
    let mut tables = 0;
    let sizes = [false, true].map(|plain_skinning| {
        let config = AvatarConfig { uv_resolution: 32, plain_skinning, ..Default::default() };
        let avatar = Avatar::untrained(&model, &config, [0.5; 3], 7).unwrap();
        avatar.save(&path).unwrap();
        assert_eq!(Avatar::load(&path).unwrap(), avatar);
        tables = 2 * avatar.template.len() * avatar.template.joint_count() * size_of::<f32>();
        std::fs::metadata(&path).unwrap().len() as usize
    });
    // Two entries fewer in the header, too.
    assert!((tables..tables + 400).contains(&(sizes[0] - sizes[1])), "{sizes:?}, {tables}");
}

#[test]
fn an_avatar_file_is_read_back_bit_for_bit_and_damage_is_rejected() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.ghand");
    let config = AvatarConfig { uv_resolution: 32, shape_bases: 2, color_components: 1, ..Default::default() };
    let model = ProceduralHand::default().build().unwrap();
    let mut avatar = Avatar::untrained(&model, &config, [0.5; 3], 7).unwrap();
    avatar.save(&path).unwrap();
    assert_eq!(Avatar::load(&path).unwrap(), avatar, "without limits");
    let PropertyTables::Direct(tables) = &mut avatar.tables else { unreachable!() };
    tables.response_limits.iter_mut().zip(-50..).for_each(|(limit, i)| *limit = 0.01 * i as f32);
    avatar.save(&path).unwrap();
    assert_eq!(Avatar::load(&path).unwrap(), avatar);
    let bytes = std::fs::read(&path).unwrap();
    avatar.save(&path).unwrap();
    assert_eq!(std::fs::read(&path).unwrap(), bytes, "the same avatar gives the same bytes");

    let damaged = folder.path().join("damaged.ghand");
    for length in [0, 7, 100, bytes.len() / 2, bytes.len() - 1] {
        std::fs::write(&damaged, &bytes[..length]).unwrap();
        let message = Avatar::load(&damaged).unwrap_err().to_string();
        assert!(message.contains("damaged.ghand") && !message.contains('\n'), "{message}");
    }
    // The limits ascend from -0.5 in steps of 0.01: an upper limit is found by its neighbours and set below the lower.
    let limits: Vec<u8> = tables_of(&avatar).response_limits[..8].iter().flat_map(|v| v.to_le_bytes()).collect();
    let at = bytes.windows(limits.len()).position(|window| window == limits).unwrap();
    for bad in [-0.9f32, f32::NAN, f32::INFINITY] {
        let mut other = bytes.clone();
        other[at + 28..at + 32].copy_from_slice(&bad.to_le_bytes());
        std::fs::write(&damaged, &other).unwrap();
        let message = Avatar::load(&damaged).unwrap_err().to_string();
        assert!(message.contains("damaged.ghand: response_limits: ") && !message.contains('\n'), "{message}");
    }
    let version = b"\\\"version\\\":2";
    let at = bytes.windows(version.len()).position(|w| w == version).unwrap();
    for (number, remedy) in [(b'9', "use the ghand that wrote it"), (b'1', "train the avatar again")] {
        let mut other = bytes.clone();
        other[at + version.len() - 1] = number;
        std::fs::write(&damaged, &other).unwrap();
        let message = Avatar::load(&damaged).unwrap_err().to_string();
        assert!(message.contains("version") && message.contains(remedy), "{message}");
    }
    assert!(Avatar::load(&folder.path().join("missing.ghand")).unwrap_err().to_string().contains("missing.ghand"));
}
