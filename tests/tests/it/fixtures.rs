//! The data from which the fixtures of all formats are made.

use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use ghand_capture::Capture;
use ghand_capture::SplitView;
use ghand_capture::capture::{Frame, HandModelSource};
use ghand_capture::mask::covered_pixels;
use ghand_core::posing::pose_hand;
use ghand_core::{Camera, HandModel, Pose, Side};
use ghand_hand_model::files::mano::{ManoOptions, read_mano_bytes};
use ghand_hand_model::files::read::read_gltf_hand;
use ghand_hand_model::joints::names::JointRole;
use ghand_synthetic::{SceneMesh, SyntheticOptions, generate};
use ghand_test_support::procedural_hand::ProceduralHand;
use ghand_test_support::rigged_glb;
use glam::{DMat3, DVec3};
use tempfile::TempDir;

use ghand_test_support::mano_files::hands::{Hand, as_pickle};

/// A capture of a procedural hand, which has MANO's joints, from which the other formats are written: 6 cameras and 3
/// frames for training, 2 and 2 for testing, with the cameras and the motion of the synthetic capture. The hand has one
/// colour.
pub fn synthetic() -> &'static Capture {
    static CAPTURE: LazyLock<(Capture, TempDir)> = LazyLock::new(|| {
        let options = SyntheticOptions {
            views: 6,
            train_frames: 3,
            test_frames: 2,
            test_views: 2,
            width: 128,
            height: 192,
            ..Default::default()
        };
        made(&options)
    });
    &CAPTURE.0
}

/// A longer one, as [`synthetic`]: 3 cameras and 24 frames for training.
pub fn long() -> &'static Capture {
    static CAPTURE: LazyLock<(Capture, TempDir)> = LazyLock::new(|| {
        let options = SyntheticOptions {
            views: 3,
            train_frames: 24,
            test_frames: 1,
            test_views: 1,
            width: 96,
            height: 144,
            ..Default::default()
        };
        made(&options)
    });
    &CAPTURE.0
}

fn made(options: &SyntheticOptions) -> (Capture, TempDir) {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path().join("capture");
    let pixels = |camera: &Camera| camera.width as usize * camera.height as usize;
    generate(options, &root, &mut |_: &SceneMesh, camera| Ok(vec![[0; 4]; pixels(camera)])).unwrap();
    let capture = of_procedural_hand(Capture::open(&root).unwrap());
    capture.save().unwrap();
    capture.splits.values().flat_map(|split| &split.views).for_each(|view| draw(&capture, view));
    (Capture::open(&root).unwrap(), folder)
}

/// The capture with the procedural hand where the built-in one was. Joints that it lacks do not turn in it.
fn of_procedural_hand(capture: Capture) -> Capture {
    let path = capture.root.join("hand.glb");
    std::fs::write(&path, rigged_glb(&ProceduralHand::default().build().unwrap()).unwrap()).unwrap();
    let hand_model = read_gltf_hand(&path, Some(Side::Right)).unwrap().model;
    let roles = |model: &HandModel| JointRole::of_joints(&model.joint_names);
    let full = roles(&capture.hand_model);
    let rows: Vec<usize> =
        roles(&hand_model).iter().map(|role| full.iter().position(|other| other == role).unwrap()).collect();
    let shift = capture.hand_model.joints[0] - hand_model.joints[0];
    let moved = |pose: Pose| Pose {
        rotations: rows.iter().map(|row| pose.rotations[*row]).collect(),
        translation: pose.translation + shift,
    };
    let frames = capture.frames.into_iter().map(|frame| Frame { pose: moved(frame.pose), ..frame }).collect();
    let truth = capture.truth.map(|truth| truth.into_iter().map(|pose| pose.map(moved)).collect());
    let hand_model_source = HandModelSource::Gltf { path: "hand.glb".into() };
    Capture { frames, truth, template: hand_model.clone(), hand_model, hand_model_source, ..capture }
}

/// Draws the hand of a view in its true pose, and its mask.
fn draw(capture: &Capture, view: &SplitView) {
    let camera = &capture.cameras[view.camera];
    let pose = capture.truth.as_ref().unwrap()[view.frame].as_ref().unwrap();
    let posed = pose_hand(&capture.hand_model, &[], pose).unwrap().vertices;
    let inside = covered_pixels(camera, &posed, &capture.hand_model.faces);
    let size = (camera.width, camera.height);
    let at = |x: u32, y: u32| inside[(y * size.0 + x) as usize];
    let image =
        image::RgbImage::from_fn(size.0, size.1, |x, y| image::Rgb(if at(x, y) { [200, 150, 120] } else { [0; 3] }));
    image.save(capture.image_file(view.camera, view.frame).unwrap()).unwrap();
    let mask = image::GrayImage::from_fn(size.0, size.1, |x, y| image::Luma([if at(x, y) { 255 } else { 0 }]));
    mask.save(capture.mask_file(view.camera, view.frame).unwrap().unwrap()).unwrap();
}

