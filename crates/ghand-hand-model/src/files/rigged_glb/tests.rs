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

fn read_back(model: &HandModel) -> GltfFile {
    read_gltf_bytes("hand.glb", &rigged_glb_bytes(model).unwrap(), None).unwrap()
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
        let mut model = read_gltf(&path).unwrap();
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
    let bytes = |model: &HandModel| rigged_glb_bytes(model).unwrap().len();
    assert!(bytes(&model) < bytes(&HandModel { pose_directions: vec![], ..model.clone() }) + 64);
}

#[test]
fn bad_correctives_are_rejected_with_their_joint() {
    let model = procedural(false);
    let glb = rigged_glb_bytes(&model).unwrap();
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
        read_gltf_bytes("hand.glb", &[&head.concat()[..], &text, rest].concat(), None)
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
    let message = rigged_glb_bytes(&model).unwrap_err().to_string();
    assert!(message.contains("shape directions: have a number that is too large"), "{message}");
}
