//! `ghand pose` and `ghand inspect` as a user runs them.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking; clippy knows that only inside of #[test]")]

mod common;

use std::path::{Path, PathBuf};

use common::{assert_one_sentence, run};
use ghand_core::Pose;
use ghand_core::hand_model::mano::{ManoOptions, read_mano};
use ghand_core::hand_model::procedural::ProceduralHand;
use ghand_core::posing::pose_hand;
use glam::DVec3;
use image::RgbImage;

const GHAND: &str = env!("CARGO_BIN_EXE_ghand");

/// A tiny model in MANO's layout: three vertices, two joints.
fn tiny_mano() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../ghand-core/tests/data/mano/protocol2.pkl")
}

/// Vertices of an OBJ file.
fn vertices(path: &Path) -> Vec<DVec3> {
    let text = std::fs::read_to_string(path).unwrap();
    let numbers = |line: &str| line.split(' ').map(|word| word.parse().unwrap()).collect::<Vec<f64>>();
    text.lines().filter_map(|line| line.strip_prefix("v ")).map(|line| DVec3::from_slice(&numbers(line))).collect()
}

fn assert_near(found: &[DVec3], expected: &[DVec3]) {
    assert_eq!(found.len(), expected.len());
    for (a, b) in found.iter().zip(expected) {
        // Written with nine significant digits.
        assert!((*a - *b).length() < 1e-8 * (1.0 + b.length()), "{a} against {b}");
    }
}

