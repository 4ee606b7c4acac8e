//! The camera that a user names: a file with one camera, or one of the cameras of a capture.

use std::path::{Path, PathBuf};

use ghand_core::Camera;
use serde::Deserialize;
use serde::de::IgnoredAny;

use super::list::{LensCamera, read_own_cameras};
use crate::capture::CaptureError;
use crate::ghand_format::CAPTURE_FILE;
use crate::ghand_format::fields::read_camera_fields;
use crate::reading::json_file::{LARGEST_FILE, parse};
use crate::reading::text_file::read_text;
use crate::reading::validation::FileValidator;

/// Most ids that an error lists; with more cameras, ids follow a pattern.
const LISTED_IDS: usize = 40;

/// Whether a file has cameras, or is a camera.
#[derive(Deserialize)]
struct Kind {
    cameras: Option<IgnoredAny>,
}

/// Reads a camera from `FILE` or `FILE:ID`. The file is JSON: one camera, or a `capture.json` (or the folder that holds
/// it), which needs the id of one of its cameras unless it has only one. An existing path is used unchanged, including
/// colons.
///
/// # Errors
/// [`CaptureError`] names the file, the field and its problem; for an unknown id it lists the existing ids.
pub fn read_named_camera(name: &Path) -> Result<Camera, CaptureError> {
    let (path, id) = split(name);
    let path = if path.is_dir() { path.join(CAPTURE_FILE) } else { path };
    let remedy = "give a JSON file with one camera as in the `cameras` of a capture.json, or capture.json:ID";
    let text = read_text(&path, LARGEST_FILE, "read the camera", remedy)?;
    let validator = FileValidator { path: &path };
    if parse::<Kind>(&path, &text)?.cameras.is_none() {
        let file = read_camera_fields(&path, &text)?;
        return match id {
            Some(id) if file.id != id => {
                let problem = format!("is {:?}, not {id:?}; the file has only this camera", file.id);
                Err(validator.invalid("id", problem))
            }
            _ => file.camera(validator, String::new()),
        };
    }
    let cameras = read_own_cameras(&path)?;
    let chosen = match (&id, cameras.as_slice()) {
        (Some(id), _) => cameras.iter().find(|lens| lens.camera.id == *id).ok_or_else(|| {
            let problem = format!("has none with the id {id:?}; the ids are {}", ids(&cameras));
            validator.invalid("cameras", problem)
        })?,
        (None, [only]) => only,
        (None, []) => return Err(validator.invalid("cameras", "is empty")),
        (None, several @ [first, ..]) => {
            let file = path.display();
            let count = several.len();
            let ids = ids(several);
            let first = &first.camera.id;
            let problem = format!("has {count}; choose one by its id, as in {file}:{first}; the ids are {ids}");
            return Err(validator.invalid("cameras", problem));
        }
    };
    Ok(chosen.camera.clone())
}

/// The file and the id in a name.
fn split(name: &Path) -> (PathBuf, Option<String>) {
    let Some(text) = name.to_str().filter(|_| !name.exists()) else { return (name.into(), None) };
    // Paths and ids may have colons: the file is the longest existing path.
    let parts: Vec<(&str, &str)> = text.rmatch_indices(':').map(|(at, _)| (&text[..at], &text[at + 1..])).collect();
    let found = parts.iter().find(|(path, _)| Path::new(path).exists());
    // For a missing file: not the colon of `C:\...`.
    match found.or(parts.first().filter(|(_, id)| !id.contains(['/', '\\']))) {
        Some((path, id)) => (path.into(), Some((*id).into())),
        None => (name.into(), None),
    }
}

