//! Runs of `train` that are killed, and go on.

use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

use crate::common::{assert_one_sentence, assert_trained, listing, run, run_in, small_capture};
use ghand_test_support::{cases, long};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

const TRAIN: &str = env!("CARGO_BIN_EXE_train");

/// How often each run is killed; more with GHAND_KILLS.
fn kills() -> usize {
    std::env::var("GHAND_KILLS").ok().and_then(|text| text.parse().ok()).unwrap_or(cases(1, 4))
}

/// Options of a run that takes some seconds.
fn options<'a>(more: &[&'a str]) -> Vec<&'a str> {
    [&["--capture", "capture", "--set", "uv_resolution=40"], more].concat()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// Runs, and kills the run after some time. Returns whether it ended before.
fn run_and_kill(folder: &Path, arguments: &[&str], after: Duration) -> bool {
    let mut child = Command::new(TRAIN)
        .current_dir(folder)
        .args(arguments)
        .env("XDG_RUNTIME_DIR", folder)
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    std::thread::sleep(after);
    let ended = child.try_wait().unwrap().is_some();
    child.kill().unwrap();
    child.wait().unwrap();
    ended
}

fn checkpoints(folder: &Path) -> Vec<PathBuf> {
    let names = listing(&folder.join("checkpoints")).into_iter().filter(|name| name.ends_with(".checkpoint"));
    names.map(|name| folder.join("checkpoints").join(name)).collect()
}

/// Starts a run into `run` that is killed once it has two checkpoints.
fn interrupted(folder: &Path, more: &[&str]) {
    let options =
        options(&[&["--out", "run", "--set", "iterations=1000000", "--checkpoint-every", "0s"], more].concat());
    let mut child = Command::new(TRAIN)
        .current_dir(folder)
        .args(options)
        .env("XDG_RUNTIME_DIR", folder)
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let start = Instant::now();
    while !folder.join("run/checkpoints").exists() || checkpoints(&folder.join("run")).len() < 2 {
        assert!(start.elapsed() < Duration::from_secs(300), "no checkpoints");
        std::thread::sleep(Duration::from_millis(10));
    }
    child.kill().unwrap();
    child.wait().unwrap();
}

#[test]
fn a_run_killed_at_any_moment_ends_with_the_same_bytes() {
    let folder = tempfile::tempdir().unwrap();
    small_capture(&folder.path().join("capture"));
    let direct = ["--set", "iterations=120", "--set", "light=transfer", "--set", "gloss=always"];
    let paper = ["--set", "align=paper", "--set", "light=off"];
    let network = [&paper[..], &["--set", "model=network", "--set", "iterations=24"]].concat();
    let both = [&paper[..], &["--set", "iterations=120"]].concat();
    let mut rng = ChaCha8Rng::seed_from_u64(16);
    let runs = [("direct", &direct[..]), ("both", &both), ("network", &network)];
    let is_tried = |name: &str| match name {
        "direct" => true,
        "network" => cfg!(feature = "networks") && long(),
        _ => long(),
    };
    for (name, more) in runs.into_iter().filter(|(name, _)| is_tried(name)) {
        let whole = format!("{name}-whole");
        let start = Instant::now();
        assert_trained(&run(TRAIN, folder.path(), &options(&[more, &["--out", &whole]].concat())));
        let time = start.elapsed();
        let killed = format!("{name}-killed");
        // The same command begins the run and goes on with it.
        let again = ["--out", &killed, "--resume", "--checkpoint-every", "50ms"];
        let again = options(&[more, &again].concat());
        let mut killed_in_time = 0;
        for _ in 0..kills() {
            // As long as the whole run is possible: a run that goes on needs its start again.
            let after = time.mul_f64(rng.random_range(0.05..1.0));
            killed_in_time += usize::from(!run_and_kill(folder.path(), &again, after));
        }
        assert!(killed_in_time > 0);
        // As if it had been killed while it wrote, which is rare.
        std::fs::write(folder.path().join(&killed).join(".writing-abc"), "half").unwrap();
        let last = run(TRAIN, folder.path(), &again);
        assert!(last.status.success() || text(&last.stderr).contains("floor"), "{}", text(&last.stderr));
        for file in ["avatar.ghand", "poses.json", "config.toml", "report.png"] {
            let [a, b] = [&whole, &killed].map(|run| std::fs::read(folder.path().join(run).join(file)).unwrap());
            assert!(a == b, "{name}: {file} differs");
        }
        assert_eq!(listing(&folder.path().join(&killed)), listing(&folder.path().join(&whole)));
    }
}

