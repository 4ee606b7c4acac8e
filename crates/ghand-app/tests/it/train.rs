//! `train` as a user runs it: bad input, and being killed.

use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Command, Stdio};

use crate::common::{
    RESULTS, UNALIGNED, assert_one_sentence, assert_trained, listing, run, small_capture, small_capture_with,
};

const TRAIN: &str = env!("CARGO_BIN_EXE_train");

/// Changes the text of a file.
fn edit(path: &Path, change: impl Fn(&str) -> String) {
    let text = std::fs::read_to_string(path).unwrap();
    let changed = change(&text);
    assert_ne!(text, changed, "nothing to change in {}", path.display());
    std::fs::write(path, changed).unwrap();
}

#[test]
fn bad_input_is_one_sentence_that_names_the_file_and_leaves_no_avatar() {
    let folder = tempfile::tempdir().unwrap();
    let good = folder.path().join("good");
    small_capture(&good);
    let train = |name: &str, more: &[&str], expected: &[&str]| {
        let arguments = [&["--capture", name, "--out", "out", "--set", "iterations=2"], more].concat();
        let output = run(TRAIN, folder.path(), &arguments);
        assert_one_sentence(&output, expected);
        let left = listing(&folder.path().join("out"));
        assert!(left.iter().all(|f| !f.contains("avatar") && !f.starts_with('.')), "{name} left {left:?}");
    };
    std::fs::create_dir(folder.path().join("out")).unwrap();
    std::fs::write(folder.path().join("out/notes.txt"), "of the user").unwrap();
    train("missing", &[], &["missing"]);
    train("good", &["--split", "nonsense"], &["nonsense", "train5"]);
    train("good", &["--set", "nonsense=1"], &["nonsense", "iterations"]);
    train("good", &["--set", "iterations=many"], &["iterations"]);
    train("good", &["--adapter", "no such adapter"], &["no such adapter", "GHAND_ADAPTER"]);

    let copy = |name: &str| {
        let to = folder.path().join(name);
        let status = Command::new("cp").args(["-r"]).arg(&good).arg(&to).status().unwrap();
        assert!(status.success());
        to
    };
    std::fs::write(copy("broken").join("capture.json"), "{\"format\":").unwrap();
    train("broken", &[], &["broken", "capture.json"]);
    edit(&copy("short").join("capture.json"), |t| {
        let mut json: serde_json::Value = serde_json::from_str(t).unwrap();
        json["frames"][0]["pose"].as_array_mut().unwrap().pop();
        json.to_string()
    });
    train("short", &[], &["capture.json", "pose", "25", "24"]);
    let gone = copy("gone");
    std::fs::remove_dir_all(gone.join("images")).unwrap();
    train("gone", &[], &["gone", "no images are left in split \"train\"", "11 without a file", "0000.png"]);
}

/// Changes every mask of a capture.
fn change_masks(capture: &Path, change: impl Fn(u8) -> u8) {
    for camera in listing(&capture.join("masks")) {
        let folder = capture.join("masks").join(camera);
        for name in listing(&folder) {
            let mut mask = image::open(folder.join(&name)).unwrap().into_luma8();
            mask.pixels_mut().for_each(|value| value.0[0] = change(value.0[0]));
            mask.save(folder.join(&name)).unwrap();
        }
    }
}

/// Changes a capture's `capture.json`.
fn change_json(capture: &Path, change: impl Fn(&mut serde_json::Value)) {
    edit(&capture.join("capture.json"), |text| {
        let mut json = serde_json::from_str(text).unwrap();
        change(&mut json);
        json.to_string()
    });
}

