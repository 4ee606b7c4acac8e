//! The cameras of a capture, from `InterHand2.6M_{subset}_camera.json`.

use std::collections::BTreeMap;
use std::path::Path;

use serde::Deserialize;
use serde::de::{Error, MapAccess};

use crate::error::CaptureError;
use crate::reading::json_stream::{Keys, Numbers, Object, read_streaming, skip};
use crate::reading::validation::FileValidator;

/// What to do when an annotation file cannot be opened.
pub(super) const REMEDY: &str = "download the annotations of InterHand2.6M v1.0 into the folder annotations";

/// Most cameras of a capture; there are about 140.
const MOST_CAMERAS: usize = 4096;

/// The tables of one capture, each by the id of a camera.
#[derive(Debug, Default, PartialEq)]
pub(crate) struct CameraTables {
    /// Centre of projection, millimetres.
    pub campos: BTreeMap<String, Numbers<3>>,
    /// Rows of `camera_from_world`.
    pub camrot: BTreeMap<String, [Numbers<3>; 3]>,
    /// Focal lengths, pixels.
    pub focal: BTreeMap<String, Numbers<2>>,
    /// Principal point, pixels.
    pub princpt: BTreeMap<String, Numbers<2>>,
}

/// The tables of one capture.
pub(super) fn read_cameras(path: &Path, capture: &str) -> Result<CameraTables, CaptureError> {
    let mut wanted = OfCapture::new(capture);
    read_streaming(path, Object(&mut wanted), REMEDY)?;
    if !wanted.found {
        let problem = format!("capture {capture:?} is missing; {REMEDY}");
        return Err(FileValidator { path }.invalid("captures", problem));
    }
    Ok(wanted.tables)
}

struct OfCapture<'a> {
    capture: &'a str,
    found: bool,
    tables: CameraTables,
}

impl<'a> OfCapture<'a> {
    fn new(capture: &'a str) -> OfCapture<'a> {
        OfCapture { capture, found: false, tables: CameraTables::default() }
    }
}

impl Keys for OfCapture<'_> {
    fn value<'de, A: MapAccess<'de>>(&mut self, key: &str, map: &mut A) -> Result<(), A::Error> {
        if key != self.capture {
            return skip(map);
        }
        self.found = true;
        map.next_value_seed(Object(&mut self.tables))
    }
}

impl Keys for CameraTables {
    fn value<'de, A: MapAccess<'de>>(&mut self, key: &str, map: &mut A) -> Result<(), A::Error> {
        match key {
            "campos" => map.next_value_seed(Object(&mut ById(&mut self.campos))),
            "camrot" => map.next_value_seed(Object(&mut ById(&mut self.camrot))),
            "focal" => map.next_value_seed(Object(&mut ById(&mut self.focal))),
            "princpt" => map.next_value_seed(Object(&mut ById(&mut self.princpt))),
            _ => skip(map),
        }
    }
}

struct ById<'a, T>(&'a mut BTreeMap<String, T>);

impl<T: for<'a> Deserialize<'a>> Keys for ById<'_, T> {
    fn value<'de, A: MapAccess<'de>>(&mut self, key: &str, map: &mut A) -> Result<(), A::Error> {
        // A camera without a value does not exist.
        let Some(value) = map.next_value::<Option<T>>()? else { return Ok(()) };
        if self.0.len() >= MOST_CAMERAS {
            return Err(A::Error::custom(format!("more than {MOST_CAMERAS} cameras")));
        }
        match self.0.insert(key.into(), value) {
            Some(_) => Err(A::Error::custom(format!("camera {key:?} occurs twice"))),
            None => Ok(()),
        }
    }
}
