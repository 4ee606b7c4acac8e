use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use ghand_core::{Camera, HandModel, Pose, Side};
use ghand_files::atomic_file::write_atomically;
use ghand_hand_model::files::gltf::read_gltf_bytes;
use ghand_test_support::procedural_hand::ProceduralHand;
use ghand_test_support::{rigged_glb, shared};
use glam::{DMat3, DVec3};
use serde_json::{Value, json};

use crate::capture::{Capture, Frame, HandModelSource, ImagePaths, Split, mean_shaped};
use crate::mask::{MadeMasks, MaskMethod};

fn hand() -> HandModel {
    ProceduralHand { detail: 1, ..Default::default() }.build().unwrap()
}

/// The file of that hand.
static HAND_FILE: LazyLock<Vec<u8>> = LazyLock::new(|| rigged_glb(&hand()).unwrap());

/// A small valid capture in its own folder, with images of 4 x 3 pixels.
pub(super) fn sample(root: &Path) -> Capture {
    // Built once, because it would take most of the time of many small tests.
    static HAND_MODEL: LazyLock<HandModel> = LazyLock::new(|| read_gltf_bytes("hand.glb", &HAND_FILE).unwrap().model);
    let file = root.join("hand.glb");
    write_atomically(&file, &HAND_FILE).unwrap();
    let hand_model = HandModel { name: file.display().to_string(), ..HAND_MODEL.clone() };
    let joints = hand_model.joint_count();
    let camera = |i: usize| {
        let eye = DVec3::new(0.3, 0.2 + i as f64, 0.5);
        Camera { id: format!("cam{i}"), ..Camera::look_at(eye, DVec3::ZERO, DVec3::Y, 0.5, 4, 3) }
    };
    let frame = |i: usize| {
        let rotations = (0..joints).map(|k| DVec3::new(0.1 * k as f64, 0.01 * i as f64, -0.3)).collect();
        let pose = Pose { rotations, translation: DVec3::new(0.01, 0.02, i as f64 / 3.0) };
        Frame { id: format!("{i:04}"), pose, shape: vec![0.5, -1.0] }
    };
    let frames: Vec<Frame> = (0..2).map(frame).collect();
    Capture {
        root: root.into(),
        side: Side::Right,
        background: [0.0, 0.5, 1.0],
        template: mean_shaped(&hand_model, &frames).unwrap(),
        hand_model,
        hand_model_source: HandModelSource::Gltf { path: "hand.glb".into() },
        cameras: (0..3).map(camera).collect(),
        distortion: vec![],
        color_correction: Default::default(),
        frames,
        images: ImagePaths::plain("images/{camera}/{frame}.png", Some("masks/{camera}/{frame}.png")),
        splits: [
            ("train".to_owned(), Split::product(vec![0, 2], vec![0])),
            ("test".to_owned(), Split::product(vec![1], vec![1])),
        ]
        .into(),
        truth: Some(vec![None, Some(Pose::rest(joints))]),
    }
}

pub(super) fn write_image(path: &Path, bytes: &[u8], width: u32, height: u32, color: image::ExtendedColorType) {
    std::fs::create_dir_all(path.parent().unwrap()).unwrap();
    image::save_buffer(path, bytes, width, height, color).unwrap();
}

pub(super) fn read_json(path: &Path) -> Value {
    serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap()
}

/// The message of opening the sample after a change of its `capture.json`.
pub(super) fn message_after(change: impl FnOnce(&mut Value)) -> String {
    let folder = tempfile::tempdir().unwrap();
    sample(folder.path()).save().unwrap();
    let file = folder.path().join("capture.json");
    let mut value = read_json(&file);
    change(&mut value);
    write_atomically(&file, &serde_json::to_vec(&value).unwrap()).unwrap();
    let message = Capture::open(folder.path()).unwrap_err().to_string();
    assert!(message.contains("capture.json"), "{message:?} names the file");
    message
}

pub(super) fn assert_contains(message: &str, parts: &[&str]) {
    for part in parts {
        assert!(message.contains(part), "{message:?} should contain {part:?}");
    }
}

/// The largest difference of any entry; NaN if an entry is NaN.
fn apart(a: DMat3, b: DMat3) -> f64 {
    (a - b).to_cols_array().iter().map(|e| e.abs()).fold(0.0, larger)
}

/// The larger of two numbers, or NaN if one of them is.
fn larger(a: f64, b: f64) -> f64 {
    if a.is_nan() || b.is_nan() { f64::NAN } else { a.max(b) }
}

