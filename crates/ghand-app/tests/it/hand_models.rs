//! `ghand pose` and `ghand inspect` as a user runs them.

use std::path::{Path, PathBuf};

use ghand_avatar::{Avatar, AvatarConfig, Provenance};
use ghand_core::posing::pose_hand;
use ghand_core::{Pose, Side};
use ghand_hand_model::builtin::builtin_hand;
use ghand_hand_model::files::gltf::read_gltf;
use ghand_hand_model::files::mano::{ManoOptions, read_mano};
use ghand_hand_model::named_poses::named_pose;
use ghand_test_support::procedural_hand::ProceduralHand;
use ghand_test_support::rigged_glb;
use glam::DVec3;
use image::RgbImage;

use crate::common::{assert_one_sentence, run, save_avatar};

const GHAND: &str = env!("CARGO_BIN_EXE_ghand");

/// A tiny model in MANO's layout: three vertices, two joints.
fn tiny_mano() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../ghand-hand-model/tests/data/mano/protocol2.pkl")
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
    let rotations: Vec<DVec3> = (0..25).map(|k| DVec3::new(0.1, -0.02 * f64::from(k), 0.3)).collect();
    let rows: Vec<[f64; 3]> = rotations.iter().map(|r| r.to_array()).collect();
    let json = serde_json::json!({"fps": 30, "frames": [
        {"id": "a", "pose": vec![[0.0; 3]; 25]},
        {"id": "b", "pose": rows, "translation": [0.1, 0.2, 0.3]},
    ]});
    std::fs::write(folder.path().join("poses.json"), json.to_string()).unwrap();
    let output = run(GHAND, folder.path(), &["pose", "--pose", "poses.json", "--frame", "1", "--out", "mesh.obj"]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let hand = builtin_hand(Side::Right).unwrap();
    let pose = Pose { rotations, translation: DVec3::new(0.1, 0.2, 0.3) };
    let posed = pose_hand(&hand, &[], &pose).unwrap().vertices;
    // The file has the embedded file's vertices, which are split at UV seams.
    let expected: Vec<DVec3> = hand.source_vertices.iter().map(|v| posed[*v as usize]).collect();
    assert_near(&vertices(&folder.path().join("mesh.obj")), &expected);
}

#[test]
fn a_mano_models_mean_pose_is_added_unless_the_pose_is_from_the_flat_hand() {
    let folder = tempfile::tempdir().unwrap();
    let model = read_mano(&tiny_mano(), &ManoOptions::default()).unwrap().model;
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
    // A tracker's file with an invalid frame and without a rate: one warning for each, on stderr.
    let estimate = |number: Option<f64>| serde_json::json!({"is_right": 1, "global_orient": [number, 0, 0], "hand_pose": vec![0.1; 45]});
    let estimates = serde_json::json!([estimate(Some(0.5)), estimate(None)]);
    std::fs::write(folder.path().join("hands.json"), estimates.to_string()).unwrap();
    let (hands, warnings) = written(&["--pose", "hands.json", "--out", "out.json"]);
    assert_eq!(hands["frames"].as_array().unwrap().len(), 2);
    for said in ["1 of 2 frames is skipped", "the last frame has no pose and is held", "--file-fps"] {
        assert!(warnings.contains(said), "{warnings}");
    }
    assert_eq!(warnings.lines().count(), 3, "{warnings}");
}

/// Writes an avatar of the small built-in hand whose joints have WebXR's names.
fn save_renamed_avatar(folder: &Path) -> PathBuf {
    let mut model = ProceduralHand { detail: 1, ..Default::default() }.build().unwrap();
    for name in model.joint_names.iter_mut().skip(1) {
        let number = name.pop().unwrap();
        let parts = if name == "thumb" {
            ["metacarpal", "phalanx-proximal", "phalanx-distal"]
        } else {
            ["phalanx-proximal", "phalanx-intermediate", "phalanx-distal"]
        };
        let finger = if name == "thumb" { "thumb".to_owned() } else { format!("{name}-finger") };
        *name = format!("{finger}-{}", parts[number.to_digit(10).unwrap() as usize - 1]);
    }
    let config = AvatarConfig { uv_resolution: 64, ..Default::default() };
    let mut avatar = Avatar::untrained(&model, &config, [0.8, 0.6, 0.5], 0).unwrap();
    avatar.provenance = Provenance { capture: "rig".into(), iterations: 12, seed: 7, ..Default::default() };
    let path = folder.join("renamed.ghand");
    avatar.save(&path).unwrap();
    path
}

