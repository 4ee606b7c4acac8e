//! `ghand-lab cleanliness` as a user runs it.

use std::path::Path;
use std::process::Output;

use crate::common::{assert_one_sentence, listing, run, small_capture};
use ghand_avatar::{Avatar, PropertyTables};
use ghand_capture::Capture;
use ghand_render::{AdapterChoice, Gpu};
use ghand_train::{TrainSettings, Trainer};
use serde_json::Value;

const LAB: &str = env!("CARGO_BIN_EXE_ghand-lab");

fn cleanliness(folder: &Path, more: &[&str]) -> Output {
    run(LAB, folder, &[&["cleanliness", "avatar.ghand", "--capture", "capture"], more].concat())
}

fn assert_measured(output: &Output) -> String {
    let [said, told] = [&output.stdout, &output.stderr].map(|bytes| String::from_utf8_lossy(bytes).into_owned());
    assert!(output.status.success() && told.is_empty(), "{said}{told}");
    said
}

fn json(path: &Path) -> Value {
    serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap()
}

/// Makes `capture` and `avatar.ghand`, trained on it for a few iterations.
fn train(folder: &Path) {
    small_capture(&folder.join("capture"));
    let gpu = Gpu::new(&AdapterChoice::from_env()).unwrap();
    let capture = Capture::open(&folder.join("capture")).unwrap();
    let settings = TrainSettings { uv_resolution: 32, iterations: 4, ..Default::default() };
    let trained = Trainer::new(&gpu, &capture, "train", &settings).unwrap().train(|_| ()).unwrap();
    trained.avatar.save(&folder.join("avatar.ghand")).unwrap();
}

/// The avatar with all its colours replaced by bright green.
fn paint_green(folder: &Path) {
    let mut avatar = Avatar::load(&folder.join("avatar.ghand")).unwrap();
    let PropertyTables::Direct(tables) = &mut avatar.tables else { unreachable!() };
    let count = avatar.template.len();
    tables.set_base_colors(&vec![[0.01, 0.99, 0.01]; count]);
    // One Gaussian in two hundred lies some centimetres beside its place.
    tables.shape_basis.iter_mut().take(3 * count).step_by(200).for_each(|offset| *offset += 0.04);
    avatar.light = None;
    avatar.save(&folder.join("avatar.ghand")).unwrap();
}

#[test]
fn the_named_poses_show_how_clean_an_avatar_is() {
    let folder = tempfile::tempdir().unwrap();
    train(folder.path());
    let said = assert_measured(&cleanliness(folder.path(), &["--out", "clean"]));
    assert!(said.contains("12 named poses from 24 views") && said.contains("thumbs-up"), "{said}");
    assert_eq!(listing(&folder.path().join("clean")), ["cleanliness.json", "cleanliness.png"]);
    let results = |out: &str| json(&folder.path().join(out).join("cleanliness.json"));
    let clean = results("clean");
    let number = |value: &Value| value.as_f64().filter(|v| v.is_finite()).unwrap_or_else(|| panic!("{value}"));
    let share = |value: &Value| Some(number(value)).filter(|share| (0.0..=1.0).contains(share)).unwrap();
    let [poses, views] = ["poses", "views"].map(|field| clean[field].as_array().unwrap());
    assert_eq!((poses.len(), views.len()), (12, 24));
    for figures in poses.iter().chain([&clean]) {
        share(&figures["outside_share"]);
        assert!(share(&figures["see_through_share"]) < 0.5, "{figures}");
        assert!(number(&figures["detail"]) > 0.0 && number(&figures["albedo_detail"]) > 0.0, "{figures}");
        // After a few iterations Gaussians are some millimetres wide.
        assert!(share(&figures["loose_share"]) < 0.25 && number(&figures["roughness"]) > 0.0, "{figures}");
    }
    views.iter().for_each(|view| assert!(share(&view["outside_share"]) <= 1.0));
    for (worst, figure) in [("loose", "loose_share"), ("rough", "roughness")] {
        let worst = &clean["worst"][worst];
        let of_pose = poses.iter().find(|pose| pose["pose"] == worst["pose"]).unwrap();
        assert!(number(&worst[figure]) >= number(&of_pose[figure]) && worst["direction"].is_array(), "{worst}");
    }
    let held_out = &clean["held_out"];
    assert_eq!((&held_out["split"], &held_out["images"]), (&"test".into(), &1.into()));
    assert!(
        share(&held_out["outside_share"]) < 0.05 && (0.2..5.0).contains(&number(&held_out["detail"])),
        "{held_out}"
    );
    let (width, height) = image::image_dimensions(folder.path().join("clean/cleanliness.png")).unwrap();
    assert!(width > 200 && height > 200, "{width} x {height}");

    // Colours that no image shows, and loose Gaussians.
    paint_green(folder.path());
    assert_measured(&cleanliness(folder.path(), &["--out", "green"]));
    let painted = results("green");
    let [own_loose, loose] = [&clean, &painted].map(|file| share(&file["loose_share"]));
    assert!(loose > own_loose + 1e-4, "{own_loose} of the avatar is loose, {loose} of one with loose Gaussians");
    let [own, painted] = [clean, painted].map(|file| share(&file["outside_share"]));
    assert!(painted > 0.99 && own < 0.5 * painted, "{own} of the avatar's pixels, {painted} of the green one's");

    // The figures alone need no folder; results are replaced only on request.
    assert_measured(&cleanliness(folder.path(), &[]));
    assert_one_sentence(&cleanliness(folder.path(), &["--out", "clean"]), &["clean/cleanliness.", "--force"]);
    assert_one_sentence(&cleanliness(folder.path(), &["--out", "capture"]), &["--out capture"]);
    assert_measured(&cleanliness(folder.path(), &["--out", "clean", "--force"]));
    assert_eq!(results("clean"), results("green"));
}

#[test]
fn what_is_missing_is_one_sentence() {
    let folder = tempfile::tempdir().unwrap();
    train(folder.path());
    let refused = |more: &[&str], parts: &[&str]| {
        assert_one_sentence(&cleanliness(folder.path(), &[&["--out", "out"], more].concat()), parts);
        assert!(!folder.path().join("out").exists());
    };
    refused(&["--split", "exam"], &["exam", "train5"]);
    refused(&["--train-split", "exam"], &["exam", "train5"]);
    let mut description = json(&folder.path().join("capture/capture.json"));
    description.as_object_mut().unwrap().remove("mask_path");
    std::fs::write(folder.path().join("capture/capture.json"), description.to_string()).unwrap();
    // Masks are made, then.
    assert!(cleanliness(folder.path(), &["--out", "out"]).status.success());
}
