//! EasyMocap's `intri.yml` and `extri.yml`: fields named after cameras, which `names` lists. Lengths are metres.

use std::path::Path;

use super::field::Field;
use super::found::{CalibrationFormat, FoundCalibration, FoundCamera, LengthUnit};
use super::lens;
use super::node::Node;
use crate::cameras::rigid::Rigid;
use crate::error::CaptureError;

/// Whether a file has the intrinsics, or the extrinsics.
pub(super) fn recognises(node: &Node) -> bool {
    let begins = |start: &str| node.entries().iter().any(|(name, _)| name.starts_with(start));
    matches!(node.get("names"), Some(Node::List(_) | Node::Text(_))) && (begins("K_") || begins("R_") || begins("Rot_"))
}

/// Reads a pair of files, whose names are for messages; `extri` may be missing.
pub(super) fn read(
    path: &Path,
    intri: (&Path, &Node),
    extri: Option<(&Path, &Node)>,
) -> Result<FoundCalibration, CaptureError> {
    let lenses = Field::root(intri.0, intri.1);
    let places = extri.map(|(path, node)| Field::root(path, node));
    let format = CalibrationFormat::EasyMocap;
    let mut cameras = vec![];
    for name in names(&lenses.require("names")?)? {
        let find = |kind: &str| lenses.find(&format!("{kind}_{name}"));
        let size = match (find("W"), find("H")) {
            (Some(width), Some(height)) => Some([width.whole()?, height.whole()?]),
            _ => None,
        };
        cameras.push(FoundCamera {
            size,
            projection: lens::projection(&lenses.require(&format!("K_{name}"))?, format)?,
            distortion: match find("dist").or_else(|| find("D")) {
                Some(coefficients) => lens::distortion(&coefficients)?,
                None => None,
            },
            extrinsics: places.as_ref().map(|places| place(places, &name)).transpose()?,
            id: name,
        });
    }
    let mut remarks = vec![];
    if places.is_some() {
        remarks.push("lengths are metres, as EasyMocap wants them".into());
    }
    FoundCalibration::checked(path, format, LengthUnit::Metre, cameras, remarks)
}

/// A single name is not a list in XML.
fn names(field: &Field) -> Result<Vec<String>, CaptureError> {
    match field.node {
        Node::Text(name) => Ok(vec![name.clone()]),
        _ => field.items()?.iter().map(Field::text).collect(),
    }
}

fn place(places: &Field, name: &str) -> Result<Rigid, CaptureError> {
    let vector = places.find(&format!("R_{name}"));
    let rotation = vector.or_else(|| places.find(&format!("Rot_{name}")));
    let rotation = match rotation {
        Some(rotation) => rotation.rotation()?,
        None => places.require(&format!("R_{name}"))?.rotation()?,
    };
    Ok(Rigid { rotation, translation: places.require(&format!("T_{name}"))?.vector()? })
}
