//! `ghand inspect` on captures, as a user runs it.

use std::path::Path;
use std::process::Output;

use crate::common::{assert_one_sentence, listing, run, run_in};

const GHAND: &str = env!("CARGO_BIN_EXE_ghand");

/// A folder with a copy of the synthetic capture in it, called `rig`.
fn folder_with_capture() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let copied = std::process::Command::new("cp")
        .arg("-r")
        .arg(&crate::fixtures::synthetic().root)
        .arg(folder.path().join("rig"))
        .status()
        .unwrap();
    assert!(copied.success());
    folder
}

/// The stdout of a run that must succeed.
fn said(output: &Output) -> String {
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8_lossy(&output.stdout).into_owned()
}

fn inspect(folder: &Path, arguments: &[&str]) -> Output {
    run(GHAND, folder, &[&["inspect"], arguments].concat())
}

/// Asserts that a text contains all parts.
fn assert_says(text: &str, parts: &[&str]) {
    for part in parts {
        assert!(text.contains(part), "no {part:?} in {text}");
    }
}

#[test]
fn a_capture_is_described_and_its_pictures_are_written() {
    let folder = folder_with_capture();
    let text = said(&inspect(folder.path(), &["rig"]));
    assert_says(&text, &["rig: capture in ghand's own format, right hand", "16 joints", "true poses: all"]);
    assert_says(&text, &["cam00", "128 x 192 pixels: 22 images", "train: 6 cameras x 3 frames: 18 images"]);
    assert_says(&text, &["44, images and masks of 22 views: all present", "test 4 of 4", "train 18 of 18"]);
    assert_says(
        &text,
        &["train: given poses 0.", ", true poses 1.0", "warnings     none", "pictures: out/inspect-rig.png"],
    );
    let rows = text.lines().filter(|line| line.contains("  train  ") || line.contains("  test   ")).count();
    assert_eq!(rows, 12, "one line per view: {text}");
    let sheet = image::open(folder.path().join("out/inspect-rig.png")).unwrap().into_rgb8();
    // Three views side by side, each of three pictures of 160 x 240 pixels, in four rows below the legend.
    assert_eq!(sheet.dimensions(), (3 * (3 * 160 + 2 * 4 + 16) + 16, 16 + 18 + 16 + 4 * (2 * 18 + 240 + 16)));
    // The poses are noisy: the template extends beyond the mask in some places and misses it in others.
    let count = |is: fn([u32; 3]) -> bool| sheet.pixels().filter(|p| is(p.0.map(u32::from))).count();
    let red = count(|[r, g, b]| r > 100 && r > 2 * g.max(b));
    let blue = count(|[r, _, b]| b > 100 && b > 2 * r);
    assert!(red > 1000 && blue > 1000, "{red} red, {blue} blue");
    assert_eq!(listing(folder.path()), ["out", "rig"]);
}

#[test]
fn a_capture_json_is_a_capture_and_its_pictures_go_to_the_requested_file_or_nowhere() {
    let folder = folder_with_capture();
    let text = said(&inspect(folder.path(), &["rig/capture.json", "--sheet", "a.png"]));
    assert_says(&text, &["pictures: a.png"]);
    assert_eq!(listing(folder.path()), ["a.png", "rig"]);
    assert!(!said(&inspect(folder.path(), &["rig", "--no-sheet"])).contains("pictures"));
    assert_eq!(listing(folder.path()), ["a.png", "rig"]);
}

#[test]
fn unusable_files_are_named_and_fail_only_if_no_image_remains() {
    let folder = folder_with_capture();
    let image = |camera: usize, frame| {
        let file = crate::fixtures::synthetic().image_file(camera, frame).unwrap();
        folder.path().join("rig").join(file.strip_prefix(&crate::fixtures::synthetic().root).unwrap())
    };
    let view = crate::fixtures::synthetic().splits["train"].views[0];
    let [missing, cut] =
        [view.camera, crate::fixtures::synthetic().splits["train"].views[1].camera].map(|c| image(c, view.frame));
    std::fs::remove_file(&missing).unwrap();
    let bytes = std::fs::read(&cut).unwrap();
    std::fs::write(&cut, &bytes[..bytes.len() / 2]).unwrap();
    let text = said(&inspect(folder.path(), &["rig", "--no-sheet"]));
    assert_says(&text, &["1 missing, 1 broken", "read the image", "replace the file", "train 16 of 18"]);
    for file in [missing, cut] {
        assert_says(&text, &[&file.strip_prefix(folder.path()).unwrap().display().to_string()]);
    }
    // No image can be used.
    for kind in ["images", "masks"] {
        std::fs::remove_dir_all(folder.path().join("rig").join(kind)).unwrap();
    }
    let output = inspect(folder.path(), &["rig"]);
    assert_one_sentence(&output, &["rig", "no image can be used"]);
    let text = String::from_utf8_lossy(&output.stdout);
    assert_says(&text, &["44 missing, 0 broken", "and 39 more", "train 0 of 18", "no pictures: "]);
    assert_says(&text, &["problem      none of the 22 images can be used"]);
    assert!(!text.contains("warnings"), "{text}");
    assert_eq!(listing(folder.path()), ["rig"]);
}

