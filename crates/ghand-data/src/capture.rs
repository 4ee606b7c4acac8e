//! The one capture type that the rest of the system sees.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use ghand_core::hand_model::procedural::ProceduralHand;
use ghand_core::{Camera, HandModel, HandModelError, Pose, Side};
use image::DynamicImage;

/// What is wrong with a capture. Every message names the file, the field and what to do.
#[derive(Debug, thiserror::Error)]
pub enum CaptureError {
    /// A file could not be read or written.
    #[error("{path}: cannot {action}: {source}; {remedy}")]
    Io {
        /// The file.
        path: PathBuf,
        /// What was tried, as in "read the capture".
        action: &'static str,
        /// The cause.
        source: std::io::Error,
        /// What to do about it.
        remedy: &'static str,
    },
    /// A file is not JSON, or a field is missing or has the wrong type.
    #[error("{path}: {source}; correct the file at that place or export the capture again")]
    Json {
        /// The file.
        path: PathBuf,
        /// The cause, with the field's name or its line and column.
        source: serde_json::Error,
    },
    /// A field holds something unusable.
    #[error("{path}: {field}: {problem}")]
    Invalid {
        /// The file.
        path: PathBuf,
        /// The field, as in `frames["0003"].pose`.
        field: String,
        /// What is wrong and what to do about it.
        problem: String,
    },
    /// The capture's hand model is unusable.
    #[error("{path}: hand_model: {source}")]
    HandModel {
        /// The file of the capture.
        path: PathBuf,
        /// The cause.
        source: HandModelError,
    },
    /// An image or mask could not be decoded or encoded.
    #[error("{path}: {what}: {source}; replace the file by a valid PNG or JPEG")]
    Image {
        /// The file.
        path: PathBuf,
        /// "image" or "mask".
        what: &'static str,
        /// The cause.
        source: image::ImageError,
    },
    /// The renderer of a synthetic capture failed.
    #[error("synthetic capture: frame {frame} from camera {camera} could not be rendered: {problem}")]
    Render {
        /// Id of the frame.
        frame: String,
        /// Id of the camera.
        camera: String,
        /// What the renderer said.
        problem: String,
    },
}

/// Where a capture's hand model comes from; what a writer puts in place of the model itself.
#[derive(Debug, Clone, PartialEq)]
pub enum HandModelSource {
    /// A glTF file, its path relative to the capture's folder.
    Gltf {
        /// The path, with `/` between its parts.
        path: String,
    },
    /// The built-in hand of these parameters.
    Procedural(ProceduralHand),
}

/// One moment of the capture.
#[derive(Debug, Clone, PartialEq)]
pub struct Frame {
    /// Name of the frame within its capture.
    pub id: String,
    /// Coarse pose, in the order of the hand model's joints.
    pub pose: Pose,
    /// Shape parameters of the hand model; empty for models without any.
    pub shape: Vec<f64>,
}

/// A named choice of cameras and frames, as indices into those of the capture: every pair of them is an image.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Split {
    /// Indices into [`Capture::cameras`].
    pub cameras: Vec<usize>,
    /// Indices into [`Capture::frames`].
    pub frames: Vec<usize>,
}

/// Where the images are: paths relative to the capture's folder with `{camera}` and `{frame}` in place of the ids.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ImagePaths {
    /// Path of the images.
    pub image: String,
    /// Path of the masks (8-bit, hand at >= 128). Without one the images' alpha channel is the mask, and without that the hand
    /// may be anywhere in the image.
    pub mask: Option<String>,
}

/// One image of the capture with its mask.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct View {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Row-major display values: red, green and blue exactly as in the file (images with an alpha channel are composited over the
    /// capture's background), and 255 where the mask says hand, 0 elsewhere.
    pub rgba: Vec<[u8; 4]>,
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
    /// The hand model that the poses are for.
    pub hand_model: HandModel,
    /// Where `hand_model` comes from.
    pub hand_model_source: HandModelSource,
    /// The cameras; metres, world axes.
    pub cameras: Vec<Camera>,
    /// The frames, poses in the order of the hand model's joints.
    pub frames: Vec<Frame>,
    /// Where the images are.
    pub images: ImagePaths,
    /// Splits by name: `train`, `test` and whatever else the capture offers.
    pub splits: BTreeMap<String, Split>,
    /// Exact poses, one entry a frame, where they are known. For evaluation; training must not look.
    pub truth: Option<Vec<Option<Pose>>>,
}

