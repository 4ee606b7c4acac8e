//! The examples run and write the files that they announce.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking; clippy knows that only inside #[test]")]

use std::collections::HashSet;
use std::path::PathBuf;
use std::process::Command;

/// An example's program, built by cargo for the tests.
fn example(name: &str) -> PathBuf {
    let test = std::env::current_exe().unwrap();
    test.parent().and_then(|deps| deps.parent()).unwrap().join("examples").join(name)
}

fn run(name: &str, writes: &str, says: &str) {
    let folder = tempfile::tempdir().unwrap();
    let output = Command::new(example(name)).current_dir(folder.path()).output().unwrap();
    let text = String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success() && text.contains(says), "{name}: {text}");
    let path = folder.path().join(writes);
    if writes.ends_with(".png") {
        let colors: HashSet<[u8; 3]> = image::open(path).unwrap().into_rgb8().pixels().map(|pixel| pixel.0).collect();
        assert!(colors.len() > 100, "{name}: {writes} has {} colours", colors.len());
    } else {
        let avatar = ghand::avatar::Avatar::load(&path).unwrap();
        assert!(avatar.seen.is_some(), "{name}: {writes} is not trained");
    }
}

#[test]
fn a_pose_is_rendered() {
    run("render_pose", "pose.png", "`point`");
}

#[test]
fn an_avatar_is_drawn_into_the_pass_of_another_program() {
    run("draw_into_a_pass", "pass.png", "Gaussians and a board");
}

#[test]
fn a_custom_property_model_draws_a_wave() {
    run("property_model", "wave.png", "Gaussians");
}

#[test]
fn splats_are_fitted_to_a_picture() {
    run("splat_a_scene", "splats.png", "after 100 steps");
}

#[test]
fn a_small_avatar_is_trained() {
    run("train_small", "small.ghand", "look at it");
}
