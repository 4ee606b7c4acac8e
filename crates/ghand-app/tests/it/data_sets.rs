//! `train` accepts every kind of capture in one command.

use std::path::Path;

use ghand_capture::Capture;
use ghand_capture::capture::HandModelSource;
use ghand_motion::{PoseOptions, read_poses};

use crate::common::{RESULTS, assert_one_sentence, assert_trained, listing, run};
use ghand_test_support::{cases, long};

const TRAIN: &str = env!("CARGO_BIN_EXE_train");
const SHORT: [&str; 4] = ["--set", "iterations=4", "--set", "uv_resolution=32"];

/// A folder with a MANO file.
fn folder_with_mano() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let bytes = ghand_test_support::mano_files::hands::as_pickle(&crate::fixtures::mano_hand().published());
    std::fs::write(folder.path().join("MANO_RIGHT.pkl"), bytes).unwrap();
    folder
}

/// Trains and returns the output.
fn train(folder: &Path, arguments: &[&str]) -> String {
    let output = run(
        TRAIN,
        folder,
        &[arguments, &["--hand-model", "MANO_RIGHT.pkl", "--out", "out", "--force"], &SHORT[..]].concat(),
    );
    let said = assert_trained(&output).concat();
    assert_eq!(listing(&folder.join("out")), RESULTS);
    said
}

#[test]
fn training_starts_from_interhand() {
    let folder = folder_with_mano();
    let mut data = crate::interhand_files::right();
    data.annotations[0]["hand_type"] = serde_json::json!("interacting");
    data.write(&folder.path().join("InterHand2.6M"));
    let said = train(folder.path(), &["--capture", "InterHand2.6M", "--split", "train20"]);
    assert!(said.contains("6 cameras, 3 frames, 17 images"), "{said}");
    assert!(said.contains("1 of 22 images are skipped: 1 of the other hand"), "{said}");
    assert_poses_are_read_back_unchanged(&folder.path().join("out/poses.json"));
    if cases(false, true) {
        train(folder.path(), &["--capture", "InterHand2.6M/images/test/Capture0", "--split", "train5"]);
    }
    let output = run(TRAIN, folder.path(), &["--capture", "InterHand2.6M"]);
    assert_one_sentence(&output, &["InterHand2.6M", "MANO_RIGHT.pkl", "--hand-model"]);
}

/// Refined poses for the MANO model, read from their file, are those that were written.
fn assert_poses_are_read_back_unchanged(path: &Path) {
    let file: serde_json::Value = serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap();
    let model = crate::fixtures::mano();
    assert_eq!(file["flat_hand_mean"], true);
    assert_eq!(file["hand_model"]["joints"], serde_json::json!(model.joint_names));
    let written: Vec<f64> = (file["frames"].as_array().unwrap().iter())
        .flat_map(|frame| serde_json::from_value::<Vec<[f64; 3]>>(frame["pose"].clone()).unwrap().concat())
        .collect();
    let read = |options: &PoseOptions| -> Vec<f64> {
        let sequence = read_poses(path, model, options).unwrap();
        sequence.frames.iter().flat_map(|frame| crate::fixtures::numbers(&frame.pose.rotations)).collect()
    };
    assert!(model.pose_space.as_ref().unwrap().mean.iter().any(|rotation| rotation.length() > 0.1));
    // Copied exactly: the mean pose was not added, and the poses were not transferred to another skeleton.
    assert_eq!(read(&PoseOptions::default()), written);
    assert_eq!(read(&PoseOptions::default()), read(&PoseOptions { flat_mean: true, ..Default::default() }));
}

#[test]
fn training_starts_from_hand_appearance() {
    if !long() {
        return;
    }
    let folder = folder_with_mano();
    crate::hand_appearance_files::write_subject(&folder.path().join("subject_1"), "metro_mano");
    let said = train(folder.path(), &["--capture", "subject_1", "--principal-point", "224,224"]);
    assert!(said.contains("1 cameras, 6 frames, 6 images"), "{said}");
}

#[test]
fn training_starts_from_a_rig_with_mano_poses() {
    if !long() {
        return;
    }
    let folder = folder_with_mano();
    let root = folder.path().join("rig");
    let copied =
        std::process::Command::new("cp").arg("-r").arg(&crate::fixtures::synthetic().root).arg(&root).status().unwrap();
    assert!(copied.success());
    let rig = Capture {
        root,
        hand_model: crate::fixtures::mano().clone(),
        hand_model_source: HandModelSource::Mano,
        ..crate::fixtures::synthetic().clone()
    };
    rig.save().unwrap();
    train(folder.path(), &["--capture", "rig"]);
}
