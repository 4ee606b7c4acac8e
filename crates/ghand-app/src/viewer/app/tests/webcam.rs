//! Hands of a video drive the hand.

use std::path::PathBuf;
use std::process::Command;
use std::time::{Duration, Instant};

use clap::Parser;
use ghand_core::Pose;
use ghand_core::rotation::rotation_from_axis_angle;
use ghand_footage::LiveSource;
use ghand_motion::RestSkeleton;
use ghand_motion::ik::HandIk;
use ghand_motion::live::{LiveOptions, LivePoses};
use serde_json::Value;

use super::*;
use crate::commands::track::{self, TrackArgs};
use crate::viewer::live::feed::FeedSettings;

/// Longest time until something happens on a busy computer.
const PATIENCE: Duration = Duration::from_secs(60);

/// A film in a folder: a picture of a right hand with these filters of ffmpeg, without loss; `None` without ffmpeg.
fn film(folder: &Path, filters: &str) -> Option<PathBuf> {
    if !ghand_test_support::ffmpeg() {
        return None;
    }
    let hand = Path::new(env!("CARGO_MANIFEST_DIR")).join("../ghand-tracker/tests/data/hand.png");
    let path = folder.join("film of a hand.mkv");
    let mut ffmpeg = Command::new("ffmpeg");
    ffmpeg.args(["-v", "error", "-y", "-loop", "1", "-r", "25", "-i"]).arg(hand);
    ffmpeg.args(["-t", "4", "-vf", filters, "-c:v", "ffv1", "-pix_fmt", "bgr0"]).arg(&path);
    assert!(ffmpeg.status().unwrap().success());
    Some(path)
}

/// A hand that turns to and fro.
const TURNING: &str = "rotate=0.5*sin(PI*t):c=gray";
const STILL: &str = "null";
const NO_HAND: &str = "drawbox=color=gray:thickness=fill";

fn viewer(path: &Path) -> Headless {
    let mut ui = Headless::new(Subject::Hand(Box::new(small_hand())), vec2(760.0, 900.0), 0.1);
    ui.frame(Vec::new());
    ui.viewer().start_live(FeedSettings::Webcam(LiveSource::video(path).unwrap()));
    ui.viewer().wait_for_webcam().unwrap();
    ui.frame(Vec::new());
    ui
}

/// Numbers of the processes that read a file.
fn readers(path: &Path) -> Vec<u32> {
    let processes = std::fs::read_dir("/proc").unwrap().flatten();
    let numbers = processes.filter_map(|entry| entry.file_name().to_string_lossy().parse().ok());
    let reads = |number: &u32| {
        let line = std::fs::read(format!("/proc/{number}/cmdline")).unwrap_or_default();
        let line = String::from_utf8_lossy(&line);
        line.starts_with("ffmpeg") && line.contains(&*path.to_string_lossy())
    };
    numbers.filter(reads).collect()
}

impl Headless {
    fn until(&mut self, what: &str, mut is_so: impl FnMut(&mut Headless) -> bool) {
        let start = Instant::now();
        while !is_so(self) {
            assert!(start.elapsed() < PATIENCE, "{what}: not in time");
            std::thread::sleep(Duration::from_millis(5));
            self.frame(Vec::new());
        }
    }

    fn shows(&self, text: &str) -> bool {
        self.harness.query_all_by_label_contains(text).next().is_some()
    }

    fn is_driven(&mut self) -> bool {
        self.viewer().live.drives()
    }
}

/// Largest difference of the rotations, as matrices.
fn difference(a: &Pose, b: &Pose) -> f64 {
    let turns = a.rotations.iter().zip(&b.rotations);
    let entries =
        turns.flat_map(|(a, b)| (rotation_from_axis_angle(*a) - rotation_from_axis_angle(*b)).to_cols_array());
    entries.map(f64::abs).fold(0.0, f64::max)
}

/// Farthest that landmarks of a still hand may be apart, mm: the tracker goes to and fro by 0.6, its first pictures,
/// off by up to 7, tell other sizes, and the filter lags.
const FARTHEST: f64 = 3.0;

/// `ghand track`.
#[derive(Parser)]
struct Track {
    #[command(flatten)]
    args: TrackArgs,
}

