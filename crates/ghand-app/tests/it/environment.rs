//! The programs on limited systems: no runtime folder, outputs that cannot be written.

use std::os::unix::fs::FileTypeExt;
use std::process::Command;

use crate::common::{assert_one_sentence, listing, run, save_avatar};

const GHAND: &str = env!("CARGO_BIN_EXE_ghand");
const VIEWER: &str = env!("CARGO_BIN_EXE_viewer");
const SCREENSHOT: [&str; 5] = ["hand.ghand", "--size", "128x96", "--screenshot", "a.png"];

#[test]
fn a_missing_runtime_folder_causes_no_message_and_no_leftover() {
    let folder = tempfile::tempdir().unwrap();
    save_avatar(folder.path());
    let temporary = folder.path().join("tmp");
    std::fs::create_dir(&temporary).unwrap();
    for runtime in [None, Some("/nonexistent")] {
        let mut command = Command::new(VIEWER);
        command.current_dir(folder.path()).args(SCREENSHOT).env("TMPDIR", &temporary);
        for variable in ["DISPLAY", "WAYLAND_DISPLAY", "WAYLAND_SOCKET", "XDG_RUNTIME_DIR"] {
            command.env_remove(variable);
        }
        let output = command.envs(runtime.map(|folder| ("XDG_RUNTIME_DIR", folder))).output().unwrap();
        assert!(output.status.success(), "{output:?}");
        assert_eq!(String::from_utf8_lossy(&output.stderr), "");
        assert_eq!(listing(&temporary), [""; 0]);
    }
}

#[test]
fn an_output_never_replaces_anything_but_a_file() {
    let folder = tempfile::tempdir().unwrap();
    save_avatar(folder.path());
    let pipe = folder.path().join("pipe.png");
    assert!(Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    std::os::unix::fs::symlink("/dev/null", folder.path().join("null.png")).unwrap();
    std::fs::create_dir(folder.path().join("folder.png")).unwrap();
    let kept = folder.path().join("kept.png");
    std::fs::write(&kept, "kept").unwrap();
    let mut permissions = std::fs::metadata(&kept).unwrap().permissions();
    permissions.set_readonly(true);
    std::fs::set_permissions(&kept, permissions).unwrap();
    let before = listing(folder.path());
    for (name, problem) in [
        ("pipe.png", "pipe or a device"),
        ("null.png", "pipe or a device"),
        ("folder.png", "folder"),
        ("kept.png", "read-only"),
        ("kept.png/a.png", "not a folder"),
    ] {
        let screenshot = run(VIEWER, folder.path(), &["hand.ghand", "--size", "64x64", "--screenshot", name]);
        assert_one_sentence(&screenshot, &[name, problem]);
        let picture = run(GHAND, folder.path(), &["pose", "--picture", name, "--size", "64x64"]);
        assert_one_sentence(&picture, &[name, problem]);
    }
    assert_eq!(listing(folder.path()), before);
    assert!(std::fs::metadata(&pipe).unwrap().file_type().is_fifo());
    assert_eq!(std::fs::read(&kept).unwrap(), b"kept");
    assert!(std::fs::metadata("/dev/null").unwrap().file_type().is_char_device());
}

#[test]
fn parent_folders_are_made_and_links_are_followed() {
    let folder = tempfile::tempdir().unwrap();
    save_avatar(folder.path());
    std::os::unix::fs::symlink("b/c/real.png", folder.path().join("link.png")).unwrap();
    let arguments = ["hand.ghand", "--size", "64x64", "--screenshot", "link.png"];
    let output = run(VIEWER, folder.path(), &arguments);
    assert!(output.status.success(), "{output:?}");
    assert!(image::open(folder.path().join("b/c/real.png")).is_ok());
    assert!(std::fs::symlink_metadata(folder.path().join("link.png")).unwrap().is_symlink());
}
