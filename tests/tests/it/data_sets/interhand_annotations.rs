//! InterHand2.6M: nulls, unusable images, and impossible annotations.

use ghand_capture::images::skipped::SkipReason;
use ghand_capture::{Capture, OpenOptions};
use ghand_test_support::procedural_hand::ProceduralHand;
use serde_json::{Value, json};

use crate::fixtures::assert_says;
use crate::interhand_files::{InterHand, camera_id, number, open_after, options, right};

const SEQUENCE: &str = "ROM04_RT_Occlusion";

#[test]
fn unusable_images_are_counted_by_reason() {
    let (opened, folder) = open_after(|data| {
        let last = number(2).to_string();
        // Both forms of null, and a missing frame.
        data.mano["0"][&last]["right"] = Value::Null;
        data.mano["0"][number(4).to_string()] = Value::Null;
        data.mano["0"].as_object_mut().unwrap().remove(&number(3).to_string());
        data.annotations[0]["hand_type"] = json!("interacting");
        data.annotations[1]["bbox"] = json!([9.9, 50, 60, 90]);
        data.annotations[2]["bbox"] = json!([10, 50, 108.1, 90]);
        data.annotations[3]["bbox"] = json!([10, 50, 60, 79]);
        data.annotations[4]["bbox"] = Value::Null;
        data.images[5]["width"] = json!(127);
        // Images of other captures and of grey cameras are not counted.
        let other = data.add(SEQUENCE, &camera_id(0), 77, [20, 20, 90, 90]);
        data.images[other]["capture"] = json!(1);
        data.add(SEQUENCE, "410001", number(0), [20, 20, 90, 90]);
        data.add("ROM05", &camera_id(0), number(0), [20, 20, 90, 90]);
        // An image without a camera, and one without a file.
        data.add(SEQUENCE, "400999", number(0), [20, 20, 90, 90]);
        data.add(SEQUENCE, &camera_id(0), number(3), [20, 20, 90, 90]);
    });
    // The test sequence is empty: both of its frames have lost their poses.
    let message = opened.unwrap_err().to_string();
    assert_says(&message, &["data.json", "\"test\"", "without a pose"]);
    drop(folder);

    let (opened, _folder) = open_after(|data| {
        data.mano["0"][number(2).to_string()]["right"] = Value::Null;
        data.mano["0"][number(4).to_string()] = Value::Null;
        data.annotations[0]["hand_type"] = json!("interacting");
        data.annotations[1]["bbox"] = json!([9.9, 50, 60, 90]);
        data.annotations[2]["bbox"] = json!([10, 50, 108.1, 90]);
        data.annotations[3]["bbox"] = json!([10, 50, 60, 79]);
        data.annotations[4]["bbox"] = Value::Null;
        data.images[5]["width"] = json!(127);
        let other = data.add(SEQUENCE, &camera_id(0), 77, [20, 20, 90, 90]);
        data.images[other]["capture"] = json!(1);
        data.add(SEQUENCE, "410001", number(0), [20, 20, 90, 90]);
        data.add("ROM05", &camera_id(0), number(0), [20, 20, 90, 90]);
        data.add(SEQUENCE, "400999", number(0), [20, 20, 90, 90]);
        data.add("ROM03_RT_No_Occlusion", &camera_id(0), number(3), [20, 20, 90, 90]);
    });
    let opened = opened.unwrap();
    let reasons: Vec<(SkipReason, usize)> = opened.skipped_images.reasons.into_iter().collect();
    let expected = [
        (SkipReason::NoCamera, 1),
        // Six images of the last training frame, two of the last test frame.
        (SkipReason::NoPose, 8),
        (SkipReason::OtherHand, 1),
        (SkipReason::AtBorder, 2),
        (SkipReason::Small, 2),
        (SkipReason::Missing, 1),
        // The image with another width: it is the first of its camera, whose size it determines.
        (SkipReason::Broken, 1),
    ];
    assert_eq!(reasons, expected);
    assert_eq!(opened.skipped_images.checked, 22 + 2);
    assert_eq!(opened.capture.splits["train"].views.len(), 18 - 6 - 6);
    assert!(opened.capture.camera_index("410001").is_none() && opened.capture.camera_index("400999").is_none());
}

#[test]
fn annotations_can_precede_the_images() {
    let folder = tempfile::tempdir().unwrap();
    let data = right();
    data.write(folder.path());
    let expected = Capture::open_with(folder.path(), &options()).unwrap();
    let text = format!("{{\"annotations\": {}, \"images\": {}}}", json!(data.annotations), json!(data.images));
    std::fs::write(folder.path().join("annotations/test/InterHand2.6M_test_data.json"), text).unwrap();
    assert!(Capture::open_with(folder.path(), &options()).unwrap() == expected);
}

