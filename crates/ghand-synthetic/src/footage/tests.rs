use std::path::Path;
use std::process::Command;

use ghand_board::{BoardCamera, BoardFinder, BoardKind, calibrate};
use ghand_capture::cameras::list::{LensCamera, read_cameras};
use ghand_core::Camera;
use ghand_core::rotation::rotation_from_axis_angle;
use ghand_render::{AdapterChoice, Gpu};
use ghand_test_support::long;
use glam::{DVec2, DVec3};
use serde_json::Value;

use super::board::Board;
use super::clock::Clock;
use super::exposure::{FilmCamera, Scene};
use super::room::Room;
use super::subject::Subject;
use super::truth::Truth;
use super::*;
use crate::images::lighting::lighting;
use crate::make_footage::make_footage;
use crate::{LightSetup, SceneMesh};

fn options() -> FootageOptions {
    FootageOptions { views: 2, seconds: 1.0, width: 160, height: 120, ..Default::default() }
}

/// A renderer that draws vertices as points in the hue of their depth.
fn points(scene: &SceneMesh, camera: &Camera) -> Result<Vec<[u8; 4]>, String> {
    let mut pixels = vec![[0; 4]; camera.width as usize * camera.height as usize];
    for position in scene.positions {
        let (pixel, depth) = camera.project(*position);
        let is_inside = pixel.min_element() >= 0.0
            && pixel.x < f64::from(camera.width)
            && pixel.y < f64::from(camera.height)
            && depth > 0.0;
        if is_inside {
            pixels[pixel.y as usize * camera.width as usize + pixel.x as usize] =
                [200, 150, (depth * 200.0) as u8, 255];
        }
    }
    Ok(pixels)
}

/// Some frames of all cameras, and the truth as text.
fn frames(options: &FootageOptions) -> (Vec<Vec<u8>>, String) {
    let subject = Subject::random(options).unwrap();
    let room = Room::furnished(options.seed);
    let cameras = FilmCamera::all(options, Clock::all(options), &room);
    let scene = Scene { subject: &subject, room: &room, lighting: &lighting(LightSetup::Soft), board: None };
    let frame = |camera, frame| scene.frame(camera, frame, false, &mut points).unwrap().0;
    let frames = cameras.iter().flat_map(|camera| [0, 11].map(|k| frame(camera, k))).collect();
    (frames, serde_json::to_string(&Truth::of(&subject, &cameras, Side::Right, None)).unwrap())
}

#[test]
fn the_same_options_give_the_same_frames_and_truth_and_others_do_not() {
    let (first, truth) = frames(&options());
    assert!(first.iter().all(|frame| frame.len() == 160 * 120 * 3));
    assert!(first[0] != first[1] && first[0] != first[2], "frames and cameras differ");
    assert!((first.clone(), truth.clone()) == frames(&options()));
    let other = frames(&FootageOptions { seed: 8, ..options() });
    assert!(other.0[0] != first[0] && other.1 != truth);
}

fn numbers<const N: usize>(value: &Value) -> [f64; N] {
    std::array::from_fn(|k| value[k].as_f64().unwrap())
}

/// Size, nominal rate, and the time of each frame of a video.
fn probed(path: &Path) -> ([u64; 2], String, Vec<f64>) {
    let mut ffprobe = Command::new("ffprobe");
    ffprobe.args(["-v", "error", "-select_streams", "v:0", "-of", "json"]);
    ffprobe.args(["-show_entries", "stream=width,height,r_frame_rate:frame=best_effort_timestamp_time"]);
    let output = ffprobe.arg(path).output().unwrap();
    let found: Value = serde_json::from_slice(&output.stdout).unwrap();
    let stream = &found["streams"][0];
    let size = ["width", "height"].map(|edge| stream[edge].as_u64().unwrap());
    let time = |frame: &Value| frame["best_effort_timestamp_time"].as_str().unwrap().parse().unwrap();
    let times = found["frames"].as_array().unwrap().iter().map(time).collect();
    (size, stream["r_frame_rate"].as_str().unwrap().into(), times)
}

fn made(options: &FootageOptions, folder: &Path) -> (Value, Vec<LensCamera>) {
    let gpu = Gpu::new(&AdapterChoice::from_env()).unwrap();
    let mut told = vec![];
    let frames = make_footage(&gpu, options, folder, |done, all| told.push((done, all))).unwrap();
    assert!(told.len() == frames && told.last() == Some(&(frames, frames)));
    let truth: Value = serde_json::from_slice(&std::fs::read(folder.join("truth.json")).unwrap()).unwrap();
    (truth, read_cameras(&folder.join("cameras.json")).unwrap())
}

/// Where a camera of the file sees a point.
fn seen(lens: &LensCamera, point: DVec3) -> DVec2 {
    let camera = &lens.camera;
    let at = camera.camera_from_world(point);
    lens.distortion.unwrap().distorted(at.truncate() / at.z) * camera.focal + camera.principal
}

