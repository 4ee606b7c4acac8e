//! The built programs on a graphics driver that loses devices and runs out of memory: `support/losing_vulkan.c` stands
//! between them and the driver.

use std::process::Output;

use ghand_render::{AdapterChoice, Gpu};
use ghand_synthetic::SyntheticOptions;
use ghand_synthetic::make_capture::make_capture;

use crate::common::failing_driver::FailingDriver;
use crate::common::{assert_trained, listing, save_avatar};
use ghand_test_support::long;

const GHAND: &str = env!("CARGO_BIN_EXE_ghand");
const VIEWER: &str = env!("CARGO_BIN_EXE_viewer");
const TRAIN: &str = env!("CARGO_BIN_EXE_train");

fn small_capture() -> SyntheticOptions {
    SyntheticOptions {
        views: 5,
        train_frames: 2,
        test_frames: 1,
        test_views: 1,
        width: 64,
        height: 96,
        ..SyntheticOptions::default()
    }
}

/// Every submission, beginning with the first.
fn always() -> String {
    (1..=2000).map(|n: u32| n.to_string()).collect::<Vec<_>>().join(",")
}

fn lines(output: &Output) -> Vec<String> {
    String::from_utf8_lossy(&output.stderr).lines().map(str::to_owned).collect()
}

/// Asserts success with one warning per loss, and nothing else on stderr.
fn assert_recovered(output: &Output, losses: usize) {
    assert!(output.status.success(), "{:?}", lines(output));
    assert_warned(&lines(output), losses);
}

/// Asserts one warning per loss, and nothing else.
fn assert_warned(lines: &[String], losses: usize) {
    assert_eq!(lines.len(), losses, "{lines:?}");
    assert!(
        lines.iter().all(|l| l.contains("the graphics device was lost: ") && l.contains("with a new one")),
        "{lines:?}"
    );
}

/// Asserts exit code 1 and, after the warnings of losses, one sentence.
fn assert_given_up(output: &Output) {
    let lines = lines(output);
    assert_eq!(output.status.code(), Some(1), "{lines:?}");
    let (last, warnings) = lines.split_last().unwrap();
    assert!(last.starts_with("error: ") && last.contains("was lost") && last.contains("driver"), "{last}");
    assert!(warnings.iter().all(|l| l.contains("with a new one")), "{lines:?}");
}

#[test]
fn pictures_are_the_same_whether_or_not_the_device_was_lost_between_them() {
    let gpu = Gpu::new(&AdapterChoice::from_env()).unwrap();
    let Some(driver) = FailingDriver::new(&gpu) else { return };
    let folder = tempfile::tempdir().unwrap();
    save_avatar(folder.path());
    let render = |out: &str, fault: (&str, &str)| {
        let arguments = ["render", "hand.ghand", "--turntable", "4", "--size", "96x96", "--out", out];
        driver.run(GHAND, folder.path(), &arguments, fault)
    };
    assert_recovered(&render("whole", ("LOSE_AT", "")), 0);
    let pictures = |out: &str| -> Vec<Vec<u8>> {
        let files = listing(&folder.path().join(out));
        // The list of the pictures in the folder contains the command, which differs.
        files
            .iter()
            .filter(|f| f.ends_with(".png"))
            .map(|f| std::fs::read(folder.path().join(out).join(f)).unwrap())
            .collect()
    };
    assert_eq!(pictures("whole").len(), 4);
    let faults = [("LOSE_AT", "1", 1), ("LOSE_AFTER", "1", 1), ("LOSE_AT", "9", 1), ("LOSE_AFTER", "4,14", 2)];
    for (k, (variable, number, losses)) in faults.into_iter().enumerate() {
        let out = format!("lost {k}");
        assert_recovered(&render(&out, (variable, number)), losses);
        assert!(pictures(&out) == pictures("whole"), "{variable} {number}");
    }
    for variable in ["LOSE_AT", "LOSE_AFTER"] {
        assert_given_up(&render("never", (variable, &always())));
        assert!(!folder.path().join("never").exists());
    }
}

