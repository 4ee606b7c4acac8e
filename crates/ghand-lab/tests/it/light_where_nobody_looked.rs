//! A hand that was seen only from its back, in light from one side: with the light that `auto` chooses no part is darker or
//! more saturated than skin in the images.

use ghand_avatar::{Avatar, Scene};
use ghand_capture::{Capture, Split};
use ghand_core::rotation::rotation_from_axis_angle;
use ghand_core::sphere::spiral_direction;
use ghand_core::{Camera, Pose};
use ghand_hand_model::joints::hand_directions::hand_directions;
use ghand_hand_model::named_poses::{POSE_NAMES, named_pose};
use ghand_lab::cleanliness::figures::{DetailEnergy, HandPicture, KnownColors, PictureSums};
use ghand_render::splat::Purpose;
use ghand_render::{AdapterChoice, Gpu};
use ghand_synthetic::make_capture::make_capture;
use ghand_synthetic::{LightSetup, SyntheticOptions};
use ghand_test_support::long;
use ghand_train::{Align, TrainSettings, Trainer};
use glam::{DVec2, DVec3};

const VIEWS: usize = 24;
/// Pixels around the hand, from 0.6 m away.
const SIDE: u32 = 160;
/// Least cosine between the direction that the back faces and that to a camera: within 53 degrees.
const FROM_BEHIND: f64 = 0.6;

/// The direction that the back of a hand faces in a pose, world axes.
fn back(capture: &Capture, pose: &Pose) -> DVec3 {
    rotation_from_axis_angle(pose.rotations[0]) * hand_directions(&capture.template).unwrap().back
}

/// The images of a capture that show the back of the hand.
fn seen_from_the_back(capture: &Capture) -> Split {
    capture.split("train").unwrap().filtered(|view| {
        let pose = &capture.frames[view.frame].pose;
        let towards = (capture.cameras[view.camera].center() - pose.translation).normalize();
        back(capture, pose).dot(towards) > FROM_BEHIND
    })
}

/// The parts of the hand that are darker and that are more saturated than the images' skin, in the library's poses with
/// the hand where it was in a frame, from all around.
fn parts_beyond(gpu: &Gpu, avatar: &Avatar, root: &Pose, known: &KnownColors) -> [f64; 2] {
    let mut scene = Scene::new(gpu, &[avatar], Purpose::Images, 1, [SIDE; 2]).unwrap();
    let mut sums = PictureSums::default();
    for name in POSE_NAMES {
        let mut pose = named_pose(name, &avatar.model).unwrap();
        pose.rotations[0] = root.rotations[0];
        pose.translation = root.translation;
        scene.set_pose(gpu, 0, 0, &pose).unwrap();
        let vertices = ghand_core::posing::pose_hand(&avatar.model, &[], &pose).unwrap().vertices;
        let middle = vertices.iter().sum::<DVec3>() / vertices.len() as f64;
        for k in 0..VIEWS {
            let eye = middle + 0.6 * spiral_direction(k, VIEWS);
            let camera = Camera::look_at(eye, middle, DVec3::NEG_Y, 1.0, SIDE, SIDE);
            let camera = Camera { focal: DVec2::splat(2.0 * f64::from(SIDE)), ..camera };
            let image = scene.render(gpu, 0, &camera, [0.0; 3]).unwrap();
            sums.add(&HandPicture::of_rendering(&image.rgba, [SIDE; 2]), known);
        }
    }
    let figures = sums.figures(&DetailEnergy::default());
    [figures.darker_share.unwrap(), figures.more_saturated_share.unwrap()]
}

#[test]
fn a_palm_that_no_image_showed_is_not_dark() {
    if !long() {
        return;
    }
    let gpu = Gpu::new(&AdapterChoice::from_env()).unwrap_or_else(|e| panic!("{e}"));
    let options = SyntheticOptions {
        identity: 13,
        light: LightSetup::Side,
        views: 10,
        train_frames: 12,
        width: 160,
        height: 240,
        pose_noise_degrees: 0.0,
        translation_noise: 0.0,
        test_frames: 0,
        ..Default::default()
    };
    let folder = tempfile::tempdir().unwrap();
    make_capture(&gpu, &options, &folder.path().join("capture")).unwrap();
    let mut capture = Capture::open(&folder.path().join("capture")).unwrap();
    let split = seen_from_the_back(&capture);
    assert!(split.views.len() >= 20, "only {} images show the back", split.views.len());
    let mut known = KnownColors::default();
    for view in &split.views {
        let image = capture.load_view(view.camera, view.frame).unwrap();
        known.add(&HandPicture::of_image(&image.rgba, [image.width, image.height]));
    }
    let root = capture.frames[split.frames[0]].pose.clone();
    capture.splits.insert("back".into(), split);
    let settings = TrainSettings { iterations: 150, align: Align::Off, ..Default::default() };
    let trained = Trainer::new(&gpu, &capture, "back", &settings).unwrap().train(|_| ()).unwrap();
    println!("{:?}", trained.light.unwrap().report());
    let avatar = trained.avatar;
    let chosen = parts_beyond(&gpu, &avatar, &root, &known);
    println!("{chosen:?} are darker, more saturated");
    // Directions are chosen here, the worst of twelve persons: 0.0002 are darker and 0.003 more saturated, of which 0.086
    // were before the light's colours were drawn to each other.
    assert!(chosen[0] < 0.005 && chosen[1] < 0.01, "{chosen:?}");
}
