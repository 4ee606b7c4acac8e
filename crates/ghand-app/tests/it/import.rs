//! `ghand import`: from real videos to a capture, and what it says of footage that cannot be used.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use ghand_capture::Capture;
use ghand_capture::cameras::list::read_cameras;
use ghand_core::{Camera, Pose, Side};
use ghand_hand_model::builtin::builtin_hand;
use ghand_motion::RestSkeleton;
use ghand_motion::ik::HandIk;
use ghand_test_support::{cases, ffmpeg, long, shared};
use glam::DVec3;
use image::{Rgb, RgbImage};
use serde_json::Value;

use crate::common::{assert_one_sentence, run};

/// Seconds of the films that are imported.
fn seconds() -> &'static str {
    cases("4", "7")
}

fn make_video(arguments: &[&str], path: &Path) {
    let made = Command::new("ffmpeg").args(["-loglevel", "error", "-y"]).args(arguments).arg(path).output().unwrap();
    assert!(made.status.success(), "{}", String::from_utf8_lossy(&made.stderr));
}

fn import(footage: &[&Path], out: &Path, more: &[&str]) -> Output {
    let text = |path: &Path| path.to_str().unwrap().to_owned();
    let mut arguments = vec!["import".to_owned()];
    arguments.extend(footage.iter().map(|path| text(path)));
    arguments.extend(["--out".to_owned(), text(out)]);
    arguments.extend(more.iter().map(|option| (*option).to_owned()));
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    run(env!("CARGO_BIN_EXE_ghand"), out.parent().unwrap(), &arguments)
}

/// The first seconds of the films of two cameras, without a hand in the first half second.
fn films(folder: &Path) -> Option<[PathBuf; 2]> {
    let films = ["cam0", "cam1"].map(|name| shared(&format!("footage/desk-two-cameras/{name}.mp4")));
    let [Some(a), Some(b)] = films else { return None };
    let cut = |from: &Path, name: &str| {
        let path = folder.join(name);
        make_video(&["-i", from.to_str().unwrap(), "-t", seconds(), "-c", "copy"], &path);
        path
    };
    Some([cut(&a, "cam0.mp4"), cut(&b, "cam1.mp4")])
}

/// Degrees by which the second camera's turn relative to the first one differs.
fn turn_between(found: &[Camera], given: &[Camera]) -> f64 {
    let turn = |cameras: &[Camera]| cameras[1].rotation * cameras[0].rotation.transpose();
    let off = turn(found) * turn(given).transpose();
    (0.5 * (off.x_axis.x + off.y_axis.y + off.z_axis.z - 1.0)).clamp(-1.0, 1.0).acos().to_degrees()
}

