//! All cameras of a capture or of a file of cameras, with the distortion of their lenses. Training writes such a file for
//! the cameras that it refined.

use std::collections::BTreeMap;
use std::path::Path;

use ghand_core::Camera;
use ghand_files::input_file;
use glam::DVec2;
use serde::de::IgnoredAny;
use serde::{Deserialize, Serialize};

use super::calibration_files::read_calibration;
use super::distortion::Distortion;
use super::file::{CameraFile, principal_shift};
use crate::capture::{Capture, CaptureError};
use crate::ghand_format::CAPTURE_FILE;
use crate::ghand_format::fields::read_cameras_fields;
use crate::images::color_correction::ColorMap;
use crate::reading::json_file::{LARGEST_FILE, write_json};
use crate::reading::text_file::read_text;
use crate::reading::validation::FileValidator;

/// A camera with a lens.
#[derive(Debug, Clone, PartialEq)]
pub struct LensCamera {
    /// The camera, as if its lens did not distort.
    pub camera: Camera,
    /// What the lens does, if anything.
    pub distortion: Option<Distortion>,
}

impl LensCamera {
    /// Where a pixel of the image as filmed is in the image without distortion, pixels; `None` if the lens cannot have
    /// seen anything there.
    pub fn undistorted(&self, pixel: DVec2) -> Option<DVec2> {
        let Some(distortion) = self.distortion else { return Some(pixel) };
        let ray = distortion.undistorted_ray((pixel - self.camera.principal) / self.camera.focal)?;
        Some(ray * self.camera.focal + self.camera.principal)
    }
}

/// Refined cameras that differ by more are not those of the capture: radians, and parts of the distance from the world's
/// origin and of the focal length.
const LARGEST_TURN: f64 = 5.0_f64.to_radians();
const LARGEST_PART: f64 = 0.1;

/// The field of a file of cameras that a `capture.json` lacks.
const COLORS: &str = "colors";

#[derive(Serialize, Deserialize)]
struct CameraList {
    /// As in a `capture.json`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pixel_center: Option<f64>,
    cameras: Vec<CameraFile>,
    /// What makes the colours of a camera's images those of all, by its id.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    colors: BTreeMap<String, ColorMap>,
}

/// Reads the cameras of a `capture.json`, of the folder that holds it, of any JSON file with such `cameras`, or of a
/// calibration that another tool wrote ([`read_calibration`]), if it has sizes, places and the unit of lengths.
///
/// # Errors
/// [`CaptureError`] names the file, the field and its problem, or what a calibration lacks.
pub fn read_cameras(path: &Path) -> Result<Vec<LensCamera>, CaptureError> {
    if is_of_another_tool(path) { read_calibration(path)?.lens_cameras() } else { read_own_cameras(path) }
}

/// Reads cameras in ghand's own format.
pub(crate) fn read_own_cameras(path: &Path) -> Result<Vec<LensCamera>, CaptureError> {
    Ok(read(path)?.0)
}

/// Whether a file or folder exists that is not ghand's own.
fn is_of_another_tool(path: &Path) -> bool {
    #[derive(Deserialize)]
    struct Kind {
        cameras: Option<IgnoredAny>,
        /// glTF has cameras, too.
        asset: Option<IgnoredAny>,
    }
    if path.is_dir() {
        return !path.join(CAPTURE_FILE).exists();
    }
    let Ok(Some(bytes)) = input_file::read(path, LARGEST_FILE) else { return false };
    match serde_json::from_slice::<Kind>(&bytes) {
        Ok(kind) => kind.cameras.is_none() || kind.asset.is_some(),
        // Broken JSON is probably ghand's.
        Err(_) => bytes.trim_ascii_start().first() != Some(&b'{'),
    }
}

