//! The output that `--out` and `--format` request: a picture, a film or a folder of pictures.

use std::path::{Path, PathBuf};

use crate::PictureError;
use crate::format::{FilmFormat, Format, StillFormat};

/// Where pictures go.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Destination {
    /// One picture.
    Picture(PathBuf, StillFormat),
    /// One film of all pictures.
    Film(PathBuf, FilmFormat),
    /// A file for each picture.
    Folder(PathBuf, StillFormat),
}

impl Destination {
    /// Where the pictures go: to the file if `out` ends in a format's name, else to the folder, which need not exist
    /// yet. A film in a folder is called `name`. `format` is the one that was asked for, if any.
    ///
    /// # Errors
    /// [`PictureError::Unsuitable`], which says how `--out` may end, or that it contradicts `--format`.
    pub fn new(out: &Path, format: Option<Format>, name: &str) -> Result<Destination, PictureError> {
        let unsuitable = |problem: String| Err(PictureError::Unsuitable(format!("--out {}: {problem}", out.display())));
        let is_folder = out.is_dir() || out.as_os_str().to_string_lossy().ends_with(std::path::is_separator);
        if is_folder || out.extension().is_none() {
            if out.exists() && !out.is_dir() {
                return unsuitable(
                    "is a file, not a folder; give a folder, or a file that ends in .png or .gif".into(),
                );
            }
            return Ok(match format.unwrap_or(Format::Still(StillFormat::Png)) {
                Format::Still(format) => Destination::Folder(out.into(), format),
                Format::Film(film) => {
                    Destination::Film(out.join(format!("{name}.{}", Format::Film(film).ending())), film)
                }
            });
        }
        let Some(of_name) = Format::of(out) else {
            return unsuitable(
                "must end in .png, .exr, .gif, .webm or .mp4; a folder with a dot in its name ends in /".into(),
            );
        };
        if let Some(wanted) = format.filter(|wanted| *wanted != of_name) {
            return unsuitable(format!("ends in .{}, but --format is {}", of_name.ending(), wanted.ending()));
        }
        Ok(match of_name {
            Format::Still(format) => Destination::Picture(out.into(), format),
            Format::Film(format) => Destination::Film(out.into(), format),
        })
    }

    /// The file that is written, if it is one.
    pub fn file(&self) -> Option<&Path> {
        match self {
            Destination::Picture(path, _) | Destination::Film(path, _) => Some(path),
            Destination::Folder(..) => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn destination(out: &Path, format: Option<&str>) -> Result<Destination, PictureError> {
        Destination::new(out, format.map(|f| Format::parse(f).unwrap()), "count")
    }

    #[test]
    fn extensions_and_formats_distinguish_files_from_folders() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        std::fs::create_dir(at("dotted.png")).unwrap();
        std::fs::write(at("file"), b"").unwrap();
        let cases = [
            ("a.png", None, Destination::Picture(at("a.png"), StillFormat::Png)),
            ("a.EXR", Some("exr"), Destination::Picture(at("a.EXR"), StillFormat::Exr)),
            ("a.Gif", None, Destination::Film(at("a.Gif"), FilmFormat::Gif)),
            ("a", None, Destination::Folder(at("a"), StillFormat::Png)),
            ("a", Some("EXR"), Destination::Folder(at("a"), StillFormat::Exr)),
            ("a", Some("webm"), Destination::Film(at("a/count.webm"), FilmFormat::Webm)),
            ("v1.2/", None, Destination::Folder(at("v1.2/"), StillFormat::Png)),
            ("dotted.png", None, Destination::Folder(at("dotted.png"), StillFormat::Png)),
        ];
        for (out, format, expected) in cases {
            assert_eq!(destination(&at(out), format).unwrap(), expected, "{out}");
        }
        for (out, format, part) in [
            ("a.jpg", None, "must end in .png"),
            ("v1.2", None, "ends in /"),
            ("a.png", Some("gif"), "but --format is gif"),
            ("file", None, "is a file, not a folder"),
        ] {
            let error = destination(&at(out), format).unwrap_err().to_string();
            assert!(error.starts_with("--out ") && error.contains(part), "{error}");
        }
    }
}
