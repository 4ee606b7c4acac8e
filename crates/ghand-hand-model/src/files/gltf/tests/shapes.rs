//! Morph targets and the joints that follow them.

use ghand_core::posing::shape_hand;

use super::*;

/// What is said of joints that follow the skin.
const FITTED: &str = "the file does not say how its shapes move the joints; each joint follows the skin around it";

/// All vertices move by `x`, `y`, `z`.
fn all(x: f32, y: f32, z: f32) -> [[f32; 3]; 6] {
    [[x, y, z]; 6]
}

/// The upper corners of the square, which are file vertices 2, 4 and 5, move up.
fn taller() -> [[f32; 3]; 6] {
    let mut target = all(0.0, 0.0, 0.0);
    for corner in [2, 4, 5] {
        target[corner][1] = 0.5;
    }
    target
}

/// Extras of a skin whose entries have the given names and shift each joint of the skin (tip, middle, root) by one
/// number along x.
fn shifts(entries: &[(&str, [f64; 3])]) -> String {
    let entry = |(name, along_x): &(&str, [f64; 3])| {
        let rows: Vec<[f64; 3]> = along_x.iter().map(|x| [*x, 0.0, 0.0]).collect();
        serde_json::json!({"name": name, "unit": "1 m", "joint_shift": rows})
    };
    serde_json::json!({"joints": ["tip", "middle", "root"], "shape": entries.iter().map(entry).collect::<Vec<_>>()})
        .to_string()
}

