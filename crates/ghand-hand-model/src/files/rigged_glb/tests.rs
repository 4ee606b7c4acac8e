use ghand_core::Pose;
use ghand_core::posing::{pose_hand, shape_hand};
use ghand_test_support::shared;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::*;
use crate::files::gltf::{GltfFile, read_gltf, read_gltf_bytes};
use ghand_test_support::procedural_hand::ProceduralHand;

/// Single precision of coordinates below 0.25 m.
const ROUNDING: f64 = 1.5e-8;

fn procedural(left: bool) -> HandModel {
    ProceduralHand { left, detail: 1, ..Default::default() }.build().unwrap()
}

fn rigged_glb(model: &HandModel) -> Result<Vec<u8>, HandModelError> {
    RiggedHand::default().document(model)?.finish()
}

fn read_back(model: &HandModel) -> GltfFile {
    read_gltf_bytes("hand.glb", &rigged_glb(model).unwrap()).unwrap()
}

fn random_vector(rng: &mut ChaCha8Rng, size: f64) -> DVec3 {
    DVec3::from_array(std::array::from_fn(|_| rng.random_range(-size..size)))
}

fn assert_near(found: &[DVec3], expected: &[DVec3], tolerance: f64, what: &str) {
    assert_eq!(found.len(), expected.len(), "{what}");
    let worst = found.iter().zip(expected).map(|(f, e)| f.distance(*e)).fold(0.0, f64::max);
    assert!(worst <= tolerance, "{what}: {worst:e} apart");
}

/// Fails unless the second model is what the first becomes in a file.
fn assert_same(model: &HandModel, found: &HandModel) {
    assert_eq!((found.side, &found.joint_names, &found.parents), (model.side, &model.joint_names, &model.parents));
    assert_eq!((&found.shape_names, &found.faces), (&model.shape_names, &model.faces));
    assert_near(&found.vertices, &model.vertices, ROUNDING, "vertices");
    assert_near(&found.joints, &model.joints, ROUNDING, "joints");
    assert_near(&found.shape_directions, &model.shape_directions, ROUNDING, "shape directions");
    // Directions below the threshold are missing: nine of them, each of three coordinates.
    let missing = if model.pose_directions.is_empty() { 0.0 } else { NO_EFFECT };
    assert_near(&found.pose_directions, &model.pose_directions, missing + ROUNDING, "pose directions");
    assert!(found.weights.iter().zip(&model.weights).all(|(f, w)| (f - w).abs() < 1e-7));
    assert_eq!(found.weights.len(), model.weights.len());
    for (found_face, face) in found.face_uvs.iter().zip(&model.face_uvs) {
        for (f, e) in found_face.iter().zip(face) {
            assert!(found.uvs[*f as usize].distance(model.uvs[*e as usize]) < 1e-7);
        }
    }
    let shapes = model.shape_count();
    for k in 0..shapes {
        let mut shape = vec![0.0; shapes];
        shape[k] = 1.0;
        let joints = |model: &HandModel| shape_hand(model, &shape).unwrap().joints;
        assert_near(&joints(found), &joints(model), 2.0 * ROUNDING, &format!("joints of shape {k}"));
    }
    let rng = &mut ChaCha8Rng::seed_from_u64(3);
    let shape: Vec<f64> = (0..shapes).map(|_| rng.random_range(-2.0..2.0)).collect();
    let mut pose = Pose::rest(model.joint_count());
    pose.rotations.iter_mut().for_each(|r| *r = random_vector(rng, 0.7));
    let posed = |model: &HandModel| pose_hand(model, &shape, &pose).unwrap().vertices;
    assert_near(&posed(found), &posed(model), 2e-5, "posed vertices");
}

#[test]
fn a_written_procedural_hand_is_read_back() {
    for left in [false, true] {
        let model = procedural(left);
        let found = read_back(&model);
        assert_eq!(found.warnings, Vec::<String>::new());
        assert_same(&model, &found.model);
    }
}

#[test]
fn the_human_hand_is_read_back_with_correctives_if_it_has_any() {
    for file in ["right.glb", "left.glb"] {
        let Some(path) = shared(&format!("assets/human-hand/{file}")) else { return };
        let mut model = read_gltf(&path, None).unwrap().model;
        assert_same(&model, &read_back(&model).model);
        let count = model.vertices.len();
        let rng = &mut ChaCha8Rng::seed_from_u64(4);
        model.pose_directions = vec![DVec3::ZERO; 9 * 24 * count];
        for at in (0..model.pose_directions.len()).step_by(7) {
            model.pose_directions[at] = random_vector(rng, 1e-3);
        }
        assert_same(&model, &read_back(&model).model);
    }
}

