//! TOML of anipose, and of FreeMoCap and Caliscope, whose cameras have the same fields.
//!
//! anipose's lengths are those of the user's board and its file does not tell them. They are millimetres in most
//! tutorials, and in FreeMoCap; Caliscope's are metres.

use std::path::Path;

use super::field::Field;
use super::found::{CalibrationFormat, FoundCalibration, FoundCamera, LengthUnit};
use super::lens;
use super::node::Node;
use crate::cameras::rigid::Rigid;
use crate::error::CaptureError;

/// A camera of a hand is not so far from the world's origin, in metres or in squares of a board: lengths beyond are
/// millimetres.
const LARGEST_DISTANCE: f64 = 100.0;
/// FreeMoCap asks for the side of a board's squares in millimetres; 1 is its default. Smaller ones than this are not
/// seen.
const LEAST_SQUARE: f64 = 5.0;

/// The tables of a file that are cameras, with their names, if it is one of these.
fn tables<'a>(root: &Field<'a>) -> Vec<(&'a str, Field<'a>)> {
    let is_camera = |field: &Field| ["matrix", "size"].iter().all(|name| field.node.get(name).is_some());
    // Caliscope's today are in `cameras`.
    let of = |field: Field<'a>| field.entries().filter(|(_, field)| is_camera(field)).collect::<Vec<_>>();
    match root.find("cameras").map(of) {
        Some(tables) if !tables.is_empty() => tables,
        _ => of(root.clone()),
    }
}

pub(super) fn recognises(path: &Path, node: &Node) -> bool {
    !tables(&Field::root(path, node)).is_empty()
}

pub(super) fn read(path: &Path, node: &Node) -> Result<FoundCalibration, CaptureError> {
    let root = Field::root(path, node);
    let tables = tables(&root);
    let has = |name: &str| tables.iter().any(|(_, field)| field.node.get(name).is_some());
    let metadata = root.find("metadata");
    let square = metadata.as_ref().and_then(|metadata| metadata.find("charuco_square_size"));
    let format = if has("port") || has("cam_id") {
        CalibrationFormat::Caliscope
    } else if square.is_some() || has("world_position") {
        CalibrationFormat::FreeMoCap
    } else {
        CalibrationFormat::Anipose
    };
    let mut remarks = vec![];
    let mut cameras = vec![];
    for (name, table) in &tables {
        if table.find("ignore").is_some_and(|ignore| ignore.is_true()) {
            remarks.push(format!("{name} is not read, because it is marked to be ignored"));
            continue;
        }
        if let Some(turns) = table.find("rotation_count").map(|turns| turns.number()).transpose()?
            && turns != 0.0
        {
            remarks.push(format!("{name} is shown turned in {format}; images must be as filmed"));
        }
        cameras.push(camera(name, table, format)?);
    }
    let unit = unit(format, square.map(|square| square.number()).transpose()?, &cameras, &mut remarks);
    FoundCalibration::checked(path, format, unit, cameras, remarks)
}

fn camera(name: &str, table: &Field, format: CalibrationFormat) -> Result<FoundCamera, CaptureError> {
    let id = match table.find("name") {
        Some(name) => name.text()?,
        // The name of Caliscope's videos.
        None if name.bytes().all(|byte| byte.is_ascii_digit()) => format!("cam_{name}"),
        None => name.into(),
    };
    let is_fisheye = table.find("fisheye").is_some_and(|fisheye| fisheye.is_true());
    let distortion = match table.find("distortions") {
        _ if is_fisheye => lens::fisheye(&table.require("distortions")?)?,
        Some(coefficients) => lens::distortion(&coefficients)?,
        None => None,
    };
    let extrinsics = match (table.find("rotation"), table.find("translation")) {
        (Some(rotation), Some(translation)) => {
            Some(Rigid { rotation: rotation.rotation()?, translation: translation.vector()? })
        }
        _ => None,
    };
    Ok(FoundCamera {
        id,
        size: Some(table.require("size")?.size()?),
        projection: lens::projection(&table.require("matrix")?, format)?,
        distortion,
        extrinsics,
    })
}

/// The unit, and why.
fn unit(
    format: CalibrationFormat,
    square: Option<f64>,
    cameras: &[FoundCamera],
    remarks: &mut Vec<String>,
) -> LengthUnit {
    let extrinsics = cameras.iter().filter_map(|camera| camera.extrinsics);
    let farthest = extrinsics.map(|at| at.translation.length()).fold(0.0, f64::max);
    match (format, square) {
        (CalibrationFormat::Caliscope, _) => LengthUnit::Metre,
        (CalibrationFormat::FreeMoCap, Some(square)) if square >= LEAST_SQUARE => LengthUnit::Millimetre,
        (CalibrationFormat::FreeMoCap, Some(_)) => {
            remarks.push("the board's squares were not measured in millimetres".into());
            LengthUnit::Unknown
        }
        _ if farthest > LARGEST_DISTANCE => {
            remarks.push(format!("lengths are millimetres: the farthest camera is {farthest:.0} from the origin"));
            LengthUnit::Millimetre
        }
        _ => {
            remarks.push(format!(
                "lengths are in the board's unit, which is not millimetres: the farthest camera is {farthest:.3} from \
                 the origin"
            ));
            LengthUnit::Unknown
        }
    }
}
