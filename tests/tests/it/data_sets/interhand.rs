//! InterHand2.6M: the read data equal the written data.

use ghand_capture::capture::HandModelSource;
use ghand_capture::{Capture, OpenOptions};
use ghand_core::posing::{pose_hand, shape_hand};
use ghand_core::rotation::rotation_from_axis_angle;
use ghand_core::{Pose, Side};
use glam::DVec3;
use serde_json::json;

use crate::fixtures::{
    assert_same_camera, assert_says, difference, mano, mano_hand, model_of, numbers, shape, synthetic,
};
use crate::interhand_files::{InterHand, camera_id, number, open_after, options, parameters, right};

#[test]
fn cameras_and_poses_equal_the_written_ones() {
    let (opened, folder) = open_after(|_| ());
    let opened = opened.unwrap();
    let capture = opened.capture;
    let expected = synthetic();
    assert_eq!((opened.skipped_images.total(), opened.skipped_images.checked), (0, 6 * 3 + 2 * 2));
    assert_eq!((capture.side, capture.background), (Side::Right, [0.0; 3]));
    assert_eq!(capture.hand_model_source, HandModelSource::Mano);
    assert_eq!((capture.cameras.len(), capture.frames.len()), (8, 5));
    for (i, camera) in expected.cameras.iter().enumerate() {
        assert_same_camera(&capture.cameras[capture.camera_index(&camera_id(i)).unwrap()], camera);
    }
    for (i, frame) in expected.frames.iter().enumerate() {
        let sequence = if i < 3 { "ROM04_RT_Occlusion" } else { "ROM03_RT_No_Occlusion" };
        let found = &capture.frames[capture.frame_index(&format!("{sequence}/{}", number(i))).unwrap()];
        let error = difference(numbers(&found.pose.rotations), numbers(&frame.pose.rotations));
        assert!(error <= 1e-6, "rotations of frame {i} are off by {error}");
        let error = difference(found.pose.translation.to_array(), frame.pose.translation.to_array());
        assert!(error <= 1e-6, "translation of frame {i} is off by {error}");
        assert!(difference(found.shape.iter().copied(), shape()) <= 1e-6);
    }
    let shaped = shape_hand(mano(), &shape()).unwrap();
    assert!(difference(numbers(&capture.template.joints), numbers(&shaped.joints)) <= 1e-12);
    // The image of each pair is the one written for it.
    let camera = capture.camera_index(&camera_id(2)).unwrap();
    let frame = capture.frame_index("ROM04_RT_Occlusion/20003");
    let view = capture.splits["train"].views.iter().find(|v| v.camera == camera && Some(v.frame) == frame);
    if let Some(view) = view {
        let file = right().image_file(folder.path(), 0, 2, 1);
        assert_eq!(capture.image_file(view.camera, view.frame).unwrap(), file);
        assert!(file.is_file());
    }
}

#[test]
fn the_root_rotates_about_the_wrist_joint_and_trans_is_added_last() {
    let turn = DVec3::new(0.4, -1.2, 0.7);
    let trans = DVec3::new(0.1, -0.3, 1.1);
    let mut rotations = vec![DVec3::ZERO; 16];
    rotations[0] = turn;
    let pose = Pose { rotations, translation: trans };
    let (opened, _folder) =
        open_after(|data| data.mano["0"][number(0).to_string()] = json!({"right": parameters(&pose, mano())}));
    let capture = opened.unwrap().capture;
    let frame = &capture.frames[capture.frame_index("ROM04_RT_Occlusion/20000").unwrap()];
    let posed = pose_hand(&capture.hand_model, &frame.shape, &frame.pose).unwrap();
    let shaped = shape_hand(mano(), &shape()).unwrap();
    let rotation = rotation_from_axis_angle(turn);
    let wrist = shaped.joints[0];
    let about = |center: DVec3| -> Vec<DVec3> {
        shaped.vertices.iter().map(|v| rotation * (*v - center) + center + trans).collect()
    };
    let error = |expected: &[DVec3]| difference(numbers(&posed.vertices), numbers(expected));
    assert!(error(&about(wrist)) <= 1e-9);
    assert!(error(&about(DVec3::ZERO)) > 1e-4, "the test cannot distinguish the wrist from the origin");
}

/// The annotation file of the posed model's joints: right hand first, each finger from tip to base, thumb to little
/// finger, then the wrist.
fn joints_of_posed_hands() -> serde_json::Value {
    let mut frames = json!({});
    for (i, frame) in synthetic().frames.iter().enumerate() {
        let joints = pose_hand(mano(), &shape(), &frame.pose).unwrap().joints;
        // Tips are not joints of MANO; 13 to 15 are the thumb's, then index, middle, ring (10) and little finger (7).
        let finger = |base: usize| [joints[base + 2], joints[base + 2], joints[base + 1], joints[base]];
        let mut right: Vec<DVec3> = [13, 1, 4, 10, 7].into_iter().flat_map(finger).collect();
        right.push(joints[0]);
        let world: Vec<[f64; 3]> = right.iter().map(|j| (*j * 1000.0).to_array()).chain([[0.0; 3]; 21]).collect();
        frames[number(i).to_string()] = json!({"world_coord": world, "hand_type": "right"});
    }
    json!({ "0": frames })
}