#[test]
fn more_than_four_joints_of_a_vertex_take_more_sets() {
    let mut model = procedural(false);
    let joints = model.joint_count();
    model.weights[..joints].copy_from_slice(&[0.0625; 16]);
    model.weights[joints..2 * joints].fill(0.0);
    (0..5).for_each(|k| model.weights[joints + 3 * k] = 0.2);
    assert_same(&model, &read_back(&model).model);
}

#[test]
fn a_model_with_nothing_but_a_skin_is_read_back_and_one_without_names_gets_numbers() {
    let bare = procedural(false).without_blend_shapes();
    let found = read_back(&bare);
    assert!(found.model.joint_directions.is_empty() && found.warnings.is_empty());
    assert_same(&bare, &found.model);
    let found = read_back(&HandModel { shape_names: vec![], ..procedural(false) });
    assert_eq!(found.model.shape_names[..2], ["shape-0", "shape-1"]);
    assert!(found.warnings.is_empty());
}

#[test]
fn a_corrected_vertex_too_little_to_see_takes_no_space() {
    let mut model = procedural(false);
    model.pose_directions.iter_mut().for_each(|d| *d = d.normalize_or_zero() * 0.9e-6);
    let found = read_back(&model);
    assert!(found.model.pose_directions.is_empty());
    let bytes = |model: &HandModel| rigged_glb(model).unwrap().len();
    assert!(bytes(&model) < bytes(&HandModel { pose_directions: vec![], ..model.clone() }) + 64);
}

