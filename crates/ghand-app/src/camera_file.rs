//! Reading one camera from a file: an object as in the `cameras` of a `capture.json`.

use std::path::Path;

use anyhow::{Context, ensure};
use ghand_core::Camera;
use glam::{DMat3, DVec2, DVec3};
use serde::Deserialize;

/// Rotations further than this from orthonormal (largest entry of R R^T - I) are refused: rounding to four digits, the
/// coarsest that exporters write, stays below it.
const ROTATION_TOLERANCE: f64 = 1e-3;
/// Larger images are taken for a mistake.
const LARGEST_IMAGE: u32 = 16_384;

#[derive(Deserialize)]
struct CameraFile {
    #[serde(default)]
    id: String,
    width: u32,
    height: u32,
    intrinsics: [[f64; 3]; 3],
    rotation: [[f64; 3]; 3],
    translation: [f64; 3],
}

/// Reads and checks a camera.
///
/// # Errors
/// One that names the file, the field and what is wrong with it.
pub fn read_camera(path: &Path) -> anyhow::Result<Camera> {
    let name = path.display();
    let text = std::fs::read_to_string(path).with_context(|| format!("{name}: cannot read the camera"))?;
    let file: CameraFile = serde_json::from_str(&text)
        .with_context(|| format!("{name}: not a camera as in the `cameras` of a capture.json"))?;
    camera(&file).with_context(|| name.to_string())
}

fn camera(file: &CameraFile) -> anyhow::Result<Camera> {
    for (field, size) in [("width", file.width), ("height", file.height)] {
        ensure!((1..=LARGEST_IMAGE).contains(&size), "{field}: is {size}; must be 1 to {LARGEST_IMAGE} pixels");
    }
    let [[fx, skew, cx], [k10, fy, cy], last_row] = file.intrinsics;
    ensure!(
        fx > 0.0 && fy > 0.0 && [fx, fy, cx, cy].iter().all(|v| v.is_finite()),
        "intrinsics: focal lengths {fx} and {fy} must be positive, the principal point finite"
    );
    ensure!(
        skew == 0.0 && k10 == 0.0 && last_row == [0.0, 0.0, 1.0],
        "intrinsics: must be [[fx,0,cx],[0,fy,cy],[0,0,1]]"
    );
    // glam takes columns; the file holds rows.
    let rotation = DMat3::from_cols_array_2d(&file.rotation).transpose();
    let error = (rotation * rotation.transpose() - DMat3::IDENTITY).to_cols_array();
    ensure!(
        error.iter().all(|e| e.abs() <= ROTATION_TOLERANCE) && rotation.determinant() > 0.0,
        "rotation: is no rotation; give the rows of camera_from_world without scale or mirror"
    );
    let translation = DVec3::from(file.translation);
    ensure!(translation.is_finite(), "translation: is not finite; give metres");
    Ok(Camera {
        id: file.id.clone(),
        width: file.width,
        height: file.height,
        focal: DVec2::new(fx, fy),
        principal: DVec2::new(cx, cy),
        rotation,
        translation,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(json: &str) -> anyhow::Result<Camera> {
        let folder = tempfile::tempdir()?;
        let path = folder.path().join("camera.json");
        std::fs::write(&path, json)?;
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
            let error = format!("{:#}", read(&GOOD.replace(from, to)).unwrap_err());
            assert!(error.contains(field) && error.contains("camera.json"), "{error}");
        }
    }
}
