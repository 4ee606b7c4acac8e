//! What a calibration says, and what it leaves open.

use std::fmt::{self, Display};
use std::path::{Path, PathBuf};

use glam::DVec2;

use super::super::distortion::Distortion;
use super::super::file::LEAST_SEEN;
use super::super::list::LensCamera;
use crate::cameras::rigid::Rigid;
use crate::error::CaptureError;
use crate::reading::validation::{CameraEntry, FileValidator, Position};

/// Pictures whose aspect differs by more from the camera's are of another setting.
const ASPECT_TOLERANCE: f64 = 0.01;

/// The tool, or the layout of files, that a calibration is in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CalibrationFormat {
    /// OpenCV's `FileStorage`, or files with its names.
    OpenCv,
    /// ROS's `camera_info`.
    Ros,
    /// Text files of handpose3d.
    DatFiles,
    /// COLMAP's text or binary models.
    Colmap,
    /// anipose's TOML.
    Anipose,
    /// FreeMoCap's TOML.
    FreeMoCap,
    /// Caliscope's TOML.
    Caliscope,
    /// Kalibr's chain of cameras.
    Kalibr,
    /// EasyMocap's two files.
    EasyMocap,
    /// Meshroom's, that is AliceVision's, scenes.
    Meshroom,
    /// glTF, as Blender exports it.
    Gltf,
    /// ghand's own.
    Ghand,
}

impl CalibrationFormat {
    /// What is added to a principal point of the format, in pixels: its first pixel's centre is at 0, ghand's at 0.5.
    pub(super) fn pixel_shift(self) -> f64 {
        match self {
            CalibrationFormat::Colmap | CalibrationFormat::Gltf | CalibrationFormat::Ghand => 0.0,
            _ => 0.5,
        }
    }
}

impl Display for CalibrationFormat {
    fn fmt(&self, formatter: &mut fmt::Formatter) -> fmt::Result {
        formatter.write_str(match self {
            CalibrationFormat::OpenCv => "OpenCV",
            CalibrationFormat::Ros => "ROS",
            CalibrationFormat::DatFiles => "handpose3d",
            CalibrationFormat::Colmap => "COLMAP",
            CalibrationFormat::Anipose => "anipose",
            CalibrationFormat::FreeMoCap => "FreeMoCap",
            CalibrationFormat::Caliscope => "Caliscope",
            CalibrationFormat::Kalibr => "Kalibr",
            CalibrationFormat::EasyMocap => "EasyMocap",
            CalibrationFormat::Meshroom => "Meshroom",
            CalibrationFormat::Gltf => "glTF",
            CalibrationFormat::Ghand => "ghand",
        })
    }
}

/// The unit of a calibration's lengths.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LengthUnit {
    /// Metres.
    Metre,
    /// Millimetres.
    Millimetre,
    /// Squares of a board, a reconstruction's own scale, or not told.
    Unknown,
}

impl LengthUnit {
    /// The unit's length, metres, if it is known.
    pub fn in_metres(self) -> Option<f64> {
        match self {
            LengthUnit::Metre => Some(1.0),
            LengthUnit::Millimetre => Some(1e-3),
            LengthUnit::Unknown => None,
        }
    }
}

/// How a camera without distortion projects.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Projection {
    /// Numbers in pixels of an image of the calibrated size.
    Pixels {
        /// Focal lengths (fx, fy).
        focal: DVec2,
        /// Principal point (cx, cy); the centre of the first pixel is at (0.5, 0.5).
        principal: DVec2,
    },
    /// Square pixels of any number, the principal point in the middle.
    FieldOfView {
        /// The vertical field of view, radians.
        vertical: f64,
        /// Width over height, if the file tells it.
        aspect: Option<f64>,
    },
}

/// One camera of a calibration.
#[derive(Debug, Clone, PartialEq)]
pub struct FoundCamera {
    /// Its name in the calibration, which can be part of a path: a field, or the name of its file or folder of images.
    pub id: String,
    /// Width and height of its images, pixels, if the calibration has them.
    pub size: Option<[u32; 2]>,
    /// How it projects.
    pub projection: Projection,
    /// What its lens does, if anything.
    pub distortion: Option<Distortion>,
    /// Where it stands, if the calibration has it: `camera_from_world` with OpenCV's axes, in the calibration's unit.
    pub extrinsics: Option<Rigid>,
}

