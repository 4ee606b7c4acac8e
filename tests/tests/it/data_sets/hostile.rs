//! Replaces each input file by something that is not a file, is too large, or is made to take memory or time.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use ghand_capture::cameras::named::read_named_camera;
use ghand_capture::{Capture, CaptureError};
use ghand_hand_model::files::mano::LeftShapes;
use ghand_hand_model::files::read::read_hand_model;
use ghand_motion::{PoseOptions, read_poses};
use serde_json::{Value, json};
use tempfile::TempDir;

use crate::fixtures::{assert_says, mano, rows, synthetic};
use crate::hand_appearance_files::write_subject;
use crate::interhand_files::{options, right};

/// One camera and one frame of a MANO hand in a separate folder; the hand model is built only once.
fn small() -> (TempDir, Value) {
    let folder = tempfile::tempdir().unwrap();
    let camera = &synthetic().cameras[0];
    let value = json!({
        "format": "ghand-capture", "version": 1, "units": "metre", "side": "right",
        "hand_model": {"kind": "mano"},
        "cameras": [{
            "id": "a", "width": 128, "height": 192, "intrinsics": [[100, 0, 64], [0, 100, 96], [0, 0, 1]],
            "rotation": rows(camera.rotation), "translation": [0, 0, 1],
        }],
        "frames": [{"id": "0", "pose": vec![[0.0; 3]; 16], "translation": [0, 0, 0]}],
        "image_path": "image.png", "mask_path": "mask.png",
        "splits": {"train": {"cameras": ["a"], "frames": ["0"]}, "test": {}},
    });
    (folder, value)
}

fn save(folder: &Path, value: &Value) -> PathBuf {
    let file = folder.join("capture.json");
    std::fs::write(&file, value.to_string()).unwrap();
    file
}

/// The message of opening the small capture after a change.
fn message(change: impl FnOnce(&mut Value)) -> String {
    let (folder, mut value) = small();
    change(&mut value);
    save(folder.path(), &value);
    open(folder.path()).unwrap_err().to_string()
}

fn open(folder: &Path) -> Result<Capture, CaptureError> {
    Capture::open_with(folder, &options()).map(|opened| opened.capture)
}

/// The replacements of a file.
#[derive(Clone, Copy, Debug)]
enum Harm {
    Nothing,
    Empty,
    Folder,
    #[cfg(unix)]
    Pipe,
    Utf16,
    Huge,
    Brackets,
}

const HARMS: &[Harm] = &[
    Harm::Nothing,
    Harm::Empty,
    Harm::Folder,
    #[cfg(unix)]
    Harm::Pipe,
    Harm::Utf16,
    Harm::Huge,
    Harm::Brackets,
];

fn put(harm: Harm, path: &Path) {
    if path.is_dir() {
        std::fs::remove_dir(path).unwrap();
    } else if path.exists() {
        std::fs::remove_file(path).unwrap();
    }
    match harm {
        Harm::Nothing => {}
        Harm::Empty => std::fs::write(path, b"").unwrap(),
        Harm::Folder => std::fs::create_dir(path).unwrap(),
        #[cfg(unix)]
        Harm::Pipe => assert!(std::process::Command::new("mkfifo").arg(path).status().unwrap().success()),
        Harm::Utf16 => std::fs::write(path, b"\xff\xfe{\0}\0").unwrap(),
        // The file is sparse: it uses no disk space.
        Harm::Huge => std::fs::File::create(path).unwrap().set_len(2 << 30).unwrap(),
        Harm::Brackets => std::fs::write(path, b"[".repeat(1_000_000)).unwrap(),
    }
}

/// Replaces a file by each harm and reads it: the result must be one sentence that names the file, within seconds.
fn harm(path: &Path, read: impl Fn() -> Result<(), String>) {
    let name = path.file_name().unwrap().to_string_lossy().into_owned();
    for harm in HARMS {
        put(*harm, path);
        let start = Instant::now();
        let said = read().expect_err(&format!("{harm:?} in place of {name}"));
        println!("{harm:?}: {said}");
        assert_says(&said, &[name.as_str()]);
        assert!(said.len() < 1000, "{harm:?}: {said}");
        // The limit is generous because other tests run at the same time.
        assert!(start.elapsed() < Duration::from_secs(20), "{harm:?}: {:?}", start.elapsed());
    }
}

