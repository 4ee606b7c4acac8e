//! The formats of pictures and films, and how a file's name determines its format.

use std::path::Path;

use crate::PictureError;

/// Formats of single pictures.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StillFormat {
    /// 8 bits.
    Png,
    /// 32-bit floats.
    Exr,
}

/// Formats of films.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FilmFormat {
    /// 256 colours per frame; pixels are opaque or fully transparent.
    Gif,
    /// VP9, may be translucent.
    Webm,
    /// H.264.
    Mp4,
}

/// Formats of everything that is rendered.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    /// Single pictures.
    Still(StillFormat),
    /// One film of all pictures.
    Film(FilmFormat),
}

/// All formats, by file extension.
const FORMATS: [(&str, Format); 5] = [
    ("png", Format::Still(StillFormat::Png)),
    ("exr", Format::Still(StillFormat::Exr)),
    ("gif", Format::Film(FilmFormat::Gif)),
    ("webm", Format::Film(FilmFormat::Webm)),
    ("mp4", Format::Film(FilmFormat::Mp4)),
];

impl Format {
    /// Parses `png`, `exr`, `gif`, `webm` or `mp4`, in upper or lower case.
    ///
    /// # Errors
    /// A description of the problem with the text.
    pub fn parse(text: &str) -> Result<Format, String> {
        let found = FORMATS.iter().find(|(name, _)| text.eq_ignore_ascii_case(name));
        found.map(|(_, format)| *format).ok_or_else(|| "must be png, exr, gif, webm or mp4".into())
    }

    /// The format given by a file's extension, in upper or lower case.
    pub fn of(path: &Path) -> Option<Format> {
        path.extension().and_then(|ending| Format::parse(ending.to_str()?).ok())
    }

    /// The extension of its files.
    pub fn ending(self) -> &'static str {
        FORMATS.iter().find(|(_, format)| *format == self).map_or("", |(name, _)| name)
    }
}

impl StillFormat {
    /// The format of a single picture, given by a file's extension; `option` is for the message.
    ///
    /// # Errors
    /// An error that names the option and the file.
    pub fn of(path: &Path, option: &str) -> Result<StillFormat, PictureError> {
        match Format::of(path) {
            Some(Format::Still(format)) => Ok(format),
            _ => Err(PictureError::Unsuitable(format!("{option} {}: must end in .png or .exr", path.display()))),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_extension_determines_the_format_in_any_case() {
        for (name, format) in [
            ("a.png", Some(Format::Still(StillFormat::Png))),
            ("a.b.PNG", Some(Format::Still(StillFormat::Png))),
            ("folder.gif/a.Exr", Some(Format::Still(StillFormat::Exr))),
            ("a.GIF", Some(Format::Film(FilmFormat::Gif))),
            ("a.webm", Some(Format::Film(FilmFormat::Webm))),
            ("a.mP4", Some(Format::Film(FilmFormat::Mp4))),
            ("a.jpg", None),
            ("png", None),
            (".png", None),
            ("a.png/b", None),
        ] {
            assert_eq!(Format::of(Path::new(name)), format, "{name}");
        }
        assert!(FORMATS.iter().all(|(name, format)| Format::parse(format.ending()) == Ok(*format) && !name.is_empty()));
        assert_eq!(StillFormat::of(Path::new("a.PNG"), "--picture").unwrap(), StillFormat::Png);
        for name in ["a.gif", "a", "a.jpg"] {
            let error = StillFormat::of(Path::new(name), "--picture").unwrap_err().to_string();
            assert!(error.starts_with(&format!("--picture {name}: must end in .png or .exr")), "{error}");
        }
    }
}