/// The cameras of a file, and the corrections of their colours.
fn read(path: &Path) -> Result<(Vec<LensCamera>, BTreeMap<String, ColorMap>), CaptureError> {
    let path = if path.is_dir() { path.join(CAPTURE_FILE) } else { path.to_path_buf() };
    let remedy = "give a capture.json, or a JSON file with `cameras` as in one";
    let text = read_text(&path, LARGEST_FILE, "read the cameras", remedy)?;
    let validator = FileValidator { path: &path };
    let CameraList { pixel_center, cameras: files, colors } = read_cameras_fields::<CameraList>(&path, &text, COLORS)?;
    validator.index("cameras", files.iter().map(|file| file.id.as_str()))?;
    let shift = principal_shift(validator, pixel_center)?;
    let camera = |file: &CameraFile| {
        let field = format!("cameras[{:?}]", file.id);
        let camera = file.camera(validator, field.clone())?;
        let camera = Camera { principal: camera.principal + shift, ..camera };
        let distortion = file.distortion(validator, &field, &camera)?;
        Ok(LensCamera { camera, distortion })
    };
    let cameras: Vec<LensCamera> = files.iter().map(camera).collect::<Result<_, _>>()?;
    if let Some((id, _)) = colors.iter().find(|(_, map)| map.iter().flatten().any(|value| !value.is_finite())) {
        return Err(validator.invalid(format!("colors[{id:?}]"), "must be three rows of four finite numbers"));
    }
    Ok((cameras, colors))
}

/// Writes cameras with their lenses to a file that [`read_cameras`] reads.
///
/// # Errors
/// [`CaptureError::Io`] if it cannot be written; an earlier file is then unchanged.
pub fn write_cameras(path: &Path, cameras: &[LensCamera]) -> Result<(), CaptureError> {
    let cameras = cameras.iter().map(|lens| CameraFile::of(&lens.camera, lens.distortion)).collect();
    write_json(path, &CameraList { pixel_center: None, cameras, colors: BTreeMap::new() })
}

impl Capture {
    /// Writes the capture's cameras, and the corrections of their colours, to a file that [`read_cameras`] reads.
    ///
    /// # Errors
    /// [`CaptureError::Io`] if it cannot be written; an earlier file is then unchanged.
    pub fn save_cameras(&self, path: &Path) -> Result<(), CaptureError> {
        let distortion = |k: usize| self.distortion.get(k).copied().flatten();
        let cameras = self.cameras.iter().enumerate().map(|(k, camera)| CameraFile::of(camera, distortion(k)));
        let corrections = self.color_correction.cameras.iter();
        let colors = corrections.filter_map(|(k, map)| Some((self.cameras.get(*k)?.id.clone(), *map)));
        write_json(path, &CameraList { pixel_center: None, cameras: cameras.collect(), colors: colors.collect() })
    }

    /// Takes the cameras, and the corrections of their colours, of a file that [`Capture::save_cameras`] wrote for this capture.
    ///
    /// # Errors
    /// [`CaptureError`] names the file and its problem; also if its cameras are not the capture's, by ids, sizes, or because
    /// they are farther from the given ones than a calibration may be wrong.
    pub fn take_cameras(&mut self, path: &Path) -> Result<(), CaptureError> {
        let (refined, colors) = read(path)?;
        let images = |camera: &Camera| (camera.id.clone(), camera.width, camera.height);
        if !refined.iter().map(|lens| images(&lens.camera)).eq(self.cameras.iter().map(images)) {
            let problem = "are not those of the capture, with the same ids and sizes; remove the file, or give the capture \
                           that it was made for";
            return Err(FileValidator { path }.invalid("cameras", problem));
        }
        if let Some((lens, _)) = refined.iter().zip(&self.cameras).find(|(lens, given)| !is_near(&lens.camera, given)) {
            let problem = format!(
                "are of another capture: {:?} looks from elsewhere; remove the file, or give the capture that it was made for",
                lens.camera.id
            );
            return Err(FileValidator { path }.invalid("cameras", problem));
        }
        self.cameras = refined.into_iter().map(|lens| lens.camera).collect();
        let index = |id: &String| self.cameras.iter().position(|camera| camera.id == *id);
        self.color_correction.cameras = colors.iter().filter_map(|(id, map)| Some((index(id)?, *map))).collect();
        Ok(())
    }
}

