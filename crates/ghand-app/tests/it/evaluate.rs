//! `ghand evaluate`, and the poses that `train` starts from, as a user runs them.

use std::path::Path;
use std::process::Output;

use crate::common::{UNALIGNED, assert_one_sentence, assert_trained, listing, run, small_capture, small_capture_with};
use ghand_avatar::Avatar;
use ghand_render::{AdapterChoice, Gpu};
use ghand_synthetic::SyntheticOptions;
use ghand_synthetic::make_capture::make_capture;
use serde_json::Value;

const TRAIN: &str = env!("CARGO_BIN_EXE_train");
const GHAND: &str = env!("CARGO_BIN_EXE_ghand");

fn train(folder: &Path, out: &str, more: &[&str]) -> Output {
    let options = ["--capture", "capture", "--out", out, "--set", "uv_resolution=32", "--set", "iterations=4"];
    run(TRAIN, folder, &[&options[..], more].concat())
}

fn train_unaligned(folder: &Path, out: &str) -> Output {
    run(TRAIN, folder, &[&["--capture", "capture", "--out", out][..], &UNALIGNED].concat())
}

fn evaluate(folder: &Path, out: &str, more: &[&str]) -> Output {
    run(GHAND, folder, &[&["evaluate", "run/avatar.ghand", "--capture", "capture", "--out", out], more].concat())
}

fn assert_evaluated(output: &Output) -> String {
    let [said, told] = [&output.stdout, &output.stderr].map(|bytes| String::from_utf8_lossy(bytes).into_owned());
    assert!(output.status.success() && told.is_empty(), "{said}{told}");
    said
}

fn json(path: &Path) -> Value {
    serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap()
}

fn change_json(path: &Path, change: impl Fn(&mut Value)) {
    let mut file = json(path);
    change(&mut file);
    std::fs::write(path, file.to_string()).unwrap();
}

/// The figures on images.
fn figures(folder: &Path, out: &str) -> Vec<Value> {
    let metrics = json(&folder.join(out).join("metrics.json"));
    let fields = ["split", "frames", "psnr", "psnr_hand", "ssim", "squared_error", "floor", "beats_floor"];
    let figures: Vec<Value> = fields.iter().map(|field| metrics[field].clone()).collect();
    assert!(figures.iter().all(|value| !value.is_null()), "{metrics}");
    figures
}

#[test]
fn the_protocol_given_repeats_the_figures_of_the_training_and_others_have_their_own() {
    let folder = tempfile::tempdir().unwrap();
    small_capture_with(2, &folder.path().join("capture"));
    let [said, _] = assert_trained(&train_unaligned(folder.path(), "run"));
    assert!(said.contains("protocol `given`") && said.contains("training poses: given"), "{said}");
    let said = assert_evaluated(&evaluate(folder.path(), "given", &[]));
    assert!(said.contains("protocol `given`") && said.contains("run/poses.json"), "{said}");
    assert_eq!(listing(&folder.path().join("given")), ["metrics.json", "report.png"]);
    assert_eq!(figures(folder.path(), "given"), figures(folder.path(), "run"));
    let picture = |out: &str| std::fs::read(folder.path().join(out).join("report.png")).unwrap();
    assert!(picture("given") == picture("run"));
    for out in ["run", "given"] {
        assert_eq!(json(&folder.path().join(out).join("metrics.json"))["protocol"], "given");
    }

    let said = assert_evaluated(&evaluate(folder.path(), "aligned", &["--protocol", "aligned"]));
    assert!(said.contains("protocol `aligned`") && said.contains("degrees per joint"), "{said}");
    assert_eq!(json(&folder.path().join("aligned/metrics.json"))["protocol"], "aligned");
    assert_ne!(figures(folder.path(), "aligned"), figures(folder.path(), "run"));

    let said = assert_evaluated(&evaluate(folder.path(), "boxed", &["--protocol", "handavatar"]));
    assert!(said.contains("protocol `handavatar`"), "{said}");
    assert_ne!(figures(folder.path(), "boxed"), figures(folder.path(), "run"));
    // The report shows squares of 256 pixels, four in a row.
    let width = image::image_dimensions(folder.path().join("boxed/report.png")).unwrap().0;
    assert!((4 * 256..4 * 256 + 60).contains(&width), "{width}");

    // Results are replaced only on request.
    assert_one_sentence(&evaluate(folder.path(), "given", &[]), &["given/metrics.json", "--force"]);
    assert_evaluated(&evaluate(folder.path(), "given", &["--force"]));

    // Refined poses that are the true ones have no offsets.
    let truth = json(&folder.path().join("capture/truth.json"));
    std::fs::write(folder.path().join("truth.json"), truth.to_string()).unwrap();
    let with_truth = |out: &str, protocol: &str| {
        let said = evaluate(folder.path(), out, &["--training-poses", "truth.json", "--protocol", protocol]);
        assert_evaluated(&said);
        json(&folder.path().join(out).join("metrics.json"))["psnr"].as_f64().unwrap()
    };
    let difference = with_truth("same", "aligned") - with_truth("untouched", "given");
    assert!(difference.abs() < 1e-3, "{difference} dB");
}

