//! Poses that ghand wrote for one skeleton, transferred to another.

use super::hands::{directions, webxr};
use super::mano::mano;
use super::*;

/// The output of `ghand pose --out` for some poses of a model.
fn written(model: &HandModel, poses: &[Pose]) -> Json {
    let frame = |(k, pose): (usize, &Pose)| PoseFrame { id: format!("f{k}"), pose: pose.clone(), shape: vec![] };
    let frames = poses.iter().enumerate().map(frame).collect();
    let sequence = PoseSequence { fps: 24.0, joint_names: model.joint_names.clone(), frames, warnings: vec![] };
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("poses.json");
    ghand::write_poses(&path, &sequence, model).unwrap();
    serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap()
}

/// Largest angle between the bones of two hands, degrees.
fn worst_angle(a: &[DVec3], b: &[DVec3]) -> f64 {
    assert_eq!((a.len(), b.len()), (15, 15));
    a.iter().zip(b).map(|(a, b)| a.angle_between(*b).to_degrees()).fold(0.0, larger)
}

#[test]
fn poses_for_one_skeleton_give_another_the_same_finger_directions() {
    let mut models: Vec<HandModel> = vec![right().clone(), webxr(Side::Right), mano(Side::Right)];
    models.extend(generic(Side::Right));
    for from in &models {
        let poses = poses(from, 3);
        let file = written(from, &poses);
        for to in &models {
            let sequence = read(&file, to).unwrap();
            assert_eq!((sequence.fps, sequence.frames[1].id.as_str(), sequence.warnings.len()), (24.0, "f1", 0));
            for (frame, pose) in sequence.frames.iter().zip(&poses) {
                assert_eq!(frame.pose.rotations.len(), to.joint_count());
                let off = worst_angle(&directions(from, pose), &directions(to, &frame.pose));
                assert!(off < 1e-4, "{} to {}: {off} degrees", from.name, to.name);
            }
        }
        let left = webxr(Side::Left);
        let sequence = read(&file, &left).unwrap();
        assert!(sequence.warnings[0].contains("right hand, mirrored for this left one"), "{:?}", sequence.warnings);
        let image: Vec<DVec3> =
            directions(from, &poses[0]).iter().map(|p| crate::retarget::mirrored_point(*p)).collect();
        assert!(worst_angle(&image, &directions(&left, &sequence.frames[0].pose)) < 1e-4);
    }
    // The comparison detects a finger that is off by a degree.
    let mut bent = Pose::rest(16);
    bent.rotations[2].z = 1f64.to_radians();
    assert!(worst_angle(&directions(right(), &Pose::rest(16)), &directions(right(), &bent)) > 0.9);
}

#[test]
fn a_round_trip_through_files_gives_the_same_pose() {
    let own = right();
    let other = webxr(Side::Right);
    let poses = poses(own, 3);
    let there: Vec<Pose> =
        read(&written(own, &poses), &other).unwrap().frames.into_iter().map(|frame| frame.pose).collect();
    assert_same(&read(&written(&other, &there), own).unwrap(), &poses, 1e-9);
}

#[test]
fn an_avatar_with_learned_joints_uses_its_templates_rotations_unchanged() {
    let mut learned = right().clone();
    learned.joints.iter_mut().skip(1).for_each(|joint| *joint += DVec3::new(0.002, -0.004, 0.003));
    learned.joints[5] += DVec3::new(0.006, 0.0, -0.004);
    let poses = poses(right(), 2);
    assert_same(&read(&written(right(), &poses), &learned).unwrap(), &poses, 0.0);
    // The same names on a hand in other axes are another skeleton.
    let turned = read(&written(right(), &poses), &mano(Side::Right)).unwrap();
    assert!(difference(&turned.frames[0].pose, &poses[0]) > 0.1);
}