#[test]
fn poses_far_from_the_annotated_joints_give_a_warning() {
    let (opened, _folder) = open_after(|data| data.joints = Some(joints_of_posed_hands()));
    assert_eq!(opened.unwrap().warnings, [""; 0]);
    // Without the mean pose, the fingers are at other positions.
    let (opened, _folder) = open_after(|data| {
        data.joints = Some(joints_of_posed_hands());
        for frame in synthetic().frames.iter().enumerate().map(|(i, _)| number(i).to_string()) {
            let pose = &mut data.mano["0"][&frame]["right"]["pose"];
            let moved = pose.as_array().unwrap().iter().enumerate().map(|(k, v)| v.as_f64().unwrap() + (k % 3) as f64);
            *pose = json!(moved.collect::<Vec<f64>>());
        }
    });
    let warnings = opened.unwrap().warnings;
    assert_says(&warnings[0], &["joint_3d.json", "mm from the annotated", "MANO_RIGHT.pkl"]);
    // Nulls, hands with another number of joints, and missing frames give no warning.
    let (opened, _folder) = open_after(|data| {
        let odd = json!({"world_coord": [[0, 0, 0]]});
        data.joints = Some(json!({"0": {(number(0).to_string()): null, (number(1).to_string()): odd}}));
    });
    assert_eq!(opened.unwrap().warnings, [""; 0]);
}

#[test]
fn splits_are_those_of_handavatar_plus_sparse_ones_and_every_200th_test_image() {
    let (opened, _folder) = open_after(|_| ());
    let capture = opened.unwrap().capture;
    let names: Vec<&str> = capture.splits.keys().map(String::as_str).collect();
    assert_eq!(names, ["test", "test_all", "train", "train20", "train5"]);
    let sizes = |name: &str| {
        let split = &capture.splits[name];
        (split.cameras.len(), split.frames.len(), split.views.len())
    };
    assert_eq!(sizes("train"), (6, 3, 18));
    assert_eq!(sizes("train20"), (6, 3, 18));
    assert_eq!(sizes("train5"), (5, 3, 15));
    assert_eq!(sizes("test_all"), (2, 2, 4));
    assert_eq!(sizes("test"), (1, 1, 1));
    let of = |name: &str| capture.splits[name].frames.iter().all(|f| capture.frames[*f].id.starts_with("ROM04"));
    assert!(of("train") && of("train5") && !of("test_all"));
    // The first camera is always chosen.
    assert_eq!(capture.splits["train5"].cameras[0], capture.splits["train"].cameras[0]);
}

#[test]
fn a_left_hand_is_read_by_the_left_model() {
    let folder = tempfile::tempdir().unwrap();
    let model = model_of(&mano_hand().mirrored(), "MANO_LEFT.pkl");
    InterHand::new(&model, ["left", "LT"]).write(folder.path());
    let left = OpenOptions { mano: Some(model), ..Default::default() };
    let capture = Capture::open_with(folder.path(), &left).unwrap().capture;
    assert_eq!((capture.side, capture.splits["train"].views.len()), (Side::Left, 18));
    let error = difference(numbers(&capture.frames[0].pose.rotations), numbers(&synthetic().frames[3].pose.rotations));
    let other = difference(numbers(&capture.frames[0].pose.rotations), numbers(&synthetic().frames[0].pose.rotations));
    assert!(error.min(other) <= 1e-6);
    // The right hand is missing.
    let message = Capture::open_with(folder.path(), &options()).unwrap_err().to_string();
    assert_says(&message, &["data.json", "ROM04_RT_Occlusion", "ROM04_LT_Occlusion", "--train-sequences"]);
}

#[test]
fn root_folder_capture_folders_and_unpacked_archive_are_recognised() {
    let folder = tempfile::tempdir().unwrap();
    let mut data = right();
    data.image_folder = "InterHand2.6M_5fps_batch1/images";
    data.write(folder.path());
    let by_root = Capture::open_with(folder.path(), &options()).unwrap().capture;
    let path = folder.path().join("InterHand2.6M_5fps_batch1/images/test/Capture0");
    let by_folder = Capture::open_with(&path, &options()).unwrap().capture;
    assert_eq!((&by_root.frames, &by_root.splits), (&by_folder.frames, &by_folder.splits));
    assert!(by_folder.image_file(0, 0).unwrap().starts_with(&path));
    assert!(by_folder.mask_file(0, 0).unwrap().unwrap().to_string_lossy().contains("batch1/masks_removeblack/test"));
    std::fs::rename(&path, path.with_file_name("Capture7")).unwrap();
    let message = Capture::open_with(folder.path(), &options()).unwrap_err().to_string();
    assert_says(&message, &["test/Capture0", "Capture3"]);
    let message = Capture::open_with(&path.with_file_name("Capture7"), &options()).unwrap_err().to_string();
    assert_says(&message, &["camera.json", "\"7\""]);
}

#[test]
fn a_capture_of_the_data_set_is_not_written_in_the_own_format() {
    let (opened, _folder) = open_after(|_| ());
    let message = opened.unwrap().capture.save().unwrap_err().to_string();
    assert_says(&message, &["capture.json", "masks"]);
}