#[test]
fn two_films_and_their_calibration_become_a_capture() {
    let folder = tempfile::tempdir().unwrap();
    let (true, Some([a, b])) = (ffmpeg(), films(folder.path())) else { return };
    let calibration = shared("footage/desk-two-cameras").unwrap();
    let out = folder.path().join("me");
    let options = ["--cameras", calibration.to_str().unwrap(), "--frames", "10"];
    let made = import(&[&a, &b], &out, &options);
    let said = String::from_utf8_lossy(&made.stdout).into_owned();
    assert!(made.status.success(), "{said}{}", String::from_utf8_lossy(&made.stderr));
    // The calibration counts in squares of a board.
    assert!(said.contains("unit of length") && said.contains("train --capture"), "{said}");
    let capture = Capture::open(&out).unwrap();
    assert_eq!((capture.cameras.len(), capture.frames.len()), (2, 10));
    assert_eq!(capture.split("test").unwrap().frames.len(), 2);
    let given = ghand_capture::cameras::calibration_files::read_calibration(&calibration).unwrap();
    let given: Vec<Camera> =
        given.cameras.iter().map(|camera| given.lens_camera(camera, [720, 720], 1.0).unwrap().camera).collect();
    assert!(turn_between(&capture.cameras, &given) < 1e-6);
    // A square is 43 mm; the mean hand may differ from this one by some per cent.
    let distance = |cameras: &[Camera]| cameras[0].center().distance(cameras[1].center());
    let square = distance(&capture.cameras) / distance(&given);
    assert!((0.036..0.050).contains(&square), "{square}");
    for view in &capture.split("train").unwrap().views {
        let mask = capture.load_hand_mask(view.camera, view.frame).unwrap();
        let hand = mask.iter().filter(|inside| **inside).count();
        assert!((2_000..60_000).contains(&hand), "{hand} pixels of the hand");
    }
    let page = fs::read_to_string(out.join("import.html")).unwrap();
    assert!(page.contains("cam1") && page.len() < 3_000_000);
    // Sheet and turntable; a plan and two time lines, each with the distances of its camera.
    assert_eq!([page.matches("data:image/png").count(), page.matches("<svg").count()], [2, 3]);
    assert_eq!(page.matches("<path class=\"residual\" d=\"M").count(), 2);
    assert_eq!(page.matches("<code>--").count(), 7, "an option for each decision");
    if !cases(false, true) {
        return;
    }
    // What was tracked is kept: other options need no tracking.
    let kept = out.join("import/tracked-cam0.json");
    let before = fs::metadata(&kept).unwrap().modified().unwrap();
    let made = import(&[&a, &b], &out, &["--frames", "8"]);
    let said = String::from_utf8_lossy(&made.stdout).into_owned();
    assert!(made.status.success(), "{said}{}", String::from_utf8_lossy(&made.stderr));
    assert_eq!(fs::metadata(&kept).unwrap().modified().unwrap(), before);
    let alone = Capture::open(&out).unwrap();
    assert_eq!(alone.frames.len(), 8);
    assert_eq!(fs::read_dir(out.join("images/cam1")).unwrap().count(), 8, "no image of the first choice is left");
    // The hand alone, in seven seconds.
    let off = turn_between(&alone.cameras, &given);
    println!("cameras by the hand alone: {off:.1} degrees off");
    assert!(off < 10.0, "{off}");
}

/// FreiHAND's files with a few images of a hand that turns before the camera.
fn freihand(root: &Path) {
    const SIZE: u32 = 224;
    const FOCAL: f64 = 400.0;
    let model = builtin_hand(Side::Right).unwrap();
    let ik = HandIk::new(&RestSkeleton::of(&model).unwrap());
    let camera = Camera::look_at(DVec3::new(0.0, 0.0, -0.6), DVec3::ZERO, DVec3::NEG_Y, 0.5, SIZE, SIZE);
    let mut joints = vec![];
    for folder in ["training/rgb", "training/mask"] {
        fs::create_dir_all(root.join(folder)).unwrap();
    }
    for sample in 0..6 {
        let mut pose = Pose::rest(model.joint_count());
        pose.rotations[0] = DVec3::new(0.1 * f64::from(sample), 0.0, 0.2);
        pose.translation = -model.joints[0];
        let seen = ik.landmarks(&pose).map(|at| camera.camera_from_world(at));
        let pixels = seen.map(|at| [at.x, at.y].map(|x| x / at.z * FOCAL + 112.0));
        let near =
            |x: u32, y: u32| pixels.iter().any(|[u, v]| (u - f64::from(x)).abs().max((v - f64::from(y)).abs()) < 9.0);
        let picture = |of: [u8; 2]| RgbImage::from_fn(SIZE, SIZE, |x, y| Rgb([of[usize::from(near(x, y))]; 3]));
        picture([90, 180]).save(root.join(format!("training/rgb/{sample:08}.jpg"))).unwrap();
        picture([0, 255]).save(root.join(format!("training/mask/{sample:08}.jpg"))).unwrap();
        joints.push(seen.map(|at| at.to_array()).to_vec());
    }
    let matrix = [[FOCAL, 0.0, 112.0], [0.0, FOCAL, 112.0], [0.0, 0.0, 1.0]];
    fs::write(root.join("training_K.json"), serde_json::to_vec(&vec![matrix; 6]).unwrap()).unwrap();
    fs::write(root.join("training_xyz.json"), serde_json::to_vec(&joints).unwrap()).unwrap();
}

