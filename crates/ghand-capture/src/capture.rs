//! The capture type that the rest of the system uses.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;

use ghand_core::posing::shape_hand;
use ghand_core::{Camera, HandModel, Pose, Side};
use ghand_hand_model::HandModelError;

use crate::cameras::distortion::Distortion;
pub use crate::error::CaptureError;
use crate::images::color_correction::ColorCorrection;
use crate::mask::{AlignedHand, MadeMasks};
pub use crate::split::{Split, SplitView};

/// The source of a capture's hand model; a writer stores this instead of the model.
#[derive(Debug, Clone, PartialEq)]
pub enum HandModelSource {
    /// A glTF file, its path relative to the capture's folder.
    Gltf {
        /// The path, with `/` between its parts.
        path: String,
    },
    /// The built-in hand of the capture's side ([`ghand_hand_model::builtin`]).
    Builtin,
    /// The user's own MANO file, which the user gives each time.
    Mano,
}

/// One moment of the capture.
#[derive(Debug, Clone, PartialEq)]
pub struct Frame {
    /// Name of the frame within its capture. If frames are in folders of several sequences, it is `sequence/number`.
    pub id: String,
    /// Coarse pose, in the order of the hand model's joints.
    pub pose: Pose,
    /// Shape parameters of the hand model; empty for models without any.
    pub shape: Vec<f64>,
}

/// Paths of the images, relative to the capture's folder, with `{camera}` and `{frame}` in place of the ids. For a
/// frame called `sequence/number`, `{sequence}` and `{number}` are its parts.
#[derive(Debug, Clone, PartialEq)]
pub struct ImagePaths {
    /// Path of the images.
    pub image: String,
    /// Path of the masks (8-bit, hand at >= 128). Without it, and if none are made, the images' alpha channel is the
    /// mask, and without that the hand may be anywhere in the image.
    pub mask: Option<String>,
    /// Path of where other hands are in the images (8-bit, another hand at >= 128): masks that are made leave them out. An
    /// image without such a file shows no other hand.
    pub other_hands: Option<String>,
    /// How masks are made for images without a file at `mask`, if they are.
    pub made_masks: Option<MadeMasks>,
    /// The hand that masks are cut to. No file has it: training finds it.
    pub aligned: Option<Arc<AlignedHand>>,
}

impl ImagePaths {
    /// Images, and masks if there are any, that show the hand over the capture's background.
    pub fn plain(image: &str, mask: Option<&str>) -> ImagePaths {
        ImagePaths {
            image: image.into(),
            mask: mask.map(Into::into),
            other_hands: None,
            made_masks: None,
            aligned: None,
        }
    }
}

/// Calibrated images of a moving hand from several cameras, with a coarse pose per frame.
#[derive(Debug, Clone, PartialEq)]
pub struct Capture {
    /// The folder that all paths are relative to.
    pub root: PathBuf,
    /// Which hand it shows.
    pub side: Side,
    /// Display colour behind the hand, in `[0, 1]`.
    pub background: [f64; 3],
    /// The hand model that the poses and shapes are for.
    pub hand_model: HandModel,
    /// Where `hand_model` comes from.
    pub hand_model_source: HandModelSource,
    /// The hand model in the mean shape of the frames: this person's hand at rest, from which an avatar starts.
    pub template: HandModel,
    /// The cameras; metres, world axes.
    pub cameras: Vec<Camera>,
    /// Distortion of the cameras' lenses, one per camera; empty if none has any. Files of images and masks are
    /// distorted, views are not: [`Capture::load_view`] undistorts them.
    pub distortion: Vec<Option<Distortion>>,
    /// What [`Capture::load_view`] does to the colours of the images. No file has it: training finds it.
    pub color_correction: ColorCorrection,
    /// The frames, poses in the order of the hand model's joints.
    pub frames: Vec<Frame>,
    /// Where the images are.
    pub images: ImagePaths,
    /// Splits by name: `train`, `test` and any others of the capture.
    pub splits: BTreeMap<String, Split>,
    /// Exact poses, one entry per frame, if known. For evaluation only; training must not use them.
    pub truth: Option<Vec<Option<Pose>>>,
}

impl Capture {
    /// The split of that name.
    ///
    /// # Errors
    /// [`CaptureError::Invalid`] lists the existing splits.
    pub fn split(&self, name: &str) -> Result<&Split, CaptureError> {
        self.splits.get(name).ok_or_else(|| {
            let names: Vec<&str> = self.splits.keys().map(String::as_str).collect();
            let problem = format!("there is no split {name:?}; choose one of: {}", names.join(", "));
            CaptureError::Invalid { path: self.root.clone(), field: "splits".into(), problem }
        })
    }

    /// Gives all frames, and with them the template, another shape.
    ///
    /// # Errors
    /// [`CaptureError::HandModel`] if it has more numbers than the hand model has shapes, or one is not finite.
    pub fn take_shape(&mut self, shape: &[f64]) -> Result<(), CaptureError> {
        self.frames.iter_mut().for_each(|frame| frame.shape = shape.to_vec());
        self.template = mean_shaped(&self.hand_model, &self.frames)
            .map_err(|source| CaptureError::HandModel { path: self.root.clone(), source })?;
        Ok(())
    }

    /// Index of the camera of that id.
    pub fn camera_index(&self, id: &str) -> Option<usize> {
        self.cameras.iter().position(|c| c.id == id)
    }