#[test]
fn a_screenshot_is_made_on_a_new_device() {
    let gpu = Gpu::new(&AdapterChoice::from_env()).unwrap();
    let Some(driver) = FailingDriver::new(&gpu) else { return };
    let folder = tempfile::tempdir().unwrap();
    save_avatar(folder.path());
    let shot = |file: &str, fault: (&str, &str)| {
        let arguments = ["hand.ghand", "--screenshot", file, "--size", "400x200"];
        driver.run(VIEWER, folder.path(), &arguments, fault)
    };
    // Without the panel, because it shows times.
    let hand = |file: &str| {
        let picture = image::open(folder.path().join(file)).unwrap().into_rgb8();
        image::imageops::crop_imm(&picture, 260, 0, 140, 200).to_image()
    };
    assert_recovered(&shot("whole.png", ("LOSE_AT", "")), 0);
    for fault in [("LOSE_AT", "1"), ("LOSE_AFTER", "1"), ("LOSE_AFTER", "2"), ("LOSE_AT", "3"), ("LOSE_AFTER", "3")] {
        assert_recovered(&shot("lost.png", fault), 1);
        assert!(hand("lost.png") == hand("whole.png"), "{fault:?}");
    }
    assert_given_up(&shot("never.png", ("LOSE_AFTER", &always())));
    assert!(!folder.path().join("never.png").exists());
}

#[test]
fn training_gives_the_same_avatar_or_an_error() {
    if !long() {
        return;
    }
    let gpu = Gpu::new(&AdapterChoice::from_env()).unwrap();
    let Some(driver) = FailingDriver::new(&gpu) else { return };
    let folder = tempfile::tempdir().unwrap();
    make_capture(&gpu, &small_capture(), &folder.path().join("capture")).unwrap();
    let train = |out: &str, fault: (&str, &str)| {
        let arguments = ["--capture", "capture", "--out", out, "--set", "uv_resolution=32", "--set", "iterations=20"];
        driver.run(TRAIN, folder.path(), &arguments, fault)
    };
    let avatar = |out: &str| std::fs::read(folder.path().join(out).join("avatar.ghand")).unwrap();
    let assert_recovered = |output: &Output, losses| {
        let [_, told] = assert_trained(output);
        assert_warned(&told.lines().map(str::to_owned).collect::<Vec<_>>(), losses);
    };
    assert_recovered(&train("whole", ("LOSE_AT", "")), 0);
    let faults = [("LOSE_AT", "5", 1), ("LOSE_AFTER", "40", 1), ("LOSE_AFTER", "30,90", 2)];
    for (k, (variable, number, losses)) in faults.into_iter().enumerate() {
        let out = format!("lost {k}");
        assert_recovered(&train(&out, (variable, number)), losses);
        assert!(avatar(&out) == avatar("whole"), "{variable} {number}");
    }
    assert_given_up(&train("never", ("LOSE_AFTER", &always())));
    assert!(!folder.path().join("never").exists());
}

#[test]
fn a_picture_needs_no_more_device_memory_than_there_is() {
    let gpu = Gpu::new(&AdapterChoice::from_env()).unwrap();
    let Some(driver) = FailingDriver::new(&gpu) else { return };
    let folder = tempfile::tempdir().unwrap();
    save_avatar(folder.path());
    // Larger than the blocks that allocators request.
    let run = |arguments: &[&str]| driver.run(GHAND, folder.path(), arguments, ("REFUSE_FROM", "300000000"));
    assert_recovered(&run(&["render", "hand.ghand", "--turntable", "1", "--size", "64x64", "--out", "picture.png"]), 0);
}

#[test]
fn training_with_too_little_device_memory_names_the_setting_to_lower() {
    let gpu = Gpu::new(&AdapterChoice::from_env()).unwrap();
    let Some(driver) = FailingDriver::new(&gpu) else { return };
    let folder = tempfile::tempdir().unwrap();
    make_capture(&gpu, &small_capture(), &folder.path().join("capture")).unwrap();
    let settings = ["--set", "uv_resolution=1024", "--set", "shape_bases=32", "--set", "light=off"];
    let arguments = [&["--capture", "capture", "--out", "out", "--poses", "truth"][..], &settings[..]].concat();
    // Larger than the blocks that allocators request, smaller than the shape bases.
    let output = driver.run(TRAIN, folder.path(), &arguments, ("REFUSE_FROM", "140000000"));
    crate::common::assert_one_sentence(&output, &["too little memory for", "lower uv_resolution=1024"]);
}
