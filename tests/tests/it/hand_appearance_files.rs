//! A small subject of the Hand Appearance dataset, written from the synthetic capture.

use std::path::Path;

use ghand_core::posing::shape_hand;
use ghand_core::rotation::{axis_angle_from_rotation, rotation_from_axis_angle};
use ghand_core::{HandModel, Pose};
use glam::DVec3;
use image::{GrayImage, RgbImage};

use crate::fixtures::{mano, numbers, shape, synthetic, synthetic_image, write, write_jpeg};
use ghand_test_support::mano_files::python::{Py, array, dictionary, pickle};

/// The hand's pose in the axes of a camera of the synthetic capture.
fn in_camera(pose: &Pose, camera: usize, model: &HandModel) -> Pose {
    let camera = &synthetic().cameras[camera];
    let wrist = shape_hand(model, &shape()).unwrap().joints[0];
    let mut rotations = pose.rotations.clone();
    rotations[0] = axis_angle_from_rotation(&(camera.rotation * rotation_from_axis_angle(rotations[0])));
    Pose { rotations, translation: camera.camera_from_world(wrist + pose.translation) - wrist }
}

/// Weak-perspective camera: its scale, and its translation of the hand.
const CAM: [f64; 3] = [5.5, 0.03, -0.02];

fn moved() -> DVec3 {
    DVec3::new(CAM[1], CAM[2], 2.0 * 2000.0 / (448.0 * CAM[0]))
}

/// The pickle of a frame. Fits of only MANO have `trans`, fits with an arm have the wrist's position.
pub fn frame_pickle(pose: &Pose, model: &HandModel, with_arm: bool) -> Vec<(&'static str, Py)> {
    let mean = &model.pose_space.as_ref().unwrap().mean;
    let wrist = shape_hand(model, &shape()).unwrap().joints[0];
    let floats = |shape: &[usize], values: &[f64]| Py::Array(array("<f4", shape, false, values));
    let fingers: Vec<DVec3> = pose.rotations[1..].iter().zip(mean).map(|(r, m)| *r - *m).collect();
    let trans = pose.translation - moved();
    let mut joints = vec![0.5; 63];
    joints[..3].copy_from_slice(&((trans + wrist) * 1000.0).to_array());
    let stored_trans = if with_arm { trans + wrist } else { trans };
    vec![
        ("joints", floats(&[1, 21, 3], &joints)),
        ("verts", floats(&[1, 1, 3], &[0.0; 3])),
        ("rot", floats(&[1, 3], &pose.rotations[0].to_array())),
        ("pose", floats(&[1, 45], &numbers(&fingers))),
        ("shape", floats(&[1, 10], &shape())),
        ("trans", floats(&[1, 3], &stored_trans.to_array())),
        ("cam", floats(&[3], &CAM)),
    ]
}

/// The written poses: those of the synthetic frames, one per sequence.
pub fn poses() -> Vec<(u32, Pose)> {
    let frames = [(1, 0), (2, 1), (5, 2), (6, 3), (9, 4)];
    frames.map(|(sequence, frame)| (sequence, in_camera(&synthetic().frames[frame].pose, 0, mano()))).to_vec()
}

pub fn write_subject(root: &Path, folder: &str) {
    for (sequence, pose) in poses() {
        for number in ["0001", "0007"] {
            let below = root.join(sequence.to_string());
            let entries = frame_pickle(&pose, mano(), sequence % 2 == 0);
            write(&below.join(format!("{folder}/{number}_mano.pkl")), &pickle(&dictionary(entries)));
            let mut image = RgbImage::from_pixel(448, 448, image::Rgb([255; 3]));
            image::imageops::replace(&mut image, &synthetic_image(0, 0), 160, 128);
            write_jpeg(&below.join(format!("unscreen_cropped/{number}.jpg")), &image);
            let inside =
                |x: u32, y: u32| image::Luma([if x.abs_diff(224) < 64 && y.abs_diff(224) < 96 { 255u8 } else { 0 }]);
            let mask = GrayImage::from_fn(448, 448, inside);
            write_jpeg(&below.join(format!("mask/{number}_mask.jpg")), &image::DynamicImage::from(mask).into_rgb8());
        }
    }
}