#[test]
fn hopeless_training_is_rejected_in_one_sentence_with_the_remedy() {
    let folder = tempfile::tempdir().unwrap();
    let capture = folder.path().join("capture");
    small_capture_with(0, &capture);
    let json = std::fs::read_to_string(capture.join("capture.json")).unwrap();
    let arguments = ["--capture", "capture", "--out", "out", "--set", "uv_resolution=32", "--set", "iterations=2"];
    let refused = |parts: &[&str]| {
        let output = run(TRAIN, folder.path(), &arguments);
        assert_one_sentence(&output, &[&["capture"], parts].concat());
        assert_eq!(listing(folder.path()), ["capture"], "a rejected run leaves its folder");
    };
    let remedy = ["training on the split \"train\" cannot succeed", "ghand inspect", "--ignore-checks"];
    let scaled = |json: &mut serde_json::Value, list: &str, field: &str, factor: f64| {
        for entry in json[list].as_array_mut().unwrap() {
            for value in entry[field].as_array_mut().unwrap() {
                if let Some(number) = value.as_f64() {
                    *value = (number * factor).into();
                } else {
                    value.as_array_mut().unwrap().iter_mut().for_each(|v| *v = (v.as_f64().unwrap() * factor).into());
                }
            }
        }
    };
    change_json(&capture, |json| scaled(json, "cameras", "translation", 1000.0));
    refused(&[&remedy[..], &["not between 0.03 and 20 m", "metre", "(0.00)"]].concat());
    std::fs::write(capture.join("capture.json"), &json).unwrap();
    change_json(&capture, |json| scaled(json, "frames", "pose", 40.0));
    refused(&[&remedy[..], &["longer than a whole turn", "radians"]].concat());
    std::fs::write(capture.join("capture.json"), &json).unwrap();
    change_json(&capture, |json| json["frames"][0]["pose"][1][2] = 1e30.into());
    refused(&["frames[\"0000\"].pose", "joint \"thumb-metacarpal\"", "radians"]);
    std::fs::write(capture.join("capture.json"), json.replace("mask_path", "mask_paht")).unwrap();
    refused(&["mask_paht", "nearest", "\"mask_path\""]);
    std::fs::write(capture.join("capture.json"), &json).unwrap();
    change_masks(&capture, |_| 0);
    refused(&[&remedy[..], &["masks are empty", "128"]].concat());
    // Users can train anyway.
    let forced = run(TRAIN, folder.path(), &[&arguments[..], &["--ignore-checks"]].concat());
    let warned = String::from_utf8_lossy(&forced.stderr);
    assert!(forced.status.success() && warned.contains("masks are empty"), "{warned}");
    assert!(listing(&folder.path().join("out")).contains(&"avatar.ghand".into()));
}

#[test]
fn masks_of_0_and_1_give_the_same_avatar_as_0_and_255_and_one_warning() {
    let folder = tempfile::tempdir().unwrap();
    let capture = folder.path().join("capture");
    small_capture_with(0, &capture);
    let train = |out: &str| {
        let arguments = ["--capture", "capture", "--out", out];
        let output = run(TRAIN, folder.path(), &[&arguments[..], &UNALIGNED].concat());
        let warned = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.success(), "{warned}");
        (std::fs::read(folder.path().join(out).join("avatar.ghand")).unwrap(), warned)
    };
    let (avatar, warned) = train("a");
    assert!(!warned.contains("masks"), "{warned}");
    change_masks(&capture, |value| value / 255);
    let (same, warned) = train("b");
    assert!(avatar == same, "another avatar");
    assert_eq!(warned.matches("split \"train\": 10 of 10 masks have 0 and 1").count(), 1, "{warned}");
}

#[test]
fn unusable_images_are_skipped_with_one_warning() {
    let folder = tempfile::tempdir().unwrap();
    small_capture(&folder.path().join("capture"));
    let image = |name: &str| folder.path().join("capture/images").join(name);
    let bytes = std::fs::read(image("cam00/0000.png")).unwrap();
    std::fs::write(image("cam00/0000.png"), &bytes[..bytes.len() / 2]).unwrap();
    image::RgbImage::new(65, 96).save(image("cam00/0001.png")).unwrap();
    std::fs::remove_file(image("cam01/0001.png")).unwrap();
    let arguments = ["--capture", "capture", "--out", "out"];
    let output = run(TRAIN, folder.path(), &[&arguments[..], &UNALIGNED].concat());
    let [said, warned] = assert_trained(&output);
    assert!(said.contains("4 cameras, 2 frames, 7 images"), "{said}");
    assert!(
        warned.contains("3 of 11 images are skipped: 1 without a file, 2 with a broken file; the first:"),
        "{warned}"
    );
    assert_eq!(warned.matches("are skipped").count(), 1, "{warned}");
}