#[test]
fn videos_have_their_size_rate_and_lost_frames_and_masks_show_the_landmarks() {
    if !ghand_test_support::ffmpeg() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path().join("made");
    let options = FootageOptions { mixed_rates: true, lost_frames: 0.15, seconds: 2.0, ..options() };
    let (truth, cameras) = made(&options, &folder);
    assert_eq!(cameras.len(), 2);
    let mut all = 0;
    let mut inside = 0;
    for (k, rate) in [(0, 30.0), (1, 25.0)] {
        let of_camera = &truth["cameras"][k];
        let frames = of_camera["frames"].as_array().unwrap();
        let (size, nominal, times) = probed(&folder.join(format!("cam{k}.mp4")));
        assert_eq!(size, [160, 120]);
        assert_eq!(nominal, format!("{rate}/1"));
        let count = (2.0 * rate) as usize;
        assert!(frames.len() < count && frames.len() > count / 2, "{} of {count} frames", frames.len());
        assert_eq!(times.len(), frames.len());
        // A frame is in the video when the camera's clock said so.
        let start = of_camera["start"].as_f64().unwrap();
        for (time, frame) in times.iter().zip(frames) {
            let expected = frame["time"].as_f64().unwrap() - start;
            assert!((time - times[0] - expected).abs() < 1e-4, "{time} {expected}");
        }
        for (i, frame) in frames.iter().enumerate().step_by(MASK_EVERY) {
            let mask = image::open(folder.join(format!("truth-masks/cam{k}/{i:04}.png"))).unwrap().into_luma8();
            assert_eq!(mask.dimensions(), (160, 120));
            for landmark in frame["landmarks"].as_array().unwrap() {
                let [x, y] = numbers::<2>(landmark).map(|v| v.floor() as i64);
                if (1..159).contains(&x) && (1..119).contains(&y) {
                    all += 1;
                    let near = (-1..=1).flat_map(|dy| (-1..=1).map(move |dx| ((x + dx) as u32, (y + dy) as u32)));
                    inside += usize::from(near.into_iter().any(|(x, y)| mask.get_pixel(x, y).0[0] == 255));
                }
            }
            // Nor is everything hand.
            let part = mask.pixels().filter(|pixel| pixel.0[0] == 255).count() as f64 / (160.0 * 120.0);
            assert!((0.01..0.3).contains(&part), "{part} of camera {k}'s frame {i} is hand");
        }
    }
    assert!(all > 200 && inside as f64 > 0.98 * all as f64, "{inside} of {all} landmarks are on the hand");
    // Poses are of the first camera's clock, which sees what the file of cameras says.
    let hand = truth["hand"].as_array().unwrap();
    assert_eq!(hand.len(), 60);
    for frame in truth["cameras"][0]["frames"].as_array().unwrap() {
        let pose = hand.iter().find(|pose| pose["time"] == frame["time"]).unwrap();
        let landmarks = pose["landmarks"].as_array().unwrap().iter().zip(frame["landmarks"].as_array().unwrap());
        for (point, pixel) in landmarks {
            let seen = seen(&cameras[0], DVec3::from(numbers::<3>(point)));
            assert!(seen.distance(DVec2::from(numbers::<2>(pixel))) < 0.01);
        }
    }
}

#[test]
fn poses_of_the_truth_are_those_of_its_skeleton_and_a_moving_camera_has_a_place_in_each_frame() {
    if !ghand_test_support::ffmpeg() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path().join("made");
    let options = FootageOptions { views: 1, is_moving: true, side: Side::Left, ..options() };
    let (truth, cameras) = made(&options, &folder);
    let frames = truth["cameras"][0]["frames"].as_array().unwrap();
    let hand = truth["hand"].as_array().unwrap();
    assert!(cameras.len() == 30 && frames.len() == 30 && hand.len() == 30);
    assert_eq!(cameras[29].camera.id, "cam0-0029");
    assert!(cameras[29].camera.center().distance(cameras[0].camera.center()) > 0.5);

    let model = &truth["hand_model"];
    let rest: Vec<DVec3> = model["rest"].as_array().unwrap().iter().map(|p| DVec3::from(numbers::<3>(p))).collect();
    let named = |name: &str| model["joints"].as_array().unwrap().iter().position(|joint| joint == name).unwrap();
    for (k, (pose, frame)) in hand.iter().zip(frames).enumerate() {
        let landmark = |i: usize| DVec3::from(numbers::<3>(&pose["landmarks"][i]));
        // The root turns about the wrist, then the translation is added.
        let root = rotation_from_axis_angle(DVec3::from(numbers::<3>(&pose["pose"][0])));
        let wrist = rest[0] + DVec3::from(numbers::<3>(&pose["translation"]));
        assert!(landmark(0).distance(wrist) < 1e-5);
        // The base of the middle finger does not move against the wrist.
        let base = wrist + root * (rest[named("middle-finger-phalanx-proximal")] - rest[0]);
        assert!(landmark(9).distance(base) < 1e-5, "{} {base}", landmark(9));
        for i in 0..21 {
            let pixel = DVec2::from(numbers::<2>(&frame["landmarks"][i]));
            assert!(seen(&cameras[k], landmark(i)).distance(pixel) < 0.01);
        }
    }
    let length = truth["hand_length"].as_f64().unwrap();
    assert!((0.15..0.22).contains(&length), "{length}");
    assert!(folder.join("truth-masks/cam0/0020.png").exists() && !folder.join("truth-masks/cam0/0021.png").exists());
}