#[test]
fn what_a_protocol_lacks_is_one_sentence() {
    let folder = tempfile::tempdir().unwrap();
    small_capture(&folder.path().join("capture"));
    assert_trained(&train_unaligned(folder.path(), "run"));
    let refused = |more: &[&str], parts: &[&str]| {
        assert_one_sentence(&evaluate(folder.path(), "out", more), parts);
        assert!(!folder.path().join("out").exists());
    };
    let without_capture = ["evaluate", "run/avatar.ghand", "--out", "out"];
    assert_one_sentence(&run(GHAND, folder.path(), &without_capture), &["--capture"]);
    refused(&["--split", "exam"], &["exam", "train5"]);
    refused(&["--train-split", "exam"], &["exam", "train5"]);
    refused(&["--training-poses", "missing.json"], &["missing.json"]);
    // One camera sees the test frame.
    refused(&["--protocol", "refined-cross"], &["\"0002\"", "1 image", "two cameras"]);
    change_json(&folder.path().join("run/poses.json"), |file| file["frames"][1]["id"] = "other".into());
    refused(&[], &["run/poses.json", "no pose for the frame \"0001\"", "\"train\""]);
    std::fs::remove_file(folder.path().join("run/poses.json")).unwrap();
    refused(&["--protocol", "aligned"], &["--protocol aligned", "poses.json", "--training-poses"]);
    std::fs::remove_file(folder.path().join("capture/truth.json")).unwrap();
    refused(
        &["--protocol", "aligned", "--training-poses", "capture/capture.json"],
        &["--protocol aligned", "capture", "no exact poses"],
    );
    // Without refined poses, the baseline takes the capture's.
    let said = assert_evaluated(&evaluate(folder.path(), "out", &[]));
    assert!(said.contains("capture's training poses"), "{said}");
}

#[test]
fn refined_cross_scores_every_image_in_a_pose_from_other_cameras() {
    let folder = tempfile::tempdir().unwrap();
    let gpu = Gpu::new(&AdapterChoice::from_env()).unwrap();
    let options = SyntheticOptions {
        views: 5,
        train_frames: 2,
        test_frames: 2,
        test_views: 3,
        width: 64,
        height: 96,
        ..SyntheticOptions::default()
    };
    make_capture(&gpu, &options, &folder.path().join("capture")).unwrap();
    assert_trained(&train_unaligned(folder.path(), "run"));
    let said = assert_evaluated(&evaluate(folder.path(), "cross", &["--protocol", "refined-cross"]));
    assert!(said.contains("6 images") && said.contains("protocol `refined-cross`"), "{said}");
    assert_ne!(figures(folder.path(), "cross")[2..], figures(folder.path(), "run")[2..]);
}