/// The cameras of a calibration, checked: ids are unique, numbers finite, rotations proper.
#[derive(Debug, Clone, PartialEq)]
pub struct FoundCalibration {
    /// The file or folder, for messages.
    pub path: PathBuf,
    /// What wrote it.
    pub format: CalibrationFormat,
    /// At least one camera.
    pub cameras: Vec<FoundCamera>,
    /// The unit of where cameras stand.
    pub unit: LengthUnit,
    /// What was converted, assumed or ignored, one sentence each.
    pub remarks: Vec<String>,
}

impl FoundCalibration {
    /// Checks the cameras and adds the remark on their pixels.
    pub(super) fn checked(
        path: &Path,
        format: CalibrationFormat,
        unit: LengthUnit,
        mut cameras: Vec<FoundCamera>,
        mut remarks: Vec<String>,
    ) -> Result<FoundCalibration, CaptureError> {
        let validator = FileValidator { path };
        if cameras.is_empty() {
            return Err(validator.invalid("cameras", "are missing; give the result of the calibration"));
        }
        for camera in &mut cameras {
            camera.id = plain_id(&camera.id);
        }
        validator.index("cameras", cameras.iter().map(|camera| camera.id.as_str()))?;
        for camera in &cameras {
            check(validator, camera)?;
        }
        if format.pixel_shift() != 0.0 {
            remarks.push(format!(
                "principal points are moved by half a pixel: the first pixel's centre is at 0 in {format}, at 0.5 in \
                 ghand"
            ));
        }
        if cameras.iter().all(|camera| camera.extrinsics.is_none()) {
            remarks.push("it does not tell where the cameras stand".into());
        } else if unit == LengthUnit::Unknown {
            remarks.push("the unit of its lengths is unknown".into());
        }
        Ok(FoundCalibration { path: path.into(), format, cameras, unit, remarks })
    }

    /// A camera for images of that width and height, at the world's origin.
    ///
    /// # Errors
    /// [`CaptureError`] if the camera was calibrated for another size, or shows almost nothing of such images.
    pub fn lens_at_origin(&self, camera: &FoundCamera, size: [u32; 2]) -> Result<LensCamera, CaptureError> {
        self.lens(camera, size, &Rigid::IDENTITY)
    }

    /// A camera for images of that width and height where it stands, if one unit of the calibration is so many metres.
    ///
    /// # Errors
    /// As of [`Self::lens_at_origin`]; also if the calibration does not tell where the camera stands, or if that is not
    /// within 1000 m.
    pub fn lens_camera(
        &self,
        camera: &FoundCamera,
        size: [u32; 2],
        metres_per_unit: f64,
    ) -> Result<LensCamera, CaptureError> {
        let Some(Rigid { rotation, translation }) = camera.extrinsics else {
            let problem = "is missing: the calibration does not tell where this camera stands; give one that does";
            return Err(self.invalid(&camera.id, "extrinsics", problem));
        };
        self.lens(camera, size, &Rigid { rotation, translation: translation * metres_per_unit })
    }

    /// All cameras, in metres, if the calibration leaves nothing open.
    ///
    /// # Errors
    /// [`CaptureError`] names what is missing: images' sizes, the unit of lengths, or where a camera stands.
    pub fn lens_cameras(&self) -> Result<Vec<LensCamera>, CaptureError> {
        let camera = |camera: &FoundCamera| {
            let size = camera.size.ok_or_else(|| {
                let problem = "is missing: the calibration does not tell the images' width and height; give a \
                               capture.json with the cameras";
                self.invalid(&camera.id, "size", problem)
            })?;
            match (self.unit.in_metres(), camera.extrinsics) {
                (None, Some(_)) => {
                    let problem = format!(
                        "is unknown: {} does not store it; give a capture.json with the cameras in metres",
                        self.format
                    );
                    Err(FileValidator { path: &self.path }.invalid("unit of lengths", problem))
                }
                // Of a camera that stands nowhere, the unit is not what is missing.
                (unit, _) => self.lens_camera(camera, size, unit.unwrap_or(1.0)),
            }
        };
        self.cameras.iter().map(camera).collect()
    }