/// Whether a camera may be another one refined: alignment expects errors of half a degree and 1 %.
fn is_near(refined: &Camera, given: &Camera) -> bool {
    let turn = refined.rotation * given.rotation.transpose();
    let cosine = 0.5 * (turn.x_axis.x + turn.y_axis.y + turn.z_axis.z - 1.0);
    let moved = refined.translation.distance(given.translation);
    let zoom = (refined.focal / given.focal).max_element().max((given.focal / refined.focal).max_element());
    cosine >= LARGEST_TURN.cos()
        && moved <= LARGEST_PART * given.translation.length().max(0.1)
        && zoom <= 1.0 + LARGEST_PART
}

#[cfg(test)]
mod tests {
    use super::*;

    const CAMERA: &str = r#"{"id":"a","width":64,"height":48,"intrinsics":[[100,0,32],[0,110,24],[0,0,1]],
        "rotation":[[1,0,0],[0,1,0],[0,0,1]],"translation":[0,0,1],"distortion":[-0.2,0.05,0.004,-0.006,-0.01]}"#;

    fn read(json: &str) -> Result<Vec<LensCamera>, String> {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join(CAPTURE_FILE), json).unwrap();
        let [file, folder] = [folder.path().join(CAPTURE_FILE), folder.path().to_path_buf()].map(|p| read_cameras(&p));
        assert_eq!(file.as_ref().ok(), folder.as_ref().ok());
        file.map_err(|error| error.to_string())
    }

    #[test]
    fn cameras_are_read_with_their_lenses_and_faults_are_named() {
        let plain = CAMERA.replace(",\"distortion\":[-0.2,0.05,0.004,-0.006,-0.01]", "").replace("\"a\"", "\"b\"");
        let found = read(&format!("{{\"cameras\":[{CAMERA},{plain}]}}")).unwrap();
        assert_eq!((found[0].camera.id.as_str(), found[1].camera.id.as_str()), ("a", "b"));
        assert!(found[0].distortion.is_some() && found[1].distortion.is_none());
        let error = read(&format!("{{\"cameras\":[{CAMERA},{CAMERA}]}}")).unwrap_err();
        assert!(error.contains("cameras") && error.contains("\"a\""), "{error}");
        let error = read(&format!("{{\"cameras\":[{}]}}", CAMERA.replace("[100,", "[-100,"))).unwrap_err();
        assert!(error.contains("cameras[\"a\"].intrinsics"), "{error}");
        assert!(read("{}").is_err());
    }

    #[test]
    fn cameras_are_read_as_they_were_written() {
        let written = read(&format!("{{\"cameras\":[{CAMERA}]}}")).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("cameras.json");
        write_cameras(&path, &written).unwrap();
        assert_eq!(read_cameras(&path).unwrap(), written);
    }

    #[test]
    fn undistorted_pixels_are_those_that_the_lens_moves_to_where_they_were_seen() {
        let lens = read(&format!("{{\"cameras\":[{CAMERA}]}}")).unwrap().remove(0);
        let camera = &lens.camera;
        let distortion = lens.distortion.unwrap();
        for pixel in [DVec2::new(32.0, 24.0), DVec2::new(3.0, 40.0), DVec2::new(63.0, 1.0)] {
            let ray = (lens.undistorted(pixel).unwrap() - camera.principal) / camera.focal;
            let seen = distortion.distorted(ray) * camera.focal + camera.principal;
            assert!(seen.distance(pixel) < 1e-6, "{pixel} {seen}");
        }
        // Away from the middle it matters.
        assert!(lens.undistorted(DVec2::new(63.0, 1.0)).unwrap().distance(DVec2::new(63.0, 1.0)) > 0.2);
        // r (1 - 0.9 r^2) never exceeds 0.406: nothing is seen there.
        let barrel = LensCamera { distortion: Distortion::from_opencv(&[-0.9, 0.0, 0.0, 0.0, 0.0]).ok(), ..lens };
        assert!(barrel.undistorted(DVec2::new(32.0 + 60.0, 24.0)).is_none());
    }
}