#[test]
fn poses_are_made_for_an_avatar_and_drive_avatars_of_other_joints() {
    let folder = tempfile::tempdir().unwrap();
    save_avatar(folder.path());
    save_renamed_avatar(folder.path());
    let pose = |arguments: &[&str]| {
        let output = run(GHAND, folder.path(), &[&["pose"], arguments].concat());
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    };
    let names = |file: &str| {
        let text = std::fs::read(folder.path().join(file)).unwrap();
        let file = serde_json::from_slice::<serde_json::Value>(&text).unwrap();
        file["hand_model"]["joints"].clone()
    };
    pose(&["--pose", "fist", "--for", "hand.ghand", "--out", "mano-names.json"]);
    pose(&["--pose", "mano-names.json", "--for", "renamed.ghand", "--out", "webxr-names.json"]);
    assert_eq!(
        (&names("mano-names.json")[1], &names("webxr-names.json")[1]),
        (&"index1".into(), &"index-finger-phalanx-proximal".into())
    );
    let small = ProceduralHand { detail: 1, ..Default::default() }.build().unwrap();
    let fist = pose_hand(&small.without_blend_shapes(), &[], &named_pose("fist", &small).unwrap()).unwrap().vertices;
    // Both files give the same fist with both avatars.
    for avatar in ["hand.ghand", "renamed.ghand"] {
        for file in ["mano-names.json", "webxr-names.json"] {
            pose(&["--hand-model", avatar, "--pose", file, "--out", "mesh.obj"]);
            assert_near(&vertices(&folder.path().join("mesh.obj")), &fist);
        }
    }
    // So do poses that ghand wrote for the finer procedural hand, except for the last bones: they point to the end of the
    // skin, which is some millimetres off in a coarse mesh.
    let fine = rigged_glb(&ProceduralHand::default().build().unwrap()).unwrap();
    std::fs::write(folder.path().join("fine.glb"), fine).unwrap();
    pose(&["--hand-model", "fine.glb", "--pose", "fist", "--out", "large.json"]);
    pose(&["--hand-model", "renamed.ghand", "--pose", "large.json", "--out", "mesh.obj"]);
    let off =
        vertices(&folder.path().join("mesh.obj")).iter().zip(&fist).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max);
    assert!(off < 8e-3, "{off} m");
    let from_avatar =
        ["--pose", "large.json", "--pose-model", "hand.ghand", "--for", "renamed.ghand", "--out", "mesh.obj"];
    pose(&from_avatar);
    let both = ["pose", "--hand-model", "hand.ghand", "--left-shapes-as-published", "--out", "mesh.obj"];
    assert_one_sentence(&run(GHAND, folder.path(), &both), &["--left-shapes-as-published", "is an avatar"]);
    std::fs::write(folder.path().join("cut.ghand"), b"").unwrap();
    let cut = run(GHAND, folder.path(), &["pose", "--hand-model", "cut.ghand", "--out", "mesh.obj"]);
    assert_one_sentence(&cut, &["cut.ghand", "is not an avatar, or is truncated"]);
}

