//! The cameras of a capture, from `InterHand2.6M_{subset}_camera.json`.

use std::collections::{BTreeMap, HashMap};
use std::path::Path;

use serde::Deserialize;

use crate::error::CaptureError;
use crate::reading::json_file::{LARGEST_FILE, parse};
use crate::reading::json_stream::Numbers;
use crate::reading::text_file::read_text;
use crate::reading::validation::FileValidator;

/// What to do when an annotation file cannot be opened.
pub(super) const REMEDY: &str = "download the annotations of InterHand2.6M v1.0 into the folder annotations";

/// The tables of one capture, each by the id of a camera. A camera without a value does not exist.
#[derive(Default, Deserialize)]
#[serde(default)]
pub(crate) struct CameraTables {
    /// Centre of projection, millimetres.
    pub campos: BTreeMap<String, Option<Numbers<3>>>,
    /// Rows of `camera_from_world`.
    pub camrot: BTreeMap<String, Option<[Numbers<3>; 3]>>,
    /// Focal lengths, pixels.
    pub focal: BTreeMap<String, Option<Numbers<2>>>,
    /// Principal point, pixels.
    pub princpt: BTreeMap<String, Option<Numbers<2>>>,
}

/// The tables of one capture. A file has those of all captures of a subset, one or two megabytes.
pub(super) fn read_cameras(path: &Path, capture: &str) -> Result<CameraTables, CaptureError> {
    let text = read_text(path, LARGEST_FILE, "read the annotations", REMEDY)?;
    let mut captures: HashMap<String, CameraTables> = parse(path, &text)?;
    captures.remove(capture).ok_or_else(|| {
        let problem = format!("capture {capture:?} is missing; {REMEDY}");
        FileValidator { path }.invalid("captures", problem)
    })
}