#[test]
fn the_largest_difference_covers_every_entry_and_keeps_nan() {
    let mut other = DMat3::IDENTITY;
    other.y_axis.x = -0.5;
    assert_eq!(apart(other, DMat3::IDENTITY), 0.5);
    other.x_axis.x = f64::NAN;
    assert!(apart(other, DMat3::IDENTITY).is_nan());
}

#[test]
fn what_is_written_is_read_back_exactly() {
    let folder = tempfile::tempdir().unwrap();
    let capture = sample(folder.path());
    capture.save().unwrap();
    let read = Capture::open(folder.path()).unwrap();
    // Rotations are made orthonormal again, which may move their last bit.
    for (a, b) in read.cameras.iter().zip(&capture.cameras) {
        let error = apart(a.rotation, b.rotation);
        assert!(error <= 4.0 * f64::EPSILON, "{error}");
    }
    let cameras = capture.cameras.clone();
    assert!(Capture { cameras: cameras.clone(), ..read } == capture);
    let by_file = Capture::open(&folder.path().join("capture.json")).unwrap();
    assert!(Capture { cameras, ..by_file } == capture);
}

#[test]
fn poses_are_reordered_to_the_order_of_the_model() {
    let folder = tempfile::tempdir().unwrap();
    let capture = sample(folder.path());
    capture.save().unwrap();
    for name in ["capture.json", "truth.json"] {
        let file = folder.path().join(name);
        let mut value = read_json(&file);
        for frame in value["frames"].as_array_mut().unwrap() {
            frame["pose"].as_array_mut().unwrap().reverse();
        }
        if name == "capture.json" {
            let last = value["hand_model"]["joints"].as_array().unwrap().len() as i64 - 1;
            value["hand_model"]["joints"].as_array_mut().unwrap().reverse();
            let parents = value["hand_model"]["parents"].as_array_mut().unwrap();
            parents.reverse();
            for parent in parents {
                let index = parent.as_i64().unwrap();
                *parent = json!(if index < 0 { -1 } else { last - index });
            }
        }
        write_atomically(&file, &serde_json::to_vec(&value).unwrap()).unwrap();
    }
    let read = Capture::open(folder.path()).unwrap();
    assert_eq!((read.frames, read.truth), (capture.frames, capture.truth));
}

#[test]
fn a_file_that_is_missing_or_not_json_is_named() {
    let folder = tempfile::tempdir().unwrap();
    assert_contains(&Capture::open(folder.path()).unwrap_err().to_string(), &["capture.json", "give the folder"]);
    let file = folder.path().join("capture.json");
    std::fs::write(&file, "{\"format\": \"ghand-capture\", ").unwrap();
    assert_contains(&Capture::open(&file).unwrap_err().to_string(), &["capture.json", "line 1"]);
    std::fs::write(&file, [0xFF, 0xFE, 0x00]).unwrap();
    assert_contains(&Capture::open(&file).unwrap_err().to_string(), &["capture.json", "UTF-8"]);
}

