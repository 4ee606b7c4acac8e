//! The data sets, one file for each: where its files are, and what their numbers mean.

pub(crate) mod arctic;
pub(crate) mod contactpose;
pub(crate) mod dexycb;
pub(crate) mod freihand;
pub(crate) mod hanco;
pub(crate) mod ho3d;
pub(crate) mod hot3d;
pub(crate) mod taco;

use std::path::{Path, PathBuf};

use crate::DatasetError;

/// The folder this many levels above.
fn above(folder: &Path, levels: usize) -> PathBuf {
    // `.` has no parents by name.
    let folder = folder.canonicalize().unwrap_or_else(|_| folder.into());
    folder.ancestors().nth(levels).map_or_else(|| folder.clone(), Path::to_path_buf)
}

/// The last part of a path.
fn name(folder: &Path) -> String {
    let folder = folder.canonicalize().unwrap_or_else(|_| folder.into());
    folder.file_name().map_or(String::new(), |name| name.to_string_lossy().into_owned())
}

/// Names without extension of the files with one of these extensions in a folder, sorted; none if it cannot be read.
fn stems(folder: &Path, extensions: &[&str]) -> Vec<String> {
    let Ok(entries) = folder.read_dir() else { return vec![] };
    let stem = |path: PathBuf| {
        let extension = path.extension()?.to_str()?.to_ascii_lowercase();
        let stem = path.file_stem()?.to_str()?;
        // macOS leaves files such as `._0001.jpg` in archives.
        (extensions.contains(&extension.as_str()) && !stem.starts_with('.')).then(|| stem.to_owned())
    };
    let mut stems: Vec<String> = entries.filter_map(|entry| stem(entry.ok()?.path())).collect();
    stems.sort();
    stems.dedup();
    stems
}

/// Names of the folders in a folder, sorted; none if it cannot be read.
fn folders(folder: &Path) -> Vec<String> {
    let Ok(entries) = folder.read_dir() else { return vec![] };
    let name = |entry: std::fs::DirEntry| entry.path().is_dir().then(|| entry.file_name().to_str().map(str::to_owned));
    let mut names: Vec<String> = entries.filter_map(|entry| name(entry.ok()?)?).collect();
    names.sort();
    names
}

/// The file of a name with one of these extensions, if one exists.
fn with_extension(folder: &Path, stem: &str, extensions: &[&str]) -> Option<PathBuf> {
    extensions.iter().map(|extension| folder.join(format!("{stem}.{extension}"))).find(|path| path.is_file())
}

/// Extensions of images.
const IMAGES: [&str; 3] = ["jpg", "png", "jpeg"];

fn no_images(folder: &Path) -> DatasetError {
    DatasetError::file(folder, "has no images; unpack the data set's images, too")
}