#[test]
fn a_posed_hand_is_written_as_gltf_too() {
    let folder = tempfile::tempdir().unwrap();
    let output = run(GHAND, folder.path(), &["pose", "--pose", "fist", "--out", "fist.glb"]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let bytes = std::fs::read(folder.path().join("fist.glb")).unwrap();
    assert!(bytes.starts_with(b"glTF") && bytes.len() > 100_000);
}

/// Fraction of the pixels that differ from white.
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
        ["solid", "wireframe", "solid-wireframe", "weights", "weights=index-finger-phalanx-proximal", "weights=6"]
            .map(|style| draw(&[&size[..], &["--style", style]].concat()));
    for picture in [&solid, &wireframe, &both, &weights, &joint] {
        assert_eq!(picture.dimensions(), (160, 240));
        assert!((0.2..0.8).contains(&coverage(picture)), "{}", coverage(picture));
    }
    assert_eq!(joint, number);
    // There is white between lines; weights are more colourful than skin; with one joint most of the hand is grey.
    let mean = |p: &RgbImage| p.pixels().map(|p| f64::from(p.0[0])).sum::<f64>() / f64::from(p.width() * p.height());
    assert!(mean(&both) < mean(&wireframe) && mean(&both) < mean(&solid));
    assert!(colors(&weights) > 2 * colors(&wireframe));
    let grey = |p: &RgbImage| p.pixels().filter(|p| p.0[0] == p.0[1] && p.0[1] == p.0[2] && p.0[0] < 255).count();
    assert!(grey(&joint) > 5000 && grey(&weights) < 500, "{} {}", grey(&joint), grey(&weights));
    assert_eq!(solid, draw(&size), "solid is the default");
    // A given camera, another background, and the mesh in addition to the picture.
    let camera = r#"{"id":"c","width":96,"height":64,"intrinsics":[[120,0,48],[0,120,32],[0,0,1]],
        "rotation":[[0,0,1],[0,1,0],[-1,0,0]],"translation":[0,0.1,0.6]}"#;
    std::fs::write(folder.path().join("camera.json"), camera).unwrap();
    let seen = draw(&["--camera", "camera.json", "--background", "1,0,0", "--out", "mesh.obj"]);
    assert_eq!((seen.dimensions(), seen.get_pixel(0, 0).0), ((96, 64), [255, 0, 0]));
    assert!(!vertices(&folder.path().join("mesh.obj")).is_empty());
}

#[test]
fn a_rigged_hand_is_exported_and_read_back() {
    let folder = tempfile::tempdir().unwrap();
    let export = |arguments: &[&str]| run(GHAND, folder.path(), &[&["export"], arguments].concat());
    let said = |arguments: &[&str]| {
        let output = export(arguments);
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8_lossy(&output.stdout).into_owned()
    };
    assert!(said(&["builtin", "--out", "hand.glb"]).contains("25 joints, 10 shapes, 216 pose directions"));
    let read = read_gltf(&folder.path().join("hand.glb"), None).unwrap().model;
    let built_in = builtin_hand(Side::Right).unwrap();
    assert_eq!((read.vertices, read.shape_names), (built_in.vertices, built_in.shape_names));
    // An avatar has no correctives any more; its template is given new ones.
    save_avatar(folder.path());
    assert!(said(&["hand.ghand", "--out", "plain.glb"]).contains(" 0 pose directions"));
    assert!(said(&["hand.ghand", "--out", "fitted.GLB", "--fit-pose-correctives"]).contains(" 135 pose directions"));
    for (arguments, expected) in [
        (&["builtin"][..], "--out"),
        (&["builtin", "--out", "hand.obj"], "hand.obj: must end in one of .glb"),
        (&["builtin", "--out", "hand.ply", "--fit-pose-correctives"], "--fit-pose-correctives: means nothing for .ply"),
        (&["builtin", "--out", "other.glb", "--pose", "fist"], "--pose"),
        (&["absent.glb", "--out", "other.glb"], "absent.glb"),
        (&["builtin", "--out", "hand.glb/other.glb"], "hand.glb/other.glb"),
    ] {
        assert_one_sentence(&export(arguments), &[expected]);
    }
    let tiny = tiny_mano().display().to_string();
    let unknown = export(&[&tiny, "--out", "tiny.glb", "--fit-pose-correctives"]);
    let told = String::from_utf8_lossy(&unknown.stderr);
    assert!(
        told.contains("error: --fit-pose-correctives: ")
            && told.contains("protocol2.pkl: the joints' names do not tell"),
        "{told}"
    );
    assert!(!folder.path().join("tiny.glb").exists() && !folder.path().join("other.glb").exists());
}

