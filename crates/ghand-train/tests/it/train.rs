//! Whole training runs on a small synthetic capture.
#![allow(clippy::neg_cmp_op_on_partial_ord, reason = "`!(error <= bound)` rejects NaN too")]

use ghand_capture::Capture;
use ghand_core::Pose;
use ghand_core::pose_error::{moving_joints, pose_error_degrees};
use ghand_measure::baseline::Baseline;
use ghand_measure::evaluation::evaluate;
use ghand_render::{AdapterChoice, Gpu};
use ghand_synthetic::SyntheticOptions;
use ghand_synthetic::make_capture::make_capture;
use ghand_test_support::long;
use ghand_train::{Align, ExposureChoice, LightChoice, TrainSettings, Trained, Trainer};

fn gpu() -> Gpu {
    Gpu::new(&AdapterChoice::from_env()).unwrap_or_else(|e| panic!("{e}"))
}

fn small_capture(gpu: &Gpu, folder: &std::path::Path) -> Capture {
    capture_of(gpu, folder, 6, 6)
}

fn capture_of(gpu: &Gpu, folder: &std::path::Path, views: usize, train_frames: usize) -> Capture {
    let options = SyntheticOptions {
        views,
        train_frames,
        test_frames: 2,
        test_views: 2,
        width: 128,
        height: 192,
        ..SyntheticOptions::default()
    };
    make_capture(gpu, &options, folder).unwrap();
    Capture::open(folder).unwrap()
}

fn train(gpu: &Gpu, capture: &Capture, settings: &TrainSettings) -> Trained {
    Trainer::new(gpu, capture, "train", settings).unwrap().train(|_| ()).unwrap()
}

#[test]
fn the_same_seed_gives_the_same_file_and_a_different_seed_a_different_one() {
    let gpu = gpu();
    let folder = tempfile::tempdir().unwrap();
    let capture = capture_of(&gpu, &folder.path().join("capture"), 4, 4);
    let settings = TrainSettings { iterations: 12, uv_resolution: 48, ..TrainSettings::default() };
    let bytes = |settings: &TrainSettings| {
        let path = folder.path().join("avatar.ghand");
        train(&gpu, &capture, settings).avatar.save(&path).unwrap();
        std::fs::read(path).unwrap()
    };
    if long() {
        assert!(bytes(&settings) == bytes(&settings), "two runs with one seed differ");
    }
    let quick = TrainSettings { align: Align::Off, light: LightChoice::Off, exposure: ExposureChoice::Off, ..settings };
    let first = bytes(&quick);
    assert!(first == bytes(&quick), "two runs with one seed differ");
    assert!(first != bytes(&TrainSettings { seed: 2, ..quick.clone() }), "the seed has no effect");
}

#[test]
fn as_many_gaussians_as_the_images_require() {
    let gpu = gpu();
    let folder = tempfile::tempdir().unwrap();
    let mut capture = small_capture(&gpu, &folder.path().join("capture"));
    let of = |capture: &Capture, settings: TrainSettings| {
        let trainer = Trainer::new(&gpu, capture, "train", &settings).unwrap();
        (trainer.uv_resolution(), trainer.gaussian_width().unwrap())
    };
    let found = of(&capture, TrainSettings::default());
    assert!((96..512).contains(&found.0) && (found.1 - 1.75).abs() < 0.15, "{found:?}");
    assert_eq!(of(&capture, TrainSettings { uv_resolution: 40, ..TrainSettings::default() }).0, 40);
    // As if the images were smaller and larger.
    let mut enlarged = |by: f64, settings: TrainSettings| {
        capture.cameras.iter_mut().for_each(|camera| camera.focal *= by);
        of(&capture, settings).0
    };
    assert_eq!(enlarged(0.2, TrainSettings::default()), 96);
    // So that Gaussians 1.75 pixels wide would take a resolution of 640, then 1024.
    assert_eq!(enlarged(640.0 / (0.2 * f64::from(found.0)), TrainSettings::default()), 512);
    let large = enlarged(1.6, TrainSettings::default());
    assert!((656..=720).contains(&large), "{large}");
    assert_eq!(enlarged(50.0, TrainSettings::default()), 768);
    let network = TrainSettings { model: ghand_train::Model::Network, ..TrainSettings::default() };
    if crate::is_built(&network.model) {
        assert_eq!(enlarged(1.0, network), 160);
    }
}

