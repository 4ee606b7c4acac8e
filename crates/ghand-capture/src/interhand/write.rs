//! Writes a capture in the layout of InterHand2.6M, as capture 0 of the subset `test`.

use std::path::Path;

use ghand_core::{Camera, Pose};
use glam::DVec3;
use rayon::prelude::*;
use serde_json::{Map, Value, json};

use super::joints::{JOINTS, OF_MANO, TIPS};
use super::{Location, Sequences, paths};
use crate::capture::{Capture, Frame};
use crate::error::CaptureError;
use crate::images::view::crop_box;
use crate::reading::json_file::write_json;
use crate::split::Split;
use crate::truth::write_truth;

/// The annotated points of a frame, world, metres: MANO's joints in MANO's order, then the fingertips in the same order
/// (index, middle, little, ring, thumb).
pub type Landmarks = [DVec3; JOINTS];

/// The number of the first frame, and the step between frames: the data set has every third.
const FIRST_NUMBER: usize = 20_000;
const NUMBER_STEP: usize = 3;
/// The hand that synthetic captures show.
const SIDE: &str = "right";

fn location(root: &Path) -> Location {
    Location { root: root.into(), images: "images", subset: "test".into(), capture: "0".into() }
}

/// Names cameras, frames and images as in the data set: frames of the split `test` are in the test sequence, the others
/// in the training sequence.
pub fn rename_as_interhand(capture: &mut Capture) {
    let sequences = Sequences::default().or_default(capture.side);
    let is_test = |i: usize| capture.splits.get("test").is_some_and(|split| split.frames.contains(&i));
    let names: Vec<String> = (0..capture.frames.len())
        .map(|i| {
            let sequence = if is_test(i) { &sequences.test } else { &sequences.train };
            format!("{}/{}", sequence.concat(), FIRST_NUMBER + NUMBER_STEP * i)
        })
        .collect();
    capture.frames.iter_mut().zip(names).for_each(|(frame, name)| frame.id = name);
    // Those of grey cameras begin with 41.
    (400_200..).zip(&mut capture.cameras).for_each(|(id, camera): (u32, _)| camera.id = id.to_string());
    capture.images = paths(&location(&capture.root));
    capture.images.made_masks = None;
}

/// Writes the annotations of a capture named by [`rename_as_interhand`] whose images and masks exist, and `truth.json` beside them.
/// `landmarks` are those of its frames.
///
/// # Errors
/// [`CaptureError::Io`] if a file or folder cannot be written.
pub fn write_annotations(capture: &Capture, landmarks: &[Landmarks]) -> Result<(), CaptureError> {
    let location = location(&capture.root);
    let file = |kind: &str| {
        let path = location.annotation(kind);
        let folder = path.parent().unwrap_or(Path::new("."));
        std::fs::create_dir_all(folder).map(|()| path.clone()).map_err(|source| CaptureError::Io {
            path,
            action: "create the folder",
            source,
            remedy: "check that the capture's folder is writable (and has free space)",
        })
    };
    let of_capture = |value: Value| json!({ location.capture.as_str(): value });
    write_json(&file("camera")?, &of_capture(camera_tables(capture)))?;
    write_json(&file("data")?, &images(capture)?)?;
    write_json(&file("MANO_NeuralAnnot")?, &of_capture(by_number(capture, |frame, _| parameters(capture, frame))))?;
    write_json(&file("joint_3d")?, &of_capture(by_number(capture, |_, i| joints(landmarks.get(i)))))?;
    write_truth(capture)
}

/// Frame numbers and their values.
fn by_number(capture: &Capture, value: impl Fn(&Frame, usize) -> Value) -> Value {
    let entries = capture.frames.iter().enumerate().map(|(i, f)| (number(f).to_owned(), value(f, i)));
    Value::Object(entries.collect())
}

fn number(frame: &Frame) -> &str {
    frame.id.split_once('/').map_or(&frame.id, |(_, number)| number)
}