#[test]
fn a_data_set_becomes_a_capture_with_a_page() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    freihand(&path("FreiHAND"));
    let said = run_ghand(folder.path(), &["import", "FreiHAND", "--out", "me"]);
    assert!(said.contains("6 of 6 annotated frames of FreiHAND") && said.contains("page: me"), "{said}");
    assert_eq!(Capture::open(&path("me")).unwrap().frames.len(), 6);
    let page = fs::read_to_string(path("me/import.html")).unwrap();
    for part in ["FreiHAND", "224 × 224", "6 of 6", "<code>--hand-model</code>", "mm off the hand"] {
        assert!(page.contains(part), "{part}");
    }
    // Sheet and turntable; a plan, but no time lines.
    assert_eq!([page.matches("data:image/png").count(), page.matches("<svg").count()], [2, 1]);
    assert!(!page.contains("class=\"timeline\"") && page.len() < 3_000_000);
}

/// Whether each pixel of a mask's file is on the hand.
fn mask_of(path: &Path) -> Vec<bool> {
    image::open(path).unwrap().to_luma8().pixels().map(|pixel| pixel.0[0] >= 128).collect()
}

fn run_ghand(folder: &Path, arguments: &[&str]) -> String {
    let made = run(env!("CARGO_BIN_EXE_ghand"), folder, arguments);
    let said = String::from_utf8_lossy(&made.stdout).into_owned();
    assert!(made.status.success(), "{said}{}", String::from_utf8_lossy(&made.stderr));
    said
}

/// Makes videos of two cameras.
fn made_footage(folder: &Path, seconds: &str) {
    let size = ["--size", "480x360", "--seconds", seconds];
    run_ghand(folder, &[&["capture", "--footage", "--views", "2", "--out", "footage"][..], &size].concat());
}

fn truth(folder: &Path) -> Value {
    serde_json::from_slice(&fs::read(folder.join("footage/truth.json")).unwrap()).unwrap()
}

