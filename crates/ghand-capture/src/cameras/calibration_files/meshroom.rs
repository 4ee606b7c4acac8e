//! Meshroom's `cameras.sfm`: AliceVision's scenes in JSON, whose values are all texts. Their scale is free.
//!
//! Until version 1.2.0 of the file focal lengths are in pixels and principal points from the corner; since then they
//! are in millimetres of the sensor's width, and from the middle.

use std::collections::HashMap;
use std::path::Path;

use glam::DMat3;

use super::super::distortion::Distortion;
use super::field::Field;
use super::found::{CalibrationFormat, FoundCalibration, FoundCamera, LengthUnit, Projection};
use super::lens;
use super::node::Node;
use super::shots::{self, Shot};
use crate::cameras::rigid::Rigid;
use crate::error::CaptureError;
use crate::reading::validation::FileValidator;

/// The width of a sensor that a file does not tell, millimetres.
const USUAL_SENSOR: f64 = 36.0;

/// The version of a file.
type Version = [u32; 3];

pub(super) fn recognises(node: &Node) -> bool {
    ["version", "views", "intrinsics"].iter().all(|name| matches!(node.get(name), Some(Node::List(_))))
}

pub(super) fn read(path: &Path, node: &Node) -> Result<FoundCalibration, CaptureError> {
    let root = Field::root(path, node);
    let version_field = root.require("version")?;
    let version: Vec<u32> = version_field.items()?.iter().map(Field::whole).collect::<Result<_, _>>()?;
    let Ok(version) = Version::try_from(version) else {
        return Err(version_field.invalid("must be 3 numbers"));
    };
    let list = |name: &str| root.find(name).map_or(Ok(vec![]), |list| list.items());
    let by_id = |items: &[Field<'_>], name: &str| -> HashMap<String, usize> {
        let id = |(index, item): (usize, &Field)| Some((item.find(name)?.text().ok()?, index));
        items.iter().enumerate().filter_map(id).collect()
    };
    let lenses = list("intrinsics")?;
    let poses = list("poses")?;
    let lens_of = by_id(&lenses, "intrinsicId");
    let pose_of = by_id(&poses, "poseId");
    let mut shots = vec![];
    let mut missing = 0;
    for view in list("views")? {
        if let Some(rig) = view.find("rigId") {
            return Err(rig.invalid("is a rig of Meshroom, which is not read; reconstruct without rigs"));
        }
        let id = |name: &str| view.require(name)?.text();
        let lens = *lens_of
            .get(&id("intrinsicId")?)
            .ok_or_else(|| view.invalid("has a lens that is missing; give the result of StructureFromMotion"))?;
        let pose = pose_of.get(&id("poseId")?).and_then(|pose| poses.get(*pose));
        match pose {
            Some(pose) => shots.push(Shot { path: id("path")?, lens, place: place(pose)? }),
            None => missing += 1,
        }
    }
    if shots.is_empty() {
        return Err(root.invalid("has no image with a pose; give the cameras.sfm of StructureFromMotion"));
    }
    let mut remarks = vec![];
    if missing > 0 {
        remarks.push(format!("{missing} images were not reconstructed"));
    }
    let mut cameras = vec![];
    for camera in shots::cameras(path, &shots)? {
        let Some(lens) = lenses.get(camera.lens) else { continue };
        cameras.push(FoundCamera {
            id: camera.id,
            size: Some([lens.require("width")?.whole()?, lens.require("height")?.whole()?]),
            projection: projection(lens, version)?,
            distortion: distortion(lens)?,
            extrinsics: Some(camera.place),
        });
    }
    FoundCalibration::checked(path, CalibrationFormat::Meshroom, LengthUnit::Unknown, cameras, remarks)
}

/// `camera_from_world`, by columns, and the centre.
fn place(pose: &Field) -> Result<Rigid, CaptureError> {
    let transform = pose.require("pose")?.require("transform")?;
    let rotation = transform.require("rotation")?;
    let columns: DMat3 = rotation.matrix()?.transpose();
    let turned = FileValidator { path: pose.path }.rotation(rotation.name.clone(), columns)?;
    Ok(Rigid { rotation: turned, translation: -(turned * transform.require("center")?.vector()?) })
}