#[test]
fn bad_correctives_are_rejected_with_their_joint() {
    let model = procedural(false);
    let glb = rigged_glb(&model).unwrap();
    let length = u32::from_le_bytes(glb[12..16].try_into().unwrap()) as usize;
    let document: Value = serde_json::from_slice(&glb[20..20 + length]).unwrap();
    let read = |change: &dyn Fn(&mut Value, &mut Value)| {
        let mut document = document.clone();
        let mut accessors = document["accessors"].take();
        change(&mut document["skins"][0]["extras"]["pose_correctives"], &mut accessors);
        document["accessors"] = accessors;
        let mut text = document.to_string().into_bytes();
        text.resize(text.len().next_multiple_of(4), b' ');
        let rest = &glb[20 + length..];
        let number = |n: usize| (n as u32).to_le_bytes();
        let head = [&b"glTF"[..], &number(2), &number(20 + text.len() + rest.len()), &number(text.len()), b"JSON"];
        read_gltf_bytes("hand.glb", &[&head.concat()[..], &text, rest].concat())
    };
    assert!(!read(&|_, _| {}).unwrap().model.pose_directions.is_empty());
    for other in [json!("thin"), json!({"a": 1}), json!([{"joint": "index1"}]), json!([]), json!(null)] {
        assert!(read(&|c, _| *c = other.clone()).unwrap().model.pose_directions.is_empty(), "{other}");
    }
    type Change = fn(&mut Value, &mut Value);
    let cases: [(Change, &str); 8] = [
        (|c, _| c[0]["joint"] = "elbow".into(), r#"those of joint "elbow" are of no joint of the skin"#),
        (|c, _| c[0]["joint"] = "wrist".into(), "are of the root, which has none"),
        (|c, _| c[1]["joint"] = c[0]["joint"].clone(), "are there twice"),
        (|c, _| c[0]["vertices"] = 999.into(), "refer to accessor 999 of"),
        (|c, _| c[0]["vertices"] = c[1]["vertices"].clone(), "directions for"),
        (|c, a| a[c[0]["vertices"].as_u64().unwrap() as usize]["count"] = 1.into(), "directions for 1 vertices"),
        (|c, _| c[0]["vertices"] = 0.into(), "directions for"),
        (|c, a| a[c[0]["directions"].as_u64().unwrap() as usize]["type"] = "VEC2".into(), "expected 3"),
    ];
    for (change, expected) in cases {
        let message = read(&change).unwrap_err().to_string();
        assert!(
            message.contains(expected) && message.starts_with("hand.glb: "),
            "wanted {expected:?}, got {message:?}"
        );
    }
}

#[test]
fn numbers_too_large_for_the_file_are_rejected() {
    let mut model = procedural(false);
    model.shape_directions[5].x = 1e300;
    let message = rigged_glb(&model).unwrap_err().to_string();
    assert!(message.contains("shape directions: have a number that is too large"), "{message}");
}

/// A file of a hand with a skin, a pose and two motions, and what the `gltf` crate finds in it.
fn dressed(model: &HandModel, is_lit: bool, poses: &[Pose]) -> (::gltf::Gltf, Vec<u8>) {
    let gloss = Some(Gloss { roughness: 0.4, strength: 0.7 });
    let skin = Skin { png: b"\x89PNG picture".to_vec(), is_lit, gloss };
    let motions = [
        Motion { name: "wave", fps: 25.0, poses, correctives: &[] },
        Motion { name: "still", fps: 30.0, poses: &poses[..1], correctives: &[] },
    ];
    let hand = RiggedHand { skin: Some(&skin), pose: Some(&poses[1]), motions: &motions, ..RiggedHand::default() };
    let file = ::gltf::Gltf::from_slice(&hand.document(model).unwrap().finish().unwrap()).unwrap();
    let blob = file.blob.clone().unwrap();
    (file, blob)
}

fn moving(model: &HandModel) -> Vec<Pose> {
    let mut poses = vec![Pose::rest(model.joint_count()); 3];
    for (k, pose) in poses.iter_mut().enumerate() {
        pose.rotations[0] = DVec3::new(0.0, 2.0 * k as f64, 0.1);
        pose.rotations[4] = DVec3::new(0.3 * k as f64, 0.0, 0.2);
        pose.translation = DVec3::new(0.01 * k as f64, 0.0, -0.02);
    }
    poses
}

#[test]
fn another_reader_finds_the_skins_picture_and_the_motions_at_their_times() {
    let model = procedural(false);
    let poses = moving(&model);
    let (file, blob) = dressed(&model, false, &poses);
    let image = file.images().next().unwrap();
    let ::gltf::image::Source::View { view, mime_type } = image.source() else { panic!("no view") };
    assert_eq!((&blob[view.offset()..][..view.length()], mime_type), (&b"\x89PNG picture"[..], "image/png"));
    let material = file.materials().next().unwrap();
    let look = material.pbr_metallic_roughness();
    assert_eq!((look.roughness_factor(), look.metallic_factor()), (0.4, 0.0));
    assert_eq!(look.base_color_texture().unwrap().texture().source().index(), image.index());
    let names: Vec<_> = file.animations().map(|a| a.name().unwrap().to_owned()).collect();
    assert_eq!(names, ["wave", "still"]);
    let animation = file.animations().next().unwrap();
    // Root and finger turn, and the root has a place; nothing else moves.
    assert_eq!(animation.channels().count(), 3);
    for channel in animation.channels() {
        let reader = channel.reader(|_| Some(&blob[..]));
        let times: Vec<f32> = reader.read_inputs().unwrap().collect();
        assert_eq!(times, [0.0, 0.04, 0.08]);
        let node = channel.target().node().index();
        match reader.read_outputs().unwrap() {
            ::gltf::animation::util::ReadOutputs::Rotations(found) => {
                let found: Vec<glam::Quat> = found.into_f32().map(glam::Quat::from_array).collect();
                assert_eq!(found.len(), 3);
                assert!(found.windows(2).all(|pair| pair[0].dot(pair[1]) >= 0.0), "the long way round");
                for (found, pose) in found.iter().zip(&poses) {
                    let turned = found.as_dquat() * DVec3::new(0.2, 0.3, 0.4);
                    let expected = glam::DQuat::from_scaled_axis(pose.rotations[node]) * DVec3::new(0.2, 0.3, 0.4);
                    assert!(turned.distance(expected) < 1e-6, "{node}");
                }
            }
            ::gltf::animation::util::ReadOutputs::Translations(found) => {
                for (found, pose) in found.zip(&poses) {
                    let expected = (model.joints[0] + pose.translation).as_vec3();
                    assert!(node == 0 && glam::Vec3::from(found).distance(expected) < 1e-7);
                }
            }
            _ => panic!("neither rotations nor places"),
        }
    }
}

#[test]
fn nodes_have_the_pose_and_the_skeleton_moves_the_skin_as_ghand_does() {
    let model = procedural(true).without_blend_shapes();
    let poses = moving(&model);
    let (file, blob) = dressed(&model, true, &poses);
    assert!(file.extensions_used().any(|name| name == "KHR_materials_unlit"));
    let mut world = vec![glam::DMat4::IDENTITY; model.joint_count()];
    for node in file.nodes().take(model.joint_count()) {
        let own = glam::Mat4::from_cols_array_2d(&node.transform().matrix()).as_dmat4();
        let parent = model.parents[node.index()].map_or(glam::DMat4::IDENTITY, |parent| world[parent]);
        world[node.index()] = parent * own;
    }
    let skin = file.skins().next().unwrap();
    let bind: Vec<glam::DMat4> = (skin.reader(|_| Some(&blob[..])).read_inverse_bind_matrices().unwrap())
        .map(|m| glam::Mat4::from_cols_array_2d(&m).as_dmat4())
        .collect();
    let mesh = file.meshes().next().unwrap();
    let primitive = mesh.primitives().next().unwrap();
    let reader = primitive.reader(|_| Some(&blob[..]));
    let order = in_order_of_vertices(RenderMesh::from_model(&model));
    let expected = order.gather(&pose_hand(&model, &[], &poses[1]).unwrap().vertices);
    let sets = (reader.read_joints(0).unwrap().into_u16()).zip(reader.read_weights(0).unwrap().into_f32());
    for ((position, (joints, weights)), expected) in reader.read_positions().unwrap().zip(sets).zip(expected) {
        let at = glam::Vec3::from(position).as_dvec3();
        let moved: DVec3 = (joints.iter().zip(weights))
            .map(|(k, w)| (world[*k as usize] * bind[*k as usize]).transform_point3(at) * f64::from(w))
            .sum();
        assert!(moved.distance(expected) < 1e-6, "{moved} against {expected}");
    }
}

#[test]
fn poses_and_names_that_do_not_fit_are_rejected() {
    let model = procedural(false);
    let error = |hand: RiggedHand<'_>| hand.document(&model).err().unwrap().to_string();
    let mut pose = Pose::rest(3);
    assert!(error(RiggedHand { pose: Some(&pose), ..Default::default() }).contains("pose: has 3 rotations"));
    pose = Pose::rest(model.joint_count());
    pose.rotations[2].x = f64::NAN;
    assert!(error(RiggedHand { pose: Some(&pose), ..Default::default() }).contains("not finite"));
    let motions = [Motion { name: "m", fps: 30.0, poses: std::slice::from_ref(&pose), correctives: &[] }];
    assert!(error(RiggedHand { motions: &motions, ..Default::default() }).contains("not finite"));
    let names = vec!["a".to_owned()];
    assert!(error(RiggedHand { joint_names: Some(&names), ..Default::default() }).contains("joint names: 1 of them"));
}

#[test]
fn correctives_are_morph_targets_whose_weights_a_motion_drives() {
    let model = procedural(false);
    let poses = moving(&model);
    let count = model.vertices.len();
    let targets: Vec<DVec3> = (0..2 * count).map(|k| DVec3::new(1e-3 * (k as f64).sin(), 0.0, 2e-3)).collect();
    let keys =
        [(0, [0.0, 0.5]), (2, [1.0, -0.25])].map(|(frame, weights)| CorrectiveKey { frame, weights: weights.to_vec() });
    let motions = [Motion { name: "wave", fps: 25.0, poses: &poses, correctives: &keys }];
    let hand = RiggedHand {
        motions: &motions,
        correctives: &targets,
        corrective_weights: &[0.1, 0.2],
        ..RiggedHand::default()
    };
    let file = ::gltf::Gltf::from_slice(&hand.document(&model).unwrap().finish().unwrap()).unwrap();
    let blob = file.blob.clone().unwrap();
    let mesh = file.meshes().next().unwrap();
    let shapes = model.shape_count();
    assert_eq!(mesh.weights().unwrap()[shapes..], [0.1, 0.2]);
    assert!(mesh.extras().as_ref().unwrap().get().contains("pose-corrective-2"));
    let primitive = mesh.primitives().next().unwrap();
    let order = in_order_of_vertices(RenderMesh::from_model(&model));
    let reader = primitive.reader(|_| Some(&blob[..]));
    let second = reader.read_morph_targets().nth(shapes + 1).unwrap().0.unwrap();
    for (found, expected) in second.zip(order.gather(&targets[count..])) {
        assert!(glam::Vec3::from(found).as_dvec3().distance(expected) < 1e-9);
    }
    let animation = file.animations().next().unwrap();
    let channel =
        animation.channels().find(|c| c.target().property() == ::gltf::animation::Property::MorphTargetWeights);
    let channel = channel.unwrap();
    assert!(channel.target().node().mesh().is_some());
    let reader = channel.reader(|_| Some(&blob[..]));
    assert_eq!(reader.read_inputs().unwrap().collect::<Vec<_>>(), [0.0, 0.08]);
    let Some(::gltf::animation::util::ReadOutputs::MorphTargetWeights(found)) = reader.read_outputs() else { panic!() };
    let found: Vec<f32> = found.into_f32().collect();
    assert_eq!(found.len(), 2 * (shapes + 2));
    assert_eq!((&found[shapes..shapes + 2], &found[2 * shapes + 2..]), (&[0.0, 0.5][..], &[1.0, -0.25][..]));
    let wrong = [CorrectiveKey { frame: 9, weights: vec![0.0; 2] }];
    let motions = [Motion { name: "wave", fps: 25.0, poses: &poses, correctives: &wrong }];
    let error = RiggedHand { motions: &motions, correctives: &targets, ..RiggedHand::default() }.document(&model);
    assert!(error.err().unwrap().to_string().contains("weights: of the motion wave"));
}