#[test]
fn made_footage_comes_back_with_its_truth() {
    // Real films import the same way.
    if !ffmpeg() || (shared("footage/desk-two-cameras").is_some() && !long()) {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    made_footage(folder.path(), "2");
    let cameras = ["--cameras", "footage/cameras.json"];
    run_ghand(folder.path(), &[&["import", "footage", "--out", "me", "--frames", "12"][..], &cameras].concat());
    let capture = Capture::open(&path("me")).unwrap();
    let truth = truth(folder.path());
    // Landmarks in space, as far as the wrist, knuckles and joints are those of the tracker.
    let ik = HandIk::new(&RestSkeleton::of(&capture.template).unwrap());
    let mut off = vec![];
    for frame in &capture.frames {
        let seen = truth["hand"][frame.id.parse::<usize>().unwrap()]["landmarks"].as_array().unwrap().clone();
        for (landmark, at) in ik.landmarks(&frame.pose).iter().enumerate().filter(|(k, _)| k % 4 != 0) {
            let number = |axis: usize| seen[landmark][axis].as_f64().unwrap();
            off.push(at.distance(DVec3::new(number(0), number(1), number(2))));
        }
    }
    off.sort_by(f64::total_cmp);
    // Masks, where the truth has them: those of every tenth frame.
    let (mut wrong, mut all) = (0, 0);
    for frame in capture.frames.iter().map(|frame| &frame.id).filter(|id| id.ends_with('0')) {
        let true_mask = path("footage/truth-masks/cam0").join(format!("{}.png", &frame[1..]));
        let found = capture.frames.iter().position(|other| other.id == *frame).unwrap();
        let mask = capture.load_hand_mask(0, found).unwrap();
        all += mask.iter().filter(|inside| **inside).count();
        wrong += mask.iter().zip(mask_of(&true_mask)).filter(|(found, truth)| **found && !truth).count();
    }
    println!(
        "landmarks {:.1} mm off (median); {:.1} % of the masks' pixels are not the hand",
        1e3 * off[off.len() / 2],
        1e2 * wrong as f64 / all.max(1) as f64
    );
    assert!(off[off.len() / 2] < 0.012, "{}", off[off.len() / 2]);
    assert!((wrong as f64) < 0.08 * all as f64, "{wrong} of {all} pixels");
}

#[test]
fn made_footage_without_calibration_tells_cameras_and_clocks_and_what_is_wrong_with_it() {
    if !long() || !ffmpeg() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    made_footage(folder.path(), "4");
    let truth = truth(folder.path());
    // The clocks, from what is said.
    let given = read_cameras(&path("footage/cameras.json")).unwrap();
    let given: Vec<Camera> = given.into_iter().map(|lens| lens.camera).collect();
    let said = run_ghand(folder.path(), &["import", "footage", "--out", "alone", "--frames", "20"]);
    let alone = Capture::open(&path("alone")).unwrap();
    let turn = turn_between(&alone.cameras, &given);
    println!("cameras by the hand alone: {turn:.1} degrees off\n{said}");
    assert!(turn < 8.0, "{turn}");
    let line = said.lines().find(|line| line.starts_with("clock of cam1")).unwrap();
    let later: f64 = line.split_whitespace().nth(3).unwrap().parse().unwrap();
    let start = truth["cameras"][1]["start"].as_f64().unwrap();
    println!("clock: {later} s found, {start} s true");
    assert!((later + start).abs() < 0.01, "{later} {start}");
    // What is wrong with footage of hands, and both hands side by side.
    let [cam0, cam1] = ["cam0", "cam1"].map(|name| path(&format!("footage/{name}.mp4")));
    let filtered = |filter: &str, name: &str| {
        let made = path(name);
        make_video(&["-i", cam1.to_str().unwrap(), "-vf", filter, "-t", "2"], &made);
        made
    };
    let mirrored = filtered("hflip", "mirrored.mp4");
    let moving = filtered("crop=360:270:60+50*sin(2*t):45+40*cos(2*t)", "moving.mp4");
    let both = filtered("split[a][b];[b]hflip[c];[a][c]hstack", "<img src=x>.mp4");
    for (other, more, parts) in [
        (&mirrored, &[][..], &["mirrored.mp4", "left", "mirror"][..]),
        (&moving, &[], &["moving", "moves", "stand still"]),
        (&cam0, &[], &["same side", "twice"]),
        (&cam1, &["--landmarks", "footage/cameras.json"], &["cameras.json", "landmarks"]),
    ] {
        assert_one_sentence(&import(&[&cam0, other], &path("bad"), more), parts);
    }
    let said = import(&[&both], &path("both"), &["--side", "both", "--frames", "8"]);
    assert!(said.status.success(), "{}", String::from_utf8_lossy(&said.stderr));
    let sides = ["right", "left"].map(|name| Capture::open(&path("both").join(name)).unwrap());
    assert!(sides[0].side == Side::Right && sides[1].side == Side::Left);
    assert_eq!(sides[0].frames.len(), 8);
    let page = fs::read_to_string(path("both/left/import.html")).unwrap();
    assert!(page.contains("&lt;img src=x&gt;.mp4") && !page.contains("<img src=x"));
}

#[test]
fn footage_that_cannot_be_used_is_one_sentence() {
    if !ffmpeg() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    fs::write(path("empty.mp4"), b"").unwrap();
    fs::write(path("text.mp4"), b"not a film").unwrap();
    make_video(&["-f", "lavfi", "-i", "testsrc=size=160x120:rate=30:duration=1"], &path("no-hand.mp4"));
    fs::create_dir(path("mine")).unwrap();
    fs::write(path("mine/notes.txt"), b"keep").unwrap();
    let no_hand = path("no-hand.mp4");
    for (footage, out, more, parts) in [
        (path("none.mp4"), "a", &[][..], &["none.mp4"][..]),
        (path("empty.mp4"), "b", &[], &["empty.mp4", "empty"]),
        (path("text.mp4"), "c", &[], &["text.mp4"]),
        (no_hand.clone(), "d", &[], &["no-hand.mp4", "no hand", "film"]),
        (no_hand.clone(), "mine", &[], &["mine", "not empty"]),
        (no_hand.clone(), "e", &["--hand-length", "186"], &["--hand-length", "186mm"]),
        (no_hand.clone(), "e", &["--hand-length", "3m"], &["no hand is 3 m long"]),
        (no_hand, "f", &["--cameras", "nowhere.toml"], &["nowhere.toml"]),
    ] {
        assert_one_sentence(&import(&[&footage], &path(out), more), parts);
    }
    assert_eq!(fs::read(path("mine/notes.txt")).unwrap(), b"keep");
}