#[test]
fn each_unusable_field_is_named_with_what_to_do() {
    type Change = fn(&mut Value);
    let cases: [(Change, &[&str]); 37] = [
        (|v| v["format"] = json!("other"), &["format", "ghand-capture"]),
        (|v| drop(v.as_object_mut().unwrap().remove("format")), &["format", "nothing"]),
        (|v| v["version"] = json!(2), &["version", "is 2", "newer program"]),
        (|v| drop(v.as_object_mut().unwrap().remove("version")), &["version", "missing"]),
        (|v| v["units"] = json!("millimetre"), &["units", "metre"]),
        (|v| v["side"] = json!("middle"), &["side", "right"]),
        (|v| v["side"] = json!("left"), &["hand_model", "right hand", "left"]),
        (|v| v["background"] = json!([0, 255, 0]), &["background", "0 to 1"]),
        (|v| drop(v.as_object_mut().unwrap().remove("cameras")), &["the field `cameras` is missing"]),
        (|v| v["cameras"][0]["width"] = json!("wide"), &["cameras[0].width", "the text \"wide\"", "line"]),
        (|v| v["cameras"][0]["width"] = json!(0), &["cameras[\"cam0\"].width", "is 0"]),
        (|v| v["cameras"][1]["id"] = json!("cam0"), &["cameras", "\"cam0\" occurs twice"]),
        (|v| v["cameras"][1]["id"] = json!("../x"), &["cameras", "\"../x\"", "path"]),
        (|v| v["cameras"][0]["intrinsics"][0][0] = json!(0.0), &["cameras[\"cam0\"].intrinsics", "singular"]),
        (|v| v["cameras"][0]["intrinsics"][0][1] = json!(0.3), &["intrinsics", "skew"]),
        (|v| v["cameras"][0]["rotation"][0][0] = json!(3.0), &["cameras[\"cam0\"].rotation", "is not a rotation"]),
        (
            |v| v["cameras"][0]["rotation"] = json!([[-1, 0, 0], [0, 1, 0], [0, 0, 1]]),
            &["rotation", "determinant -1.000"],
        ),
        (|v| v["cameras"][0]["translation"] = json!([0, null, 0]), &["null", "line"]),
        (|v| v["frames"][1]["id"] = json!("0000"), &["frames", "\"0000\" occurs twice"]),
        (
            |v| drop(v["frames"][1]["pose"].as_array_mut().unwrap().pop()),
            &["frames[\"0001\"].pose", "15 rows, expected 16"],
        ),
        (|v| v["frames"][1]["pose"][3] = json!([0.0, 1.0]), &["frames[\"0001\"].pose", "row 3", "expected 3"]),
        (|v| v["frames"][1]["shape"] = json!([1.0]), &["frames[\"0001\"].shape", "1 numbers"]),
        (|v| v["splits"]["test"]["cameras"] = json!(["cam9"]), &["splits[\"test\"].cameras", "\"cam9\""]),
        (|v| v["splits"]["test"]["frames"] = json!(["nine"]), &["splits[\"test\"].frames", "\"nine\""]),
        (|v| v["splits"]["test"]["frames"] = json!(["0000", "0000"]), &["splits[\"test\"].frames", "twice"]),
        (|v| v["hand_model"] = json!({"kind": "mano"}), &["hand_model.kind", "MANO_RIGHT.pkl", "--hand-model"]),
        (|v| v["hand_model"] = json!({"kind": "foot"}), &["hand_model.kind", "\"foot\"", "builtin"]),
        (|v| v["hand_model"]["joints"][3] = json!("tail"), &["hand_model.joints", "\"tail\"", "is not a joint"]),
        (
            |v| {
                v["hand_model"]["joints"].as_array_mut().unwrap().pop();
                v["hand_model"]["parents"].as_array_mut().unwrap().pop();
            },
            &["hand_model.joints", "thumb3", "not listed"],
        ),
        (|v| v["hand_model"]["parents"][3] = json!(0), &["hand_model.parents", "index3", "has the parent wrist"]),
        (|v| v["hand_model"]["parents"][3] = json!(99), &["hand_model.parents", "99"]),
        (|v| v["hand_model"] = json!({"kind": "gltf"}), &["hand_model.path", "missing"]),
        (
            |v| v["hand_model"] = json!({"kind": "gltf", "path": "../hand.glb"}),
            &["hand_model.path", "leaves the capture's folder"],
        ),
        (|v| v["hand_model"]["path"] = json!("other.glb"), &["hand_model", "other.glb"]),
        (|v| v["image_path"] = json!("/etc/{camera}/{frame}"), &["image_path", "leaves the capture's folder"]),
        (|v| v["mask_path"] = json!("masks/{camera}.png"), &["mask_path", "does not contain {frame}"]),
        (|v| v["masks"] = json!("masks/{camera}/{frame}.png"), &["masks", "must be \"made\"", "mask_path"]),
    ];
    for (change, parts) in cases {
        assert_contains(&message_after(change), parts);
    }
}

#[test]
fn oddities_of_a_captures_own_hand_model_are_told() {
    let right = hand();
    let mut in_centimetres = right.clone();
    in_centimetres.vertices.iter_mut().chain(&mut in_centimetres.joints).for_each(|point| *point *= 100.0);
    for (model, expected) in [
        (right.mirrored(), "is a left hand but side says right"),
        (in_centimetres, "m long, which is not the size of a hand"),
    ] {
        let folder = tempfile::tempdir().unwrap();
        sample(folder.path()).save().unwrap();
        std::fs::write(folder.path().join("hand.glb"), rigged_glb(&model).unwrap()).unwrap();
        let opened = Capture::open_with(folder.path(), &Default::default());
        let told = opened.map_or_else(|error| error.to_string(), |opened| opened.warnings.join("; "));
        assert!(told.contains(expected), "{told}");
    }
}