/// A right hand in MANO's layout, with invented shapes, correctives and mean pose on the procedural hand's mesh.
pub fn mano_hand() -> Hand {
    let count = ProceduralHand { detail: 1, ..Default::default() }.build().unwrap().vertices.len();
    Hand::procedural(count, (20, 10))
}

/// The model of [`mano_hand`].
pub fn mano() -> &'static HandModel {
    static MODEL: LazyLock<HandModel> = LazyLock::new(|| model_of(&mano_hand(), "MANO_RIGHT.pkl"));
    &MODEL
}

pub fn model_of(hand: &Hand, name: &str) -> HandModel {
    read_mano_bytes(name, &as_pickle(&hand.published()), None, &ManoOptions::default()).unwrap().model
}

/// Shape parameters of the fixtures: small and distinct numbers.
pub fn shape() -> Vec<f64> {
    (0..10).map(|i| 0.05 - 0.02 * f64::from(i)).collect()
}

/// The largest difference of any entry; NaN if any is NaN.
pub fn difference(a: impl IntoIterator<Item = f64>, b: impl IntoIterator<Item = f64>) -> f64 {
    let (a, b): (Vec<f64>, Vec<f64>) = (a.into_iter().collect(), b.into_iter().collect());
    assert_eq!(a.len(), b.len());
    a.iter().zip(&b).map(|(a, b)| (a - b).abs()).fold(0.0, |worst, d| if d > worst || d.is_nan() { d } else { worst })
}

pub fn numbers(vectors: &[DVec3]) -> Vec<f64> {
    vectors.iter().flat_map(DVec3::to_array).collect()
}

/// Asserts that two cameras agree to 1e-6 in all numbers.
pub fn assert_same_camera(found: &Camera, expected: &Camera) {
    let all = |c: &Camera| {
        let vectors = [c.translation.to_array(), c.center().to_array()].concat();
        [vectors, c.rotation.to_cols_array().to_vec(), c.focal.to_array().to_vec(), c.principal.to_array().to_vec()]
            .concat()
    };
    assert_eq!((found.width, found.height), (expected.width, expected.height));
    let error = difference(all(found), all(expected));
    assert!(error <= 1e-6, "camera {} is off by {error}", expected.id);
}

pub fn rows(matrix: DMat3) -> [[f64; 3]; 3] {
    matrix.transpose().to_cols_array_2d()
}

/// Asserts that a message is one line and contains all parts.
pub fn assert_says(message: &str, parts: &[&str]) {
    assert!(!message.contains('\n'), "{message:?}");
    for part in parts {
        assert!(message.contains(part), "{message:?} should say {part:?}");
    }
}

/// Writes a file and creates its folders.
pub fn write(path: &Path, bytes: &[u8]) {
    std::fs::create_dir_all(path.parent().unwrap()).unwrap();
    std::fs::write(path, bytes).unwrap();
}

/// Writes an image as a JPEG.
pub fn write_jpeg(path: &Path, image: &image::RgbImage) {
    let mut bytes = Vec::new();
    image::codecs::jpeg::JpegEncoder::new_with_quality(&mut bytes, 95).encode_image(image).unwrap();
    write(path, &bytes);
}

/// The synthetic image of a camera and a frame.
pub fn synthetic_image(camera: usize, frame: usize) -> image::RgbImage {
    let path: PathBuf = synthetic().image_file(camera, frame).unwrap();
    image::open(path).unwrap().into_rgb8()
}

#[test]
fn the_largest_difference_keeps_nan_and_detects_a_wrong_entry() {
    assert_eq!(difference([1.0, 2.0], [1.0, 2.5]), 0.5);
    assert!(difference([1.0, f64::NAN, 2.0], [1.0, 2.0, 2.0]).is_nan());
    let camera = &synthetic().cameras[0];
    let moved = Camera { translation: camera.translation + DVec3::X * 2e-6, ..camera.clone() };
    assert!(std::panic::catch_unwind(|| assert_same_camera(&moved, camera)).is_err());
}
