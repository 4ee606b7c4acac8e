//! Options that do not apply are refused by name, not ignored.

use std::path::Path;

use crate::common::{assert_one_sentence, listing, run, save_avatar, small_capture};

const GHAND: &str = env!("CARGO_BIN_EXE_ghand");
const TRAIN: &str = env!("CARGO_BIN_EXE_train");
const VIEWER: &str = env!("CARGO_BIN_EXE_viewer");

/// Runs a line of a program and its arguments; it must fail and name the first of its `parts`.
fn refused(folder: &Path, line: &str, parts: &[&str]) {
    let words: Vec<&str> = line.split_whitespace().collect();
    let program = match words[0] {
        "ghand" => GHAND,
        "train" => TRAIN,
        _ => VIEWER,
    };
    let before = listing(folder);
    assert_one_sentence(&run(program, folder, &words[1..]), parts);
    assert_eq!(listing(folder), before, "{line}");
}

#[test]
fn options_for_files_of_poses_are_refused_without_one() {
    let folder = tempfile::tempdir().unwrap();
    save_avatar(folder.path());
    let render = "ghand render hand.ghand --turntable 1 --out pictures";
    for (line, option) in [
        ("--pose fist --side left", "--side"),
        ("--side right", "--side"),
        ("--pose count --take 3", "--take"),
        ("--pose point --pose-model builtin", "--pose-model"),
        ("--pose fist --in-place", "--in-place"),
        ("--pose fist --flat-mean", "--flat-mean"),
        ("--pose wave --cameras none.json", "--cameras"),
        ("--pose fist --fps 12", "--fps"),
        ("--pose fist --mirrored yes", "--mirrored"),
        ("--pose wave --file-fps 25", "--file-fps"),
        ("--pose wave --smooth", "--smooth"),
    ] {
        refused(folder.path(), &format!("{render} {line}"), &[option, "omit"]);
    }
    for (line, option) in [
        ("ghand pose --out a.obj --side left", "--side"),
        ("ghand pose --out a.obj --flat-mean", "--flat-mean"),
        ("ghand pose --out a.obj --smooth", "--smooth"),
        ("ghand pose --out a.obj --pose count --fps 10", "--fps"),
        ("ghand bake hand.ghand --out b.ghand --side left", "--side"),
        ("ghand bake hand.ghand --out b.ghand --poses fist --side left", "--side"),
        ("ghand export hand.ghand --out a.glb --in-place", "--in-place"),
        ("ghand export hand.ghand --out a.ply --pose fist --fps 3", "--fps"),
        ("viewer hand.ghand --screenshot a.png --side left", "--side"),
        ("viewer hand.ghand --screenshot a.png --pose fist --take a", "--take"),
    ] {
        refused(folder.path(), line, &[option]);
    }
}

#[test]
fn options_for_captures_and_hand_models_are_refused_where_there_are_none() {
    let folder = tempfile::tempdir().unwrap();
    save_avatar(folder.path());
    small_capture(&folder.path().join("S"));
    for (line, parts) in [
        ("train --capture S --hand-model builtin --out R", ["--hand-model", "brings its own"]),
        ("train --capture S --train-sequences ROM03 --out R", ["--train-sequences", "not InterHand2.6M"]),
        ("ghand inspect S --no-sheet --principal-point 3,4", ["--principal-point", "Hand Appearance"]),
        ("ghand inspect S --no-sheet --left-shapes-as-published", ["--left-shapes-as-published", "no --hand-model"]),
        ("train --left-shapes-as-published --out R", ["--left-shapes-as-published", "no --hand-model"]),
        ("viewer hand.ghand --screenshot a.png --left-shapes-as-published", ["--left-shapes-as-published", "omit it"]),
        ("ghand inspect builtin --left-shapes-as-published", ["--left-shapes-as-published", "a hand of ghand"]),
        ("ghand inspect hand.ghand --left-shapes-as-published", ["--left-shapes-as-published", "is an avatar"]),
        (
            "ghand export hand.ghand --out a.ply --left-shapes-as-published",
            ["--left-shapes-as-published", "only an avatar has Gaussians"],
        ),
        ("ghand pose --out a.obj --left-shapes-as-published", ["--left-shapes-as-published", "built-in hand"]),
    ] {
        refused(folder.path(), line, &parts);
    }
}

#[test]
fn options_that_need_another_are_refused_without_it() {
    let folder = tempfile::tempdir().unwrap();
    save_avatar(folder.path());
    for (line, option) in [
        ("viewer hand.ghand --screenshot a.png --joint wrist", "--joint"),
        ("viewer hand.ghand --screenshot a.png --layer weights --basis 1", "--basis"),
        ("viewer builtin --screenshot a.png --baked", "--baked"),
        ("viewer hand.ghand --screenshot a.png --live-origin https://a.b", "--live-origin"),
        ("viewer hand.ghand --live --size 30x30", "--size"),
        ("viewer hand.ghand --webcam --live", "--webcam"),
        ("viewer hand.ghand --webcam --screenshot a.png", "--webcam"),
        ("viewer hand.ghand --webcam=none.mp4", "--webcam: none.mp4: is neither a camera nor a file"),
        ("viewer hand.ghand --webcam=hand.ghand", "--webcam: hand.ghand: is not a video"),
        ("ghand splat none.ply --camera c.json --up z --out a.png", "--up"),
        ("ghand splat none.ply --turntable 2 --gradients g.safetensors --out pictures", "--gradients"),
        ("ghand export hand.ghand --out a.glb --frame 2", "--frame"),
        ("ghand capture --out C --masks arm", "--masks arm"),
        ("ghand capture --out C --masks none --mask-noise 2", "--mask-noise"),
        ("ghand capture --out C --test-frames 3 --test-views 0", "--test-frames"),
    ] {
        refused(folder.path(), line, &[option]);
    }
}
