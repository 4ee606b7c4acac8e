//! Runs the built programs and checks their output files.

#![allow(dead_code, reason = "every test file is its own crate and uses the part that it needs")]

pub mod failing_driver;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::Mutex;

use ghand_avatar::{Avatar, AvatarConfig};
use ghand_render::{AdapterChoice, Gpu};
use ghand_synthetic::SyntheticOptions;
use ghand_synthetic::make_capture::make_capture;
use ghand_test_support::procedural_hand::ProceduralHand;

/// What a run of `train` leaves in its folder.
pub const RESULTS: [&str; 10] = [
    "align.png",
    "avatar.ghand",
    "config.toml",
    "curves.csv",
    "curves.png",
    "metrics.json",
    "poses.json",
    "preview.png",
    "report.html",
    "report.png",
];

/// Options of a short training where poses as given will do.
pub const UNALIGNED: [&str; 6] = ["--set", "uv_resolution=32", "--set", "iterations=4", "--set", "align=off"];

/// Runs a program in a folder, without a display.
pub fn run(program: &str, folder: &Path, arguments: &[&str]) -> Output {
    run_in(program, folder, arguments, &[])
}

/// Like [`run`], with some variables in the environment.
pub fn run_in(program: &str, folder: &Path, arguments: &[&str], variables: &[(&str, &str)]) -> Output {
    let mut command = Command::new(program);
    command.current_dir(folder).args(arguments).envs(variables.iter().copied());
    for display in ["DISPLAY", "WAYLAND_DISPLAY", "WAYLAND_SOCKET"] {
        command.env_remove(display);
    }
    // The Wayland library inside the driver complains without it.
    command.env("XDG_RUNTIME_DIR", folder);
    command.output().unwrap()
}

/// Asserts exit code 1 and one line on stderr, `error: ...`, that contains all of `parts`.
pub fn assert_one_sentence(output: &Output, parts: &[&str]) {
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{stderr}");
    assert_eq!(stderr.trim_end().lines().count(), 1, "{stderr}");
    assert!(stderr.starts_with("error: "), "{stderr}");
    for part in parts {
        assert!(stderr.contains(part), "{part} is not in: {stderr}");
    }
}

/// Asserts that `train` has trained, evaluated and saved an avatar. It may be below its baseline, because tests train
/// for only a few iterations. Returns stdout and stderr, without the sentence on the baseline.
pub fn assert_trained(output: &Output) -> [String; 2] {
    let [said, told] = [&output.stdout, &output.stderr].map(|bytes| String::from_utf8_lossy(bytes).into_owned());
    let is_failure = |line: &&str| line.starts_with("error: the training has failed: the avatar's PSNR");
    let failures = told.lines().filter(is_failure).count() as i32;
    assert_eq!(output.status.code(), Some(failures), "{said}{told}");
    assert!(said.contains("\navatar: "), "{said}{told}");
    let rest = told.lines().filter(|line| !is_failure(line)).map(|line| format!("{line}\n")).collect();
    [said, rest]
}

/// Writes a small untrained avatar of 16 joints.
pub fn save_avatar(folder: &Path) -> PathBuf {
    let model = ProceduralHand { detail: 1, ..Default::default() }.build().unwrap();
    let config = AvatarConfig { uv_resolution: 64, ..Default::default() };
    let path = folder.join("hand.ghand");
    Avatar::untrained(&model, &config, [0.8, 0.6, 0.5], 0).unwrap().save(&path).unwrap();
    path
}

/// Makes a capture of 10 training images of 2 frames and one test image.
pub fn small_capture(folder: &Path) {
    small_capture_with(1, folder);
}

/// Like [`small_capture`], with this many test frames of one image each.
pub fn small_capture_with(test_frames: usize, folder: &Path) {
    static MADE: Mutex<BTreeMap<usize, Files>> = Mutex::new(BTreeMap::new());
    let mut made = MADE.lock().unwrap();
    let files = made.entry(test_frames).or_insert_with(|| {
        let gpu = Gpu::new(&AdapterChoice::from_env()).unwrap();
        let options = SyntheticOptions {
            views: 5,
            train_frames: 2,
            test_frames,
            test_views: 1,
            width: 64,
            height: 96,
            ..SyntheticOptions::default()
        };
        let folder = tempfile::tempdir().unwrap();
        make_capture(&gpu, &options, folder.path()).unwrap();
        let mut files = Files::new();
        read_below(folder.path(), Path::new(""), &mut files);
        files
    });
    for (path, bytes) in files {
        let path = folder.join(path);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, bytes).unwrap();
    }
}

/// Files by their paths in a folder.
type Files = BTreeMap<PathBuf, Vec<u8>>;

fn read_below(root: &Path, folder: &Path, files: &mut Files) {
    for entry in std::fs::read_dir(root.join(folder)).unwrap() {
        let entry = entry.unwrap();
        let path = folder.join(entry.file_name());
        if entry.file_type().unwrap().is_dir() {
            read_below(root, &path, files);
        } else {
            files.insert(path, std::fs::read(entry.path()).unwrap());
        }
    }
}

/// Names of the files in a folder, including hidden ones, sorted.
pub fn listing(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).unwrap();
    let mut names: Vec<String> = entries.map(|e| e.unwrap().file_name().to_string_lossy().into_owned()).collect();
    names.sort();
    names
}