    /// Index of the frame of that id.
    pub fn frame_index(&self, id: &str) -> Option<usize> {
        self.frames.iter().position(|f| f.id == id)
    }

    /// File of the image of a camera and a frame.
    ///
    /// # Errors
    /// [`CaptureError::Invalid`] if there is no such camera or frame.
    pub fn image_file(&self, camera: usize, frame: usize) -> Result<PathBuf, CaptureError> {
        self.file(&self.images.image, camera, frame)
    }

    /// File of the mask of a camera and a frame, if the capture has masks.
    ///
    /// # Errors
    /// [`CaptureError::Invalid`] if there is no such camera or frame.
    pub fn mask_file(&self, camera: usize, frame: usize) -> Result<Option<PathBuf>, CaptureError> {
        self.images.mask.as_ref().map(|template| self.file(template, camera, frame)).transpose()
    }

    /// File of where other hands are in the image of a camera and a frame, if there is one.
    pub(crate) fn other_hands_file(&self, camera: usize, frame: usize) -> Result<Option<PathBuf>, CaptureError> {
        let template = self.images.other_hands.as_ref();
        let file = template.map(|template| self.file(template, camera, frame)).transpose()?;
        Ok(file.filter(|file| file.exists()))
    }

    fn file(&self, template: &str, camera: usize, frame: usize) -> Result<PathBuf, CaptureError> {
        let (camera, frame) = self.camera_and_frame(camera, frame)?;
        Ok(self.root.join(fill_template(template, &camera.id, &frame.id)))
    }

    pub(crate) fn camera_and_frame(&self, camera: usize, frame: usize) -> Result<(&Camera, &Frame), CaptureError> {
        let found = self.cameras.get(camera).ok_or_else(|| self.absent("cameras", camera, self.cameras.len()))?;
        Ok((found, self.frame(frame)?))
    }

    pub(crate) fn frame(&self, index: usize) -> Result<&Frame, CaptureError> {
        self.frames.get(index).ok_or_else(|| self.absent("frames", index, self.frames.len()))
    }

    pub(crate) fn absent(&self, field: &str, index: usize, count: usize) -> CaptureError {
        let problem = format!("number {index} does not exist; the capture has {count}, counted from 0");
        CaptureError::Invalid { path: self.root.clone(), field: field.into(), problem }
    }
}

/// The hand model in the mean shape of the frames; missing parameters of shorter shapes are 0.
///
/// # Errors
/// [`HandModelError::Invalid`] when a shape is longer than the model's or not finite.
pub(crate) fn mean_shaped(model: &HandModel, frames: &[Frame]) -> Result<HandModel, HandModelError> {
    let length = frames.iter().map(|f| f.shape.len()).max().unwrap_or(0);
    if length == 0 {
        return Ok(model.clone());
    }
    let mean = |i: usize| frames.iter().filter_map(|f| f.shape.get(i)).sum::<f64>() / frames.len() as f64;
    let shaped = shape_hand(model, &(0..length).map(mean).collect::<Vec<f64>>())?;
    Ok(HandModel { vertices: shaped.vertices, joints: shaped.joints, ..model.clone() })
}

/// A path template with the ids filled in. An inserted id is not expanded again, even if it looks like a placeholder.
pub fn fill_template(template: &str, camera: &str, frame: &str) -> String {
    let (sequence, number) = frame.split_once('/').unwrap_or(("", frame));
    let ids = [("{camera}", camera), ("{frame}", frame), ("{sequence}", sequence), ("{number}", number)];
    let mut filled = String::new();
    let mut rest = template;
    while let Some(at) = rest.find('{') {
        let (before, from) = rest.split_at(at);
        filled.push_str(before);
        let (text, taken) = match ids.iter().find(|(name, _)| from.starts_with(name)) {
            Some((name, id)) => (*id, name.len()),
            None => ("{", 1),
        };
        filled.push_str(text);
        rest = from.get(taken..).unwrap_or("");
    }
    filled + rest
}

#[cfg(test)]
mod tests {
    use super::*;
    use ghand_test_support::procedural_hand::ProceduralHand;

    #[test]
    fn ids_fill_only_their_own_placeholders() {
        assert_eq!(fill_template("i/{camera}/{frame}.png", "{frame}", "{camera}"), "i/{frame}/{camera}.png");
        assert_eq!(fill_template("{frame}-{camera}-{frame}", "a", "b"), "b-a-b");
        assert_eq!(fill_template("{sequence}/c{camera}/{number}.j{p}g{", "4", "ROM/12"), "ROM/c4/12.j{p}g{");
    }

    #[test]
    fn the_template_has_the_mean_shape_and_its_joints() {
        let model = ProceduralHand { detail: 1, ..Default::default() }.build().unwrap();
        let frame = |shape: &[f64]| Frame { id: "a".into(), pose: Pose::rest(16), shape: shape.to_vec() };
        assert_eq!(mean_shaped(&model, &[frame(&[]), frame(&[])]).unwrap(), model);
        let shaped = mean_shaped(&model, &[frame(&[2.0, 1.0]), frame(&[0.0, 1.0])]).unwrap();
        let expected = shape_hand(&model, &[1.0, 1.0]).unwrap();
        assert_eq!((&shaped.vertices, &shaped.joints), (&expected.vertices, &expected.joints));
        assert_ne!(shaped.joints, model.joints);
        assert!(mean_shaped(&model, &[frame(&[0.0; 99])]).is_err());
    }
}
