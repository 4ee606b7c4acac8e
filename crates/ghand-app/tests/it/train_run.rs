//! A run of `train`: its folder, what it keeps, how it is stopped and when it has failed.

use std::io::{BufRead, BufReader, Read};
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};

use crate::common::{RESULTS, assert_one_sentence, listing, run, small_capture};
use ghand_avatar::Avatar;
use ghand_test_support::long;

const TRAIN: &str = env!("CARGO_BIN_EXE_train");
/// Longer than any test needs to wait.
const ENDLESS: &str = "iterations=1000000";

/// Options of a run that takes about a second.
fn options<'a>(more: &[&'a str]) -> Vec<&'a str> {
    [&["--capture", "capture", "--set", "uv_resolution=32"], more].concat()
}

fn train(folder: &Path, more: &[&str]) -> Output {
    run(TRAIN, folder, &options(more))
}

/// Starts a run and waits until it prints a line with `text`.
fn start(folder: &Path, more: &[&str], text: &str) -> Child {
    let mut child = Command::new(TRAIN)
        .current_dir(folder)
        .args(options(more))
        .env("XDG_RUNTIME_DIR", folder)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let stdout = child.stdout.as_mut().unwrap();
    // Without a buffer, so that none of the following output is lost.
    let mut seen = String::new();
    let mut byte = [0];
    while !seen.lines().any(|line| line.contains(text)) || !seen.ends_with('\n') {
        assert_eq!(stdout.read(&mut byte).unwrap(), 1, "it ended before `{text}`: {seen}");
        seen.push(char::from(byte[0]));
    }
    child
}

