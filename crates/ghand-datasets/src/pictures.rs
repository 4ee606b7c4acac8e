//! Writes the images and masks of chosen frames.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::{self, Cursor, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use ghand_files::atomic_file::write_atomically;
use ghand_files::input_file;
use ghand_footage::Footage;
use image::codecs::jpeg::JpegEncoder;
use image::{GrayImage, ImageFormat, ImageReader, RgbImage};

use crate::DatasetError;
use crate::masks::warped_mask;
use crate::sequence::{Picture, Sequence, View};
use crate::warp::warped;
use crate::write::{OnProgress, Progress};

/// Quality of images that are encoded again, of 100.
const QUALITY: u8 = 97;
/// Largest file of an image, bytes.
const LARGEST_IMAGE: u64 = 1 << 28;

/// The names of the files of a capture.
pub(crate) struct Paths {
    /// `jpg` or `png`.
    pub extension: &'static str,
    pub has_masks: bool,
}

impl Paths {
    /// Images stay as they are, unless kinds are mixed.
    pub fn of<'a>(views: impl Iterator<Item = &'a View> + Clone) -> Paths {
        let is_png = |view: &View| match &view.picture {
            Picture::File(path) => view.warp.is_none() && kind(path) == "png",
            Picture::Video(..) | Picture::Entry { .. } => false,
        };
        let extension = if views.clone().all(is_png) { "png" } else { "jpg" };
        Paths { extension, has_masks: views.clone().any(|view| view.mask.is_some()) }
    }

    pub fn images(&self) -> String {
        format!("images/{{camera}}/{{frame}}.{}", self.extension)
    }

    pub fn masks(&self) -> Option<String> {
        self.has_masks.then(|| "masks/{camera}/{frame}.png".into())
    }
}

/// The usual extension of a file, in small letters.
fn kind(path: &Path) -> String {
    let extension = path.extension().map(|extension| extension.to_string_lossy().to_lowercase());
    extension.map_or(String::new(), |extension| if extension == "jpeg" { "jpg".into() } else { extension })
}

/// Writes images and masks of frames, and removes those of an earlier import of the same cameras.
pub(crate) fn write_pictures(
    out: &Path,
    sequence: &Sequence,
    frames: &[usize],
    paths: &Paths,
    on_progress: &mut OnProgress,
) -> Result<(), DatasetError> {
    let mut progress = Progress { done: 0, total: frames.len() * sequence.cameras.len() };
    for (k, lens) in sequence.cameras.iter().enumerate() {
        let camera = &lens.camera;
        let images = emptied(&out.join("images").join(&camera.id))?;
        let masks = emptied(&out.join("masks").join(&camera.id))?;
        if paths.has_masks {
            fs::create_dir_all(&masks).map_err(DatasetError::write(&masks))?;
        }
        fs::create_dir_all(&images).map_err(DatasetError::write(&images))?;
        let size = (camera.width, camera.height);
        let mut videos: BTreeMap<&Path, BTreeMap<usize, Vec<&str>>> = BTreeMap::new();
        for frame in frames.iter().filter_map(|frame| sequence.frames.get(*frame)) {
            progress.done += 1;
            let Some(Some(view)) = frame.views.get(k) else { continue };
            let path = images.join(format!("{}.{}", frame.id, paths.extension));
            match &view.picture {
                Picture::Video(video, number) => {
                    videos.entry(video).or_default().entry(*number).or_default().push(&frame.id);
                    continue;
                }
                Picture::File(file) if view.warp.is_none() && kind(file) == paths.extension => {
                    check_size(&view.picture, view.picture.size()?, size)?;
                    write_atomically(&path, &bytes_of(file)?).map_err(DatasetError::write(&path))?;
                }
                picture => {
                    let image = picture.load()?;
                    if let Some(warp) = &view.warp {
                        write_image(&path, &warped(&image, warp, size))?;
                    } else {
                        check_size(picture, image.dimensions(), size)?;
                        write_image(&path, &image)?;
                    }
                }
            }
            if let Some(mask) = &view.mask {
                let mask = mask.load(view.picture.size()?)?;
                let mask = view.warp.as_ref().map_or(mask.clone(), |warp| warped_mask(&mask, warp, size));
                write_mask(&masks.join(format!("{}.png", frame.id)), &mask)?;
            }
            tell(on_progress, &progress)?;
        }
        for (video, frames) in videos {
            write_frames(video, &frames, &images, paths.extension, size)?;
            tell(on_progress, &progress)?;
        }
    }
    Ok(())
}

fn tell(on_progress: &mut OnProgress, progress: &Progress) -> Result<(), DatasetError> {
    if on_progress(progress) { Ok(()) } else { Err(DatasetError::Stopped) }
}