#[test]
fn impossible_annotations_are_named_with_their_location() {
    type Change = fn(&mut InterHand);
    let cases: [(Change, &[&str]); 15] = [
        (|d| d.camera["0"]["camrot"][camera_id(1)][0][0] = json!(2.0), &["camera.json", "400201", "is not a rotation"]),
        (|d| d.camera["0"]["camrot"][camera_id(1)][0] = json!([1, 0]), &["camera.json", "3 finite numbers", "line 1"]),
        (|d| d.camera["0"]["focal"][camera_id(1)] = json!([0.0, 900.0]), &["camera.json", "400201", "singular"]),
        (|d| d.camera["0"]["campos"][camera_id(1)][1] = json!("x"), &["camera.json", "the text \"x\"", "line 1"]),
        (|d| d.camera = json!({"1": d.camera["0"]}), &["camera.json", "\"0\" is missing"]),
        (|d| d.images[3]["id"] = d.images[2]["id"].clone(), &["data.json", "id 1002 occurs twice"]),
        (
            |d| {
                let copy = d.images[2]["camera"].clone();
                d.images[3]["camera"] = copy;
            },
            &["data.json", "20000", "twice"],
        ),
        (|d| drop(d.images[3].as_object_mut().unwrap().remove("seq_name")), &["data.json", "seq_name", "line 1"]),
        (|d| d.images[3]["frame_idx"] = json!(-4), &["data.json", "-4", "line 1"]),
        (|d| d.annotations[3]["bbox"] = json!([1, 2, 3]), &["data.json", "4 finite numbers", "line 1"]),
        (|d| d.images.clear(), &["data.json", "no sequence", "ROM04_RT_Occlusion"]),
        (
            |d| drop(d.mano["0"][number(0).to_string()]["right"]["pose"].as_array_mut().unwrap().pop()),
            &["MANO_NeuralAnnot.json", "48 finite numbers", "line 1"],
        ),
        (
            |d| d.mano["0"][number(0).to_string()]["right"]["shape"].as_array_mut().unwrap().push(json!(0)),
            &["MANO_NeuralAnnot.json", "more than the expected 10", "line 1"],
        ),
        (
            |d| d.mano["0"][number(0).to_string()]["right"]["trans"][2] = Value::Null,
            &["MANO_NeuralAnnot.json", "null", "line 1"],
        ),
        (|d| d.mano = json!({}), &["data.json", "\"train\"", "without a pose"]),
    ];
    for (change, parts) in cases {
        let (opened, _folder) = open_after(change);
        assert_says(&opened.unwrap_err().to_string(), parts);
    }
}

#[test]
fn rotations_with_errors_up_to_a_thousandth_are_made_orthonormal() {
    let (opened, _folder) = open_after(|d| {
        let entry = &mut d.camera["0"]["camrot"][camera_id(1)][0][0];
        *entry = json!(entry.as_f64().unwrap() + 3e-4);
    });
    let capture = opened.unwrap().capture;
    let rotation = capture.cameras[capture.camera_index(&camera_id(1)).unwrap()].rotation;
    let error = crate::fixtures::difference(
        (rotation * rotation.transpose()).to_cols_array(),
        glam::DMat3::IDENTITY.to_cols_array(),
    );
    assert!(error <= 1e-14, "{error}");
}

#[test]
fn a_missing_file_hand_model_or_sequence_is_named_with_the_remedy() {
    let folder = tempfile::tempdir().unwrap();
    right().write(folder.path());
    let message = |options: &OpenOptions| Capture::open_with(folder.path(), options).unwrap_err().to_string();
    assert_says(&message(&OpenOptions::default()), &["hand_model", "MANO_RIGHT.pkl", "--hand-model"]);
    let built_in = ProceduralHand { detail: 1, ..Default::default() }.build().unwrap();
    let other = OpenOptions { mano: Some(built_in), ..Default::default() };
    assert_says(&message(&other), &["hand_model", "not a MANO model"]);
    let sequences = OpenOptions { train_sequences: vec!["ROM09".into()], ..options() };
    assert_says(&message(&sequences), &["ROM09", "ROM03_RT_No_Occlusion", "ROM04_RT_Occlusion"]);
    let outside = OpenOptions { test_sequences: vec!["../../x".into()], ..options() };
    assert_says(&message(&outside), &["\"../../x\"", "cannot be part of a path"]);
    for kind in ["MANO_NeuralAnnot", "data", "camera"] {
        std::fs::remove_file(folder.path().join(format!("annotations/test/InterHand2.6M_test_{kind}.json"))).unwrap();
        assert_says(&message(&options()), &[kind, "annotations", "download"]);
    }
}

#[test]
fn impossible_poses_are_named_with_file_frame_and_joint() {
    let message = |field: &str, index: usize| {
        let (opened, _folder) =
            open_after(|data| data.mano["0"][number(2).to_string()]["right"][field][index] = json!(1e30));
        opened.unwrap_err().to_string()
    };
    let frame = format!("frames[\"{}\"]", number(2));
    assert_says(&message("pose", 4), &["MANO_NeuralAnnot.json", &frame, "pose: joint \"index1\"", "1e30 rad"]);
    assert_says(&message("trans", 1), &["MANO_NeuralAnnot.json", &frame, "translation", "1e30 m"]);
    assert_says(&message("shape", 9), &["MANO_NeuralAnnot.json", &frame, "shape: number 9 is 1e30"]);
}