fn send(signal: &str, child: &Child) {
    let sent = Command::new("kill").args([signal, &child.id().to_string()]).status().unwrap();
    assert!(sent.success());
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

fn metrics(folder: &Path) -> serde_json::Value {
    serde_json::from_slice(&std::fs::read(folder.join("metrics.json")).unwrap()).unwrap()
}

#[test]
fn runs_without_a_named_folder_keep_earlier_ones_and_share_the_demo_capture() {
    if !long() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    small_capture(&folder.path().join("out/demo-capture"));
    let demo = |more: &[&str]| {
        let options = ["--set", "uv_resolution=32", "--set", "iterations=20"];
        let output = run(TRAIN, folder.path(), &[&options[..], more].concat());
        let said = text(&output.stdout);
        assert!(said.contains("avatar: ") && !said.contains("making a synthetic capture"), "{said}");
        said
    };
    let avatar = |run: &str| std::fs::read(folder.path().join("out").join(run).join("avatar.ghand")).unwrap();
    demo(&[]);
    let first = avatar("train");
    let said = demo(&["--seed", "2"]);
    assert!(said.contains("earlier runs are kept") && said.contains("out/train-2/avatar.ghand"), "{said}");
    assert_eq!(listing(&folder.path().join("out")), ["demo-capture", "train", "train-2"]);
    assert_eq!(listing(&folder.path().join("out/train-2")), RESULTS);
    assert!(avatar("train") == first && avatar("train-2") != first);
    // Results are replaced only on request.
    demo(&["--seed", "2", "--force"]);
    assert!(avatar("train") == avatar("train-2"));
    assert_eq!(listing(&folder.path().join("out")), ["demo-capture", "train", "train-2"]);
}

#[test]
fn results_in_a_named_folder_are_replaced_only_with_force() {
    let folder = tempfile::tempdir().unwrap();
    small_capture(&folder.path().join("capture"));
    let out = folder.path().join("run");
    std::fs::create_dir(&out).unwrap();
    std::fs::write(out.join("notes.txt"), "of the user").unwrap();
    let named = ["--out", "run", "--set", "iterations=4"];
    train(folder.path(), &named);
    let with_notes = [&RESULTS[..6], &["notes.txt"], &RESULTS[6..]].concat();
    assert_eq!(listing(&out), with_notes);
    let avatar = || std::fs::read(out.join("avatar.ghand")).unwrap();
    let first = avatar();

    let refused = train(folder.path(), &[&named[..], &["--seed", "2"]].concat());
    assert_one_sentence(&refused, &["run/avatar.ghand", "earlier run", "--force"]);
    assert!(!text(&refused.stdout).contains("training:"), "{}", text(&refused.stdout));
    // A metrics file alone is also a result.
    std::fs::remove_file(out.join("avatar.ghand")).unwrap();
    for name in &RESULTS[2..5] {
        std::fs::remove_file(out.join(name)).unwrap();
    }
    assert_one_sentence(&train(folder.path(), &named), &["run/poses.json", "--force"]);
    std::fs::write(out.join("avatar.ghand"), &first).unwrap();

    train(folder.path(), &[&named[..], &["--seed", "2", "--force"]].concat());
    assert!(avatar() != first);
    assert_eq!(listing(&out), with_notes);
}

#[test]
fn a_second_run_into_a_folder_is_rejected_until_the_first_has_ended_or_was_killed() {
    let folder = tempfile::tempdir().unwrap();
    small_capture(&folder.path().join("capture"));
    let mut first = start(folder.path(), &["--out", "run", "--set", ENDLESS], "training:");
    for force in [&[][..], &["--force"]] {
        let second = train(folder.path(), &[&["--out", "run", "--set", "iterations=4"], force].concat());
        assert_one_sentence(&second, &["run", "another run is writing", &first.id().to_string()]);
    }
    first.kill().unwrap();
    first.wait().unwrap();
    train(folder.path(), &["--out", "run", "--set", "iterations=4"]);
    assert_eq!(listing(&folder.path().join("run")), RESULTS);
}

#[test]
fn a_run_stopped_in_stage_2_saves_and_evaluates_its_avatar_and_says_so() {
    for signal in ["-INT", "-TERM"] {
        let folder = tempfile::tempdir().unwrap();
        small_capture(&folder.path().join("capture"));
        let options = ["--out", "run", "--set", ENDLESS, "--set", "align=off"];
        let child = start(folder.path(), &options, "stage 2");
        send(signal, &child);
        let output = child.wait_with_output().unwrap();
        let said = text(&output.stdout);
        let warned = text(&output.stderr);
        assert_eq!(output.status.code(), Some(130), "{said}{warned}");
        assert!(said.contains("stopped early, after") && said.contains("PSNR"), "{said}");
        assert!(warned.contains("stopping after this iteration"), "{warned}");
        assert!(warned.contains("stopped early, after") && !warned.contains("error: "), "{warned}");
        let run = folder.path().join("run");
        assert!(warned.contains("go on with `train --resume --out run`"), "{warned}");
        // All but align.png, which only align=contours makes.
        assert_eq!(listing(&run), [&RESULTS[1..2], &["checkpoints"], &RESULTS[2..]].concat());
        let metrics = metrics(&run);
        let avatar = Avatar::load(&run.join("avatar.ghand")).unwrap();
        let iterations = metrics["iterations"].as_u64().unwrap();
        assert_eq!(metrics["stopped_early"], true);
        assert!((1..1_000_000).contains(&iterations), "{iterations}");
        assert_eq!(avatar.provenance.iterations, iterations);
    }
}

#[test]
fn a_run_stopped_in_stage_1_says_so_and_leaves_only_what_it_needs_to_go_on() {
    let folder = tempfile::tempdir().unwrap();
    small_capture(&folder.path().join("capture"));
    let child = start(folder.path(), &["--out", "runs/a", "--set", ENDLESS, "--set", "align=paper"], "stage 1");
    send("-INT", &child);
    let output = child.wait_with_output().unwrap();
    let warned = text(&output.stderr);
    assert_eq!(output.status.code(), Some(130), "{warned}");
    assert!(warned.contains("of 1000000 iterations") && warned.contains("no avatar to save yet"), "{warned}");
    assert!(!warned.contains("error: "), "{warned}");
    assert!(warned.contains("go on with `train --resume --out runs/a`"), "{warned}");
    assert_eq!(listing(&folder.path().join("runs/a")), ["checkpoints"]);
}

#[test]
fn a_run_stopped_before_its_first_checkpoint_leaves_no_files() {
    let folder = tempfile::tempdir().unwrap();
    small_capture(&folder.path().join("capture"));
    let child = start(folder.path(), &["--out", "runs/a"], "aligning");
    send("-INT", &child);
    let output = child.wait_with_output().unwrap();
    let warned = text(&output.stderr);
    // The alignment may have been quicker than the signal.
    if warned.contains("after 0 of") && !warned.contains("go on") {
        assert_eq!(output.status.code(), Some(130), "{warned}");
        assert!(!listing(folder.path()).contains(&"runs".to_owned()), "{warned}");
    }
}

#[test]
fn a_second_ctrl_c_ends_a_run_at_once_and_leaves_no_half_written_file() {
    let folder = tempfile::tempdir().unwrap();
    small_capture(&folder.path().join("capture"));
    // With this many Gaussians an iteration takes longer than both signals.
    let slow = ["--out", "run", "--set", ENDLESS, "--set", "align=off", "--set", "uv_resolution=640"];
    let mut child = start(folder.path(), &slow, "stage 2");
    send("-INT", &child);
    let mut lines = BufReader::new(child.stderr.take().unwrap()).lines().map(|line| line.unwrap());
    assert!(lines.any(|line| line.contains("stopping after this iteration")));
    send("-INT", &child);
    let rest: Vec<String> = lines.collect();
    assert_eq!(child.wait().unwrap().code(), Some(130), "{rest:?}");
    assert!(rest.iter().any(|line| line.contains("at once") || line.contains("stopped before evaluation")), "{rest:?}");
    let avatar = folder.path().join("run/avatar.ghand");
    if avatar.exists() {
        // The signal came after the avatar was saved.
        Avatar::load(&avatar).unwrap();
    }
    let hidden = |name: &String| name.starts_with('.');
    assert!(!folder.path().join("run").exists() || !listing(&folder.path().join("run")).iter().any(hidden));
}

#[test]
fn an_avatar_that_does_not_beat_its_baseline_is_a_failure_and_is_kept() {
    let folder = tempfile::tempdir().unwrap();
    small_capture(&folder.path().join("capture"));
    let output = train(folder.path(), &["--out", "run", "--set", "iterations=2"]);
    assert_one_sentence(&output, &["failed", "floor", "too few iterations (2", "masks", "ghand inspect"]);
    let said = text(&output.stdout);
    assert!(said.contains("gain") && said.contains("run/avatar.ghand") && said.contains("run/report.png"), "{said}");
    let run = folder.path().join("run");
    assert_eq!(listing(&run), RESULTS);
    Avatar::load(&run.join("avatar.ghand")).unwrap();
    let metrics = metrics(&run);
    assert_eq!((&metrics["beats_floor"], &metrics["stopped_early"]), (&false.into(), &false.into()));
    assert!(metrics["psnr"].as_f64() <= metrics["floor"]["psnr"].as_f64());
}

#[test]
fn a_diverging_training_names_the_setting_and_leaves_no_avatar() {
    let folder = tempfile::tempdir().unwrap();
    small_capture(&folder.path().join("capture"));
    let diverging = |setting| ["--out", "run", "--set", "iterations=60", "--set", "align=off", "--set", setting];
    let rose = train(folder.path(), &diverging("rate_shape_basis=1"));
    assert_one_sentence(&rose, &["training failed in stage 2", "the loss rose from", "rate_shape_basis"]);
    assert!(!folder.path().join("run").exists());
    // Earlier results stay.
    let good = train(folder.path(), &["--out", "run", "--set", "iterations=4", "--set", "align=off"]);
    assert!(text(&good.stdout).contains("avatar: "));
    let results = listing(&folder.path().join("run"));
    let avatar = std::fs::read(folder.path().join("run/avatar.ghand")).unwrap();
    let infinite = train(folder.path(), &[&diverging("rate_shape_basis=1e38")[..], &["--force"]].concat());
    assert_one_sentence(&infinite, &["training failed in stage 2", "infinite", "rate_shape_basis"]);
    assert!(std::fs::read(folder.path().join("run/avatar.ghand")).unwrap() == avatar);
    assert_eq!(listing(&folder.path().join("run")), results);
}

#[test]
fn invalid_settings_are_rejected_in_plain_words() {
    let folder = tempfile::tempdir().unwrap();
    let refused = |more: &[&str], parts: &[&str]| {
        assert_one_sentence(&run(TRAIN, folder.path(), more), parts);
        assert!(listing(folder.path()).is_empty());
    };
    refused(&["--set", "iterations=1.5"], &["`iterations`", "must be a whole number"]);
    refused(&["--set", "iteration=1e2"], &["did you mean `iterations`?"]);
    refused(&["--seed", "-1"], &["`seed`", "must be a whole number, at least 0"]);
    refused(&["--seed", "one"], &["`seed`", "must be a whole number, at least 0"]);
}
