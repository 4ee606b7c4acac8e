//! Cameras in files: objects as in the `cameras` of a `capture.json`; a file may also consist of one such object.
//! [`super::named`] reads either.

use ghand_core::Camera;
use glam::{DMat3, DVec2, DVec3};
use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize};
use serde_json::Value;

use super::distortion::Distortion;
use crate::capture::CaptureError;
use crate::reading::validation::{CameraEntry, FileValidator, Position, member};

/// Distortion that leaves less than this fraction of the undistorted image with a source is probably a mistake: strong
/// lenses that the model describes have more than 0.7.
pub(super) const LEAST_SEEN: f64 = 0.5;

#[derive(Serialize, Deserialize)]
pub(crate) struct CameraFile {
    #[serde(default)]
    pub id: String,
    pub width: u32,
    pub height: u32,
    pub intrinsics: [[f64; 3]; 3],
    #[serde(deserialize_with = "rotation")]
    pub rotation: [[f64; 3]; 3],
    pub translation: [f64; 3],
    /// Lens distortion, OpenCV's k1, k2, p1, p2, k3 and so on; `None` if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub distortion: Option<Vec<f64>>,
    /// OpenCV's coefficients of a fisheye lens, k1 to k4; `None` if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fisheye: Option<Vec<f64>>,
}

/// The rows of a rotation matrix; another form of a rotation is named.
fn rotation<'de, D: Deserializer<'de>>(deserializer: D) -> Result<[[f64; 3]; 3], D::Error> {
    let value = Value::deserialize(deserializer)?;
    if let Ok(rows) = serde_json::from_value(value.clone()) {
        return Ok(rows);
    }
    let lengths: Vec<Option<usize>> =
        value.as_array().into_iter().flatten().map(|row| row.as_array().map(Vec::len)).collect();
    let is_quaternion = ["w", "x", "y", "z"].iter().all(|name| value.get(name).is_some_and(Value::is_number));
    let problem = match lengths[..] {
        [None, None, None] | [Some(1), Some(1), Some(1)] | [Some(3)] => {
            "is 3 numbers: a Rodrigues vector (give cv2.Rodrigues(v)[0]) or Euler angles; give the matrix"
        }
        [None, None, None, None] | [Some(4)] => {
            "is 4 numbers: a quaternion; give the matrix (scipy's Rotation.from_quat([x, y, z, w]).as_matrix())"
        }
        _ if is_quaternion => "is a quaternion; give the matrix (scipy's Rotation.from_quat([x, y, z, w]).as_matrix())",
        [Some(4), Some(4), Some(4), Some(4)] | [Some(4), Some(4), Some(4)] => {
            "is a transform of rows of 4; give its first 3 rows and columns here and the last column in `translation`"
        }
        _ if lengths.len() == 9 => "is 9 numbers in one list; give 3 rows of 3",
        _ => "must be 3 rows of 3 numbers: camera_from_world",
    };
    Err(D::Error::custom(problem))
}

/// What is added to the principal points of a file whose top left pixel has its centre at `pixel_center`, 0.5 if absent.
pub(crate) fn principal_shift(validator: FileValidator, pixel_center: Option<f64>) -> Result<f64, CaptureError> {
    match pixel_center {
        None | Some(0.5) => Ok(0.0),
        Some(0.0) => Ok(0.5),
        Some(other) => {
            let problem = format!("is {other}; must be 0.5, or 0 as calibrated by OpenCV, Kalibr and ROS");
            Err(validator.invalid("pixel_center", problem))
        }
    }
}

impl CameraFile {
    /// As it is written.
    pub(crate) fn of(camera: &Camera, distortion: Option<Distortion>) -> CameraFile {
        CameraFile {
            id: camera.id.clone(),
            width: camera.width,
            height: camera.height,
            intrinsics: [
                [camera.focal.x, 0.0, camera.principal.x],
                [0.0, camera.focal.y, camera.principal.y],
                [0.0, 0.0, 1.0],
            ],
            // glam stores columns; the file holds rows.
            rotation: camera.rotation.transpose().to_cols_array_2d(),
            translation: camera.translation.to_array(),
            distortion: distortion.and_then(Distortion::to_opencv),
            fisheye: distortion.and_then(|distortion| match distortion {
                Distortion::Fisheye(coefficients) => Some(coefficients.to_vec()),
                Distortion::Pinhole { .. } => None,
            }),
        }
    }

    /// The camera, checked. `field` is its field in the file, empty if the file contains nothing else.
    pub(crate) fn camera(&self, validator: FileValidator, field: String) -> Result<Camera, CaptureError> {
        let [[fx, skew, cx], [k10, fy, cy], last_row] = self.intrinsics;
        if skew != 0.0 || k10 != 0.0 || last_row != [0.0, 0.0, 1.0] {
            let problem = "must be [[fx,0,cx],[0,fy,cy],[0,0,1]]; undistort the images to a camera without skew";
            return Err(validator.invalid(member(&field, "intrinsics"), problem));
        }
        validator.camera(&CameraEntry {
            id: &self.id,
            field,
            size: [self.width, self.height],
            focal: DVec2::new(fx, fy),
            principal: DVec2::new(cx, cy),
            // glam takes columns; the file holds rows.
            rotation: DMat3::from_cols_array_2d(&self.rotation).transpose(),
            position: Position::Translation(DVec3::from(self.translation)),
        })
    }

