//! Cameras as files have them: objects as in the `cameras` of a `capture.json`, one of which may be a file of its own.

use std::path::Path;

use ghand_core::Camera;
use glam::{DMat3, DVec2, DVec3};
use serde::{Deserialize, Serialize};

use crate::capture::CaptureError;

/// Rotations further than this from orthonormal (largest entry of R R^T - I) are refused: rounding to four digits, the
/// coarsest that exporters write, stays below it.
const ROTATION_TOLERANCE: f64 = 1e-3;
/// Larger images are taken for a mistake; 16384 is also the largest texture of common devices.
const LARGEST_IMAGE: u32 = 16384;

#[derive(Serialize, Deserialize)]
pub(crate) struct CameraFile {
    #[serde(default)]
    pub id: String,
    pub width: u32,
    pub height: u32,
    pub intrinsics: [[f64; 3]; 3],
    pub rotation: [[f64; 3]; 3],
    pub translation: [f64; 3],
}

/// A field of a camera that cannot be used, and what is wrong with it.
pub(crate) struct CameraProblem {
    pub field: &'static str,
    pub problem: String,
}

/// Reads and checks a file that holds one camera.
///
/// # Errors
/// [`CaptureError`] names the file, the field and what is wrong with it.
pub fn read_camera(path: &Path) -> Result<Camera, CaptureError> {
    let text = std::fs::read_to_string(path).map_err(|source| CaptureError::Io {
        path: path.into(),
        action: "read the camera",
        source,
        remedy: "give a JSON file with one camera as in the `cameras` of a capture.json",
    })?;
    let file: CameraFile =
        serde_json::from_str(&text).map_err(|source| CaptureError::Json { path: path.into(), source })?;
    file.camera().map_err(|CameraProblem { field, problem }| CaptureError::Invalid {
        path: path.into(),
        field: field.into(),
        problem,
    })
}

impl CameraFile {
    pub(crate) fn camera(&self) -> Result<Camera, CameraProblem> {
        let fail = |field: &'static str, problem: String| Err(CameraProblem { field, problem });
        for (field, size) in [("width", self.width), ("height", self.height)] {
            if !(1..=LARGEST_IMAGE).contains(&size) {
                return fail(field, format!("is {size}; must be 1 to {LARGEST_IMAGE} pixels"));
            }
        }
        let [[fx, skew, cx], [k10, fy, cy], last_row] = self.intrinsics;
        if !(fx > 0.0 && fy > 0.0 && [fx, fy, cx, cy].iter().all(|v| v.is_finite())) {
            let problem = format!("singular: focal lengths {fx} and {fy} must be positive, the principal point finite");
            return fail("intrinsics", problem);
        }
        if skew != 0.0 || k10 != 0.0 || last_row != [0.0, 0.0, 1.0] {
            let problem = "must be [[fx,0,cx],[0,fy,cy],[0,0,1]]; undistort the images to a camera without skew";
            return fail("intrinsics", problem.into());
        }
        // glam takes columns; the file holds rows.
        let rotation = DMat3::from_cols_array_2d(&self.rotation).transpose();
        let translation = DVec3::from(self.translation);
        if !translation.is_finite() {
            return fail("translation", "is not finite; give metres".into());
        }
        Ok(Camera {
            id: self.id.clone(),
            width: self.width,
            height: self.height,
            focal: DVec2::new(fx, fy),
            principal: DVec2::new(cx, cy),
            rotation: nearest_rotation(rotation).map_err(|problem| CameraProblem { field: "rotation", problem })?,
            translation,
        })
    }
}

/// The rotation nearest to a matrix that is one but for rounding.
fn nearest_rotation(matrix: DMat3) -> Result<DMat3, String> {
    let entries = (matrix * matrix.transpose() - DMat3::IDENTITY).to_cols_array();
    let error =
        entries.iter().fold(0.0, |worst: f64, e| if worst > e.abs() || worst.is_nan() { worst } else { e.abs() });
    if !(matrix.is_finite() && error <= ROTATION_TOLERANCE && matrix.determinant() > 0.0) {
        return Err(format!(
            "is no rotation: R R^T differs from 1 by {error:.1e} (at most {ROTATION_TOLERANCE:.0e}), determinant {:.3}; give \
             the rows of camera_from_world without scale or mirror",
            matrix.determinant()
        ));
    }
    // Newton's iteration for the polar factor converges quadratically: 1e-3, 1e-6, 1e-12, rounding.
    let mut rotation = matrix;
    for _ in 0..4 {
        rotation = (rotation + rotation.inverse().transpose()) * 0.5;
    }
    Ok(rotation)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(json: &str) -> Result<Camera, CaptureError> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("camera.json");
        std::fs::write(&path, json).unwrap();
        read_camera(&path)
    }

    const GOOD: &str = r#"{"id":"a","width":64,"height":48,"intrinsics":[[100,0,32],[0,110,24],[0,0,1]],
        "rotation":[[0,1,0],[-1,0,0],[0,0,1]],"translation":[0.1,0.2,0.3]}"#;

    #[test]
    fn a_camera_is_read_with_rows_as_rows() {
        let camera = read(GOOD).unwrap();
        assert_eq!(camera.camera_from_world(DVec3::new(0.0, 1.0, 0.0)), DVec3::new(1.1, 0.2, 0.3));
        assert_eq!((camera.focal, camera.principal), (DVec2::new(100.0, 110.0), DVec2::new(32.0, 24.0)));
    }

    #[test]
    fn wrong_cameras_are_refused_with_the_field() {
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