fn said<T>(result: Result<T, impl std::fmt::Display>) -> Result<(), String> {
    result.map(drop).map_err(|error| error.to_string())
}

#[test]
fn a_harmful_file_of_the_own_format_is_named() {
    let (folder, mut value) = small();
    let root = folder.path();
    harm(&save(root, &value), || said(open(root)));
    put(Harm::Nothing, &root.join("capture.json"));
    let file = save(root, &value);
    let capture = open(root).unwrap();
    harm(&root.join("image.png"), || said(capture.load_view(0, 0)));
    image::RgbImage::new(128, 192)
        .save({
            put(Harm::Nothing, &root.join("image.png"));
            root.join("image.png")
        })
        .unwrap();
    harm(&root.join("mask.png"), || said(capture.load_view(0, 0)));
    value["hand_model"] = json!({"kind": "gltf", "path": "hand.glb"});
    save(root, &value);
    harm(&root.join("hand.glb"), || said(open(root)));
    harm(&root.join("camera.json"), || said(read_named_camera(&root.join("camera.json"))));
    std::fs::remove_file(file).unwrap();
}

#[test]
fn a_harmful_file_of_a_model_or_poses_is_named() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["hand.pkl", "hand.glb", "hand.gltf", "hand.npz"] {
        let path = folder.path().join(name);
        harm(&path, || said(read_hand_model(&path, LeftShapes::Fixed)));
    }
    let path = folder.path().join("poses.json");
    harm(&path, || said(read_poses(&path, mano(), &PoseOptions::default())));
}

#[test]
fn a_harmful_file_of_a_data_set_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let mut data = right();
    data.joints = Some(json!({}));
    data.write(folder.path());
    for kind in ["camera", "data", "MANO_NeuralAnnot", "joint_3d"] {
        let file = folder.path().join(format!("annotations/test/InterHand2.6M_test_{kind}.json"));
        let whole = std::fs::read(&file).unwrap();
        let open = || said(Capture::open_with(folder.path(), &options()));
        if kind == "joint_3d" {
            // The file is optional.
            put(Harm::Nothing, &file);
            open().unwrap();
            std::fs::write(&file, b"[").unwrap();
            assert_says(&open().unwrap_err(), &["joint_3d"]);
        } else {
            harm(&file, open);
        }
        put(Harm::Nothing, &file);
        std::fs::write(&file, whole).unwrap();
    }
    Capture::open_with(folder.path(), &options()).unwrap();
    let subject = tempfile::tempdir().unwrap();
    write_subject(subject.path(), "metro_mano");
    let file = subject.path().join("2/metro_mano/0001_mano.pkl");
    for harm in HARMS.iter().filter(|harm| !matches!(harm, Harm::Nothing)) {
        put(*harm, &file);
        let said = Capture::open_with(subject.path(), &options()).unwrap_err().to_string();
        assert_says(&said, &["0001_mano.pkl"]);
    }
}

#[test]
fn null_annotations_are_errors_or_skipped() {
    type Change = fn(&mut crate::interhand_files::InterHand);
    let refused: [(Change, &[&str]); 5] = [
        (|d| d.camera["0"] = Value::Null, &["camera.json", "null", "line 1"]),
        (|d| d.camera = Value::Null, &["camera.json", "null"]),
        (|d| d.camera["0"]["campos"] = Value::Null, &["camera.json", "null"]),
        (|d| d.images[2] = Value::Null, &["data.json", "null"]),
        (|d| d.mano["0"] = Value::Null, &["MANO_NeuralAnnot.json", "null"]),
    ];
    for (change, parts) in refused {
        let (opened, _folder) = crate::interhand_files::open_after(change);
        assert_says(&opened.unwrap_err().to_string(), parts);
    }
    // Single cameras without a table, boxes without numbers and frames without a hand are skipped.
    let (opened, _folder) = crate::interhand_files::open_after(|d| {
        for table in ["campos", "camrot", "focal", "princpt"] {
            d.camera["0"][table][crate::interhand_files::camera_id(1)] = Value::Null;
        }
        d.annotations[0]["bbox"] = Value::Null;
        d.annotations[1]["hand_type"] = Value::Null;
        d.mano["0"][crate::interhand_files::number(0).to_string()] = json!({"right": null, "left": null});
    });
    let counts = opened.unwrap().skipped_images;
    assert!(counts.total() > 3 && counts.total() < counts.checked, "{counts}");
}

