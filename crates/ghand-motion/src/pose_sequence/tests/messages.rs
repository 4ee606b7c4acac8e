//! Messages about a file have its name, the frame, the joint, and a remedy.

use super::hands::webxr;
use super::mano::mano;
use super::*;

fn says(file: &Json, model: &HandModel, parts: &[&str]) {
    let error = read(file, model).unwrap_err().to_string();
    assert!(error.starts_with("poses.json: "), "{error}");
    parts.iter().for_each(|part| assert!(error.contains(part), "{part} is missing in {error}"));
}

#[test]
fn impossible_numbers_are_named_by_frame_and_joint_in_every_format() {
    let model = mano(Side::Right);
    let mut huge = Pose::rest(16);
    huge.rotations[13].y = 1e30;
    let mut far = Pose::rest(16);
    far.translation.z = 1e30;
    let own =
        |pose: &Pose| json!({"frames": [{"id": "a", "pose": rows(pose), "translation": pose.translation.to_array()}]});
    says(&own(&huge), &model, &["frames[\"a\"].pose", "joint \"thumb1\" rotates by 1e30 rad", "radians"]);
    says(&own(&far), &model, &["frames[\"a\"].translation", "1e30 m", "give metres"]);
    let shaped = |value: f64| json!({"frames": [{"id": "a", "pose": rows(&Pose::rest(16)), "shape": [0.0, value]}]});
    says(&shaped(1e4), &model, &["frames[\"a\"].shape", "number 1 is 10000.0", "from -100 to 100"]);
    assert!(read(&shaped(-100.0), &model).is_ok());
    let numbers = rows(&huge).concat();
    for file in [
        json!(numbers),
        json!({"poses": [numbers]}),
        json!({"0000": {"right": {"pose": numbers, "shape": vec![0; 10], "trans": [0, 0, 0]}}}),
        json!({"rot": [rows(&huge)[0]], "pose": [rows(&huge)[1..].concat()]}),
        json!([{"global_orient": rows(&huge)[0], "hand_pose": rows(&huge)[1..].concat()}]),
        json!({"handPose": numbers}),
        json!([{"right": {"mano_pose": numbers}}]),
    ] {
        says(&file, &model, &["frame \"0000\"", "joint \"thumb1\" rotates by 1e30 rad"]);
    }
    let translated = json!([{"global_orient": [0, 0, 0], "hand_pose": vec![0; 45], "transl": [0, 0, 1e30]}]);
    says(&translated, &model, &["frame \"0000\"", "translation: is 1e30 m long"]);
    says(&json!({"handPose": vec![0; 48], "handBeta": vec![1e9; 10]}), &model, &["shape: number 0 is 1000000000.0"]);
    let landmarks = json!([{"world_landmarks": vec![[1e30, 0.0, 0.0]; 21]}]);
    says(&landmarks, &model, &["frame \"0000\"", "landmark 0 is 1e30 m away", "metres"]);
    let joints: Vec<Json> = (0..25)
        .map(|k| json!({"position": [if k == 7 { 1e30 } else { 0.1 }, 0, 0], "orientation": [0, 0, 0, 1]}))
        .collect();
    says(&json!([{"joints": joints}]), &model, &["joint \"index-finger-phalanx-intermediate\"", "1e30 m away"]);
    // One bad frame among good ones of a tracker is skipped.
    let sequence = without_filled(read(&json!([vec![0.0; 48], numbers]), &model).unwrap(), &["0001"]);
    assert!(sequence.frames.len() == 1 && sequence.warnings[0].contains("frame \"0001\""), "{:?}", sequence.warnings);
}