#[test]
fn causes_of_hopeless_training_are_problems_and_oddities_are_warnings() {
    let folder = folder_with_capture();
    let file = folder.path().join("rig/capture.json");
    let mut json: serde_json::Value = serde_json::from_slice(&std::fs::read(&file).unwrap()).unwrap();
    for camera in json["cameras"].as_array_mut().unwrap() {
        for value in camera["translation"].as_array_mut().unwrap() {
            *value = (value.as_f64().unwrap() * 1000.0).into();
        }
    }
    std::fs::write(&file, json.to_string()).unwrap();
    let output = inspect(folder.path(), &["rig", "--no-sheet"]);
    assert_one_sentence(&output, &["rig: training on it cannot succeed"]);
    assert_says(
        &String::from_utf8_lossy(&output.stdout),
        &["problem      8 of 8 cameras are not between", "problem      the posed template matches the masks"],
    );
    json["mask_path"] = serde_json::Value::Null;
    std::fs::write(&file, json.to_string()).unwrap();
    let output = inspect(folder.path(), &["rig", "--no-sheet"]);
    assert_says(&String::from_utf8_lossy(&output.stdout), &["22 of 22 masks have no file and are made"]);
}

#[test]
fn without_an_adapter_everything_but_the_pictures_is_reported() {
    let folder = folder_with_capture();
    let nowhere = ["VK_DRIVER_FILES", "VK_ICD_FILENAMES"].map(|variable| (variable, "/nonexistent.json"));
    let text = said(&run_in(GHAND, folder.path(), &["inspect", "rig"], &nowhere));
    if text.contains("pictures: ") {
        println!("skipped: this system finds its graphics driver without Vulkan's loader");
        return;
    }
    assert_says(&text, &["train: given poses 0.", "no pictures: no graphics adapter"]);
    let asked = run_in(GHAND, folder.path(), &["inspect", "rig", "--sheet", "sheet.png"], &nowhere);
    assert_one_sentence(&asked, &["no graphics adapter"]);
    let wrong = run(GHAND, folder.path(), &["inspect", "rig", "--adapter", "no such thing"]);
    assert_one_sentence(&wrong, &["no such thing"]);
    assert_eq!(listing(folder.path()), ["rig"]);
}

#[test]
fn data_sets_are_inspected_in_their_own_layouts() {
    let folder = tempfile::tempdir().unwrap();
    let mano = ghand_test_support::mano_files::hands::as_pickle(&crate::fixtures::mano_hand().published());
    std::fs::write(folder.path().join("MANO_RIGHT.pkl"), mano).unwrap();
    crate::interhand_files::right().write(&folder.path().join("InterHand2.6M"));
    crate::hand_appearance_files::write_subject(&folder.path().join("subject_1"), "metro_mano");
    let told = |path| inspect(folder.path(), &[path, "--hand-model", "MANO_RIGHT.pkl", "--no-sheet"]);
    let interhand = said(&told("InterHand2.6M"));
    assert_says(&interhand, &["InterHand2.6M, right hand", "(MANO)", "true poses: none", "test_all:", "made from"]);
    // Its masks are rectangles.
    let subject = String::from_utf8_lossy(&told("subject_1").stdout).into_owned();
    assert_says(&subject, &["Hand Appearance, right hand", "448 x 448", "phone", "matches the masks of"]);
    assert_one_sentence(&inspect(folder.path(), &["InterHand2.6M"]), &["MANO_RIGHT.pkl", "--hand-model"]);
}

#[test]
fn an_unknown_input_or_a_sheet_that_cannot_be_written_is_one_sentence() {
    let folder = folder_with_capture();
    std::fs::create_dir(folder.path().join("empty")).unwrap();
    std::fs::write(folder.path().join("broken.json"), "{").unwrap();
    std::fs::write(folder.path().join("file"), "in the way").unwrap();
    std::fs::create_dir_all(folder.path().join("taken.png/inside")).unwrap();
    let before = listing(folder.path());
    for (arguments, parts) in [
        (&["empty"][..], &["empty"][..]),
        (&["broken.json"], &["broken.json", "line 1"]),
        (&["absent.json"], &["absent.json"]),
        (&["rig", "--sheet", "file/a.png"], &["file", "--sheet"]),
        (&["rig", "--sheet", "taken.png"], &["taken.png"]),
        (&["rig", "--sheet", "a.jpg"], &["a.jpg", ".png"]),
        (&["rig", "--sheet", "a.png", "--no-sheet"], &["--no-sheet"]),
        (&["file", "--hand-model", "file"], &["file", "captures only", "--hand-model"]),
        (&["file", "--no-sheet"], &["captures only", "--no-sheet"]),
        (&["--no-sheet"], &["PATH"]),
        (&["rig", "--principal-point", "1"], &["224,224"]),
    ] {
        assert_one_sentence(&inspect(folder.path(), arguments), parts);
        assert_eq!(listing(folder.path()), before, "{arguments:?}");
        assert_eq!(listing(&folder.path().join("taken.png")), ["inside"]);
    }
}

#[test]
fn a_missing_path_is_reported_as_missing() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["nowhere", "nowhere/hand.glb", "capture.json"] {
        assert_one_sentence(&inspect(folder.path(), &[name]), &[name, "no such file or folder"]);
    }
    assert_eq!(listing(folder.path()), [""; 0]);
}
