//! Pictures as frames.

use std::path::{Path, PathBuf};

use image::metadata::Orientation;
use image::{DynamicImage, ImageDecoder, ImageReader};

use crate::{FootageError, StatedFocal, natural_order};

/// Most pictures of a folder.
const MOST_PICTURES: usize = 1_000_000;

/// Extensions of pictures that are read.
const ENDINGS: [&str; 4] = ["jpg", "jpeg", "png", "webp"];
/// Extensions of pictures that are not.
const OTHER_ENDINGS: [&str; 3] = ["heic", "heif", "avif"];

/// Pictures of one size, at least one.
#[derive(Debug, Clone)]
pub(crate) struct Pictures {
    paths: Vec<PathBuf>,
    size: (u32, u32),
    focal_35mm: Option<f64>,
}

impl Pictures {
    /// The pictures of a folder in the order of their names; other files are ignored.
    pub fn of_folder(folder: &Path) -> Result<Pictures, FootageError> {
        let mut paths = vec![];
        for entry in std::fs::read_dir(folder).map_err(FootageError::file(folder))? {
            let path = entry.map_err(FootageError::file(folder))?.path();
            let is_hidden = path.file_name().is_some_and(|name| name.to_string_lossy().starts_with('.'));
            if !is_hidden && is_picture(&path)? {
                paths.push(path);
            }
            if paths.len() > MOST_PICTURES {
                let problem = format!("has more than {MOST_PICTURES} pictures; give a part of them");
                return Err(FootageError::unusable(folder, problem));
            }
        }
        if paths.is_empty() {
            let problem = "has no pictures (JPEG, PNG or WebP); give a folder of pictures, or a video";
            return Err(FootageError::unusable(folder, problem));
        }
        let name = |path: &PathBuf| path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        paths.sort_by(|a, b| natural_order::compare(&name(a), &name(b)));
        Self::new(paths)
    }

    /// These pictures, in this order.
    pub fn new(paths: Vec<PathBuf>) -> Result<Pictures, FootageError> {
        let Some(first) = paths.first() else {
            return Err(FootageError::unusable(Path::new("pictures"), "there are none; give at least one"));
        };
        let (mut decoder, orientation) = decoder(first)?;
        let (width, height) = decoder.dimensions();
        let size = if is_on_its_side(orientation) { (height, width) } else { (width, height) };
        let focal_35mm = decoder.exif_metadata().ok().flatten().and_then(focal_35mm);
        Ok(Pictures { paths, size, focal_35mm })
    }

    /// As [`crate::Footage::stated_focal`], of the first picture.
    pub fn stated_focal(&self) -> Option<StatedFocal> {
        StatedFocal::of_pictures(self.focal_35mm?, self.size)
    }

    pub fn paths(&self) -> &[PathBuf] {
        &self.paths
    }

    pub fn size(&self) -> (u32, u32) {
        self.size
    }

    /// A picture's pixels, turned as its camera was held.
    pub fn read(&self, number: usize, rgb: &mut Vec<u8>) -> Result<(), FootageError> {
        rgb.clear();
        let Some(path) = self.paths.get(number) else { return Ok(()) };
        let (decoder, orientation) = decoder(path)?;
        let mut picture = DynamicImage::from_decoder(decoder)
            .map_err(|source| FootageError::Picture { path: path.clone(), source })?;
        picture.apply_orientation(orientation);
        let picture = picture.into_rgb8();
        if picture.dimensions() != self.size {
            let (width, height) = self.size;
            let (own_width, own_height) = picture.dimensions();
            let problem = format!(
                "has {own_width} x {own_height} pixels, and the first picture {width} x {height}; one camera's pictures \
                 must have one size: remove it, or put it into a folder of its own"
            );
            return Err(FootageError::unusable(path, problem));
        }
        *rgb = picture.into_raw();
        Ok(())
    }
}

/// The focal length on film of 36 x 24 mm that Exif data state, millimetres.
fn focal_35mm(exif: Vec<u8>) -> Option<f64> {
    let exif = exif::Reader::new().read_raw(exif).ok()?;
    let field = exif.get_field(exif::Tag::FocalLengthIn35mmFilm, exif::In::PRIMARY)?;
    // 0 stands for unknown.
    field.value.get_uint(0).filter(|focal| *focal > 0).map(f64::from)
}

/// Whether a file is a picture by its extension; an error for those that are not read.
pub(crate) fn is_picture(path: &Path) -> Result<bool, FootageError> {
    let ending = path.extension().map(|ending| ending.to_string_lossy().to_lowercase()).unwrap_or_default();
    if OTHER_ENDINGS.contains(&ending.as_str()) {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        let problem = format!(
            "{} pictures are not read; convert them, with ffmpeg 7.1 or later: `ffmpeg -i {name} {}.png`",
            ending.to_uppercase(),
            path.file_stem().unwrap_or_default().to_string_lossy()
        );
        return Err(FootageError::unusable(path, problem));
    }
    Ok(ENDINGS.contains(&ending.as_str()) && path.is_file())
}

/// Opens a picture, whose kind its first bytes tell.
fn decoder(path: &Path) -> Result<(impl ImageDecoder + use<>, Orientation), FootageError> {
    let failure = |source| FootageError::Picture { path: path.into(), source };
    let reader =
        ImageReader::open(path).and_then(ImageReader::with_guessed_format).map_err(FootageError::file(path))?;
    let mut decoder = reader.into_decoder().map_err(failure)?;
    let orientation = decoder.orientation().unwrap_or(Orientation::NoTransforms);
    Ok((decoder, orientation))
}

fn is_on_its_side(orientation: Orientation) -> bool {
    use Orientation::{Rotate90, Rotate90FlipH, Rotate270, Rotate270FlipH};
    matches!(orientation, Rotate90 | Rotate270 | Rotate90FlipH | Rotate270FlipH)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exif_data_tell_the_focal_length() {
        let field = exif::Field {
            tag: exif::Tag::FocalLengthIn35mmFilm,
            ifd_num: exif::In::PRIMARY,
            value: exif::Value::Short(vec![26]),
        };
        let mut writer = exif::experimental::Writer::new();
        writer.push_field(&field);
        let mut bytes = std::io::Cursor::new(vec![]);
        writer.write(&mut bytes, false).unwrap();
        let bytes = bytes.into_inner();
        assert_eq!(focal_35mm(bytes.clone()), Some(26.0));
        (0..bytes.len()).for_each(|end| assert!(focal_35mm(bytes[..end].to_vec()).is_none_or(|focal| focal == 26.0)));
    }
}
