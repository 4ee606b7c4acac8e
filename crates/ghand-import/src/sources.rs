//! The cameras' footage with their names.

use std::path::{Path, PathBuf};

use ghand_footage::Footage;

use crate::ImportError;

/// The footage of one camera.
#[derive(Debug, Clone)]
pub struct Source {
    /// Name of the camera.
    pub id: String,
    /// Its frames.
    pub footage: Footage,
}

/// Opens footage: each path is a video or a folder of pictures of one camera. A single folder without pictures has a camera
/// in each of its videos or, if it has none, in each of its folders of pictures.
///
/// # Errors
/// If one cannot be read.
pub fn open(paths: &[PathBuf]) -> Result<Vec<Source>, ImportError> {
    let inside = match paths {
        [folder] if folder.is_dir() && Footage::open(folder).is_err() => footage_in(folder)?,
        _ => vec![],
    };
    let paths = if inside.is_empty() { paths } else { &inside };
    let mut sources: Vec<Source> = vec![];
    for path in paths {
        let footage = Footage::open(path)?;
        let stem = path.file_stem().unwrap_or_default().to_string_lossy();
        let plain: String =
            stem.chars().map(|c| if c.is_ascii_alphanumeric() || "-_".contains(c) { c } else { '_' }).collect();
        let plain = if plain.is_empty() { "cam".to_owned() } else { plain };
        let is_known = |id: &str| sources.iter().any(|source| source.id == id);
        let numbered = (2..).map(|k| format!("{plain}-{k}"));
        let id = std::iter::once(plain.clone()).chain(numbered).find(|id| !is_known(id)).unwrap_or(plain);
        sources.push(Source { id, footage });
    }
    Ok(sources)
}

/// Videos in a folder or, without any, folders of pictures, by name.
fn footage_in(folder: &Path) -> Result<Vec<PathBuf>, ImportError> {
    const VIDEOS: [&str; 9] = ["mp4", "mov", "mkv", "avi", "webm", "m4v", "mts", "mpg", "3gp"];
    let unreadable = |source| ImportError::Read { path: folder.into(), source };
    let entries = std::fs::read_dir(folder).map_err(unreadable)?;
    let mut found: Vec<PathBuf> = entries.filter_map(|entry| Some(entry.ok()?.path())).collect();
    let is_video =
        |path: &PathBuf| path.extension().is_some_and(|e| VIDEOS.iter().any(|known| e.eq_ignore_ascii_case(known)));
    found.sort();
    let videos: Vec<PathBuf> = found.iter().filter(|path| is_video(path)).cloned().collect();
    if !videos.is_empty() {
        return Ok(videos);
    }
    found.retain(|path| path.is_dir() && Footage::open(path).is_ok());
    Ok(found)
}