#[test]
fn training_beats_the_baseline_on_new_poses_and_views_and_improves_the_poses() {
    let gpu = gpu();
    let folder = tempfile::tempdir().unwrap();
    let capture = small_capture(&gpu, &folder.path().join("capture"));
    let settings = TrainSettings { iterations: 200, uv_resolution: 80, ..TrainSettings::default() };
    let trained = train(&gpu, &capture, &settings);
    let split = capture.split("train").unwrap();
    let baseline = Baseline::new(&gpu, &capture, split, &trained.poses, 40).unwrap();
    let mut seen = 0;
    let evaluation = evaluate(&gpu, &trained.avatar, &capture, "test", &baseline, |_| seen += 1).unwrap();
    assert_eq!((evaluation.views, seen), (4, 4));
    // Training takes a few seconds, 200 steps. The full demo gains several times as much.
    let gain = evaluation.avatar.psnr - evaluation.baseline.psnr;
    let hand_gain = evaluation.avatar.psnr_hand - evaluation.baseline.psnr_hand;
    assert!(gain >= 2.0 && hand_gain >= 1.0, "only {gain} dB, {hand_gain} dB on the hand, above the floor");
    let truth: Vec<_> = split.frames.iter().map(|f| capture.truth.as_ref().unwrap()[*f].clone().unwrap()).collect();
    let given: Vec<_> = split.frames.iter().map(|f| capture.frames[*f].pose.clone()).collect();
    let counts = moving_joints(&given);
    let (before, after) =
        (pose_error_degrees(&given, &truth, &counts), pose_error_degrees(&trained.poses, &truth, &counts));
    assert!(after < before, "poses went from {before} to {after} degrees");
}

#[test]
fn an_unknown_split_is_one_clear_sentence() {
    let gpu = gpu();
    let folder = tempfile::tempdir().unwrap();
    let capture = small_capture(&gpu, &folder.path().join("capture"));
    let error = Trainer::new(&gpu, &capture, "nonsense", &TrainSettings::default()).err().unwrap().to_string();
    assert!(error.contains("nonsense") && error.contains("train5") && !error.contains('\n'), "{error}");
}

#[test]
fn a_trackers_constant_errors_are_known_after_training() {
    let gpu = gpu();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("capture");
    let options = SyntheticOptions {
        views: 5,
        train_frames: 10,
        test_frames: 1,
        test_views: 1,
        width: 128,
        height: 192,
        pose_noise_degrees: 0.5,
        pose_bias_degrees: 6.0,
        ..SyntheticOptions::default()
    };
    make_capture(&gpu, &options, &path).unwrap();
    let capture = Capture::open(&path).unwrap();
    let settings = TrainSettings {
        iterations: 20,
        uv_resolution: 32,
        light: LightChoice::Off,
        exposure: ExposureChoice::Off,
        ..TrainSettings::default()
    };
    let trained = train(&gpu, &capture, &settings);
    let tracker = trained.avatar.tracker.unwrap();
    assert_eq!(tracker.frames, 10);
    let frames = &capture.split("train").unwrap().frames;
    let given: Vec<Pose> = frames.iter().map(|frame| capture.frames[*frame].pose.clone()).collect();
    let truth: Vec<Pose> =
        frames.iter().map(|frame| capture.truth.as_ref().unwrap()[*frame].clone().unwrap()).collect();
    let parents = &capture.hand_model.parents;
    let corrected: Vec<Pose> = given.iter().map(|pose| tracker.offsets.apply(pose, parents)).collect();
    let moves = moving_joints(&given);
    let error = |poses: &[Pose]| pose_error_degrees(poses, &truth, &moves);
    let [before, after, refined] = [error(&given), error(&corrected), error(&trained.poses)];
    assert!(before - after > 0.7 * (before - refined), "{before} degrees, corrected {after}, refined {refined}");
    assert!(refined < 0.8 * before, "{before} degrees, refined {refined}");
}