#[test]
fn files_with_only_joint_names_are_read_for_the_built_in_hand_or_rejected() {
    let poses = poses(right(), 2);
    let other = webxr(Side::Right);
    let full = written(right(), &poses);
    let mut names = full.clone();
    names["hand_model"] = json!({"joints": right().joint_names});
    let sequence = read(&names, &other).unwrap();
    assert!(sequence.warnings[0].contains("rest_joints"), "{:?}", sequence.warnings);
    let expected: Vec<Pose> = read(&full, &other).unwrap().frames.into_iter().map(|frame| frame.pose).collect();
    assert_same(&sequence, &expected, 1e-9);
    let there = written(&other, &expected);
    for missing in [&["side"][..], &["parents"], &["side", "parents", "rest_joints"]] {
        let mut part = there.clone();
        missing.iter().for_each(|name| drop(part["hand_model"].as_object_mut().unwrap().remove(*name)));
        let error = read(&part, right()).unwrap_err().to_string();
        for expected in missing.iter().chain(&["poses.json: hand_model.joints", "\"index1\"", "--pose-model"]) {
            assert!(error.contains(expected), "{expected} is not in {error}");
        }
        // The model of the poses supplies the rest.
        let options = PoseOptions { pose_model: Some(other.clone()), ..Default::default() };
        assert_same(&read_with(&part, right(), &options).unwrap(), &poses, 1e-9);
        // On that model itself nothing is missing.
        assert_same(&read(&part, &other).unwrap(), &expected, 0.0);
    }
    // Without names, the file needs as many rows as the model has joints, or its own model.
    let bare = json!({"frames": poses.iter().map(|pose| json!({"pose": rows(pose)})).collect::<Vec<_>>()});
    let error = read(&bare, &other).unwrap_err().to_string();
    assert!(error.contains("16 rows, expected 25") && error.contains("\"rest_joints\""), "{error}");
    let options = PoseOptions { pose_model: Some(right().clone()), ..Default::default() };
    assert_eq!(read_with(&bare, &other, &options).unwrap().frames.len(), 2);
}

#[test]
fn an_impossible_description_is_rejected_with_its_field() {
    let file = written(right(), &poses(right(), 1));
    let with = |name: &str, value: Json| {
        let mut file = file.clone();
        file["hand_model"][name] = value;
        read(&file, &webxr(Side::Right)).unwrap_err().to_string()
    };
    let mut twice = right().joint_names.clone();
    twice[4] = "wrist".into();
    for (name, value, expected) in [
        ("parents", json!([-1, 0]), "16 numbers"),
        ("parents", json!([-1, 0, 3, 2, 0, 4, 5, 0, 7, 8, 0, 10, 11, 0, 13, 14]), "joint 2 has parent 3"),
        ("rest_joints", json!([[0, 0, 0]]), "16 rows of 3 numbers"),
        ("rest_joints", json!(vec![[0.0, 1e9, 0.0]; 16]), "row 0 has 1000000000"),
        ("tips", json!("long"), "5 rows"),
        ("side", json!("up"), "\"right\" or \"left\""),
        ("joints", json!(twice), "\"wrist\" occurs twice"),
    ] {
        let error = with(name, value);
        assert!(error.starts_with(&format!("poses.json: hand_model.{name}: ")) && error.contains(expected), "{error}");
    }
    // Joints at the same position have no direction.
    assert!(with("rest_joints", json!(vec![[0.0; 3]; 16])).contains("are at one point"));
    let options = PoseOptions { side: Some(Side::Left), ..Default::default() };
    let error = read_with(&file, right(), &options).unwrap_err().to_string();
    assert!(error.contains("hand_model.side") && error.contains("right hand"), "{error}");
}

#[test]
fn without_fingertips_the_last_bones_continue_straight() {
    let other = webxr(Side::Right);
    let poses = poses(right(), 1);
    let mut file = written(right(), &poses);
    file["hand_model"].as_object_mut().unwrap().remove("tips");
    let sequence = read(&file, &other).unwrap();
    // The built-in hand's fingers are straight at rest, except for the end of the skin.
    assert!(worst_angle(&directions(right(), &poses[0]), &directions(&other, &sequence.frames[0].pose)) < 20.0);
}

#[test]
fn a_hand_of_the_other_side_without_a_skeleton_is_mirrored() {
    let poses = poses(right(), 2);
    let frames: Vec<Json> =
        poses.iter().map(|pose| json!({"pose": rows(pose), "translation": pose.translation.to_array()})).collect();
    let expected: Vec<Pose> = poses.iter().map(Pose::mirrored).collect();
    for file in
        [json!({"side": "left", "frames": frames}), json!({"left": {"frames": frames}}), json!({"left": frames})]
    {
        let sequence = read(&file, right()).unwrap();
        assert_same(&sequence, &expected, 0.0);
        assert!(sequence.warnings[0].contains("left hand, mirrored"), "{:?}", sequence.warnings);
        assert_same(&read(&file, procedural(Side::Left)).unwrap(), &poses, 0.0);
    }
}