#[test]
fn a_capture_without_test_images_trains_and_claims_nothing() {
    let folder = tempfile::tempdir().unwrap();
    small_capture_with(0, &folder.path().join("capture"));
    std::fs::create_dir(folder.path().join("out")).unwrap();
    std::fs::write(folder.path().join("out/report.png"), "of an earlier run").unwrap();
    let arguments =
        ["--capture", "capture", "--out", "out", "--force", "--set", "uv_resolution=32", "--set", "iterations=4"];
    let output = run(TRAIN, folder.path(), &arguments);
    let said = String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{said}");
    assert!(said.contains("no images to evaluate") && !said.contains("PSNR") && said.contains("pose error"), "{said}");
    assert_eq!(
        listing(&folder.path().join("out")),
        RESULTS.into_iter().filter(|name| !["preview.png", "report.png"].contains(name)).collect::<Vec<_>>()
    );
    let metrics = std::fs::read_to_string(folder.path().join("out/metrics.json")).unwrap();
    assert!(metrics.contains("pose_error_deg") && !metrics.contains("psnr"), "{metrics}");
    let asked = run(TRAIN, folder.path(), &[&arguments[..], &["--test-split", "exam"]].concat());
    assert_one_sentence(&asked, &["exam", "train"]);
}

#[test]
fn an_avatar_is_not_judged_in_images_that_trained_it() {
    let folder = tempfile::tempdir().unwrap();
    let capture = folder.path().join("capture");
    small_capture(&capture);
    let train = ["--capture", "capture", "--out", "out", "--set", "uv_resolution=32", "--set", "iterations=2"];
    for of in [&["--split", "test"][..], &["--test-split", "train"]] {
        assert_one_sentence(
            &run(TRAIN, folder.path(), &[&train[..], of].concat()),
            &["of the images", "--ignore-checks"],
        );
    }
    assert!(!folder.path().join("out/avatar.ghand").exists());
    // A single image in both is enough.
    change_json(&capture, |json| {
        let test = json["splits"]["test"].clone();
        let first = |key: &str| serde_json::json!([test[key][0]]);
        json["splits"]["mixed"] = serde_json::json!({ "cameras": first("cameras"), "frames": first("frames") });
    });
    let mixed = [&train[..], &["--split", "mixed"]].concat();
    assert_one_sentence(&run(TRAIN, folder.path(), &mixed), &["1 of the images of split \"test\"", "\"mixed\""]);
}

#[test]
fn killing_a_run_leaves_the_old_avatar_whole() {
    let folder = tempfile::tempdir().unwrap();
    small_capture(&folder.path().join("capture"));
    let arguments = ["--capture", "capture", "--out", "out", "--force", "--set", "uv_resolution=32", "--set"];
    assert_trained(&run(TRAIN, folder.path(), &[&arguments[..], &["iterations=4"]].concat()));
    let files = RESULTS;
    assert_eq!(listing(&folder.path().join("out")), files);
    let avatar = std::fs::read(folder.path().join("out/avatar.ghand")).unwrap();

    let mut child = Command::new(TRAIN)
        .current_dir(folder.path())
        .args([&arguments[..], &["iterations=1000000"]].concat())
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let mut lines = BufReader::new(child.stdout.take().unwrap()).lines();
    assert!(lines.any(|l| l.unwrap().starts_with("training:")), "the second run never started");
    child.kill().unwrap();
    child.wait().unwrap();
    // The lock's file; the lock itself is free again. How the killed run was started, if it came so far.
    std::fs::remove_file(folder.path().join("out/.train.lock")).unwrap();
    let _ = std::fs::remove_dir_all(folder.path().join("out/checkpoints"));
    assert_eq!(listing(&folder.path().join("out")), files);
    assert!(std::fs::read(folder.path().join("out/avatar.ghand")).unwrap() == avatar);
}