impl Capture {
    /// The split of that name.
    ///
    /// # Errors
    /// [`CaptureError::Invalid`] lists the splits that there are.
    pub fn split(&self, name: &str) -> Result<&Split, CaptureError> {
        self.splits.get(name).ok_or_else(|| {
            let names: Vec<&str> = self.splits.keys().map(String::as_str).collect();
            let problem = format!("there is no split {name:?}; choose one of: {}", names.join(", "));
            CaptureError::Invalid { path: self.root.clone(), field: "splits".into(), problem }
        })
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
    /// [`CaptureError::Invalid`] when there is no such camera or frame.
    pub fn image_file(&self, camera: usize, frame: usize) -> Result<PathBuf, CaptureError> {
        self.file(&self.images.image, camera, frame)
    }

    /// File of the mask of a camera and a frame, if the capture has masks.
    ///
    /// # Errors
    /// [`CaptureError::Invalid`] when there is no such camera or frame.
    pub fn mask_file(&self, camera: usize, frame: usize) -> Result<Option<PathBuf>, CaptureError> {
        self.images.mask.as_ref().map(|template| self.file(template, camera, frame)).transpose()
    }

    /// Reads the image and the mask of a camera and a frame (indices). Pairs that no split names may have no file.
    ///
    /// # Errors
    /// [`CaptureError`] when there is no such camera or frame, or when a file is missing, broken or not of the camera's size.
    pub fn load_view(&self, camera: usize, frame: usize) -> Result<View, CaptureError> {
        let image_file = self.image_file(camera, frame)?;
        let mask_file = self.mask_file(camera, frame)?;
        let size = self.cameras.get(camera).map_or((0, 0), |c| (c.width, c.height));
        let picture = decode(&image_file, "image", size)?;
        let mut rgba = self.over_background(&picture);
        if let Some(mask_file) = mask_file {
            let mask = decode(&mask_file, "mask", size)?.into_luma8();
            for (pixel, mask) in rgba.iter_mut().zip(mask.as_raw()) {
                pixel[3] = *mask;
            }
        }
        for pixel in &mut rgba {
            pixel[3] = if pixel[3] >= 128 { 255 } else { 0 };
        }
        Ok(View { width: size.0, height: size.1, rgba })
    }

    fn file(&self, template: &str, camera: usize, frame: usize) -> Result<PathBuf, CaptureError> {
        let fail = |field: &str, index: usize, count: usize| CaptureError::Invalid {
            path: self.root.clone(),
            field: field.into(),
            problem: format!("there is no number {index}; the capture has {count}, counted from 0"),
        };
        let camera_id = &self.cameras.get(camera).ok_or_else(|| fail("cameras", camera, self.cameras.len()))?.id;
        let frame_id = &self.frames.get(frame).ok_or_else(|| fail("frames", frame, self.frames.len()))?.id;
        Ok(self.root.join(fill_template(template, camera_id, frame_id)))
    }

    /// Pixels of an image; alpha as in the file, 255 where it has none.
    fn over_background(&self, picture: &DynamicImage) -> Vec<[u8; 4]> {
        if !picture.color().has_alpha() {
            return picture.to_rgb8().pixels().map(|p| [p.0[0], p.0[1], p.0[2], 255]).collect();
        }
        let background = self.background.map(|b| b * 255.0);
        let blend = |value: u8, alpha: u8, behind: f64| {
            let alpha = f64::from(alpha) / 255.0;
            (f64::from(value) * alpha + behind * (1.0 - alpha)).round().clamp(0.0, 255.0) as u8
        };
        let [r0, g0, b0] = background;
        (picture.to_rgba8().pixels())
            .map(|p| {
                let [r, g, b, a] = p.0;
                [blend(r, a, r0), blend(g, a, g0), blend(b, a, b0), a]
            })
            .collect()
    }
}

/// A path template with the ids filled in. Ids are put in last to first, so that an id that looks like a placeholder stays
/// what it is.
pub(crate) fn fill_template(template: &str, camera: &str, frame: &str) -> String {
    let parts: Vec<String> = template.split("{camera}").map(|part| part.replace("{frame}", frame)).collect();
    parts.join(camera)
}

fn decode(file: &Path, what: &'static str, size: (u32, u32)) -> Result<DynamicImage, CaptureError> {
    let io = |source| CaptureError::Io {
        path: file.into(),
        action: if what == "mask" { "read the mask" } else { "read the image" },
        source,
        remedy: "add the file, or take its camera or frame out of the splits",
    };
    let reader = image::ImageReader::open(file).map_err(io)?.with_guessed_format().map_err(io)?;
    let picture = reader.decode().map_err(|source| CaptureError::Image { path: file.into(), what, source })?;
    if (picture.width(), picture.height()) == size {
        return Ok(picture);
    }
    let problem = format!(
        "is {} x {} pixels but its camera says {} x {}; resize it or correct width, height and intrinsics of the camera",
        picture.width(),
        picture.height(),
        size.0,
        size.1
    );
    Err(CaptureError::Invalid { path: file.into(), field: what.into(), problem })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ids_fill_their_own_places_only() {
        assert_eq!(fill_template("i/{camera}/{frame}.png", "{frame}", "{camera}"), "i/{frame}/{camera}.png");
        assert_eq!(fill_template("{frame}-{camera}-{frame}", "a", "b"), "b-a-b");
    }
}