#[test]
fn an_interrupted_run_goes_on_as_it_was_started_and_refuses_anything_else() {
    let folder = tempfile::tempdir().unwrap();
    small_capture(&folder.path().join("capture"));
    let train = |arguments: &[&str]| -> Output { run(TRAIN, folder.path(), arguments) };
    interrupted(folder.path(), &["--seed", "5", "--set", "align=off"]);
    // It is not overwritten by mistake.
    let anew = options(&["--out", "run", "--set", "iterations=4"]);
    assert_one_sentence(&train(&anew), &["interrupted run", "--resume", "--force"]);
    let resume = ["--resume", "--out", "run"];
    let other = |more: &[&str]| train(&[&resume[..], more].concat());
    assert_one_sentence(&other(&["--seed", "6"]), &["--resume", "`align`", "started with \"off\""]);
    let same = ["--seed", "6", "--set", "align=off", "--set", "iterations=1000000"];
    let same = options(&same);
    assert_one_sentence(&other(&same), &["`seed` is 6", "started with 5"]);
    assert_one_sentence(&other(&["--split", "test"]), &["--split", "was started with train"]);
    assert_one_sentence(&other(&["--capture", "elsewhere"]), &["--capture", "was started with"]);
    assert_one_sentence(&other(&["--force"]), &["--force", "--resume"]);
    // There is no run in a folder whose name was mistyped.
    assert_one_sentence(&train(&["--resume", "--out", "rum"]), &["rum: there is no run to go on with", "--capture"]);
    std::fs::create_dir(folder.path().join("empty")).unwrap();
    assert_one_sentence(&train(&["--resume", "--out", "empty"]), &["empty: there is no run to go on with"]);
    assert!(!folder.path().join("rum").exists() && listing(&folder.path().join("empty")).is_empty());
    // A changed capture.
    let file = folder.path().join("capture/capture.json");
    let whole = std::fs::read_to_string(&file).unwrap();
    std::fs::rename(folder.path().join("capture"), folder.path().join("moved")).unwrap();
    assert_one_sentence(&train(&resume), &["capture"]);
    std::fs::rename(folder.path().join("moved"), folder.path().join("capture")).unwrap();
    assert_eq!(std::fs::read_to_string(&file).unwrap(), whole);
    // The newest checkpoint is damaged, then all are.
    let files = checkpoints(&folder.path().join("run"));
    let bytes = std::fs::read(files.last().unwrap()).unwrap();
    std::fs::write(files.last().unwrap(), &bytes[..bytes.len() / 2]).unwrap();
    let child = Command::new(TRAIN)
        .current_dir(folder.path())
        .args(resume)
        .env("XDG_RUNTIME_DIR", folder.path())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    std::thread::sleep(Duration::from_secs(8));
    Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
    let output = child.wait_with_output().unwrap();
    let said = text(&output.stdout);
    let told = text(&output.stderr);
    assert!(told.contains("damaged") && told.contains("going on from the one before"), "{told}");
    assert!(said.contains("going on after"), "{said}{told}");
    for file in checkpoints(&folder.path().join("run")) {
        std::fs::write(file, "not a checkpoint").unwrap();
    }
    assert_one_sentence(&train(&resume), &["run/checkpoints/", "is not a checkpoint"]);
}

#[test]
fn a_run_that_has_ended_is_not_repeated_and_keeps_the_checkpoints_that_were_asked_for() {
    let folder = tempfile::tempdir().unwrap();
    small_capture(&folder.path().join("capture"));
    let keep = ["--out", "run", "--set", "iterations=25", "--set", "align=off"];
    let keep = options(&[&keep[..], &["--checkpoint-every", "0s", "--keep-checkpoints", "10"]].concat());
    assert_trained(&run(TRAIN, folder.path(), &keep));
    let kept = listing(&folder.path().join("run/checkpoints"));
    assert_eq!(
        kept,
        ["0000000010.checkpoint", "0000000020.checkpoint", "0000000024.checkpoint", "0000000025.checkpoint"]
    );
    let again = run(TRAIN, folder.path(), &["--resume", "--out", "run"]);
    assert!(again.status.success() && text(&again.stdout).contains("has ended"), "{}", text(&again.stderr));
}

