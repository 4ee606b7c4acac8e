//! Kalibr's `camchain.yaml`: each camera's place is relative to the one before it. Lengths are metres.

use std::path::Path;

use glam::{DMat3, DVec3};

use super::field::Field;
use super::found::{CalibrationFormat, FoundCalibration, FoundCamera, LengthUnit};
use super::lens;
use super::node::Node;
use crate::cameras::rigid::Rigid;
use crate::error::CaptureError;
use crate::reading::validation::FileValidator;

/// The entries that are cameras, in the order of the chain.
fn cameras<'a>(root: &Field<'a>) -> Vec<(&'a str, Field<'a>)> {
    let is_camera = |field: &Field| ["camera_model", "intrinsics"].iter().all(|name| field.node.get(name).is_some());
    let mut cameras: Vec<_> = root.entries().filter(|(_, field)| is_camera(field)).collect();
    // Names have numbers: cam10 is after cam9.
    cameras.sort_by_key(|(name, _)| (name.len(), *name));
    cameras
}

pub(super) fn recognises(path: &Path, node: &Node) -> bool {
    !cameras(&Field::root(path, node)).is_empty()
}

pub(super) fn read(path: &Path, node: &Node) -> Result<FoundCalibration, CaptureError> {
    let root = Field::root(path, node);
    let mut found = vec![];
    let mut before: Option<Rigid> = None;
    for (number, (name, camera)) in cameras(&root).into_iter().enumerate() {
        let extrinsics = match (number, camera.find("T_cn_cnm1"), before) {
            (0, _, _) => Some(Rigid::IDENTITY),
            (_, Some(transform), Some(before)) => Some(rigid(&transform)?.after(&before)),
            _ => None,
        };
        before = extrinsics;
        found.push(read_camera(name, &camera, extrinsics)?);
    }
    // A single camera stands nowhere in particular.
    if let [only] = found.as_mut_slice() {
        only.extrinsics = None;
    }
    let mut remarks = vec!["the world is that of the first camera of the chain".into()];
    if cameras(&root).iter().any(|(_, camera)| camera.find("T_cam_imu").is_some()) {
        remarks.push("places relative to an IMU, and times, are not read".into());
    }
    FoundCalibration::checked(path, CalibrationFormat::Kalibr, LengthUnit::Metre, found, remarks)
}

fn read_camera(name: &str, camera: &Field, extrinsics: Option<Rigid>) -> Result<FoundCamera, CaptureError> {
    let model = camera.require("camera_model")?;
    if model.text()? != "pinhole" {
        let problem =
            format!("is {:?}, which is not read; calibrate with pinhole-radtan or pinhole-equi", model.text()?);
        return Err(model.invalid(problem));
    }
    let intrinsics = camera.require("intrinsics")?;
    let Ok(numbers) = <[f64; 4]>::try_from(intrinsics.numbers()?.as_slice()) else {
        return Err(intrinsics.invalid("must be 4 numbers: fu, fv, pu, pv"));
    };
    let kind = camera.require("distortion_model")?;
    let coefficients = || camera.require("distortion_coeffs");
    let distortion = match kind.text()?.as_str() {
        "none" => None,
        "radtan" => lens::distortion(&coefficients()?)?,
        "equidistant" => lens::fisheye(&coefficients()?)?,
        other => {
            let problem = format!("is {other:?}, which is not read; calibrate with pinhole-radtan or pinhole-equi");
            return Err(kind.invalid(problem));
        }
    };
    Ok(FoundCamera {
        id: name.into(),
        size: camera.find("resolution").map(|size| size.size()).transpose()?,
        projection: lens::pixels(numbers, CalibrationFormat::Kalibr),
        distortion,
        extrinsics,
    })
}

/// A rigid transform of 4 rows of 4.
fn rigid(field: &Field) -> Result<Rigid, CaptureError> {
    let [a, b, c, x, d, e, f, y, g, h, i, z, 0.0, 0.0, 0.0, 1.0] = field.numbers()?[..] else {
        return Err(field.invalid("must be 4 rows of 4 numbers, the last of them 0, 0, 0, 1"));
    };
    let rotation = DMat3::from_cols_array(&[a, b, c, d, e, f, g, h, i]).transpose();
    let rotation = FileValidator { path: field.path }.rotation(field.name.clone(), rotation)?;
    Ok(Rigid { rotation, translation: DVec3::new(x, y, z) })
}