#[test]
fn untracked_xr_joints_are_reported_by_name_and_reason() {
    let model = webxr(Side::Right);
    let joint = |position: Json, orientation: Json| json!({"position": position, "orientation": orientation});
    let good = || joint(json!([0, 0, 0]), json!([0, 0, 0, 1]));
    let frame = |bad: Json| {
        let joints: Vec<Json> = (0..25).map(|k| if k == 2 { bad.clone() } else { good() }).collect();
        json!([{"id": "f", "joints": joints}])
    };
    for (bad, expected) in [
        (joint(json!([0, 0, 0]), json!([0, 0, 0, 0])), "quaternion is all zeros"),
        (joint(json!([0, 0, 0]), json!([0, 0, 0, null])), "quaternion has a number that is not finite"),
        (joint(json!([0, 0, 0]), json!([0, 0, 0, 9])), "quaternion has the length 9.0, expected 1"),
        (joint(json!([0, 0]), json!([0, 0, 0, 1])), "position is not 3 numbers"),
        (joint(json!([0, null, 0]), json!([0, 0, 0, 1])), "position is not finite"),
        (joint(json!([0, 0, 0]), json!("up")), "not a quaternion"),
        (json!({"matrix": vec![0; 16]}), "matrix is all zeros"),
        (json!({"matrix": vec![1; 16]}), "matrix is not a rotation"),
        (json!({"radius": 1}), "neither a position nor a matrix"),
    ] {
        says(&frame(bad), &model, &["frame \"f\"", "joint \"thumb-phalanx-proximal\"", expected]);
    }
    let quaternions = vec![vec![[0.0; 4]; 25]; 2];
    let file = json!({"positions": vec![vec![[0.0; 3]; 25]; 2], "orientations": quaternions});
    says(&file, &model, &["none of the 2", "frame \"0000\": joint \"wrist\": its quaternion is all zeros"]);
}

#[test]
fn an_error_names_the_content_and_the_supported_kinds() {
    let would_do = ["(T, 48)", "\"hand_pose\"", "\"handPose\"", "(T, 21, 3)", "\"world_landmarks\"", "docs/poses.md"];
    for (file, found) in [
        (
            json!({"verts": vec![[0.0; 3]; 7], "text": "x"}),
            "a map with \"text\" (text), \"verts\" (numbers of the shape [7, 3])",
        ),
        (json!(vec![vec![0.0; 47]; 2]), "numbers of the shape [2, 47]"),
        (json!([{"nothing": 1}, 2]), "a list of 2, the first a map with \"nothing\" (a number)"),
        (json!([]), "an empty list"),
        (json!({"right": {"verts": [[0, 0]]}}), "\"verts\" (numbers of the shape [1, 2])"),
    ] {
        let mut parts = would_do.to_vec();
        parts.push(found);
        says(&file, right(), &parts);
    }
    let many: serde_json::Map<String, Json> = (0..30).map(|k| (format!("field{k:02}"), json!("x"))).collect();
    says(&Json::Object(many), right(), &["field07", "and 22 more"]);
    let components = json!({"pose_m": [vec![0.0; 51]]});
    says(&components, right(), &["\"pose_m\"", "principal components", "45 or 48"]);
}

#[test]
fn implausible_rates_are_rejected_with_the_range() {
    let file = |fps: f64| json!({"fps": fps, "frames": [{"pose": vec![[0.0; 3]; 16]}]});
    for fps in [1e9, 0.0, -1.0, 1e-9] {
        says(&file(fps), right(), &["fps", &fps.to_string(), "from 0.001 to 10000"]);
    }
    assert!(read(&file(10_000.0), right()).is_ok() && read(&file(0.001), right()).is_ok());
}

#[test]
fn a_separately_stored_hand_is_used_and_frames_without_it_are_counted() {
    let model = mano(Side::Right);
    let poses = poses(&model, 3);
    let hand = |pose: &Pose| json!({"mano_pose": rows(pose).concat(), "trans": pose.translation.to_array()});
    let frames = json!([
        {"time": 0.0, "right": hand(&poses[0]), "left": hand(&poses[2])},
        {"time": 0.1, "right": null, "left": hand(&poses[2])},
        {"time": 0.2, "right": hand(&poses[1]), "left": null},
    ]);
    let sequence = without_filled(read(&json!({"frames": frames, "fps": 10}), &model).unwrap(), &["0001"]);
    assert_same(&sequence, &poses[..2], 0.0);
    assert_eq!((sequence.fps, sequence.frames[1].id.as_str()), (10.0, "0002"));
    assert!(sequence.warnings[0].contains("1 of 3"), "{:?}", sequence.warnings);
    let left = PoseOptions { side: Some(Side::Left), ..Default::default() };
    let sequence = without_filled(read_with(&frames, &mano(Side::Left), &left).unwrap(), &["0002"]);
    assert_same(&sequence, &[poses[2].clone(), poses[2].clone()], 0.0);
    assert!((sequence.fps - 10.0).abs() < 1e-9);
}