    fn invalid(&self, id: &str, part: &str, problem: impl Into<String>) -> CaptureError {
        FileValidator { path: &self.path }.invalid(format!("{}.{part}", field_of(id)), problem)
    }

    fn lens(&self, found: &FoundCamera, size: [u32; 2], at: &Rigid) -> Result<LensCamera, CaptureError> {
        let [width, height] = size;
        if let Some([w, h]) = found.size.filter(|calibrated| *calibrated != size) {
            let problem = format!(
                "is {w}x{h}, but the images are {width}x{height}; give the calibration of these images, or images as \
                 calibrated"
            );
            return Err(self.invalid(&found.id, "size", problem));
        }
        let size_f = DVec2::new(f64::from(width), f64::from(height));
        let (focal, principal) = match found.projection {
            Projection::Pixels { focal, principal } => (focal, principal),
            Projection::FieldOfView { vertical, aspect } => {
                let given = size_f.x / size_f.y;
                if let Some(aspect) = aspect.filter(|aspect| (given / aspect - 1.0).abs() > ASPECT_TOLERANCE) {
                    let problem = format!(
                        "is for pictures {aspect:.3} times as wide as high, but the images are {width}x{height}; \
                         export it with their resolution"
                    );
                    return Err(self.invalid(&found.id, "aspect", problem));
                }
                (DVec2::splat(0.5 * size_f.y / (0.5 * vertical).tan()), 0.5 * size_f)
            }
        };
        let camera = FileValidator { path: &self.path }.camera(&CameraEntry {
            id: &found.id,
            field: field_of(&found.id),
            size,
            focal,
            principal,
            rotation: at.rotation,
            position: Position::Translation(at.translation),
        })?;
        let seen = found.distortion.map_or(1.0, |distortion| distortion.visible_part(&camera));
        if seen < LEAST_SEEN {
            let problem = format!(
                "leaves {:.0}% of the undistorted image without a source; give the coefficients that were calibrated \
                 with these intrinsics",
                100.0 * (1.0 - seen)
            );
            return Err(self.invalid(&found.id, "distortion", problem));
        }
        Ok(LensCamera { camera, distortion: found.distortion })
    }
}

fn field_of(id: &str) -> String {
    format!("cameras[{id:?}]")
}

/// Checks what does not depend on images' sizes.
fn check(validator: FileValidator, camera: &FoundCamera) -> Result<(), CaptureError> {
    validator.id("cameras", &camera.id)?;
    let invalid = |part: &str, problem: &str| validator.invalid(format!("{}.{part}", field_of(&camera.id)), problem);
    match camera.projection {
        Projection::Pixels { focal, principal } => {
            if !(focal.min_element() > 0.0 && focal.is_finite() && principal.is_finite()) {
                return Err(invalid(
                    "focal length",
                    "must be positive and finite, and so must the principal point be finite",
                ));
            }
        }
        Projection::FieldOfView { vertical, aspect } => {
            let in_range = vertical > 0.0 && vertical < std::f64::consts::PI;
            if !in_range || aspect.is_some_and(|aspect| !(aspect > 0.0 && aspect.is_finite())) {
                return Err(invalid("field of view", "must be between 0 and 180 degrees, of a positive aspect"));
            }
        }
    }
    match camera.extrinsics {
        Some(at) if !(at.rotation.is_finite() && at.translation.is_finite()) => {
            Err(invalid("extrinsics", "must be finite numbers"))
        }
        _ => Ok(()),
    }
}

/// An id that can be part of a path.
fn plain_id(id: &str) -> String {
    let id = id.trim().replace(['/', '\\', ':', '\0'], "_");
    if id.starts_with('.') { format!("_{id}") } else { id }
}
