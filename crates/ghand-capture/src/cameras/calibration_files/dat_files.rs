//! Text files of handpose3d and of the calibration program of its author: sections of rows of numbers.
//!
//! `c0.dat` (or `camera0_intrinsics.dat`) has `intrinsic:` and `distortion:`; `rot_trans_c0.dat` (or
//! `camera0_rot_trans.dat`) has `R:` and `T:`. Sections that follow again are between cameras and not read.

use std::path::Path;

use super::field::Field;
use super::found::{CalibrationFormat, FoundCalibration, FoundCamera, LengthUnit};
use super::lens;
use super::node::Node;
use crate::cameras::rigid::Rigid;
use crate::error::CaptureError;
use crate::reading::text_file::read_text;
use crate::reading::validation::FileValidator;

/// Such files have some hundred bytes.
const LARGEST_FILE: u64 = 1 << 16;
/// Most files of a folder that are read.
const MOST_FILES: usize = 256;

/// Whether a text begins with such a section.
pub(super) fn recognises(text: &str) -> bool {
    ["intrinsic:", "R:"].iter().any(|section| text.trim_start().starts_with(section))
}

/// The camera whose lens a file has, by the file's name.
fn camera_of_lens(name: &str) -> Option<&str> {
    let stem = name.strip_suffix(".dat")?;
    match stem.strip_suffix("_intrinsics") {
        Some(camera) => Some(camera),
        None => stem.strip_prefix('c').filter(|n| n.parse::<u32>().is_ok()).map(|_| stem),
    }
}

/// Whether a folder has such files.
pub(super) fn is_folder(names: &[String]) -> bool {
    names.iter().any(|name| camera_of_lens(name).is_some())
}

/// Reads the files of a folder, of those names.
pub(super) fn read(folder: &Path, names: &[String]) -> Result<FoundCalibration, CaptureError> {
    let mut remarks = vec![];
    let mut cameras = vec![];
    for (name, id) in names.iter().filter_map(|name| Some((name, camera_of_lens(name)?))).take(MOST_FILES) {
        let lens_path = folder.join(name);
        let sections = sections(&lens_path)?;
        let lens = Field::root(&lens_path, &sections.node);
        let place = [format!("rot_trans_{id}.dat"), format!("{id}_rot_trans.dat")];
        let place = names.iter().find(|name| place.contains(name));
        cameras.push(FoundCamera {
            id: id.into(),
            size: None,
            projection: lens::projection(&lens.require("intrinsic")?, CalibrationFormat::DatFiles)?,
            distortion: match lens.find("distortion") {
                Some(coefficients) => lens::distortion(&coefficients)?,
                None => None,
            },
            extrinsics: place.map(|name| read_place(&folder.join(name), &mut remarks)).transpose()?,
        });
    }
    cameras.sort_by_key(|camera| (camera.id.len(), camera.id.clone()));
    FoundCalibration::checked(folder, CalibrationFormat::DatFiles, LengthUnit::Unknown, cameras, remarks)
}

fn read_place(path: &Path, remarks: &mut Vec<String>) -> Result<Rigid, CaptureError> {
    let sections = sections(path)?;
    if sections.is_repeated {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        remarks.push(format!("of {name} the first R and T are read, from the world to the camera"));
    }
    let place = Field::root(path, &sections.node);
    Ok(Rigid { rotation: place.require("R")?.rotation()?, translation: place.require("T")?.vector()? })
}

struct Sections {
    /// Rows of texts, by the section's name.
    node: Node,
    /// Whether a section follows that was there before.
    is_repeated: bool,
}

fn sections(path: &Path) -> Result<Sections, CaptureError> {
    let text = read_text(path, LARGEST_FILE, "read the cameras", "give the folder of the calibration's .dat files")?;
    let mut sections: Vec<(String, Node)> = vec![];
    let mut is_repeated = false;
    for line in text.lines().map(str::trim).filter(|line| !(line.is_empty() || line.starts_with('#'))) {
        if let Some(name) = line.strip_suffix(':') {
            is_repeated = sections.iter().any(|(known, _)| known == name);
            if is_repeated {
                break;
            }
            sections.push((name.into(), Node::List(vec![])));
            continue;
        }
        match sections.last_mut() {
            Some((_, Node::List(numbers))) => {
                numbers.extend(line.split_whitespace().map(|number| Node::Text(number.into())));
            }
            _ => {
                let problem =
                    "must begin with a section such as `intrinsic:` or `R:`; give the calibration's own files";
                return Err(FileValidator { path }.invalid("file", problem));
            }
        }
    }
    Ok(Sections { node: Node::Map(sections), is_repeated })
}