#[test]
fn cameras_and_clocks_of_made_footage_are_found_by_the_board_that_it_shows_first() {
    if !long() {
        return;
    }
    let kind: BoardKind = "charuco:8x6:30mm".parse().unwrap();
    let board = Some(FilmedBoard { kind, seconds: 9.0 });
    let options = FootageOptions { board, seconds: 10.0, width: 640, height: 480, ..options() };
    let board = Board::of(&options).unwrap();
    let subject = Subject::random(&options).unwrap();
    let room = Room::furnished(options.seed);
    let cameras = FilmCamera::all(&options, Clock::all(&options), &room);
    let lighting = lighting(LightSetup::Soft);
    let scene = Scene { subject: &subject, room: &room, lighting: &lighting, board: Some(&board) };
    let finder = BoardFinder::new(&kind).unwrap();
    let mut seen = vec![];
    for camera in &cameras {
        let mut found = BoardCamera::new(camera.id.clone(), [640, 480], Some(0.0));
        // Every third one: it is still for three frames of ten.
        for frame in (0..9 * 30).step_by(3) {
            let (rgb, mask) = scene.frame(camera, frame, true, &mut |_, _| panic!("no hand yet")).unwrap();
            assert!(mask.unwrap().iter().all(|hand| !hand));
            let time = camera.clock.time(frame) - camera.clock.start;
            found.add(time, finder.find_in_rgb(&rgb, 640, 480).unwrap());
        }
        println!("{}: {} of {}", found.id, found.views.len(), found.images);
        seen.push(found);
    }
    let found = calibrate(&kind, &seen).unwrap();
    let first = cameras[0].at(0.0).camera;
    for (camera, found) in cameras.iter().zip(&found.cameras) {
        let (truth, lens) = (camera.at(0.0).camera, &found.lens.camera);
        let turn = lens.rotation * (truth.rotation * first.rotation.transpose()).transpose();
        let angle = (0.5 * (turn.x_axis.x + turn.y_axis.y + turn.z_axis.z - 1.0)).min(1.0).acos().to_degrees();
        let place = lens.center().distance(first.camera_from_world(truth.center()));
        let focal = (lens.focal / truth.focal - 1.0).abs().max_element();
        // The start of a camera's clock is its own zero.
        let clock = found.clock + camera.clock.start;
        println!("{focal:.5} {angle:.3} {:.2} mm {:.2} ms {:.3} px", 1e3 * place, 1e3 * clock, found.residual);
        assert!(focal < 0.005 && angle < 0.15 && place < 0.0015 && clock.abs() < 0.003);
    }
    // Places repeat, in 0.8 s each, but not at the same time in both cameras.
    seen[1].clock = None;
    let clock = calibrate(&kind, &seen).unwrap().cameras[1].clock + cameras[1].clock.start;
    assert!(clock.abs() < 0.003, "{clock}");
    // And then the hand.
    let truth = serde_json::to_value(Truth::of(&subject, &cameras, Side::Right, Some(&board))).unwrap();
    assert_eq!((truth["board"]["poses"].as_array().unwrap().len(), truth["hand"].as_array().unwrap().len()), (270, 30));
    let landmark = |frame: usize| &truth["cameras"][0]["frames"][frame]["landmarks"][9];
    assert!(landmark(269).is_null() && landmark(270).is_array());
}

#[test]
fn unusable_options_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let error = |options: FootageOptions| options.check(&folder.path().join("new")).unwrap_err().to_string();
    assert!(error(FootageOptions { width: 161, ..options() }).contains("even"));
    assert!(error(FootageOptions { views: 2, is_moving: true, ..options() }).contains("views"));
    assert!(error(FootageOptions { seconds: f64::NAN, ..options() }).contains("seconds"));
    assert!(error(FootageOptions { lost_frames: 0.9, ..options() }).contains("lost frames"));
    let board = Some(FilmedBoard { kind: "chessboard:9x6:25mm".parse().unwrap(), seconds: 2.0 });
    assert!(error(FootageOptions { board: board.clone(), ..options() }).contains("is shown for 2 s; give 0.1 to 1 s"));
    assert!(error(FootageOptions { board, views: 1, is_moving: true, seconds: 3.0, ..options() }).contains("stand"));
    std::fs::write(folder.path().join("file"), "").unwrap();
    assert!(options().check(folder.path()).unwrap_err().to_string().contains("not empty"));
}
