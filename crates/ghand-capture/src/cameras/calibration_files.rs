//! Calibrations of cameras that other tools write, recognised from their contents.
//!
//! [`read_calibration`] reads one from a file or a folder. What such files leave open stays open in the result: images'
//! sizes, the unit of lengths, where cameras stand. [`FoundCalibration::lens_cameras`] makes cameras if nothing is.

mod anipose;
mod colmap;
mod dat_files;
mod easymocap;
mod field;
mod found;
mod gltf;
mod kalibr;
mod lens;
mod meshroom;
mod node;
mod opencv;
mod recognise;
mod rotations;
mod shots;
mod xml;
mod yaml;

use std::path::Path;

use crate::error::CaptureError;
use crate::ghand_format::CAPTURE_FILE;

pub use found::{CalibrationFormat, FoundCalibration, FoundCamera, LengthUnit, Projection};

/// Reads the cameras of a calibration: a file, or a folder as a tool leaves it. Contents decide, not names, but COLMAP's
/// files and a folder's calibrations are found by their usual names and endings.
///
/// | tool | file or folder |
/// |---|---|
/// | OpenCV | `FileStorage` in YAML, XML or JSON, one file per camera; the pair that `stereo_calib` writes |
/// | ROS | `camera_info` YAML |
/// | handpose3d | folder of `c0.dat`, `rot_trans_c0.dat` and so on |
/// | COLMAP | folder of `cameras`, `images` and perhaps `rigs`, `.txt` or `.bin`; also with it in `sparse/0` |
/// | anipose, FreeMoCap, Caliscope | TOML |
/// | Kalibr | `camchain.yaml` |
/// | EasyMocap | folder of `intri.yml` and `extri.yml` |
/// | Meshroom | `cameras.sfm`, or JSON |
/// | Blender | `.glb` or `.gltf` with cameras |
/// | ghand | `capture.json`, or a file with `cameras` as in one |
///
/// # Errors
/// [`CaptureError`] names the file, the field and its problem. Lenses that ghand cannot model, and cameras that move,
/// are errors.
pub fn read_calibration(path: &Path) -> Result<FoundCalibration, CaptureError> {
    let own = path.join(CAPTURE_FILE);
    if path.is_dir() && own.exists() {
        return recognise::file(&own);
    }
    if path.is_dir() { recognise::folder(path) } else { recognise::file(path) }
}
