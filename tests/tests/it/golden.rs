//! Pictures as they were when they were last looked at: [`ghand_test_support::golden`].
//!
//! `GHAND_UPDATE_GOLDEN=1 cargo test --workspace --test it golden` makes them anew.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use ghand_avatar::framing::turntable;
use ghand_avatar::{Avatar, AvatarConfig, Scene};
use ghand_core::Side;
use ghand_hand_model::builtin::builtin_hand;
use ghand_hand_model::named_poses::named_pose;
use ghand_render::splat::Purpose;
use ghand_render::{AdapterChoice, DeviceError, Gpu, Tier};
use ghand_synthetic::make_capture::make_capture;
use ghand_synthetic::{LightSetup, SyntheticOptions};
use ghand_test_support::golden::check;
use image::{Rgb, RgbImage};

const SIZE: [u32; 2] = [128, 128];

/// The built-in hand with stripes of colour, so that what goes where is seen.
fn striped(side: Side, config: AvatarConfig) -> Avatar {
    let hand = builtin_hand(side).unwrap();
    let mut avatar = Avatar::untrained(&hand, &config, [0.8, 0.6, 0.5], 0).unwrap();
    let stripe = |i: usize| [0.0, 2.0, 4.0].map(|phase| 0.55 + 0.35 * (i as f64 * 0.02 + phase).sin());
    avatar.tables.set_constant_colors(&(0..avatar.template.len()).map(stripe).collect::<Vec<_>>());
    avatar
}

fn drawn(gpu: &Gpu, avatar: &Avatar, pose: &str, view: usize) -> RgbImage {
    let pose = named_pose(pose, &avatar.model).unwrap();
    let mut scene = Scene::new(gpu, &[avatar], Purpose::Images, 1, SIZE).unwrap();
    scene.set_pose(gpu, 0, 0, &pose).unwrap();
    let cameras = turntable(&avatar.model, &[&pose], 4, SIZE);
    let image = scene.render(gpu, 0, &cameras[0][view], [0.1, 0.2, 0.4]).unwrap();
    RgbImage::from_fn(SIZE[0], SIZE[1], |x, y| {
        let pixel = image.rgba[(y * SIZE[0] + x) as usize];
        Rgb([0, 1, 2].map(|c| (pixel[c].clamp(0.0, 1.0) * 255.0).round() as u8))
    })
}

#[test]
fn avatars_are_drawn_as_before_on_every_tier() {
    let config = AvatarConfig { antialias: true, uv_resolution: 96, ..AvatarConfig::default() };
    let right = striped(Side::Right, config.clone());
    let left = striped(Side::Left, config);
    let round = striped(Side::Right, AvatarConfig::default());
    for tier in Tier::ALL {
        let gpu = match Gpu::with_tier(&AdapterChoice::from_env(), tier) {
            Ok(gpu) => gpu,
            Err(e @ DeviceError::NoTier { .. }) => {
                println!("skipped: {e}");
                continue;
            }
            Err(e) => panic!("{e}"),
        };
        check("right-fist", &drawn(&gpu, &right, "fist", 0));
        check("right-point-from-behind", &drawn(&gpu, &right, "point", 2));
        check("left-spread", &drawn(&gpu, &left, "spread", 0));
        check("right-round-aliased", &drawn(&gpu, &round, "pinch", 1));
    }
}

#[test]
fn synthetic_captures_are_drawn_as_before() {
    let gpu = Gpu::new(&AdapterChoice::from_env()).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let options = SyntheticOptions {
        views: 1,
        train_frames: 1,
        test_frames: 0,
        width: 96,
        height: 144,
        identity: 4,
        light: LightSetup::Side,
        ..SyntheticOptions::default()
    };
    make_capture(&gpu, &options, &folder.path().join("capture")).unwrap();
    let capture = ghand_capture::Capture::open(&folder.path().join("capture")).unwrap();
    let image = image::open(capture.image_file(0, 0).unwrap()).unwrap().into_rgb8();
    check("synthetic-side-light", &image);
}