#[test]
fn poses_are_those_of_the_file_that_track_writes() {
    let folder = tempfile::tempdir().unwrap();
    let Some(path) = film(folder.path(), STILL) else { return };
    let mut ui = viewer(&path);
    ui.until("the hand is driven", Headless::is_driven);
    // Until the filter and the size of the hand have settled.
    let pictures = |ui: &mut Headless| {
        let webcam = ui.viewer().live.live().and_then(|live| live.feed().webcam());
        webcam.map_or(0, |webcam| webcam.pictures())
    };
    ui.until("the hand is known", |ui| pictures(ui) > 80);
    let mut before = ui.hand().pose.clone();
    ui.until("the pose settles", |ui| {
        std::thread::sleep(Duration::from_millis(500));
        ui.frame(Vec::new());
        let now = ui.hand().pose.clone();
        difference(&now, &std::mem::replace(&mut before, now.clone())) < 0.01
    });
    let live = ui.hand().pose.clone();
    let out = folder.path().join("hands.json");
    let line = ["track", path.to_str().unwrap(), "--out", out.to_str().unwrap()];
    track::run(&Track::parse_from(line).args).unwrap();
    let file: Value = serde_json::from_slice(&std::fs::read(&out).unwrap()).unwrap();
    let options = LiveOptions { smooth: Some(false), ..LiveOptions::default() };
    let mut poses = LivePoses::default();
    let mut of_file = None;
    for (k, frame) in file["frames"].as_array().unwrap().iter().enumerate() {
        let seconds = k as f64 / 25.0;
        of_file = Some(poses.read(frame.to_string().as_bytes(), ui.hand().model(), seconds, &options).unwrap().pose);
    }
    let ik = HandIk::new(&RestSkeleton::of(ui.hand().model()).unwrap());
    let [a, b] = [&live, &of_file.unwrap()].map(|pose| ik.landmarks(pose));
    let off: Vec<f64> = a.iter().zip(&b).map(|(a, b)| 1e3 * a.distance(*b)).collect();
    assert!(off.iter().all(|off| *off < FARTHEST), "{off:.1?} mm");
    assert!(difference(&live, &Pose::rest(16)) > 0.3, "a hand at rest tells nothing");
}

#[test]
fn a_moving_hand_is_followed_until_the_user_holds_or_stops_it() {
    let folder = tempfile::tempdir().unwrap();
    let Some(path) = film(folder.path(), TURNING) else { return };
    let first = small_hand().pose;
    let mut ui = viewer(&path);
    ui.until("the hand is driven", |ui| ui.is_driven() && ui.hand().pose != first);
    let pose = ui.hand().pose.clone();
    ui.until("the hand turns", |ui| difference(&ui.hand().pose, &pose) > 0.3);
    ui.until("rates are known", |ui| ui.shows(" /s") && !ui.shows("0 /s"));
    for text in ["film of a hand.mkv", "one hand is seen", "Tracked", "Latency", "Dropped", "smooth", "move in space"] {
        assert!(ui.shows(text), "{text}");
    }
    assert!(!ui.shows("ws://") && !ui.shows("Unusable"));
    ui.harness.check_accessibility();
    ui.click("Hold");
    let held = ui.hand().pose.clone();
    (0..20).for_each(|_| {
        std::thread::sleep(Duration::from_millis(20));
        ui.frame(Vec::new());
    });
    assert!(ui.hand().pose == held && !ui.is_driven());
    ui.click("Resume");
    ui.until("it is followed again", |ui| ui.hand().pose != held);
    ui.click("Stop");
    assert!(ui.viewer().live.live().is_none() && !ui.shows("Tracked"));
    let last = ui.hand().pose.clone();
    ui.frame(Vec::new());
    assert_eq!(ui.hand().pose, last);
    // The menu opens it again.
    ui.press(egui::Modifiers::COMMAND, egui::Key::L);
    ui.until("it is followed again", |ui| ui.hand().pose != last);
    assert!(ui.shows("film of a hand.mkv"));
}

/// A viewer that takes videos for the connected cameras.
fn viewer_with_cameras(cameras: &[&Path]) -> Headless {
    let mut ui = Headless::new(Subject::Hand(Box::new(small_hand())), vec2(760.0, 900.0), 0.1);
    ui.frame(Vec::new());
    let cameras = cameras.iter().map(|path| LiveSource::video(path).unwrap()).collect();
    ui.viewer().live.set_cameras(cameras);
    ui
}