/// Frames of a video, each under the names of the capture's frames.
fn write_frames(
    video: &Path,
    frames: &BTreeMap<usize, Vec<&str>>,
    images: &Path,
    extension: &str,
    size: (u32, u32),
) -> Result<(), DatasetError> {
    let footage = Footage::open(video)?;
    check_size(&Picture::Video(video.into(), 0), footage.size(), size)?;
    let numbers: Vec<usize> = frames.keys().copied().collect();
    let mut decoded = footage.frames_at(&numbers)?;
    let mut rgb = vec![];
    while let Some(number) = decoded.next_into(&mut rgb)? {
        let image = RgbImage::from_raw(size.0, size.1, std::mem::take(&mut rgb));
        let image = image.ok_or_else(|| DatasetError::file(video, format!("frame {number} is incomplete")))?;
        for id in frames.get(&number).into_iter().flatten() {
            write_image(&images.join(format!("{id}.{extension}")), &image)?;
        }
        rgb = image.into_raw();
    }
    Ok(())
}

/// A folder without what an earlier import left in it.
fn emptied(folder: &Path) -> Result<PathBuf, DatasetError> {
    match fs::remove_dir_all(folder) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => Err(DatasetError::write(folder)(error)),
        _ => Ok(folder.into()),
    }
}

fn check_size(picture: &Picture, is: (u32, u32), expected: (u32, u32)) -> Result<(), DatasetError> {
    if is == expected {
        return Ok(());
    }
    let problem = format!(
        "has {} x {} pixels, and its camera {} x {}; use the images as they were downloaded",
        is.0, is.1, expected.0, expected.1
    );
    Err(DatasetError::file(&picture.path(), problem))
}

impl Picture {
    /// Width and height, from the file's header.
    pub fn size(&self) -> Result<(u32, u32), DatasetError> {
        let fail = |error: String| unreadable(&self.path(), &error);
        match self {
            Picture::File(path) => {
                let reader = ImageReader::open(path).and_then(|reader| reader.with_guessed_format());
                reader.map_err(|e| fail(e.to_string()))?.into_dimensions().map_err(|e| fail(e.to_string()))
            }
            Picture::Video(path, _) => Ok(Footage::open(path)?.size()),
            Picture::Entry { .. } => {
                let reader = ImageReader::new(Cursor::new(self.bytes()?)).with_guessed_format();
                reader.map_err(|e| fail(e.to_string()))?.into_dimensions().map_err(|e| fail(e.to_string()))
            }
        }
    }

    fn load(&self) -> Result<RgbImage, DatasetError> {
        decoded_bytes(&self.path(), &self.bytes()?)
    }

    fn bytes(&self) -> Result<Vec<u8>, DatasetError> {
        match self {
            Picture::File(path) | Picture::Video(path, _) => bytes_of(path),
            Picture::Entry { archive, start, length, .. } => bytes_within(archive, *start, *length),
        }
    }
}

/// A part of a file.
pub(crate) fn bytes_within(path: &Path, start: u64, length: u64) -> Result<Vec<u8>, DatasetError> {
    let mut bytes = vec![];
    let read = File::open(path).and_then(|mut file| {
        file.seek(SeekFrom::Start(start))?;
        file.take(length.min(LARGEST_IMAGE)).read_to_end(&mut bytes)
    });
    match read {
        Ok(count) if count as u64 == length => Ok(bytes),
        Ok(_) => Err(DatasetError::file(path, "ends too early; download it again")),
        Err(error) => Err(DatasetError::file(path, format!("cannot be read: {error}"))),
    }
}

fn bytes_of(path: &Path) -> Result<Vec<u8>, DatasetError> {
    let bytes = input_file::read(path, LARGEST_IMAGE);
    let bytes = bytes.map_err(|error| DatasetError::file(path, format!("cannot be read: {error}")))?;
    bytes.ok_or_else(|| DatasetError::file(path, "is larger than 256 MiB; download it again"))
}

/// The pixels of an image file.
pub(crate) fn decoded(path: &Path) -> Result<RgbImage, DatasetError> {
    decoded_bytes(path, &bytes_of(path)?)
}

fn decoded_bytes(path: &Path, bytes: &[u8]) -> Result<RgbImage, DatasetError> {
    let image = image::load_from_memory(bytes).map_err(|error| unreadable(path, &error.to_string()))?;
    Ok(image.into_rgb8())
}

fn unreadable(path: &Path, error: &str) -> DatasetError {
    // Some messages have several lines.
    let error = error.split_whitespace().collect::<Vec<_>>().join(" ");
    DatasetError::file(path, format!("is not a readable image ({error}); download it again"))
}

fn write_image(path: &Path, image: &RgbImage) -> Result<(), DatasetError> {
    let mut bytes = Cursor::new(vec![]);
    let written = match kind(path).as_str() {
        "png" => image.write_to(&mut bytes, ImageFormat::Png),
        _ => image.write_with_encoder(JpegEncoder::new_with_quality(&mut bytes, QUALITY)),
    };
    written.map_err(|error| DatasetError::write(path)(io::Error::other(error)))?;
    write_atomically(path, bytes.get_ref()).map_err(DatasetError::write(path))
}

fn write_mask(path: &Path, mask: &GrayImage) -> Result<(), DatasetError> {
    let mut bytes = Cursor::new(vec![]);
    let written = mask.write_to(&mut bytes, ImageFormat::Png);
    written.map_err(|error| DatasetError::write(path)(io::Error::other(error)))?;
    write_atomically(path, bytes.get_ref()).map_err(DatasetError::write(path))
}