#[test]
fn settings_come_from_presets_and_files_and_can_be_printed() {
    let folder = tempfile::tempdir().unwrap();
    let print = |more: &[&str]| run(TRAIN, folder.path(), &[&["--print-config"], more].concat());
    let printed = text(&print(&[]).stdout);
    assert!(
        printed.starts_with("# Iterations of training; each uses one image\niterations = 2000\n")
            && printed.contains("\nalign = \"contours\"\n"),
        "{printed}"
    );
    let paper = text(&print(&["--preset", "paper", "--max-time", "90m", "--set", "seed=3"]).stdout);
    for line in ["iterations = 124800", "model = \"network\"", "max_seconds = 5400.0", "seed = 3"] {
        assert!(paper.lines().any(|other| other == line), "{line}: {paper}");
    }
    // What was printed can be read.
    std::fs::write(folder.path().join("a.toml"), &paper).unwrap();
    assert_eq!(text(&print(&["--config", "a.toml"]).stdout), paper);
    assert_one_sentence(&print(&["--preset", "fast"]), &["--preset", "`quick` or `standard` or `paper`"]);
    assert_one_sentence(&print(&["--config", "b.toml"]), &["b.toml", "cannot be read"]);
    assert_one_sentence(&print(&["--max-time", "soon"]), &["--max-time"]);
    std::fs::write(folder.path().join("b.toml"), "iteration = 3").unwrap();
    assert_one_sentence(&print(&["--config", "b.toml"]), &["b.toml", "did you mean `iterations`?"]);
    assert_eq!(listing(folder.path()), ["a.toml", "b.toml"]);
}

/// A file system of this many bytes in memory, if the system allows it.
struct SmallDisk(PathBuf);

impl SmallDisk {
    fn new(path: &Path, bytes: usize) -> Option<SmallDisk> {
        std::fs::create_dir_all(path).unwrap();
        let size = format!("size={bytes}");
        let mut mount = Command::new("mount");
        mount.args(["-t", "tmpfs", "-o", &size, "tmpfs"]).arg(path).stderr(Stdio::null());
        mount.status().is_ok_and(|status| status.success()).then(|| SmallDisk(path.into()))
    }
}

impl Drop for SmallDisk {
    fn drop(&mut self) {
        let _ = Command::new("umount").arg("-l").arg(&self.0).status();
    }
}

#[test]
fn a_full_disk_does_not_stop_training_and_the_avatar_is_saved_when_there_is_room() {
    let folder = tempfile::tempdir().unwrap();
    small_capture(&folder.path().join("capture"));
    let Some(disk) = SmallDisk::new(&folder.path().join("run"), 4 << 20) else {
        println!("skipped: this user may not mount a small tmpfs");
        return;
    };
    let filler = disk.0.join("filler");
    std::fs::write(&filler, vec![0; (4 << 20) - (200 << 10)]).unwrap();
    let mut child = Command::new(TRAIN)
        .current_dir(folder.path())
        .args(options(&["--out", "run", "--set", "iterations=30", "--set", "align=off", "--checkpoint-every", "0s"]))
        .env("XDG_RUNTIME_DIR", folder.path())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    // What it says, until it waits for room.
    let mut lines = BufReader::new(child.stderr.take().unwrap()).lines();
    let mut told = String::new();
    while !told.contains("there is no room on the disk; waiting") {
        told += &lines.next().expect("it waits for room").unwrap();
    }
    assert!(!disk.0.join("avatar.ghand").exists(), "there was room");
    std::fs::remove_file(&filler).unwrap();
    lines.for_each(|line| told += &line.unwrap());
    let said = text(&child.wait_with_output().unwrap().stdout);
    assert!(told.contains("cannot write the checkpoint") && told.contains("training goes on"), "{said}{told}");
    assert!(said.contains("avatar: run/avatar.ghand"), "{said}{told}");
    // A folder that cannot be written to at all is an error before training.
    let refused = run_in(TRAIN, folder.path(), &options(&["--out", "/proc/run"]), &[]);
    assert_one_sentence(&refused, &["/proc/run", "cannot create the output folder"]);
}
