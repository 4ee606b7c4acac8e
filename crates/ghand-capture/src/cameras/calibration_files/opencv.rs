//! Files of OpenCV's `FileStorage`, with the names that its samples and users give camera matrices, distortions and
//! places, and ROS's `camera_info`, which has the same.
//!
//! A file is of one camera, or of a pair, whose R and T lead from the first to the second. Lengths are in squares of a
//! board or in the unit that the user gave for these.

mod names;

use std::path::{Path, PathBuf};

use self::names::{Part, Quantity};
use super::super::distortion::Distortion;
use super::field::Field;
use super::found::{CalibrationFormat, FoundCalibration, FoundCamera, LengthUnit, Projection};
use super::lens;
use super::node::Node;
use crate::cameras::rigid::Rigid;
use crate::error::CaptureError;
use crate::reading::validation::FileValidator;

/// What one file, or one group in it, says of a camera or a pair.
pub(super) struct Content {
    path: PathBuf,
    /// The file's or group's name, without words such as `intrinsics`.
    key: String,
    /// The camera's own name.
    name: Option<String>,
    is_ros: bool,
    size: Option<[u32; 2]>,
    lenses: Vec<(String, Projection, Option<Distortion>)>,
    places: Vec<(String, Rigid)>,
    remarks: Vec<String>,
}

/// Whether a file has a camera matrix or a place under a known name.
pub(super) fn recognises(node: &Node) -> bool {
    groups(node).iter().any(|(_, group)| has_content(group))
}

fn has(group: &Node, quantity: Quantity) -> bool {
    names::parts(group).iter().any(|part| part.quantity == quantity && is_array(part.node))
}

fn has_content(group: &Node) -> bool {
    has(group, Quantity::Matrix) || (has(group, Quantity::Rotation) && has(group, Quantity::Translation))
}

fn is_array(node: &Node) -> bool {
    matches!(node, Node::List(_)) || node.get("data").is_some()
}

/// The file itself, or groups in it, one per camera.
fn groups(node: &Node) -> Vec<(Option<&str>, &Node)> {
    if has_content(node) {
        return vec![(None, node)];
    }
    node.entries()
        .iter()
        .filter(|(_, node)| has_content(node))
        .map(|(name, node)| (Some(name.as_str()), node))
        .collect()
}

/// What a file says.
pub(super) fn contents(path: &Path, node: &Node) -> Result<Vec<Content>, CaptureError> {
    let root = Field::root(path, node);
    let stem = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    groups(node)
        .into_iter()
        .map(|(group, node)| match group {
            Some(name) => content(&Field { name: name.into(), node, ..root.clone() }, name),
            None => content(&root, &names::key(&stem)),
        })
        .collect()
}

fn content(group: &Field, key: &str) -> Result<Content, CaptureError> {
    let parts = names::parts(group.node);
    let field = |part: &Part| group.require(part.name);
    let find = |quantity, suffix: &str| parts.iter().find(|part| part.quantity == quantity && part.suffix == suffix);
    let first = |quantity| parts.iter().find(|part| part.quantity == quantity);
    let is_fisheye = is_fisheye(group, first(Quantity::LensModel), first(Quantity::Fisheye))?;
    let mut lenses = vec![];
    for matrix in parts.iter().filter(|part| part.quantity == Quantity::Matrix && is_array(part.node)) {
        let distortion = match find(Quantity::Distortion, &matrix.suffix).map(field).transpose()? {
            Some(coefficients) if is_fisheye => lens::fisheye(&coefficients)?,
            Some(coefficients) => lens::distortion(&coefficients)?,
            None => None,
        };
        lenses.push((matrix.suffix.clone(), lens::projection(&field(matrix)?, CalibrationFormat::OpenCv)?, distortion));
    }
    let mut places = vec![];
    let mut has_rectification = false;
    for rotation in parts.iter().filter(|part| part.quantity == Quantity::Rotation && is_array(part.node)) {
        match find(Quantity::Translation, &rotation.suffix) {
            Some(translation) => {
                let place =
                    Rigid { rotation: field(rotation)?.rotation()?, translation: field(translation)?.vector()? };
                places.push((rotation.suffix.clone(), place));
            }
            // R1 and R2 beside P1 and P2.
            None => has_rectification = true,
        }
    }
    let is_ros = first(Quantity::Rectification).is_some() && first(Quantity::LensModel).is_some();
    let mut remarks = vec![];
    if has_rectification || first(Quantity::Rectification).is_some() {
        remarks.push("rectification is not read: images must be as filmed".into());
    }
    if first(Quantity::BoardPoses).is_some() {
        remarks.push("places of the board in the calibration's images are not places of cameras, and not read".into());
    }
    let whole = |quantity| first(quantity).map(field).transpose()?.map(|field| field.whole()).transpose();
    let size = match (first(Quantity::Size), whole(Quantity::Width)?, whole(Quantity::Height)?) {
        (_, Some(width), Some(height)) => Some([width, height]),
        (Some(size), ..) => Some(field(size)?.size()?),
        _ => None,
    };
    Ok(Content {
        path: group.path.into(),
        key: key.into(),
        name: first(Quantity::Name).map(field).transpose()?.map(|name| name.text()).transpose()?,
        is_ros,
        size,
        lenses,
        places,
        remarks,
    })
}