#[test]
fn the_menu_opens_a_chosen_webcam_and_closes_it() {
    let folder = tempfile::tempdir().unwrap();
    let Some(path) = film(folder.path(), TURNING) else { return };
    let other = folder.path().join("another camera.mkv");
    std::fs::copy(&path, &other).unwrap();
    let mut ui = viewer_with_cameras(&[&path, &other]);
    let first = ui.hand().pose.clone();
    let open = |ui: &mut Headless, name: &str| {
        for title in ["Pose", "Choose webcam"] {
            ui.open_menu(title);
        }
        let entry = ui.harness.query_all_by_label_contains(name).next().unwrap();
        entry.click();
        (0..3).for_each(|_| _ = ui.frame(Vec::new()));
    };
    open(&mut ui, "another camera.mkv");
    ui.until("the hand is driven", |ui| ui.is_driven() && ui.hand().pose != first);
    assert!(ui.viewer().live.webcam_name().unwrap().ends_with("another camera.mkv"));
    // The port is another entry's.
    assert!(!ui.viewer().live.is_open());
    open(&mut ui, "film of a hand.mkv");
    assert!(ui.viewer().live.webcam_name().unwrap().ends_with("film of a hand.mkv"));
    assert_eq!(readers(&other).len(), 0);
    let keys = egui::Modifiers::COMMAND | egui::Modifiers::SHIFT;
    ui.press(keys, egui::Key::L);
    assert!(ui.viewer().live.live().is_none() && readers(&path).is_empty());
    // The one that was chosen last.
    ui.press(keys, egui::Key::L);
    assert!(ui.viewer().live.webcam_name().unwrap().ends_with("film of a hand.mkv"));
    // One camera is no choice.
    let mut ui = viewer_with_cameras(&[&path]);
    ui.open_menu("Pose");
    assert!(ui.shows("Webcam") && !ui.shows("Choose webcam"));
}

#[test]
fn a_computer_without_a_camera_is_told() {
    if !LiveSource::cameras().is_empty() {
        return;
    }
    let mut ui = viewer_with_cameras(&[]);
    ui.press(egui::Modifiers::COMMAND | egui::Modifiers::SHIFT, egui::Key::L);
    ui.frame(Vec::new());
    assert!(ui.shows("first camera: there is none; connect one"));
    assert!(ui.viewer().live.live().is_none());
}

#[test]
fn without_a_hand_the_pose_stays() {
    let folder = tempfile::tempdir().unwrap();
    let Some(path) = film(folder.path(), NO_HAND) else { return };
    let mut ui = viewer(&path);
    let pose = ui.hand().pose.clone();
    ui.until("no hand is seen", |ui| ui.shows("no hand is seen") && ui.shows("Tracked"));
    assert!(ui.hand().pose == pose && !ui.is_driven());
}

#[test]
#[cfg(target_os = "linux")]
fn ffmpeg_ends_with_live_poses_and_its_own_end_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let Some(path) = film(folder.path(), TURNING) else { return };
    let mut ui = viewer(&path);
    assert_eq!(readers(&path).len(), 1);
    ui.click("Stop");
    assert!(readers(&path).is_empty());
    ui.press(egui::Modifiers::COMMAND, egui::Key::L);
    ui.until("the hand is driven", Headless::is_driven);
    let [reader] = readers(&path)[..] else { panic!("{:?}", readers(&path)) };
    assert!(Command::new("kill").args(["-9", &reader.to_string()]).status().unwrap().success());
    ui.until("the end is told", |ui| ui.shows("has stopped reading it"));
    assert!(ui.viewer().live.live().is_none());
    // Another one, of a viewer that is closed.
    ui.press(egui::Modifiers::COMMAND, egui::Key::L);
    ui.until("the hand is driven", Headless::is_driven);
    assert_eq!(readers(&path).len(), 1);
    drop(ui);
    assert!(readers(&path).is_empty());
}

#[test]
#[cfg(target_os = "linux")]
fn a_device_that_gives_no_pictures_is_told() {
    if !ghand_test_support::ffmpeg() {
        return;
    }
    let mut ui = Headless::untrained_avatar();
    ui.frame(Vec::new());
    ui.viewer().start_live(FeedSettings::Webcam(LiveSource::find("/dev/null".as_ref()).unwrap()));
    let error = ui.viewer().wait_for_webcam().unwrap_err().to_string();
    assert!(error.starts_with("/dev/null: is not a camera"), "{error}");
    assert!(ui.viewer().live.live().is_none());
}