    /// The name of the field that describes the lens.
    fn lens_field(&self) -> &'static str {
        if self.fisheye.is_some() { "fisheye" } else { "distortion" }
    }

    /// The distortion of the camera's lens, checked; `None` if all coefficients are 0. `field` is as in
    /// [`Self::camera`].
    pub(crate) fn distortion(
        &self,
        validator: FileValidator,
        field: &str,
        camera: &Camera,
    ) -> Result<Option<Distortion>, CaptureError> {
        let invalid = |problem: String| Err(validator.invalid(member(field, self.lens_field()), problem));
        let distortion = match (self.distortion.as_deref(), self.fisheye.as_deref()) {
            (None, None) => return Ok(None),
            (Some(_), Some(_)) => return invalid("is given beside `distortion`; a lens has one of them".into()),
            // Without coefficients a fisheye lens is still one.
            (None, Some(coefficients)) => match <[f64; 4]>::try_from(coefficients) {
                Ok(coefficients) => Distortion::Fisheye(coefficients),
                Err(_) => return invalid(format!("has {} numbers; give OpenCV's four, k1 to k4", coefficients.len())),
            },
            (Some(coefficients), None) if coefficients.iter().all(|c| *c == 0.0) => return Ok(None),
            (Some(coefficients), None) => match Distortion::from_opencv(coefficients) {
                Ok(distortion) => distortion,
                Err(problem) => return invalid(problem),
            },
        };
        let seen = distortion.visible_part(camera);
        if seen < LEAST_SEEN {
            return invalid(format!(
                "leaves {:.0}% of the undistorted image without a source; give OpenCV's coefficients in its order, \
                 as calibrated with these intrinsics, or undistort the images and omit it",
                100.0 * (1.0 - seen)
            ));
        }
        Ok(Some(distortion))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cameras::named::read_named_camera;

    fn read(json: &str) -> Result<Camera, CaptureError> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("camera.json");
        std::fs::write(&path, json).unwrap();
        read_named_camera(&path)
    }

    const GOOD: &str = r#"{"id":"a","width":64,"height":48,"intrinsics":[[100,0,32],[0,110,24],[0,0,1]],
        "rotation":[[0,1,0],[-1,0,0],[0,0,1]],"translation":[0.1,0.2,0.3]}"#;

    #[test]
    fn other_forms_of_a_rotation_are_named() {
        for (form, says) in [
            ("[0.1,0.2,0.3]", "Rodrigues"),
            ("[[0.1],[0.2],[0.3]]", "Rodrigues"),
            ("[[0.1,0.2,0.3]]", "Rodrigues"),
            ("[0,0,0,1]", "quaternion"),
            (r#"{"w":1,"x":0,"y":0,"z":0}"#, "quaternion"),
            ("[0,1,0,-1,0,0,0,0,1]", "9 numbers"),
            ("[[0,1,0,5],[-1,0,0,6],[0,0,1,7],[0,0,0,1]]", "rows of 4"),
            ("[[0,1,0,5],[-1,0,0,6],[0,0,1,7]]", "rows of 4"),
            (r#""identity""#, "3 rows of 3"),
        ] {
            let file = GOOD.replace("[[0,1,0],[-1,0,0],[0,0,1]]", form);
            let error = read(&file).unwrap_err().to_string();
            assert!(error.contains("rotation") && error.contains(says), "{form}: {error}");
        }
        let long = GOOD.replace("[0.1,0.2,0.3]", "[0.1,0.2,0.3,1]");
        assert!(read(&long).unwrap_err().to_string().contains("too many values"));
    }

    #[test]
    fn a_camera_is_read_with_rows_as_rows() {
        let camera = read(GOOD).unwrap();
        assert_eq!(camera.camera_from_world(DVec3::new(0.0, 1.0, 0.0)), DVec3::new(1.1, 0.2, 0.3));
        assert_eq!((camera.focal, camera.principal), (DVec2::new(100.0, 110.0), DVec2::new(32.0, 24.0)));
    }

    #[test]
    fn wrong_cameras_are_rejected_with_the_field() {
        for (from, to, field) in [
            ("\"width\":64", "\"width\":0", "width"),
            ("[[100,0", "[[-100,0", "intrinsics"),
            ("[[100,0", "[[100,1", "intrinsics"),
            ("[[0,1,0]", "[[0,2,0]", "rotation"),
            ("[[0,1,0]", "[[0,-1,0]", "rotation"),
            ("\"height\":48,", "", "height"),
        ] {
            assert!(GOOD.contains(from));
            let error = read(&GOOD.replace(from, to)).unwrap_err().to_string();
            assert!(error.contains(field) && error.contains("camera.json"), "{error}");
        }
    }
}