#[test]
fn training_starts_from_the_chosen_poses_and_says_so() {
    let folder = tempfile::tempdir().unwrap();
    small_capture(&folder.path().join("capture"));
    let metrics = |out: &str| json(&folder.path().join(out).join("metrics.json"));
    let poses = |out: &str| json(&folder.path().join(out).join("poses.json"))["frames"].clone();
    let [said, _] = assert_trained(&train(folder.path(), "truth", &["--poses", "truth"]));
    assert!(said.contains("training poses: truth; pose error: 0.00 degrees before, 0.00 refined"), "{said}");
    assert_eq!(metrics("truth")["poses"], "truth");
    let truth = json(&folder.path().join("capture/truth.json"))["frames"].clone();
    for frame in 0..2 {
        assert_eq!(poses("truth")[frame]["pose"], truth[frame]["pose"], "the true poses were not used as they are");
        assert_eq!(poses("truth")[frame]["translation"], truth[frame]["translation"]);
    }
    // Poses are aligned only on request.
    let [said, _] = assert_trained(&train(folder.path(), "both", &["--poses", "truth", "--set", "align=contours"]));
    assert!(said.contains("training poses: truth; pose error: 0.00 degrees before") && !said.contains("0.00 refined"));

    // A file of the true poses gives the same avatar, if it is not aligned either.
    assert_trained(&train(folder.path(), "file", &["--poses", "truth/poses.json", "--set", "align=off"]));
    assert_eq!(metrics("file")["poses"], "truth/poses.json");
    let avatar = |out: &str| std::fs::read(folder.path().join(out).join("avatar.ghand")).unwrap();
    assert!(avatar("file") == avatar("truth"));
    assert_trained(&train(folder.path(), "given", &["--poses", "given", "--set", "align=off"]));
    assert_eq!(metrics("given")["poses"], "given");
    assert!(avatar("given") != avatar("truth"));

    // A file with another shape gives the hand that shape.
    let mut shaped = json(&folder.path().join("truth/poses.json"));
    for frame in shaped["frames"].as_array_mut().unwrap() {
        frame["shape"] = serde_json::json!([1.5, 0.0, -1.0]);
    }
    std::fs::write(folder.path().join("shaped.json"), shaped.to_string()).unwrap();
    assert_trained(&train(folder.path(), "shaped", &["--poses", "shaped.json", "--set", "align=off"]));
    assert_eq!(poses("shaped")[0]["shape"], serde_json::json!([1.5, 0.0, -1.0]));
    assert!(avatar("shaped") != avatar("truth"));
}

#[test]
fn start_poses_that_cannot_be_used_are_one_sentence() {
    let folder = tempfile::tempdir().unwrap();
    small_capture(&folder.path().join("capture"));
    let refused = |poses: &str, parts: &[&str]| {
        assert_one_sentence(&train(folder.path(), "out", &["--poses", poses]), parts);
        assert!(!folder.path().join("out").exists());
    };
    let file = |change: &dyn Fn(&mut Value)| {
        let mut truth = json(&folder.path().join("capture/truth.json"));
        change(&mut truth);
        std::fs::write(folder.path().join("poses.json"), truth.to_string()).unwrap();
    };
    refused("missing.json", &["missing.json"]);
    file(&|poses| poses["frames"].as_array_mut().unwrap().retain(|frame| frame["id"] != "0001"));
    refused("poses.json", &["--poses", "poses.json", "no pose for the frame \"0001\"", "\"train\""]);
    file(&|poses| {
        poses["frames"][0]["pose"].as_array_mut().unwrap().pop();
    });
    refused("poses.json", &["poses.json", "24 rows, expected 25"]);
    change_json(&folder.path().join("capture/truth.json"), |truth| {
        truth["frames"].as_array_mut().unwrap().remove(0);
    });
    refused("truth", &["--poses truth", "truth.json has no pose for the frame \"0000\"", "\"train\""]);
    std::fs::remove_file(folder.path().join("capture/truth.json")).unwrap();
    refused("truth", &["--poses truth", "capture", "no exact poses"]);
}

#[test]
fn what_evaluate_lacks_is_one_sentence() {
    let folder = tempfile::tempdir().unwrap();
    let output = run(GHAND, folder.path(), &["evaluate", "a.ghand", "--capture", "C"]);
    assert!(!output.status.success() && String::from_utf8_lossy(&output.stderr).contains("--out"));
}

#[test]
fn an_avatar_is_not_compared_with_the_other_hand() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    for (side, capture) in [("right", "R"), ("left", "L")] {
        let made =
            ["capture", "--out", capture, "--side", side, "--size", "32x32", "--views", "1", "--train-frames", "1"];
        assert!(run(GHAND, path, &made).status.success());
    }
    for (own, other) in [("right", "L"), ("left", "R")] {
        let side = if own == "left" { ghand_core::Side::Left } else { ghand_core::Side::Right };
        let model = ghand_hand_model::builtin::builtin_hand(side).unwrap();
        let config = ghand_avatar::AvatarConfig { uv_resolution: 32, ..Default::default() };
        let avatar = Avatar::untrained(&model, &config, [0.8, 0.6, 0.5], 0).unwrap();
        avatar.save(&path.join("a.ghand")).unwrap();
        let told = format!("is a {own} hand, but");
        assert_one_sentence(
            &run(GHAND, path, &["evaluate", "a.ghand", "--capture", other, "--train-split", "train", "--out", "E"]),
            &[&told],
        );
        let viewer = ["a.ghand", "--capture", other, "--compare", "split", "--screenshot", "s.png"];
        assert_one_sentence(&run(env!("CARGO_BIN_EXE_viewer"), path, &viewer), &[&told]);
    }
}