#[test]
fn a_failed_pose_command_is_one_sentence_and_leaves_no_file() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("not.pkl"), "plain text").unwrap();
    std::fs::write(folder.path().join("long.json"), r#"{"frames":[{"pose":[[0,0,0]]}]}"#).unwrap();
    let shape = serde_json::json!({"frames": [{"pose": vec![[0.0; 3]; 25], "shape": vec![0.0; 99]}]});
    std::fs::write(folder.path().join("shape.json"), shape.to_string()).unwrap();
    for (arguments, expected) in [
        (&["--out", "mesh.stl"][..], "mesh.stl"),
        (&["--out", "mesh.obj", "--hand-model", "absent.pkl"], "absent.pkl"),
        (&["--out", "mesh.obj", "--hand-model", "not.pkl"], "not.pkl"),
        (&["--out", "mesh.obj", "--pose", "long.json"], "1 rows"),
        (&["--out", "mesh.obj", "--pose", "shape.json"], "99 numbers"),
        (&["--out", "mesh.obj", "--pose", "shape.json", "--frame", "7"], "\"7\""),
        (&["--out", "mesh.obj", "--frame", "7"], "--pose"),
        (
            &["--out", "mesh.obj", "--shape", "hand-sise=1"],
            "--shape: built-in right hand: shape: \"hand-sise\" is unknown",
        ),
        (&["--out", "mesh.obj", "--picture", "a.jpg"], "a.jpg: must end in .png"),
        (&["--out", "mesh.obj", "--picture", "a.png", "--style", "pretty"], "solid-wireframe"),
        (&["--out", "mesh.obj", "--picture", "a.png", "--style", "weights=elbow"], "thumb-tip"),
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
fn inspect_describes_a_model_and_its_oddities() {
    let folder = tempfile::tempdir().unwrap();
    let told = |arguments: &[&str]| {
        let output = run(GHAND, folder.path(), &[&["inspect"], arguments].concat());
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8_lossy(&output.stdout).into_owned()
    };
    let built_in = told(&[]);
    for expected in ["right", "joints       25", "thumb-tip", "closed", "at 512", "warnings     none"] {
        assert!(built_in.contains(expected), "no {expected:?} in {built_in}");
    }
    assert!(told(&["builtin-left"]).contains("left"));
    let mano = told(&[&tiny_mano().display().to_string()]);
    for expected in ["MANO model", "joints       2", "the shaped vertices", "warning      is 15.0000 m long"] {
        assert!(mano.contains(expected), "no {expected:?} in {mano}");
    }
    assert_one_sentence(&run(GHAND, folder.path(), &["inspect", "absent.glb"]), &["absent.glb"]);
}

#[test]
fn every_program_that_opens_a_hand_warns_as_inspect_does() {
    let folder = tempfile::tempdir().unwrap();
    let mut wrong_unit = builtin_hand(Side::Right).unwrap().without_blend_shapes();
    wrong_unit.vertices.iter_mut().chain(&mut wrong_unit.joints).for_each(|point| *point *= 100.0);
    let mut misnamed = ProceduralHand { detail: 1, ..Default::default() }.build().unwrap().without_blend_shapes();
    misnamed.joint_names.iter_mut().for_each(|name| *name = name.replace("ring", "spring"));
    for (name, model, expected) in [
        ("unit.glb", wrong_unit, "is 22.7844 m long"),
        (
            "names.glb",
            misnamed,
            "do not tell ring 1, ring 2, ring 3, counted from the palm (joints without a part: spring1",
        ),
    ] {
        std::fs::write(folder.path().join(name), rigged_glb(&model).unwrap()).unwrap();
        let told = |arguments: &[&str]| {
            let output = run(GHAND, folder.path(), arguments);
            assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
            [output.stdout, output.stderr].map(|text| String::from_utf8_lossy(&text).into_owned()).concat()
        };
        for arguments in [
            &["inspect", name][..],
            &["pose", "--hand-model", name, "--out", "mesh.obj"],
            &["export", name, "--out", "again.glb"],
        ] {
            assert!(told(arguments).contains(expected), "{arguments:?}: {}", told(arguments));
        }
    }
    let fist = ["pose", "--hand-model", "names.glb", "--pose", "fist", "--out", "fist.obj"];
    let refused = run(GHAND, folder.path(), &fist);
    let told = String::from_utf8_lossy(&refused.stderr);
    assert!(!refused.status.success() && told.contains("error: names.glb: pose \"fist\" needs"), "{told}");
    assert!(told.contains("joints without a part: spring1, spring2, spring3"), "{told}");
}

#[test]
fn inspect_lists_the_part_of_each_joint() {
    let folder = tempfile::tempdir().unwrap();
    let model = ProceduralHand { detail: 1, ..Default::default() }.build().unwrap();
    std::fs::write(folder.path().join("hand.glb"), rigged_glb(&model).unwrap()).unwrap();
    let output = run(GHAND, folder.path(), &["inspect", "hand.glb"]);
    let told = String::from_utf8_lossy(&output.stdout);
    for (joint, part) in [("wrist", "wrist"), ("thumb1", "thumb 1"), ("pinky3", "little 3")] {
        let line = told.lines().find(|line| line.contains(&format!(" {joint}  ("))).unwrap();
        assert!(line.ends_with(&format!(")  {part}")), "{line}");
    }
}

#[test]
fn inspect_describes_an_avatar() {
    let folder = tempfile::tempdir().unwrap();
    let path = save_renamed_avatar(folder.path());
    save_avatar(folder.path());
    // With any file name.
    std::fs::copy(&path, folder.path().join("avatar.bin")).unwrap();
    let told = |path: &str| {
        let output = run(GHAND, folder.path(), &["inspect", path]);
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8_lossy(&output.stdout).into_owned()
    };
    let avatar = Avatar::load(&path).unwrap();
    let bytes = std::fs::metadata(&path).unwrap().len();
    for expected in [
        format!("renamed.ghand: avatar of {}, right", avatar.template.name),
        format!("file         {bytes} bytes"),
        format!("Gaussians    {}, ", avatar.template.len()),
        "extents      (".into(),
        "shape bases  8".into(),
        "4 components".into(),
        "joints       16".into(),
        "index-finger-phalanx-distal".into(),
        format!("mesh         {} vertices", avatar.model.vertices.len()),
        "uv_resolution 64".into(),
        "capture rig".into(),
        "iterations 12".into(),
        "seed 7".into(),
    ] {
        assert!(told("renamed.ghand").contains(&expected), "no {expected:?} in {}", told("renamed.ghand"));
    }
    assert_eq!(told("avatar.bin").replace("avatar.bin", "renamed.ghand"), told("renamed.ghand"));
    assert!(told("hand.ghand").contains("trained      not yet"));
    let wrong = run(GHAND, folder.path(), &["inspect", "renamed.ghand", "--hand-model", "hand.ghand"]);
    assert_one_sentence(&wrong, &["captures only", "--hand-model"]);
}

#[test]
fn inspect_describes_a_scene_and_counts_numbers_that_are_not_finite() {
    let folder = tempfile::tempdir().unwrap();
    let names = "x y z scale_0 scale_1 scale_2 rot_0 rot_1 rot_2 rot_3 opacity f_dc_0 f_dc_1 f_dc_2";
    let properties: String = names.split(' ').map(|name| format!("property float {name}\n")).collect();
    let header = format!("ply\nformat ascii 1.0\nelement vertex 3\n{properties}end_header\n");
    let good = "0 0 0 -2 -2 -2 1 0 0 0 0 0 0 0\n1 2 -3 0 0 0 1 0 0 0 20 0 0 0\n0.5 0 0 -4 -4 -4 0 1 0 0 -20 0 0 0\n";
    let told = |name: &str, rows: &str| {
        std::fs::write(folder.path().join(name), format!("{header}{rows}")).unwrap();
        let output = run(GHAND, folder.path(), &["inspect", name]);
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8_lossy(&output.stdout).into_owned()
    };
    let text = told("scene.ply", good);
    for expected in [
        "scene.ply: scene of Gaussians",
        " bytes (",
        "Gaussians    3",
        "degree 0",
        "(0.0000, 0.0000, -3.0000) to (1.0000, 2.0000, 0.0000)",
        "1.832e-2 to 1.000e0, half of them below 1.353e-1",
        "opacities    0.0000 to 1.0000, half of them below 0.5000",
        "warnings     none",
    ] {
        assert!(text.contains(expected), "no {expected:?} in {text}");
    }
    let odd =
        "nan 0 0 -2 -2 -2 1 0 0 0 inf 0 0 0\n1 2 -3 0 0 0 0 0 0 0 20 0 0 0\n0.5 0 0 -4 -4 -4 0 1 0 0 -20 0 nan 0\n";
    let text = told("odd.ply", odd);
    for expected in
        ["3 numbers are not finite, in x, opacity, f_dc_1", "1 quaternions are all zeros", "(0.5000, 0.0000, -3.0000)"]
    {
        assert!(text.contains(expected), "no {expected:?} in {text}");
    }
    let model = run(GHAND, folder.path(), &["pose", "--hand-model", "scene.ply", "--out", "mesh.obj"]);
    assert_one_sentence(&model, &["scene.ply", "not a hand model", ".ghand"]);
}

#[test]
fn a_closed_pipe_is_not_an_error() {
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