fn projection(lens: &Field, version: Version) -> Result<Projection, CaptureError> {
    let number = |name: &str| lens.require(name)?.number();
    let optional = |name: &str, default: f64| lens.find(name).map_or(Ok(default), |field| field.number());
    let middle = [number("width")? / 2.0, number("height")? / 2.0];
    let point = lens.require("principalPoint")?;
    let [x, y] = point.numbers()?[..] else { return Err(point.invalid("must be 2 numbers")) };
    let [cx, cy] = if version < [1, 2, 1] { [x, y] } else { [x + middle[0], y + middle[1]] };
    let (fx, fy) = if version < [1, 2, 2] {
        let focal = lens.require("pxFocalLength")?;
        match focal.numbers()?[..] {
            [f] => (f, f),
            [fx, fy] => (fx, fy),
            _ => return Err(focal.invalid("must be 1 or 2 numbers")),
        }
    } else {
        let pixels_per_mm = number("width")? / optional("sensorWidth", USUAL_SENSOR)?;
        let focal = number("focalLength")? * pixels_per_mm;
        let ratio = optional("pixelRatio", 1.0)?;
        match version {
            _ if ratio == 1.0 => (focal, focal),
            // The ratio of fx and fy was stored the other way round first.
            _ if version < [1, 2, 5] => (focal, focal / ratio),
            _ if version < [1, 2, 9] => (focal, focal * ratio),
            // In between, what the focal length of such a lens is was changed.
            _ if version < [1, 2, 11] => {
                let problem = "has pixels that are not square in a version of Meshroom that is not read; open and save \
                               the scene with a newer one";
                return Err(lens.invalid(problem));
            }
            _ => (focal / ratio, focal),
        }
    };
    Ok(lens::pixels([fx, fy, cx, cy], CalibrationFormat::Meshroom))
}

fn distortion(lens: &Field) -> Result<Option<Distortion>, CaptureError> {
    let text = |name: &str| lens.find(name).map(|field| field.text()).transpose();
    let invalid = |kind: &str| {
        let kind: String = kind.chars().take(40).collect();
        lens.invalid(format!(
            "has the lens model {kind:?}, which is not read; calibrate with brown, radial or fisheye4"
        ))
    };
    let kind = text("type")?.unwrap_or_default().to_ascii_lowercase();
    // Until version 1.2.6 the type is that of the distortion, too.
    let model = match text("distortionType")? {
        Some(model) if kind == "pinhole" => model.to_ascii_lowercase(),
        Some(_) => return Err(invalid(&kind)),
        None => kind,
    };
    if let Some(other) = text("undistortionType")?.filter(|kind| kind != "none") {
        return Err(invalid(&other));
    }
    let numbers = match lens.find("distortionParams") {
        Some(numbers) if *numbers.node != Node::Text(String::new()) => numbers.numbers()?,
        _ => vec![],
    };
    let coefficients = match (model.as_str(), &numbers[..]) {
        ("pinhole" | "none", _) => return Ok(None),
        ("fisheye" | "fisheye4", &[k1, k2, k3, k4]) => return Ok(Some(Distortion::Fisheye([k1, k2, k3, k4]))),
        ("radial1" | "radial3" | "radialk1" | "radialk3" | "brown", []) => return Ok(None),
        ("radial1" | "radialk1", &[k1]) => [k1, 0.0, 0.0, 0.0, 0.0],
        ("radial3" | "radialk3", &[k1, k2, k3]) => [k1, k2, 0.0, 0.0, k3],
        ("brown", &[k1, k2, k3, t1, t2]) => [k1, k2, t1, t2, k3],
        (other, _) => return Err(invalid(other)),
    };
    if coefficients.iter().all(|coefficient| *coefficient == 0.0) {
        return Ok(None);
    }
    Distortion::from_opencv(&coefficients).map(Some).map_err(|problem| lens.invalid(problem))
}
