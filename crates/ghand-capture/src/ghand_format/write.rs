//! Writes the `capture.json` of a [`Capture`].

use ghand_core::HandModel;

use super::{CAPTURE_FILE, CaptureFile, FORMAT, FrameFile, HandModelFile, MADE, SplitFile, UNITS, VERSION};
use crate::cameras::file::CameraFile;
use crate::capture::{Capture, CaptureError, HandModelSource};
use crate::mask::MaskMethod;
use crate::reading::json_file::write_json;
use crate::reading::validation::is_plain_id;
use crate::truth::{pose_rows, write_truth};

impl Capture {
    /// Writes `capture.json`, and `truth.json` if the truth is known, into the capture's folder (`root`), which must
    /// exist. Images, masks and a glTF file are not touched.
    ///
    /// # Errors
    /// [`CaptureError::Io`] if a file cannot be written; it is then unchanged. [`CaptureError::Invalid`] if the format
    /// cannot express the capture, such as one read from another data set.
    pub fn save(&self) -> Result<(), CaptureError> {
        self.check_writable()?;
        // The truth first: a folder with a capture.json is a complete capture.
        write_truth(self)?;
        write_json(&self.root.join(CAPTURE_FILE), &self.to_file())
    }

    /// The format cannot express frames of several sequences, masks made by outline, and splits that are not a product.
    fn check_writable(&self) -> Result<(), CaptureError> {
        let by_outline = self.images.made_masks.as_ref().is_some_and(|made| made.method == MaskMethod::Outline);
        let odd = if by_outline {
            "masks"
        } else if self.frames.iter().any(|f| !is_plain_id(&f.id)) {
            "frames"
        } else if self.splits.values().any(|s| !s.is_product()) {
            "splits"
        } else {
            return Ok(());
        };
        let problem =
            format!("version {VERSION} of capture.json cannot express them; read the data set from its own folder");
        Err(CaptureError::Invalid { path: self.root.join(CAPTURE_FILE), field: odd.into(), problem })
    }

    fn to_file(&self) -> CaptureFile {
        let frames = self.frames.iter().map(|f| FrameFile {
            id: f.id.clone(),
            pose: pose_rows(&f.pose),
            translation: f.pose.translation.to_array(),
            shape: f.shape.clone(),
        });
        let splits = self.splits.iter().map(|(name, split)| {
            let cameras = split.cameras.iter().filter_map(|&i| Some(self.cameras.get(i)?.id.clone())).collect();
            let frames = split.frames.iter().filter_map(|&i| Some(self.frames.get(i)?.id.clone())).collect();
            (name.clone(), SplitFile { cameras, frames })
        });
        CaptureFile {
            format: FORMAT.into(),
            version: VERSION,
            units: UNITS.into(),
            side: self.side.to_string(),
            background: self.background,
            hand_model: hand_model_file(&self.hand_model, &self.hand_model_source),
            pixel_center: None,
            cameras: (0..)
                .zip(&self.cameras)
                .map(|(i, c)| CameraFile::of(c, self.distortion.get(i).copied().flatten()))
                .collect(),
            frames: frames.collect(),
            image_path: self.images.image.clone(),
            mask_path: self.images.mask.clone(),
            other_hands_path: self.images.other_hands.clone(),
            masks: self.images.made_masks.as_ref().map(|_| MADE.into()),
            splits: splits.collect(),
        }
    }
}

fn hand_model_file(model: &HandModel, source: &HandModelSource) -> HandModelFile {
    let (kind, path) = match source {
        HandModelSource::Gltf { path } => ("gltf", Some(path.clone())),
        HandModelSource::Builtin => ("builtin", None),
        HandModelSource::Mano => ("mano", None),
    };
    let parents = model.parents.iter().map(|p| p.map_or(-1, |p| p as i64)).collect();
    HandModelFile { kind: kind.into(), path, joints: Some(model.joint_names.clone()), parents: Some(parents) }
}
