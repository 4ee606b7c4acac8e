//! The Hand Appearance dataset: the read data equal the written data.

use ghand_capture::{Capture, OpenOptions};
use ghand_core::Side;
use ghand_core::posing::pose_hand;
use glam::{DMat3, DVec2, DVec3};
use tempfile::TempDir;

use crate::fixtures::{assert_says, difference, mano, mano_hand, model_of, numbers, shape, synthetic};
use crate::hand_appearance_files::{frame_pickle, poses, write_subject};
use ghand_test_support::mano_files::python::{Py, array, dictionary, pickle, string};

fn options() -> OpenOptions {
    OpenOptions { mano: Some(mano().clone()), ..Default::default() }
}

fn subject() -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    write_subject(folder.path(), "metro_mano_smooth");
    folder
}

fn message(folder: &TempDir) -> String {
    Capture::open_with(folder.path(), &options()).unwrap_err().to_string()
}

#[test]
fn camera_and_poses_equal_the_written_ones() {
    let folder = subject();
    let opened = Capture::open_with(folder.path(), &options()).unwrap();
    let capture = opened.capture;
    assert_eq!((opened.skipped_images.total(), opened.skipped_images.checked), (0, 10));
    assert_eq!((capture.side, capture.background), (Side::Right, [1.0; 3]));
    let camera = &capture.cameras[0];
    assert_eq!((camera.width, camera.height, capture.cameras.len()), (448, 448, 1));
    assert_eq!((camera.focal, camera.principal), (DVec2::splat(2000.0), DVec2::splat(224.0)));
    assert_eq!((camera.rotation, camera.translation), (DMat3::IDENTITY, DVec3::ZERO));
    for (sequence, pose) in poses() {
        let frame = &capture.frames[capture.frame_index(&format!("{sequence}/0007")).unwrap()];
        let error = difference(numbers(&frame.pose.rotations), numbers(&pose.rotations));
        assert!(error <= 1e-6, "rotations of {sequence} are off by {error}");
        let error = difference(frame.pose.translation.to_array(), pose.translation.to_array());
        assert!(error <= 1e-6, "translation of {sequence} is off by {error}");
        assert!(difference(frame.shape.iter().copied(), shape()) <= 1e-6);
    }
    for (name, first, count) in [("train", "1/0001", 6), ("test", "6/0001", 4)] {
        let split = &capture.splits[name];
        assert_eq!((capture.frames[split.frames[0]].id.as_str(), split.views.len()), (first, count));
    }
    let view = capture.load_view(0, 0).unwrap();
    assert_eq!(view.rgba.iter().filter(|p| p[3] == 255).count(), 127 * 191);
    // Pixels outside the hand are unchanged.
    assert_eq!(view.rgba[0][..3], [255; 3]);
}

#[test]
fn the_hand_is_projected_as_by_the_world_camera() {
    let folder = subject();
    let capture = Capture::open_with(folder.path(), &options()).unwrap().capture;
    let world = &synthetic().frames[0].pose;
    let camera = &synthetic().cameras[0];
    let seen = pose_hand(mano(), &shape(), world).unwrap();
    let read = pose_hand(mano(), &capture.frames[0].shape, &capture.frames[0].pose).unwrap();
    let seen: Vec<DVec3> = seen.vertices.iter().map(|v| camera.camera_from_world(*v)).collect();
    let error = difference(numbers(&read.vertices), numbers(&seen));
    assert!(error <= 1e-6, "{error}");
}

#[test]
fn the_principal_point_can_be_chosen_and_unsmoothed_fits_are_read() {
    let folder = tempfile::tempdir().unwrap();
    write_subject(folder.path(), "metro_mano");
    let chosen = OpenOptions { principal_point: Some(DVec2::new(220.5, 230.0)), ..options() };
    let capture = Capture::open_with(folder.path(), &chosen).unwrap().capture;
    assert_eq!(capture.cameras[0].principal, DVec2::new(220.5, 230.0));
    assert_eq!(capture.frames.len(), 10);
}

#[test]
fn frames_without_an_image_or_a_mask_are_skipped_and_counted() {
    let folder = subject();
    std::fs::remove_file(folder.path().join("1/unscreen_cropped/0001.jpg")).unwrap();
    std::fs::remove_file(folder.path().join("9/mask/0007_mask.jpg")).unwrap();
    let opened = Capture::open_with(folder.path(), &options()).unwrap();
    assert_eq!(opened.skipped_images.to_string(), "2 of 10 images are skipped: 2 without a file");
    assert_eq!((opened.capture.splits["train"].views.len(), opened.capture.splits["test"].views.len()), (5, 3));
    for sequence in ["6", "9"] {
        std::fs::remove_dir_all(folder.path().join(sequence)).unwrap();
    }
    assert_says(&message(&folder), &["test", "6 to 9"]);
}

#[test]
fn impossible_values_are_named() {
    let folder = subject();
    let file = folder.path().join("2/metro_mano_smooth/0001_mano.pkl");
    let good = frame_pickle(&poses()[1].1, mano(), true);
    let floats = |shape: &[usize], values: &[f64]| Py::Array(array("<f4", shape, false, values));
    let cases: [(&str, Option<Py>, &[&str]); 10] = [
        ("pose", Some(floats(&[1, 44], &[0.0; 44])), &["pose", "[1, 44]", "45 numbers"]),
        ("rot", Some(floats(&[3], &[0.0, f64::NAN, 0.0])), &["rot", "NaN"]),
        ("rot", Some(floats(&[3], &[0.0, 512.0, 0.0])), &["pose", "joint \"wrist\" rotates by 512.0 rad", "radians"]),
        ("cam", Some(floats(&[3], &[1.0, 4096.0, 0.0])), &["joints, trans or cam", "metres"]),
        (
            "shape",
            Some(floats(&[10], &[0.0, 0.0, 512.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])),
            &["shape", "number 2 is 512.0"],
        ),
        ("cam", Some(floats(&[3], &[0.0, 0.1, 0.1])), &["cam", "scale 0", "positive"]),
        ("joints", Some(floats(&[63], &[0.0; 63])), &["joints", "[63]"]),
        ("shape", None, &["shape", "is missing"]),
        ("trans", Some(string("far")), &["trans"]),
        ("joints", None, &[]),
    ];
    for (name, value, parts) in cases {
        let mut entries = good.clone();
        entries.retain(|(key, _)| *key != name);
        entries.extend(value.map(|value| (name, value)));
        std::fs::write(&file, pickle(&dictionary(entries))).unwrap();
        if parts.is_empty() {
            // Without joints, `trans` is used.
            Capture::open_with(folder.path(), &options()).unwrap();
        } else {
            assert_says(&message(&folder), &[&["0001_mano.pkl"], parts].concat());
        }
    }
    std::fs::write(&file, "cposix\nsystem\n(S'true'\ntR.").unwrap();
    assert_says(&message(&folder), &["0001_mano.pkl", "posix.system"]);
    std::fs::write(&file, "").unwrap();
    assert_says(&message(&folder), &["0001_mano.pkl", "neither a pickle"]);
    let left = OpenOptions { mano: Some(model_of(&mano_hand().mirrored(), "MANO_LEFT.pkl")), ..Default::default() };
    assert_says(&Capture::open_with(folder.path(), &left).unwrap_err().to_string(), &["MANO_LEFT.pkl", "right hand"]);
    let none = Capture::open_with(folder.path(), &OpenOptions::default()).unwrap_err().to_string();
    assert_says(&none, &["MANO_RIGHT.pkl", "--hand-model"]);
}
