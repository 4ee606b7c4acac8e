//! How programs end that are stopped, and what keeps two of them apart.

use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use crate::common::{assert_one_sentence, listing, run, save_avatar};

const GHAND: &str = env!("CARGO_BIN_EXE_ghand");

fn start(folder: &Path, line: &str) -> Child {
    let words = line.split_whitespace();
    let mut command = Command::new(GHAND);
    command.current_dir(folder).args(words).stdout(Stdio::null()).stderr(Stdio::piped());
    command.spawn().unwrap()
}

/// Waits until a folder has an entry of this kind.
fn wait_for(folder: &Path, is_there: impl Fn(&str) -> bool) {
    let start = Instant::now();
    while !(folder.exists() && listing(folder).iter().any(|name| is_there(name))) {
        assert!(start.elapsed() < Duration::from_secs(120), "{:?}", listing(folder));
        std::thread::sleep(Duration::from_millis(5));
    }
}

fn stop(child: Child, signal: &str) -> String {
    let id = child.id().to_string();
    assert!(Command::new("kill").args([signal, &id]).status().unwrap().success());
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(130));
    String::from_utf8_lossy(&output.stderr).into_owned()
}

#[test]
fn a_capture_that_is_stopped_leaves_nothing_and_is_made_by_one_program() {
    let folder = tempfile::tempdir().unwrap();
    for signal in ["-TERM", "-INT"] {
        let first = start(folder.path(), "capture --out C --size 512x512 --views 40 --train-frames 40");
        wait_for(folder.path(), |name| name.starts_with(".synthetic-"));
        let second = run(GHAND, folder.path(), &["capture", "--out", "C"]);
        assert_one_sentence(&second, &["C: another command is writing there (process"]);
        let told = stop(first, signal);
        assert!(told.contains("stopped: nothing was written"), "{told}");
        assert_eq!(listing(folder.path()), [""; 0]);
    }
}

#[test]
fn pictures_that_are_stopped_are_listed_and_their_folder_is_free_again() {
    let folder = tempfile::tempdir().unwrap();
    save_avatar(folder.path());
    let pictures = folder.path().join("pictures");
    let line = "render hand.ghand --turntable 5000 --size 64x64 --out pictures";
    let first = start(folder.path(), line);
    wait_for(&pictures, |name| name.ends_with(".png"));
    let words: Vec<&str> = line.split_whitespace().collect();
    assert_one_sentence(&run(GHAND, folder.path(), &words), &["pictures: another command is writing there"]);
    stop(first, "-TERM");
    assert!(listing(&pictures).iter().all(|name| !name.starts_with('.')), "{:?}", listing(&pictures));
    let again = ["render", "hand.ghand", "--turntable", "2", "--size", "64x64", "--out", "pictures"];
    assert!(run(GHAND, folder.path(), &again).status.success());
    assert_eq!(listing(&pictures), ["frame-0000_view-00.png", "frame-0000_view-01.png", "render.json"]);
}