#[test]
fn the_built_in_hand_is_posed_by_a_file_with_its_shape_and_translation() {
    let folder = tempfile::tempdir().unwrap();
    let rotations: Vec<DVec3> = (0..16).map(|k| DVec3::new(0.1, -0.02 * f64::from(k), 0.3)).collect();
    let rows: Vec<[f64; 3]> = rotations.iter().map(|r| r.to_array()).collect();
    let json = serde_json::json!({"fps": 30, "frames": [
        {"id": "a", "pose": vec![[0.0; 3]; 16]},
        {"id": "b", "pose": rows, "translation": [0.1, 0.2, 0.3]},
    ]});
    std::fs::write(folder.path().join("poses.json"), json.to_string()).unwrap();
    let output = run(GHAND, folder.path(), &["pose", "--pose", "poses.json", "--frame", "1", "--out", "mesh.obj"]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let hand = ProceduralHand::default().build().unwrap();
    let pose = Pose { rotations, translation: DVec3::new(0.1, 0.2, 0.3) };
    assert_near(&vertices(&folder.path().join("mesh.obj")), &pose_hand(&hand, &[], &pose).unwrap().vertices);
}

#[test]
fn a_mano_models_mean_pose_is_added_unless_the_pose_is_from_the_flat_hand() {
    let folder = tempfile::tempdir().unwrap();
    let model = read_mano(&tiny_mano(), &ManoOptions::default()).unwrap();
    let given = Pose { rotations: vec![DVec3::new(0.1, 0.2, 0.3), DVec3::new(-0.4, 0.1, 0.2)], translation: DVec3::X };
    let shape = vec![0.5; model.shape_count()];
    let rows: Vec<[f64; 3]> = given.rotations.iter().map(|r| r.to_array()).collect();
    let json = serde_json::json!({"frames": [{"pose": rows, "translation": [1, 0, 0], "shape": shape}]});
    std::fs::write(folder.path().join("poses.json"), json.to_string()).unwrap();
    let path = tiny_mano().display().to_string();
    let posed = |flat: &[&str]| {
        let arguments = ["pose", "--hand-model", &path, "--pose", "poses.json", "--out", "mesh.obj"];
        let output = run(GHAND, folder.path(), &[&arguments[..], flat].concat());
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        vertices(&folder.path().join("mesh.obj"))
    };
    assert_near(&posed(&["--flat-mean"]), &pose_hand(&model, &shape, &given).unwrap().vertices);
    let mut full = given;
    full.rotations[1] += model.pose_space.as_ref().unwrap().mean[0];
    assert_near(&posed(&[]), &pose_hand(&model, &shape, &full).unwrap().vertices);
    assert_ne!(posed(&[]), posed(&["--flat-mean"]));
}

#[test]
fn poses_of_any_kind_are_written_as_ghands_own_and_read_again() {
    let folder = tempfile::tempdir().unwrap();
    let written = |arguments: &[&str]| {
        let output = run(GHAND, folder.path(), &[&["pose"], arguments].concat());
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let file = std::fs::read(folder.path().join("out.json")).unwrap();
        (
            serde_json::from_slice::<serde_json::Value>(&file).unwrap(),
            String::from_utf8_lossy(&output.stderr).into_owned(),
        )
    };
    let (wave, _) = written(&["--pose", "wave", "--fps", "10", "--out", "out.json"]);
    assert!(wave["fps"] == 10.0 && wave["frames"].as_array().unwrap().len() > 15);
    std::fs::rename(folder.path().join("out.json"), folder.path().join("wave.json")).unwrap();
    assert_eq!(written(&["--pose", "wave.json", "--out", "out.json"]).0, wave);
    let still = written(&["--pose", "wave.json", "--in-place", "--frame", "3", "--out", "out.json"]).0;
    assert_eq!(
        (still["frames"].as_array().unwrap().len(), &still["frames"][0]["pose"][0]),
        (1, &serde_json::json!([0.0, 0.0, 0.0]))
    );
    // A tracker's file with a frame that is none: one warning, on stderr.
    let estimate = |number: Option<f64>| serde_json::json!({"is_right": 1, "global_orient": [number, 0, 0], "hand_pose": vec![0.1; 45]});
    let estimates = serde_json::json!([estimate(Some(0.5)), estimate(None)]);
    std::fs::write(folder.path().join("hands.json"), estimates.to_string()).unwrap();
    let (hands, warnings) = written(&["--pose", "hands.json", "--out", "out.json"]);
    assert_eq!(hands["frames"].as_array().unwrap().len(), 1);
    assert!(warnings.contains("1 of 2 frames is left out") && warnings.lines().count() == 1, "{warnings}");
}

#[test]
fn a_posed_hand_is_written_as_gltf_too() {
    let folder = tempfile::tempdir().unwrap();
    let output = run(GHAND, folder.path(), &["pose", "--pose", "fist", "--out", "fist.glb"]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let bytes = std::fs::read(folder.path().join("fist.glb")).unwrap();
    assert!(bytes.starts_with(b"glTF") && bytes.len() > 100_000);
}

/// Part of the pixels that differ from white.
fn coverage(picture: &RgbImage) -> f64 {
    let count = picture.pixels().filter(|p| p.0 != [255; 3]).count();
    count as f64 / f64::from(picture.width() * picture.height())
}

#[test]
fn a_posed_hand_is_drawn_in_every_style_that_fills_the_picture() {
    let folder = tempfile::tempdir().unwrap();
    let draw = |more: &[&str]| {
        let output = run(GHAND, folder.path(), &[&["pose", "--pose", "relaxed", "--picture", "a.png"], more].concat());
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        image::open(folder.path().join("a.png")).unwrap().into_rgb8()
    };
    let colors = |picture: &RgbImage| picture.pixels().map(|p| p.0).collect::<std::collections::HashSet<_>>().len();
    let size = ["--size", "160x240"];
    let [solid, wireframe, both, weights, joint, number] =
        ["solid", "wireframe", "solid-wireframe", "weights", "weights=index1", "weights=1"]
            .map(|style| draw(&[&size[..], &["--style", style]].concat()));
    for picture in [&solid, &wireframe, &both, &weights, &joint] {
        assert_eq!(picture.dimensions(), (160, 240));
        assert!((0.2..0.8).contains(&coverage(picture)), "{}", coverage(picture));
    }
    let model = ProceduralHand::default().build().unwrap();
    assert_eq!(joint == number, model.joint_index("index1") == Some(1));
    // Lines alone leave white between them; weights are more colourful than skin; one joint leaves most of the hand grey.
    let mean = |p: &RgbImage| p.pixels().map(|p| f64::from(p.0[0])).sum::<f64>() / f64::from(p.width() * p.height());
    assert!(mean(&both) < mean(&wireframe) && mean(&both) < mean(&solid));
    assert!(colors(&weights) > 2 * colors(&wireframe));
    let grey = |p: &RgbImage| p.pixels().filter(|p| p.0[0] == p.0[1] && p.0[1] == p.0[2] && p.0[0] < 255).count();
    assert!(grey(&joint) > 5000 && grey(&weights) < 500, "{} {}", grey(&joint), grey(&weights));
    assert_eq!(solid, draw(&size), "solid is the default");
    // A camera of one's own, another background, and the mesh beside the picture.
    let camera = r#"{"id":"c","width":96,"height":64,"intrinsics":[[120,0,48],[0,120,32],[0,0,1]],
        "rotation":[[0,0,1],[0,1,0],[-1,0,0]],"translation":[0,0.1,0.6]}"#;
    std::fs::write(folder.path().join("camera.json"), camera).unwrap();
    let seen = draw(&["--camera", "camera.json", "--background", "1,0,0", "--out", "mesh.obj"]);
    assert_eq!((seen.dimensions(), seen.get_pixel(0, 0).0), ((96, 64), [255, 0, 0]));
    assert!(!vertices(&folder.path().join("mesh.obj")).is_empty());
}

#[test]
fn what_cannot_be_posed_is_one_sentence_and_leaves_no_file() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("not.pkl"), "plain text").unwrap();
    std::fs::write(folder.path().join("long.json"), r#"{"frames":[{"pose":[[0,0,0]]}]}"#).unwrap();
    let shape = serde_json::json!({"frames": [{"pose": vec![[0.0; 3]; 16], "shape": vec![0.0; 99]}]});
    std::fs::write(folder.path().join("shape.json"), shape.to_string()).unwrap();
    for (arguments, expected) in [
        (&["--out", "mesh.stl"][..], "mesh.stl"),
        (&["--out", "mesh.obj", "--hand-model", "absent.pkl"], "absent.pkl"),
        (&["--out", "mesh.obj", "--hand-model", "not.pkl"], "not.pkl"),
        (&["--out", "mesh.obj", "--pose", "long.json"], "1 rows"),
        (&["--out", "mesh.obj", "--pose", "shape.json"], "99 numbers"),
        (&["--out", "mesh.obj", "--pose", "shape.json", "--frame", "7"], "\"7\""),
        (&["--out", "mesh.obj", "--frame", "7"], "--pose"),
        (&["--out", "mesh.obj", "--picture", "a.jpg"], "a.jpg: must end in .png"),
        (&["--out", "mesh.obj", "--picture", "a.png", "--style", "pretty"], "solid-wireframe"),
        (&["--out", "mesh.obj", "--picture", "a.png", "--style", "weights=elbow"], "thumb1"),
        (&["--out", "mesh.obj", "--picture", "a.png", "--camera", "absent.json"], "absent.json"),
        (&["--out", "mesh.obj", "--picture", "a.png", "--adapter", "no such"], "no such"),
        (&["--out", "mesh.obj", "--style", "weights"], "--picture"),
        (&["--pose", "fist"], "--picture"),
    ] {
        let output = run(GHAND, folder.path(), &[&["pose"], arguments].concat());
        assert_one_sentence(&output, &[expected]);
        for name in ["mesh.obj", "mesh.stl", "a.png", "a.jpg"] {
            assert!(!folder.path().join(name).exists(), "{arguments:?} left {name}");
        }
    }
}

#[test]
fn inspect_tells_what_is_in_a_model_and_what_is_odd() {
    let folder = tempfile::tempdir().unwrap();
    let told = |arguments: &[&str]| {
        let output = run(GHAND, folder.path(), &[&["inspect"], arguments].concat());
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8_lossy(&output.stdout).into_owned()
    };
    let built_in = told(&[]);
    for expected in ["right", "joints       16", "thumb3", "closed", "at 512", "warnings     none"] {
        assert!(built_in.contains(expected), "no {expected:?} in {built_in}");
    }
    let mano = told(&[&tiny_mano().display().to_string()]);
    for expected in ["MANO model", "joints       2", "the shaped vertices", "warning      is 15.0000 m long"] {
        assert!(mano.contains(expected), "no {expected:?} in {mano}");
    }
    assert_one_sentence(&run(GHAND, folder.path(), &["inspect", "absent.glb"]), &["absent.glb"]);
}

#[test]
fn a_reader_that_goes_away_is_no_error() {
    let mut child = std::process::Command::new(GHAND)
        .arg("inspect")
        .stdout(std::process::Stdio::piped())
        .stderr(std::process::Stdio::piped())
        .spawn()
        .unwrap();
    drop(child.stdout.take());
    let output = child.wait_with_output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
}