#[test]
fn masks_are_made_if_the_file_says_so_or_the_images_have_neither_mask_nor_alpha() {
    let method = |capture: &Capture| capture.images.made_masks.as_ref().map(|made| made.method);
    for (color, channels, says_made, expected) in [
        (image::ExtendedColorType::Rgb8, 3, false, Some(MaskMethod::Colors)),
        (image::ExtendedColorType::Rgba8, 4, false, None),
        (image::ExtendedColorType::Rgba8, 4, true, Some(MaskMethod::Colors)),
    ] {
        let folder = tempfile::tempdir().unwrap();
        let mut capture = sample(folder.path());
        assert_eq!(method(&capture), None);
        capture.images.mask = None;
        if says_made {
            capture.images.made_masks = Some(MadeMasks::new(MaskMethod::Colors, folder.path().into(), PathBuf::new()));
        }
        capture.save().unwrap();
        // The first view of the first split by name.
        write_image(&folder.path().join("images/cam1/0001.png"), &vec![9; 12 * channels], 4, 3, color);
        let opened = Capture::open(folder.path()).unwrap();
        assert_eq!(method(&opened), expected);
        assert!(says_made == (read_json(&folder.path().join("capture.json"))["masks"] == "made"));
        // Nothing is written before a mask is needed.
        assert!(!folder.path().join("ghand-masks").exists());
    }
}

#[test]
fn paths_that_leave_the_folder_are_rejected_on_any_system() {
    for path in ["..", "a/../../b", "/a", "C:\\a", "a\\..\\b", "", "C:a"] {
        let path = format!("{path}{}", if path.is_empty() { "" } else { "/{camera}/{frame}" });
        assert_contains(
            &message_after(|v| v["image_path"] = json!(path)),
            &["image_path", "leaves the capture's folder"],
        );
    }
}

#[test]
fn numbers_that_are_not_finite_are_rejected() {
    // JSON has no such numbers; overflowing numbers or text such as NaN must not become one.
    for number in ["1e999", "NaN", "Infinity"] {
        let folder = tempfile::tempdir().unwrap();
        sample(folder.path()).save().unwrap();
        let file = folder.path().join("capture.json");
        let text = std::fs::read_to_string(&file).unwrap().replacen("0.3333333333333333", number, 1);
        std::fs::write(&file, text).unwrap();
        assert_contains(&Capture::open(&file).unwrap_err().to_string(), &["capture.json", "line 1"]);
    }
}

#[test]
fn rounded_rotations_are_made_orthonormal() {
    let folder = tempfile::tempdir().unwrap();
    let mut capture = sample(folder.path());
    let rounded = |v: f64| (v * 1e4).round() / 1e4;
    capture.cameras[0].rotation = DMat3::from_cols_array(&capture.cameras[0].rotation.to_cols_array().map(rounded));
    capture.save().unwrap();
    let read = Capture::open(folder.path()).unwrap().cameras[0].rotation;
    assert!(apart(read * read.transpose(), DMat3::IDENTITY) < 1e-15);
    assert!(apart(read, capture.cameras[0].rotation) < 1e-4);
}

#[test]
fn a_truth_that_does_not_match_is_named() {
    let folder = tempfile::tempdir().unwrap();
    sample(folder.path()).save().unwrap();
    let file = folder.path().join("truth.json");
    let mut value = read_json(&file);
    value["frames"][0]["id"] = json!("0007");
    std::fs::write(&file, value.to_string()).unwrap();
    assert_contains(&Capture::open(folder.path()).unwrap_err().to_string(), &["truth.json", "\"0007\""]);
    std::fs::write(&file, "[]").unwrap();
    assert_contains(&Capture::open(folder.path()).unwrap_err().to_string(), &["truth.json"]);
    std::fs::remove_file(&file).unwrap();
    assert_eq!(Capture::open(folder.path()).unwrap().truth, None);
}

#[test]
fn an_unknown_split_lists_the_existing_ones() {
    let folder = tempfile::tempdir().unwrap();
    assert_contains(
        &sample(folder.path()).split("validation").unwrap_err().to_string(),
        &["validation", "test, train"],
    );
}

#[test]
fn views_keep_the_image_and_threshold_the_mask_at_128() {
    let folder = tempfile::tempdir().unwrap();
    let mut capture = sample(folder.path());
    let colors: Vec<u8> = (0..36).map(|i| i * 7).collect();
    write_image(&folder.path().join("images/cam0/0000.png"), &colors, 4, 3, image::ExtendedColorType::Rgb8);
    let mask = [0, 1, 127, 128, 129, 255, 0, 0, 0, 0, 0, 0];
    write_image(&folder.path().join("masks/cam0/0000.png"), &mask, 4, 3, image::ExtendedColorType::L8);
    let view = capture.load_view(0, 0).unwrap();
    assert_eq!((view.width, view.height), (4, 3));
    for (i, pixel) in view.rgba.iter().enumerate() {
        assert_eq!(pixel[..3], colors[3 * i..3 * i + 3]);
        assert_eq!(pixel[3], if (3..6).contains(&i) { 255 } else { 0 });
    }
    capture.images.mask = None;
    assert!(capture.load_view(0, 0).unwrap().rgba.iter().all(|p| p[3] == 255), "without a mask everything is hand");
}