fn ids(cameras: &[LensCamera]) -> String {
    let listed: Vec<&str> = cameras.iter().take(LISTED_IDS).map(|lens| lens.camera.id.as_str()).collect();
    let more = cameras.len().saturating_sub(LISTED_IDS);
    if more == 0 { listed.join(", ") } else { format!("{} and {more} more", listed.join(", ")) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn camera(id: &str, fx: f64) -> String {
        format!(
            r#"{{"id":"{id}","width":64,"height":48,"intrinsics":[[{fx},0,32],[0,110,24],[0,0,1]],
            "rotation":[[1,0,0],[0,1,0],[0,0,1]],"translation":[0,0,1]}}"#
        )
    }

    fn capture(ids: &[&str]) -> String {
        let cameras: Vec<String> = ids.iter().zip(1..).map(|(id, k)| camera(id, 100.0 * f64::from(k))).collect();
        format!(r#"{{"format":"ghand-capture","frames":[{{"id":"0","pose":[]}}],"cameras":[{}]}}"#, cameras.join(","))
    }

    /// The result for a file with that name and content, read by `name` with `{}` for the file.
    fn read(file: &str, json: &str, name: &str) -> Result<Camera, String> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(file);
        std::fs::write(&path, json).unwrap();
        let name = name.replace("{folder}", folder.path().to_str().unwrap()).replace("{}", path.to_str().unwrap());
        read_named_camera(Path::new(&name)).map_err(|e| e.to_string())
    }

    #[test]
    fn a_camera_of_a_capture_is_found_by_its_id() {
        let json = capture(&["cam00", "cam03"]);
        for (name, fx) in [("{}:cam00", 100.0), ("{}:cam03", 200.0), ("{folder}:cam03", 200.0)] {
            assert_eq!(read("capture.json", &json, name).unwrap().focal.x, fx, "{name}");
        }
        let centered = json.replacen("\"cameras\"", "\"pixel_center\":0,\"cameras\"", 1);
        assert_eq!(read("capture.json", &centered, "{}:cam00").unwrap().principal, glam::DVec2::new(32.5, 24.5));
        let only = capture(&["a:b"]);
        for name in ["{}", "{folder}"] {
            assert_eq!(read("capture.json", &only, name).unwrap().id, "a:b");
        }
        assert_eq!(read("capture.json", &only, "{}:a:b").unwrap().id, "a:b");
        assert_eq!(read("one.json", &camera("c", 100.0), "{}").unwrap().id, "c");
        assert_eq!(read("one.json", &camera("c", 100.0), "{}:c").unwrap().id, "c");
        assert_eq!(read("with:colon.json", &camera("c", 100.0), "{}").unwrap().id, "c");
    }

    #[test]
    fn an_unknown_field_of_a_camera_or_of_its_file_is_named() {
        let one = camera("c", 100.0);
        let many = capture(&["cam00", "cam03"]);
        let lens = "\"width\":64,\"distorsion\":[0.1,0,0,0,0]";
        for (file, json, name, parts) in [
            ("one.json", one.replace("\"width\":64", lens), "{}", ["distorsion", "\"distortion\""]),
            ("one.json", one.replace("\"id\"", "\"name\""), "{}", ["name", "not a field"]),
            (
                "capture.json",
                many.replacen("\"width\":64", lens, 1),
                "{}:cam03",
                ["cameras[0].distorsion", "\"distortion\""],
            ),
            (
                "cameras.json",
                many.replacen("\"cameras\"", "\"colours\":{},\"cameras\"", 1),
                "{}:cam00",
                ["colours", "\"colors\""],
            ),
        ] {
            let error = read(file, &json, name).unwrap_err();
            assert!(parts.iter().all(|part| error.contains(part)) && error.contains(file), "{error}");
        }
        assert!(read("one.json", &one.replace("\"id\"", "\"_note\":1,\"id\""), "{}").is_ok());
        assert!(
            read("cameras.json", &many.replacen("\"cameras\"", "\"colors\":{},\"cameras\"", 1), "{}:cam00").is_ok()
        );
    }

    #[test]
    fn an_unknown_or_missing_id_lists_the_ids() {
        let json = capture(&["cam00", "cam03"]);
        for (name, part) in [("{}:cam07", "\"cam07\""), ("{}", "choose one by its id"), ("{}:", "\"\"")] {
            let error = read("capture.json", &json, name).unwrap_err();
            assert!(error.contains("capture.json: cameras"), "{error}");
            assert!(error.contains("cam00, cam03") && error.contains(part), "{error}");
        }
        let many: Vec<String> = (0..50).map(|k| format!("c{k}")).collect();
        let many: Vec<&str> = many.iter().map(String::as_str).collect();
        assert!(read("capture.json", &capture(&many), "{}:x").unwrap_err().ends_with("c39 and 10 more"));
        let error = read("one.json", &camera("c", 100.0), "{}:d").unwrap_err();
        assert!(error.contains("one.json: id: is \"c\", not \"d\""), "{error}");
        assert!(read("capture.json", &capture(&["a", "a"]), "{}:a").unwrap_err().contains("\"a\" occurs twice"));
        assert!(read("capture.json", &capture(&[]), "{}").unwrap_err().contains("is empty"));
        let error = read("capture.json", &json.replace("[[200", "[[-200"), "{}:cam03").unwrap_err();
        assert!(error.contains("cameras[\"cam03\"].intrinsics"), "{error}");
        assert!(read("one.json", "{}", "{folder}/none.json:c").unwrap_err().contains("none.json: "));
    }
}
