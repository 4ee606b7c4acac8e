//! Masks that are made beside another hand of the same colours.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking; clippy knows that only inside #[test]")]

use std::collections::BTreeMap;
use std::path::Path;

use ghand_capture::capture::{Frame, HandModelSource, ImagePaths};
use ghand_capture::images::color_correction::ColorCorrection;
use ghand_capture::mask::covered_pixels;
use ghand_capture::{Capture, Split};
use ghand_core::posing::pose_hand;
use ghand_core::{Camera, Pose, Side};
use ghand_hand_model::builtin::builtin_hand;
use glam::DVec3;
use image::{GrayImage, Luma, Rgb, RgbImage};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

const SIZE: [u32; 2] = [240, 180];
const FRAMES: usize = 10;
const OTHER_HANDS: &str = "other-hands/{camera}/{frame}.png";

/// A capture of a hand that moves beside another one; the silhouettes of both by frame.
fn capture(root: &Path) -> (Capture, Vec<[Vec<bool>; 2]>) {
    let model = builtin_hand(Side::Right).unwrap();
    let camera = Camera {
        id: "cam0".into(),
        // The palm faces along x.
        ..Camera::look_at(DVec3::new(0.55, -0.02, 0.04), DVec3::new(0.0, -0.02, 0.04), DVec3::Y, 0.7, SIZE[0], SIZE[1])
    };
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let mut frames = vec![];
    let mut shapes = vec![];
    for k in 0..FRAMES {
        let place = |across: f64| Pose {
            translation: DVec3::new(0.0, 0.006 * (k % 4) as f64, across + 0.004 * k as f64),
            ..Pose::rest(model.joint_count())
        };
        let shape =
            |pose: &Pose| covered_pixels(&camera, &pose_hand(&model, &[], pose).unwrap().vertices, &model.faces);
        let pose = place(-0.02);
        // The fingertips are as far apart as fingers are thick, or nearer.
        let both = [shape(&pose), shape(&place(0.06 + 0.004 * (k % 3) as f64))];
        let id = format!("{k:04}");
        let mut noise = |value: u8| value.saturating_add_signed(rng.random_range(-6..=6));
        let image = RgbImage::from_fn(SIZE[0], SIZE[1], |x, y| {
            let i = (y * SIZE[0] + x) as usize;
            let skin = both.iter().any(|shape| shape[i]);
            let stripes = 40 * u8::from((x / 9 + y / 13) % 2 == 0);
            let color = if skin { [205, 150, 120] } else { [60 + stripes, 80 + stripes, 105] };
            Rgb(color.map(&mut noise))
        });
        let path = |folder: &str| root.join(folder).join("cam0").join(format!("{id}.png"));
        for folder in ["images", "other-hands"] {
            std::fs::create_dir_all(path(folder).parent().unwrap()).unwrap();
        }
        image.save(path("images")).unwrap();
        GrayImage::from_fn(SIZE[0], SIZE[1], |x, y| {
            let i = (y * SIZE[0] + x) as usize;
            Luma([if both[1][i] && !both[0][i] { 255 } else { 0 }])
        })
        .save(path("other-hands"))
        .unwrap();
        frames.push(Frame { id, pose, shape: vec![] });
        shapes.push(both);
    }
    let capture = Capture {
        root: root.into(),
        side: Side::Right,
        background: [0.0; 3],
        hand_model: model.clone(),
        hand_model_source: HandModelSource::Builtin,
        template: model,
        cameras: vec![camera],
        distortion: vec![None],
        color_correction: ColorCorrection::default(),
        splits: BTreeMap::from([("train".to_owned(), Split::product(vec![0], (0..FRAMES).collect()))]),
        frames,
        images: ImagePaths {
            other_hands: Some(OTHER_HANDS.into()),
            ..ImagePaths::plain("images/{camera}/{frame}.png", None)
        },
        truth: None,
    };
    capture.save().unwrap();
    (capture, shapes)
}

/// Of all frames: the least overlap of a made mask with the hand (intersection over union), and the largest part of the other
/// hand that is in one.
fn masks(root: &Path, shapes: &[[Vec<bool>; 2]]) -> [f64; 2] {
    let capture = Capture::open(root).unwrap();
    let [mut least, mut most] = [1.0f64, 0.0f64];
    for (frame, [own, other]) in shapes.iter().enumerate() {
        let mask = capture.load_hand_mask(0, frame).unwrap();
        let count = |is_it: &dyn Fn(usize) -> bool| (0..mask.len()).filter(|i| is_it(*i)).count() as f64;
        least = least.min(count(&|i| mask[i] && own[i]) / count(&|i| mask[i] || own[i]));
        most = most.max(count(&|i| mask[i] && other[i] && !own[i]) / count(&|i| other[i] && !own[i]));
    }
    println!("at least {least:.3}, of the other hand at most {most:.3}");
    [least, most]
}

#[test]
fn made_masks_leave_other_hands_out_where_the_capture_says_where_they_are() {
    let folder = tempfile::tempdir().unwrap();
    let (mut made, shapes) = capture(folder.path());
    let [least, most] = masks(folder.path(), &shapes);
    assert!(least > 0.9 && most == 0.0, "{least} {most}");
    // Without, they cannot be told from the hand: and masks are made anew.
    made.images.other_hands = None;
    made.save().unwrap();
    let [_, most] = masks(folder.path(), &shapes);
    assert!(most > 0.1, "{most}");
}

#[test]
fn files_of_other_hands_that_cannot_be_used_are_told() {
    let folder = tempfile::tempdir().unwrap();
    let (mut made, _) = capture(folder.path());
    let file = folder.path().join("other-hands/cam0/0003.png");
    GrayImage::new(12, 9).save(&file).unwrap();
    let error = Capture::open(folder.path()).unwrap().load_hand_mask(0, 3).unwrap_err().to_string();
    assert!(error.contains("0003.png") && error.contains("240"), "{error}");
    for (path, says) in [("../{camera}/{frame}.png", "leaves the capture's folder"), ("x/{camera}.png", "{frame}")] {
        made.images.other_hands = Some(path.into());
        made.save().unwrap();
        let error = Capture::open(folder.path()).unwrap_err().to_string();
        assert!(error.contains("other_hands_path") && error.contains(says), "{error}");
    }
}
