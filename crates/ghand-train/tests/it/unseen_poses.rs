//! What avatars of poor captures look like in poses that no frame shows: few frames of an open hand, three views, masks and
//! cameras that are wrong.

use ghand_avatar::{Avatar, PropertyTables};
use ghand_capture::{Capture, Split};
use ghand_core::Pose;
use ghand_measure::outline::bent_outline;
use ghand_render::{AdapterChoice, Gpu};
use ghand_synthetic::SyntheticOptions;
use ghand_synthetic::make_capture::make_capture;
use ghand_test_support::long;
use ghand_train::{TrainSettings, Trainer};
use glam::{DMat3, DVec3};

/// Frames of the motion, and those of them with the straightest fingers, which are trained on.
const FRAMES: usize = 24;
const OPEN_FRAMES: usize = 10;
/// Turn of each camera, radians: some 3 pixels where these hands are 150 pixels high.
const CAMERA_ERROR: f64 = 0.004;

fn device() -> Gpu {
    Gpu::new(&AdapterChoice::from_env()).unwrap_or_else(|e| panic!("{e}"))
}

fn bend(pose: &Pose) -> f64 {
    pose.rotations.iter().skip(1).map(|rotation| rotation.length()).sum()
}

/// A capture like one of two webcams over a desk.
fn poor_capture(gpu: &Gpu, folder: &std::path::Path) -> Capture {
    let options = SyntheticOptions {
        identity: 23,
        seed: 5,
        views: 3,
        train_frames: FRAMES,
        test_frames: 0,
        width: 128,
        height: 192,
        pose_noise_degrees: 6.0,
        mask_noise_pixels: 2.0,
        ..Default::default()
    };
    make_capture(gpu, &options, folder).unwrap();
    let mut capture = Capture::open(folder).unwrap();
    let mut frames: Vec<usize> = (0..FRAMES).collect();
    frames.sort_by(|a, b| bend(&capture.frames[*a].pose).total_cmp(&bend(&capture.frames[*b].pose)));
    frames.truncate(OPEN_FRAMES);
    frames.sort_unstable();
    for (camera, axis) in capture.cameras.iter_mut().zip([DVec3::X, DVec3::Y, DVec3::NEG_X]) {
        camera.rotation = DMat3::from_axis_angle(axis, CAMERA_ERROR) * camera.rotation;
    }
    let cameras = (0..capture.cameras.len()).collect();
    capture.splits.insert("train".into(), Split::product(cameras, frames));
    capture
}

#[test]
fn fists_of_an_avatar_that_saw_few_open_hands_have_a_smooth_outline_and_nothing_loose() {
    if !long() {
        return;
    }
    let gpu = device();
    let folder = tempfile::tempdir().unwrap();
    let capture = poor_capture(&gpu, folder.path());
    let settings = TrainSettings { iterations: 400, ..TrainSettings::default() };
    let trained = Trainer::new(&gpu, &capture, "train", &settings).unwrap().train(|_| ()).unwrap();
    let found = bent_outline(&gpu, &trained.avatar).unwrap();
    // Measured: roughness 0.93 and 0.026 % loose; with unseen=off 0.99 and 0.035 %.
    assert!(found.roughness.unwrap() < 0.96 && found.loose_share.unwrap() < 3.1e-4, "{found:?}");
}

#[test]
fn one_loose_gaussian_is_found() {
    let gpu = device();
    let model = ghand_hand_model::builtin::builtin_hand(ghand_core::Side::Right).unwrap();
    let config = ghand_avatar::AvatarConfig { uv_resolution: 128, ..Default::default() };
    let mut avatar = Avatar::untrained(&model, &config, [0.8, 0.6, 0.5], 1).unwrap();
    let clean = bent_outline(&gpu, &avatar).unwrap();
    // Where skin is stretched at a bent joint, single large Gaussians stand out a little.
    let clean_share = clean.loose_share.unwrap();
    assert!(clean_share < 1.5e-3 && (0.5..1.3).contains(&clean.roughness.unwrap()), "{clean:?}");
    let count = avatar.template.len();
    let PropertyTables::Direct(tables) = &mut avatar.tables else { unreachable!() };
    // 5 cm away from the hand: no other Gaussian covers it.
    (0..3).for_each(|c| tables.shape_basis[c * count + count / 2] = 0.03);
    let loose = bent_outline(&gpu, &avatar).unwrap();
    assert!(loose.loose_share.unwrap() > clean_share + 3e-5, "{loose:?}, {clean:?}");
}
