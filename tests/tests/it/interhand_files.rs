//! A small InterHand2.6M, written from the synthetic capture.

use std::path::{Path, PathBuf};

use ghand_capture::{Capture, CaptureError, OpenOptions, Opened};
use ghand_core::{HandModel, Pose};
use serde_json::{Value, json};
use tempfile::TempDir;

use crate::fixtures::{mano, rows, shape, synthetic, synthetic_image, write, write_jpeg};

/// Number of a synthetic frame in the data set.
pub fn number(frame: usize) -> u64 {
    20_000 + 3 * frame as u64
}

/// Id of a synthetic camera in the data set.
pub fn camera_id(camera: usize) -> String {
    format!("4002{camera:02}")
}

/// The data set in memory, to be changed before it is written.
pub struct InterHand {
    pub camera: Value,
    pub images: Vec<Value>,
    pub annotations: Vec<Value>,
    pub mano: Value,
    /// The file of joints; not written if `None`.
    pub joints: Option<Value>,
    /// `right` or `left`, and `RT` or `LT`.
    pub side: [&'static str; 2],
    /// The folder of the images below the root.
    pub image_folder: &'static str,
}

impl InterHand {
    /// Capture 0 of the subset `test`, with only usable images.
    pub fn new(model: &HandModel, side: [&'static str; 2]) -> InterHand {
        let capture = synthetic();
        let mut data = InterHand {
            camera: json!({}),
            images: vec![],
            annotations: vec![],
            mano: json!({"0": {}}),
            joints: None,
            side,
            image_folder: "images",
        };
        let mut tables = json!({"campos": {}, "camrot": {}, "focal": {}, "princpt": {}});
        for (i, camera) in capture.cameras.iter().enumerate() {
            let id = camera_id(i);
            tables["campos"][&id] = json!((camera.center() * 1000.0).to_array());
            tables["camrot"][&id] = json!(rows(camera.rotation));
            tables["focal"][&id] = json!(camera.focal.to_array());
            tables["princpt"][&id] = json!(camera.principal.to_array());
        }
        data.camera["0"] = tables;
        for (name, sequence) in [("train", data.sequences()[0].clone()), ("test", data.sequences()[1].clone())] {
            for view in &capture.splits[name].views {
                let mask =
                    image::open(capture.mask_file(view.camera, view.frame).unwrap().unwrap()).unwrap().into_luma8();
                let on = || mask.enumerate_pixels().filter(|(_, _, p)| p.0[0] > 0);
                let (x0, x1) = (on().map(|p| p.0).min().unwrap(), on().map(|p| p.0).max().unwrap());
                let (y0, y1) = (on().map(|p| p.1).min().unwrap(), on().map(|p| p.1).max().unwrap());
                // The synthetic cameras fill their images; the data set's do not.
                let (x0, y0) = (x0.max(10), y0.max(10));
                let (x1, y1) = (x1.min(117), y1.min(181));
                data.add(&sequence, &camera_id(view.camera), number(view.frame), [x0, y0, x1 - x0 + 1, y1 - y0 + 1]);
            }
        }
        for (frame, f) in capture.frames.iter().enumerate() {
            data.mano["0"][number(frame).to_string()] = json!({side[0]: parameters(&f.pose, model)});
        }
        data
    }

    /// The sequences for training and testing.
    pub fn sequences(&self) -> [String; 2] {
        let word = self.side[1];
        [format!("ROM04_{word}_Occlusion"), format!("ROM03_{word}_No_Occlusion")]
    }

    /// Adds an image and its annotation; returns its index in both lists.
    pub fn add(&mut self, sequence: &str, camera: &str, number: u64, bbox: [u32; 4]) -> usize {
        let id = 1000 + self.images.len();
        self.images.push(json!({
            "id": id, "file_name": format!("Capture0/{sequence}/cam{camera}/image{number}.jpg"), "width": 128, "height": 192,
            "capture": 0, "subject": 3, "seq_name": sequence, "camera": camera, "frame_idx": number,
        }));
        self.annotations.push(json!({
            "id": id, "image_id": id, "bbox": bbox, "joint_valid": vec![1; 42], "hand_type": self.side[0], "hand_type_valid": 1,
        }));
        self.images.len() - 1
    }

    /// Writes annotations and images below `root`.
    pub fn write(&self, root: &Path) {
        let folder = root.join("annotations/test");
        let file = |kind: &str| folder.join(format!("InterHand2.6M_test_{kind}.json"));
        write(&file("camera"), self.camera.to_string().as_bytes());
        let data = json!({"images": self.images, "annotations": self.annotations});
        write(&file("data"), data.to_string().as_bytes());
        write(&file("MANO_NeuralAnnot"), self.mano.to_string().as_bytes());
        if let Some(joints) = &self.joints {
            write(&file("joint_3d"), joints.to_string().as_bytes());
        }
        for (split, sequence) in [("train", 0), ("test", 1)] {
            for view in &synthetic().splits[split].views {
                let path = self.image_file(root, sequence, view.camera, view.frame);
                write_jpeg(&path, &synthetic_image(view.camera, view.frame));
            }
        }
    }

    /// File of an image of the synthetic capture; `sequence` is 0 for training, 1 for testing.
    pub fn image_file(&self, root: &Path, sequence: usize, camera: usize, frame: usize) -> PathBuf {
        let folder = self.image_folder;
        let sequence = &self.sequences()[sequence];
        let camera = camera_id(camera);
        let number = number(frame);
        root.join(format!("{folder}/test/Capture0/{sequence}/cam{camera}/image{number}.jpg"))
    }
}

/// MANO's parameters of a pose, without the mean pose.
pub fn parameters(pose: &Pose, model: &HandModel) -> Value {
    let mean = &model.pose_space.as_ref().unwrap().mean;
    let mut rotations = pose.rotations.clone();
    rotations.iter_mut().skip(1).zip(mean).for_each(|(r, m)| *r -= *m);
    let pose_numbers: Vec<f64> = rotations.iter().flat_map(|r| r.to_array()).collect();
    json!({"pose": pose_numbers, "shape": shape(), "trans": pose.translation.to_array()})
}

/// The plain right hand.
pub fn right() -> InterHand {
    InterHand::new(mano(), ["right", "RT"])
}

pub fn options() -> OpenOptions {
    OpenOptions { mano: Some(mano().clone()), ..Default::default() }
}

/// Opens the data set after a change; also returns its folder.
pub fn open_after(change: impl FnOnce(&mut InterHand)) -> (Result<Opened, CaptureError>, TempDir) {
    let folder = tempfile::tempdir().unwrap();
    let mut data = right();
    change(&mut data);
    data.write(folder.path());
    (Capture::open_with(folder.path(), &options()), folder)
}
