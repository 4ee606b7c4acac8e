//! Folders with poses: a capture, or a sequence of HO-3D.

use std::path::{Path, PathBuf};

use ghand_files::value::{Value, ValueError};

use crate::pose_sequence::PoseError;
use crate::pose_sequence::formats::ho3d;

const CAPTURE_FILE: &str = "capture.json";
/// Most files of a sequence; HO-3D's longest has about two thousand.
const MOST_FILES: usize = 100_000;

/// The content of a path: of a file or of the files of a folder, with the file's name for messages.
pub(crate) fn read(path: &Path) -> Result<(PathBuf, Value), PoseError> {
    let read = |path: &Path| Value::read(path).map_err(|source| PoseError::File { path: path.into(), source });
    if !path.is_dir() {
        return Ok((path.into(), read(path)?));
    }
    let capture = path.join(CAPTURE_FILE);
    if capture.exists() {
        return read(&capture).map(|value| (capture, value));
    }
    let invalid =
        |problem: String| PoseError::Invalid { origin: path.display().to_string(), field: "folder".into(), problem };
    let mut files = pickles(&path.join("meta"));
    if files.is_empty() {
        files = pickles(path);
    }
    if files.is_empty() {
        return Err(invalid(format!(
            "has neither a {CAPTURE_FILE} nor the .pkl files of an HO-3D sequence, in it or in its folder meta; give \
             one of these, or the file with the poses"
        )));
    }
    if files.len() > MOST_FILES {
        return Err(invalid(format!(
            "has {} .pkl files, at most {MOST_FILES} are read; give a part of them",
            files.len()
        )));
    }
    let mut frames = Vec::with_capacity(files.len());
    for file in &files {
        let id = file.file_stem().map(|stem| stem.to_string_lossy().into_owned()).unwrap_or_default();
        let value = read(file)?;
        if !ho3d::is_frame(&value) {
            let problem =
                "has no \"handPose\", as the files of an HO-3D sequence have; give the one file with the poses";
            let source = ValueError::Content(problem.into());
            return Err(PoseError::File { path: file.clone(), source });
        }
        let part = |name: &str| Some((name.to_owned(), value.get(name)?.clone()));
        let parts = ho3d::FIELDS.into_iter().filter_map(part);
        frames.push(Value::Map(std::iter::once(("id".to_owned(), Value::Text(id))).chain(parts).collect()));
    }
    Ok((path.into(), Value::List(frames)))
}

/// Files in a folder that are pickles by name, in order.
fn pickles(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().filter_map(|entry| Some(entry.ok()?.path()));
    let mut files: Vec<PathBuf> = entries.filter(|path| path.extension().is_some_and(|e| e == "pkl")).collect();
    files.sort();
    files
}