fn camera_tables(capture: &Capture) -> Value {
    let table = |value: &dyn Fn(&Camera) -> Value| {
        Value::Object(capture.cameras.iter().map(|c| (c.id.clone(), value(c))).collect::<Map<_, _>>())
    };
    json!({
        "campos": table(&|c| json!((c.center() * 1000.0).to_array())),
        // glam stores columns; the file holds rows.
        "camrot": table(&|c| json!(c.rotation.transpose().to_cols_array_2d())),
        "focal": table(&|c| json!(c.focal.to_array())),
        "princpt": table(&|c| json!(c.principal.to_array())),
    })
}

/// MANO's parameters: the pose without the model's mean.
fn parameters(capture: &Capture, frame: &Frame) -> Value {
    let mean = capture.hand_model.pose_space.as_ref().map_or(&[][..], |space| &space.mean);
    let Pose { rotations, translation } = &frame.pose;
    let taken = std::iter::once(&DVec3::ZERO).chain(mean).chain(std::iter::repeat(&DVec3::ZERO));
    let pose: Vec<f64> = rotations.iter().zip(taken).flat_map(|(r, mean)| (*r - *mean).to_array()).collect();
    let mut shape = frame.shape.clone();
    shape.resize(super::poses::SHAPES, 0.0);
    let hand = json!({ "pose": pose, "shape": shape, "trans": translation.to_array() });
    json!({ SIDE: hand, "left": null })
}

/// World coordinates of both hands' joints, millimetres; those of the other hand are not valid.
fn joints(landmarks: Option<&Landmarks>) -> Value {
    let Some(landmarks) = landmarks else { return Value::Null };
    let mut world = vec![[0.0; 3]; 2 * JOINTS];
    for (point, place) in landmarks.iter().zip(OF_MANO.into_iter().chain(TIPS)) {
        world[place] = (*point * 1000.0).to_array();
    }
    let valid: Vec<[u8; 1]> = (0..2 * JOINTS).map(|i| [u8::from(i < JOINTS)]).collect();
    json!({ "world_coord": world, "joint_valid": valid, "hand_type": SIDE, "hand_type_valid": [1] })
}

/// The images with their annotations, in the layout of COCO.
fn images(capture: &Capture) -> Result<Value, CaptureError> {
    let views: Vec<_> =
        ["train", "test"].iter().filter_map(|name| capture.splits.get(*name)).flat_map(|s: &Split| &s.views).collect();
    let boxes: Vec<[u32; 4]> =
        views.par_iter().map(|v| hand_box(capture, v.camera, v.frame)).collect::<Result<_, _>>()?;
    let mut images = vec![];
    let mut annotations = vec![];
    for (id, (view, bounds)) in views.iter().zip(boxes).enumerate() {
        let (camera, frame) = capture.camera_and_frame(view.camera, view.frame)?;
        let (sequence, number) = frame.id.split_once('/').unwrap_or(("", &frame.id));
        let file = format!("Capture0/{sequence}/cam{}/image{number}.jpg", camera.id);
        images.push(json!({
            "id": id, "file_name": file, "width": camera.width, "height": camera.height, "capture": 0, "subject": 0,
            "seq_name": sequence, "camera": camera.id, "frame_idx": number.parse::<u64>().unwrap_or_default(),
        }));
        let valid: Vec<u8> = (0..2 * JOINTS).map(|i| u8::from(i < JOINTS)).collect();
        annotations.push(json!({
            "id": id, "image_id": id, "bbox": bounds, "joint_valid": valid, "hand_type": SIDE, "hand_type_valid": 1,
        }));
    }
    Ok(json!({ "images": images, "annotations": annotations }))
}

/// The box of the hand on a mask: x, y, width, height, pixels.
fn hand_box(capture: &Capture, camera: usize, frame: usize) -> Result<[u32; 4], CaptureError> {
    let size = capture.camera_and_frame(camera, frame).map(|(c, _)| (c.width, c.height))?;
    let mask = capture.load_mask(camera, frame, size)?.map(|mask| mask.values).unwrap_or_default();
    let pixels: Vec<[u8; 4]> = mask.into_iter().map(|m| [0, 0, 0, m]).collect();
    Ok(crop_box(&pixels, size.0, size.1, 0))
}