/// Whether the lens is a fisheye, by OpenCV's flag or ROS's name of the model.
fn is_fisheye(group: &Field, model: Option<&Part>, flag: Option<&Part>) -> Result<bool, CaptureError> {
    if let Some(model) = model.map(|part| group.require(part.name)).transpose()? {
        return match model.text()?.to_ascii_lowercase().as_str() {
            "plumb_bob" | "rational_polynomial" | "radtan" | "pinhole" | "brown" | "opencv" | "none" | "" => Ok(false),
            "equidistant" | "fisheye" | "kannala_brandt4" | "kannala_brandt" => Ok(true),
            other => {
                let other: String = other.chars().take(40).collect();
                Err(model.invalid(format!(
                    "is {other:?}, which is not read; calibrate with plumb_bob, rational_polynomial or equidistant"
                )))
            }
        };
    }
    Ok(flag.map(|part| group.require(part.name)).transpose()?.is_some_and(|flag| flag.is_true()))
}

/// The calibration of some files' contents; `path` is the file or folder that they are from.
pub(super) fn read(path: &Path, contents: Vec<Content>) -> Result<FoundCalibration, CaptureError> {
    let format =
        if contents.iter().any(|content| content.is_ros) { CalibrationFormat::Ros } else { CalibrationFormat::OpenCv };
    let mut remarks: Vec<String> = vec![];
    for remark in contents.iter().flat_map(|content| &content.remarks) {
        if !remarks.contains(remark) {
            remarks.push(remark.clone());
        }
    }
    let contents = merged(contents)?;
    let mut names: Vec<&String> = contents.iter().filter_map(|content| content.name.as_ref()).collect();
    names.sort_unstable();
    names.dedup();
    let has_names = names.len() == contents.len();
    let is_only = contents.len() == 1;
    let mut cameras = vec![];
    for content in &contents {
        let own = content.name.as_ref().filter(|_| has_names).unwrap_or(&content.key);
        let place = |suffix: &str| content.places.iter().find(|(known, _)| known == suffix).map(|(_, place)| *place);
        let is_pair = content.lenses.len() == 2 && content.lenses.iter().all(|(suffix, ..)| place(suffix).is_none());
        for (number, (suffix, projection, distortion)) in content.lenses.iter().enumerate() {
            let extrinsics = match (content.lenses.len(), number, place("")) {
                (1, _, between) => place(suffix).or(between),
                (_, 0, Some(_)) if is_pair => Some(Rigid::IDENTITY),
                (_, _, between) if is_pair => between,
                _ => place(suffix),
            };
            let side = match suffix.bytes().all(|byte| byte.is_ascii_digit()) {
                true => format!("camera{suffix}"),
                false => suffix.clone(),
            };
            let id = match (content.lenses.len(), is_only) {
                (1, _) => own.clone(),
                (_, true) => side,
                (_, false) => format!("{own}_{side}"),
            };
            cameras.push(FoundCamera {
                id,
                size: content.size,
                projection: *projection,
                distortion: *distortion,
                extrinsics,
            });
        }
        if is_pair && place("").is_some() {
            remarks.push("the world is that of the pair's first camera".into());
        }
    }
    FoundCalibration::checked(path, format, LengthUnit::Unknown, cameras, remarks)
}

/// Contents with lenses; places from files of their own are added to them.
fn merged(contents: Vec<Content>) -> Result<Vec<Content>, CaptureError> {
    let (mut lenses, places): (Vec<Content>, Vec<Content>) =
        contents.into_iter().partition(|content| !content.lenses.is_empty());
    for place in places {
        let same_name = lenses.iter().position(|lens| lens.key == place.key && lens.places.is_empty());
        let pair = || match lenses.as_slice() {
            [only] if only.places.is_empty() => Some(0),
            _ => None,
        };
        match same_name.or_else(pair).and_then(|index| lenses.get_mut(index)) {
            Some(lens) => lens.places = place.places,
            None => {
                let path = &place.path;
                let problem =
                    "has R and T, but no camera matrix, and no file with one has its name; give both in one folder";
                return Err(FileValidator { path }.invalid("file", problem));
            }
        }
    }
    Ok(lenses)
}