#[test]
fn morph_targets_are_the_shape_directions_and_the_joints_follow_the_skin() {
    let hand = SmallHand::new().with_targets(&[all(0.0, 0.0, 0.25), taller()]);
    let file = hand.with_extras(r#"{"targetNames":["higher","taller"]}"#, "{}").read_with_warnings().unwrap();
    let model = &file.model;
    assert_eq!(model.shape_names, ["higher", "taller"]);
    let up = DVec3::Z * 0.25;
    let still = DVec3::ZERO;
    let moved = DVec3::Y * 0.5;
    assert_eq!(model.shape_directions, [up, up, up, up, still, still, moved, moved]);
    assert_eq!(file.warnings, [FITTED]);
    assert_eq!(shape_hand(model, &[]).unwrap().joints, model.joints);
    for (joint, expected) in model.joints.iter().zip([1.0, 2.0, 3.0]) {
        assert!(joint.distance(DVec3::X * expected) < 1e-12, "{joint}");
    }
    for (moved, rest) in shape_hand(model, &[2.0]).unwrap().joints.iter().zip(&model.joints) {
        assert!((*moved - *rest).distance(up * 2.0) < 1e-12, "{moved} from {rest}");
    }
}

#[test]
fn joints_beside_a_flat_mesh_follow_the_mean_of_the_skin() {
    let mut hand = SmallHand::new().with_targets(&[all(0.0, 0.0, 0.25)]);
    // The root's inverse bind matrix: no sum over points of the square gives a joint above it.
    let at = 240 + 2 * 64 + 14 * 4;
    hand.bytes[at..at + 4].copy_from_slice(&(-0.5f32).to_le_bytes());
    let model = hand.read().unwrap();
    assert_eq!(model.joints[0], DVec3::new(1.0, 0.0, 0.5));
    assert!(model.joint_regressor.is_empty());
    for direction in &model.joint_directions {
        assert!(direction.distance(DVec3::Z * 0.25) < 1e-12, "{direction}");
    }
    assert_eq!(model.joint_directions.len(), 3);
}

#[test]
fn every_target_has_another_name() {
    let names = |extras: &str| {
        let hand = SmallHand::new().with_targets(&[taller(); 4]);
        hand.with_extras(extras, "{}").read().unwrap().shape_names
    };
    let numbered = ["shape-0", "shape-1", "shape-2", "shape-3"];
    assert_eq!(names("{}"), numbered);
    assert_eq!(names(r#"{"targetNames":["a","b","a","a"]}"#), ["a", "b", "a-2", "a-3"]);
    assert_eq!(names(r#"{"targetNames":["shape-2",null,7," "]}"#), ["shape-2", "shape-1", "shape-2-2", "shape-3"]);
    assert_eq!(names(r#"{"targetNames":["long"]}"#), ["long", "shape-1", "shape-2", "shape-3"]);
    for other in [r#"{"targetNames":"a"}"#, r#"{"targetNames":{"a":0}}"#, "7", "null", r#"["targetNames"]"#] {
        assert_eq!(names(other), numbered, "{other}");
    }
}

#[test]
fn copies_of_a_vertex_that_targets_move_apart_are_counted_and_move_by_their_mean() {
    let mut torn = taller();
    torn[4][1] = 0.75;
    let file = SmallHand::new().with_targets(&[taller(), torn]).read_with_warnings().unwrap();
    assert!(file.warnings[0].starts_with("1 vertices have copies at UV seams"), "{:?}", file.warnings);
    assert_eq!(file.model.shape_directions[4 + 2], DVec3::Y * 0.625);
}

#[test]
fn joint_shifts_belong_to_the_targets_of_their_names_else_in_order() {
    let hand = || SmallHand::new().with_targets(&[taller(), all(0.0, 0.0, 0.25)]);
    let entries = [("higher", [1.0, 2.0, 3.0]), ("taller", [4.0, 5.0, 6.0])];
    let read = |names: &str| {
        let file = hand().with_extras(names, &shifts(&entries)).read_with_warnings().unwrap();
        assert_eq!(file.warnings, Vec::<String>::new());
        assert!(file.model.joint_regressor.is_empty());
        file.model.joint_directions.iter().map(|d| d.x).collect::<Vec<f64>>()
    };
    // The skin lists its joints from the tip to the root, the model from the root.
    assert_eq!(read(r#"{"targetNames":["taller","higher"]}"#), [6.0, 5.0, 4.0, 3.0, 2.0, 1.0]);
    assert_eq!(read("{}"), [3.0, 2.0, 1.0, 6.0, 5.0, 4.0]);
    let file = hand().with_extras(r#"{"targetNames":["taller","wider"]}"#, &shifts(&entries)).read_with_warnings();
    let file = file.unwrap();
    assert_eq!(file.model.joint_directions[3..], [DVec3::ZERO; 3]);
    assert!(file.warnings[0].starts_with("1 of 2 shape directions have no joint shifts"), "{:?}", file.warnings);
}

#[test]
fn extras_of_other_programs_are_ignored() {
    let others = [
        "7",
        r#""shape""#,
        r#"{"shape":"round"}"#,
        r#"{"shape":null}"#,
        r#"{"shape":{"joint_shift":[]}}"#,
        r#"{"shape":[]}"#,
        r#"{"shape":[1e999,"joint_shifts"]}"#,
        r#"{"other":1e999}"#,
    ];
    for other in others {
        let file = SmallHand::new().with_targets(&[taller()]).with_extras("{}", other).read_with_warnings().unwrap();
        assert_eq!(file.warnings, [FITTED], "{other}");
    }
}

#[test]
fn bad_shapes_are_rejected_with_the_target_and_a_remedy() {
    let one = || SmallHand::new().with_targets(&[taller()]);
    let accessor = r#"{"bufferView":5,"componentType":5126,"count":6,"type":"VEC3"}"#;
    let stored = |changed: &str| one().replace(accessor, changed);
    let shifted = |entry: &str| one().with_extras("{}", &format!(r#"{{"shape":[{{"name":"a",{entry}}}]}}"#));
    let rows = |row: &str| shifted(&format!(r#""joint_shift":[[0,0,0],{row},[0,0,0]]"#));
    let primitive = r#"{"attributes":{"POSITION":0,"TEXCOORD_0":1,"JOINTS_0":2,"WEIGHTS_0":3}}"#;
    let cases = [
        (
            stored(r#"{"bufferView":5,"componentType":5126,"count":5,"type":"VEC3"}"#),
            "targets[0].POSITION: has 5 entries for 6 positions",
        ),
        (
            stored(r#"{"bufferView":5,"componentType":5126,"count":99999999999,"type":"VEC3"}"#),
            "has 99999999999 entries for 6",
        ),
        (
            stored(r#"{"bufferView":5,"componentType":5122,"normalized":true,"count":6,"type":"VEC3"}"#),
            "targets[0].POSITION: has components of type I16, but glTF allows only floats",
        ),
        (
            stored(r#"{"bufferView":5,"componentType":5121,"normalized":true,"count":6,"type":"VEC3"}"#),
            "export without quantization",
        ),
        (stored(r#"{"bufferView":5,"componentType":5126,"count":6,"type":"VEC2"}"#), "has 2 components, expected 3"),
        (one().put(432, f32::NAN), "targets[0].POSITION: entry 0 is not finite"),
        (SmallHand::new().with_targets(&[taller(); 300]), "targets: 300 morph targets, at most 256 are read"),
        (
            one().replace("}]}]}]", &format!("}}]}},{primitive}]}}]")),
            "primitive 1 has 0 morph targets, the first has 1",
        ),
        (shifted(r#""joint_shift":[[0,0,0]]"#), r#"skins.extras.shape["0"].joint_shift: has 1 rows for 3 joints"#),
        (shifted(r#""joint_shift":"none""#), r#"shape["0"].joint_shift: is missing"#),
        (rows("[0,null,0]"), r#"shape["0"].joint_shift: row 1 is not three finite numbers"#),
        (rows("[0,1e300,0]"), "row 1 is not three finite numbers"),
        (rows("[0,0]"), "row 1 is not three finite numbers"),
        (rows("0"), "row 1 is not three finite numbers"),
        (rows("[0,1e999,0]"), "skins.extras.shape: number out of range"),
        (
            SmallHand::new()
                .with_targets(&[taller()])
                .with_extras(r#"{"targetNames":["thumb"]}"#, r#"{"shape":[{"name":"thumb","joint_shift":[]}]}"#),
            r#"shape["thumb"].joint_shift: has 0 rows"#,
        ),
    ];
    for (hand, expected) in cases {
        let message = hand.read().map(|_| ()).unwrap_err().to_string();
        assert!(message.contains(expected) && message.contains("small.glb"), "wanted '{expected}', got '{message}'");
    }
}

#[test]
fn sparse_and_missing_displacements_are_zero_elsewhere() {
    let mut hand = SmallHand::new().with_targets(&[taller(), taller()]);
    // The first target replaces entries 1 and 5 of nothing: indices 1 and 5 as bytes, values in its old view.
    hand.bytes.extend([1, 5, 0, 0]);
    let sparse = r#"{"componentType":5126,"count":6,"type":"VEC3","sparse":{"count":2,
        "indices":{"bufferView":7,"componentType":5121},"values":{"bufferView":5,"byteOffset":48}}}"#;
    let hand = hand
        .replace(r#""byteLength":576}"#, r#""byteLength":580}"#)
        .replace(
            r#"{"buffer":0,"byteOffset":504,"byteLength":72}"#,
            r#"{"buffer":0,"byteOffset":504,"byteLength":72},{"buffer":0,"byteOffset":576,"byteLength":2}"#,
        )
        .replace(r#"{"bufferView":5,"componentType":5126,"count":6,"type":"VEC3"}"#, sparse)
        .replace(r#"{"POSITION":6}"#, "{}");
    let zero = DVec3::ZERO;
    let up = DVec3::Y * 0.5;
    assert_eq!(hand.read().unwrap().shape_directions, [zero, up, zero, up, zero, zero, zero, zero]);
    let none = SmallHand::new().with_targets(&[]).read_with_warnings().unwrap();
    assert_eq!((none.model.shape_count(), none.warnings), (0, vec![]));
}

/// The human hand, if it is beside the checkout.
fn human_hand(file: &str) -> Option<HandModel> {
    shared(&format!("assets/human-hand/{file}")).map(|path| read_gltf(&path, None).unwrap().model)
}

#[test]
fn the_human_hand_has_ten_named_shapes_that_move_its_joints() {
    let Some(model) = human_hand("right.glb") else { return };
    assert_eq!((model.vertices.len(), model.uvs.len(), model.joint_count()), (1750, 2002, 25));
    assert_eq!(model.joint_names, WEBXR_JOINTS);
    assert_eq!(model.shape_names[..4], ["finger-length", "finger-diameter", "finger-distance", "hand-scale"]);
    assert_eq!((model.shape_count(), model.joint_directions.len()), (10, 250));
    // As its description says: +1 makes the middle finger 5 mm longer.
    let tip = model.joint_index("middle-finger-tip").unwrap();
    let moved = shape_hand(&model, &[1.0]).unwrap().joints[tip] - model.joints[tip];
    assert!((moved.length() - 0.005).abs() < 1e-4, "{moved}");
}

#[test]
fn the_left_human_hand_is_the_mirror_image_of_the_right_in_every_shape() {
    let (Some(right), Some(left)) = (human_hand("right.glb"), human_hand("left.glb")) else { return };
    assert_eq!((right.side, left.side), (Side::Right, Side::Left));
    assert_eq!((&right.uvs, &right.weights, &right.shape_names), (&left.uvs, &left.weights, &left.shape_names));
    let vectors = |m: &HandModel| [&m.vertices[..], &m.shape_directions, &m.joint_directions, &m.joints].concat();
    for (r, l) in vectors(&right).iter().zip(vectors(&left)) {
        assert!(r.distance(DVec3::new(-l.x, l.y, l.z)) < 1e-9, "{r} against {l}");
    }
}

#[test]
fn fitted_joints_of_the_human_hand_are_near_those_of_its_file_in_every_shape() {
    let Some(model) = human_hand("right.glb") else { return };
    let mut fitted = HandModel { joint_directions: vec![], ..model.clone() };
    follow_skin(&mut fitted);
    fitted.validate().unwrap();
    assert_eq!(fitted.joint_regressor.len(), 25);
    let mut sum = 0.0;
    let mut largest = (0.0f64, String::new());
    for k in 0..10 {
        for value in [-2.0, 2.0] {
            let mut shape = [0.0; 10];
            shape[k] = value;
            let joints = |model: &HandModel| shape_hand(model, &shape).unwrap().joints;
            for (joint, (a, b)) in joints(&model).iter().zip(joints(&fitted)).enumerate() {
                let distance = 1e3 * a.distance(b);
                sum += distance / 500.0;
                if distance > largest.0 {
                    largest = (distance, format!("{} in {}", model.joint_names[joint], model.shape_names[k]));
                }
            }
        }
    }
    println!("fitted joints at +-2: mean {sum:.3} mm, at most {:.2} mm ({})", largest.0, largest.1);
    assert!(sum < 0.25 && largest.0 < 1.3);
    let size = |row: &crate::joints::regressor::Row| row.iter().map(|(_, w)| w.abs()).sum::<f64>();
    assert!(fitted.joint_regressor.iter().map(size).fold(0.0, f64::max) < 3.0);
}