#[test]
fn a_byte_order_mark_is_ignored() {
    let (folder, value) = small();
    let file = save(folder.path(), &value);
    std::fs::write(&file, format!("\u{feff}{value}")).unwrap();
    open(folder.path()).unwrap();
    std::fs::write(&file, b"\xfe\xff\0{\0}").unwrap();
    assert_says(&said(open(folder.path())).unwrap_err(), &["capture.json", "UTF-16", "save it as UTF-8"]);
}

#[test]
fn rotations_with_more_than_rounding_errors_are_rejected_with_their_error() {
    let off = |by: f64| {
        move |v: &mut Value| {
            let entry = &mut v["cameras"][0]["rotation"];
            *entry = json!([[1.0 + by, 0, 0], [0, 1, 0], [0, 0, 1]]);
        }
    };
    let (folder, mut value) = small();
    off(4.9e-4)(&mut value);
    save(folder.path(), &value);
    assert_eq!(open(folder.path()).unwrap().cameras[0].rotation, glam::DMat3::IDENTITY);
    assert_says(&message(off(6e-4)), &["cameras[\"a\"].rotation", "1.2e-3", "at most 1e-3"]);
    assert_says(&message(off(1e200)), &["rotation", "inf"]);
}

#[test]
fn ids_and_paths_cannot_leave_the_folder() {
    for id in ["..", ".", "a/b", "../a", "/a", "a\\b", "C:", "", "a\0"] {
        assert_says(&message(|v| v["frames"][0]["id"] = json!(id)), &["frames", "cannot be part of a path"]);
        assert_says(&message(|v| v["cameras"][0]["id"] = json!(id)), &["cameras", "cannot be part of a path"]);
    }
    for path in ["../a.png", "/a.png", "images/../../a.png", "{camera}/..\\a.png"] {
        assert_says(&message(|v| v["mask_path"] = json!(path)), &["mask_path", "leaves the capture's folder"]);
    }
}

#[test]
fn a_few_thousand_ids_do_not_become_millions_of_images() {
    let said = message(|v| {
        let camera = v["cameras"][0].clone();
        let frame = v["frames"][0].clone();
        let with_id = |entry: &Value, k: usize| {
            let mut entry = entry.clone();
            entry["id"] = json!(k.to_string());
            entry
        };
        let ids: Vec<String> = (0..3000).map(|k| k.to_string()).collect();
        v["cameras"] = (0..3000).map(|k| with_id(&camera, k)).collect();
        v["frames"] = (0..3000).map(|k| with_id(&frame, k)).collect();
        v["image_path"] = json!("{camera}/{frame}.png");
        v["mask_path"] = json!("{camera}/{frame}_mask.png");
        v["splits"] = json!({"train": {"cameras": ids, "frames": ids}});
    });
    assert_says(&said, &["splits[\"train\"]", "3000 cameras", "at most 8388608 images"]);
}

#[test]
fn numbers_shared_by_frames_are_not_copied_without_limit() {
    let folder = tempfile::tempdir().unwrap();
    let message = |value: Value| {
        let path = folder.path().join("poses.json");
        std::fs::write(&path, value.to_string()).unwrap();
        read_poses(&path, mano(), &PoseOptions::default()).unwrap_err().to_string()
    };
    // 20,000 hands with 100,000 shape parameters each are 16 GB, from a file of a few megabytes.
    let hand = json!({"hand_pose": vec![0; 45], "global_orient": [0, 0, 0]});
    let many: Vec<&Value> = vec![&hand; 20_000];
    let shared = json!({"betas": vec![0; 100_000], "mano_params": many});
    assert_says(&message(shared), &["poses.json", "100000 numbers in betas"]);
    let arctic = json!({"pose": vec![vec![0; 45]; 20_000], "rot": vec![[0; 3]; 20_000], "shape": vec![0; 100_000]});
    assert_says(&message(arctic), &["poses.json", "shape", "20000 frames", "too many"]);
    let long = "x".repeat(100_000);
    assert_says(&message(json!({long: many})), &["poses.json", "an id of 100000 bytes"]);
}