#[test]
fn an_alpha_channel_is_the_mask_and_is_composited_over_the_background() {
    let folder = tempfile::tempdir().unwrap();
    let mut capture = sample(folder.path());
    capture.images.mask = None;
    let mut pixels = [[200, 100, 40, 255]; 12];
    pixels[1] = [200, 100, 40, 0];
    pixels[2] = [200, 100, 40, 51];
    let file = folder.path().join("images/cam0/0000.png");
    write_image(&file, pixels.as_flattened(), 4, 3, image::ExtendedColorType::Rgba8);
    let view = capture.load_view(0, 0).unwrap();
    assert_eq!(view.rgba[0], [200, 100, 40, 255]);
    // The background is (0, 0.5, 1), of which 0.5 x 255 = 127.5 rounds up.
    assert_eq!(view.rgba[1], [0, 128, 255, 0]);
    // A fifth of the colour: 40, 0.2 x 100 + 0.8 x 127.5 = 122, 0.2 x 40 + 0.8 x 255 = 212.
    assert_eq!(view.rgba[2], [40, 122, 212, 0]);
}

#[test]
fn images_that_are_missing_broken_or_of_another_size_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let capture = sample(folder.path());
    let message = |camera, frame| capture.load_view(camera, frame).unwrap_err().to_string();
    assert_contains(&message(0, 0), &["0000.png", "read the image", "splits"]);
    let image = folder.path().join("images/cam0/0000.png");
    write_image(&image, &[0; 36], 3, 4, image::ExtendedColorType::Rgb8);
    assert_contains(&message(0, 0), &["0000.png", "3 x 4", "4 x 3"]);
    write_image(&image, &[0; 36], 4, 3, image::ExtendedColorType::Rgb8);
    assert_contains(&message(0, 0), &["masks", "read the mask"]);
    let mask: PathBuf = folder.path().join("masks/cam0/0000.png");
    write_image(&mask, &[0; 11], 11, 1, image::ExtendedColorType::L8);
    assert_contains(&message(0, 0), &["masks", "mask", "11 x 1"]);
    std::fs::write(&mask, &std::fs::read(&image).unwrap()[..40]).unwrap();
    assert_contains(&message(0, 0), &["masks", "replace the file"]);
    assert_contains(&message(9, 0), &["cameras", "number 9"]);
    assert_contains(&message(0, 9), &["frames", "number 9"]);
}

#[test]
fn the_path_traced_capture_is_read_completely() {
    let Some(folder) = shared("captures/blender-a") else { return };
    let capture = Capture::open(&folder).unwrap();
    assert_eq!((capture.cameras.len(), capture.frames.len()), (30, 52));
    assert_eq!(capture.hand_model.joint_count(), 25);
    for (name, cameras, frames) in [("train", 20, 40), ("train5", 5, 40), ("test", 10, 12)] {
        let split = capture.split(name).unwrap();
        assert_eq!((split.cameras.len(), split.frames.len()), (cameras, frames), "{name}");
    }
    let truth = capture.truth.as_ref().unwrap();
    for (frame, truth) in capture.frames.iter().zip(truth) {
        let truth = truth.as_ref().unwrap();
        let is_test = frame.id.as_str() >= "0040";
        assert_eq!(*truth == frame.pose, is_test, "frame {}", frame.id);
    }
    let split = capture.split("test").unwrap();
    let view = capture.load_view(split.cameras[0], split.frames[0]).unwrap();
    assert_eq!((view.width, view.height), (334, 512));
    let hand = view.rgba.iter().filter(|p| p[3] == 255).count();
    assert!((10_000..120_000).contains(&hand), "{hand} pixels of hand");

    // The hand is at the place given by its pose and the camera.
    let camera = &capture.cameras[split.cameras[0]];
    let pose = &capture.frames[split.frames[0]].pose;
    let model = &capture.hand_model;
    let chain = ghand_core::skeleton::pose_skeleton(&model.parents, &model.joints, &pose.rotations);
    let inside = (chain.world.iter())
        .filter(|joint| {
            let (pixel, _) = camera.project(joint.translation + pose.translation);
            view.rgba[pixel.y as usize * 334 + pixel.x as usize][3] == 255
        })
        .count();
    // Tips are on the skin and may project beside the mask.
    assert!(inside >= 20, "{inside} of 25 joints are seen on the hand");
}
