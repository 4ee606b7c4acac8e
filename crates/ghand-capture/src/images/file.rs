//! Reads images and masks within bounds: neither a file's length nor its declared content decides how much memory is
//! used, and a failing decoder is an ordinary error.

use std::fs::File;
use std::io::{BufReader, Cursor, Read, Seek, SeekFrom};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

use ghand_files::input_file;
use image::error::{DecodingError, ImageFormatHint};
use image::metadata::Orientation;
use image::{DynamicImage, ImageDecoder, ImageError, ImageFormat, ImageReader, Limits};

use crate::error::CaptureError;

/// Most bytes per pixel in a file: an EXR with four floats has 16, and may have more layers.
const FILE_BYTES_A_PIXEL: u64 = 64;
/// Allowance for data other than pixels.
const FILE_BYTES_BESIDE: u64 = 1 << 20;

/// The role of a file in its capture, for messages.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Role {
    Image,
    Mask,
}

impl Role {
    pub fn name(self) -> &'static str {
        match self {
            Role::Image => "image",
            Role::Mask => "mask",
        }
    }
}

/// The bytes of the file of an image of `size` pixels (width, height).
pub(crate) fn read_bytes(file: &Path, role: Role, size: (u32, u32)) -> Result<Vec<u8>, CaptureError> {
    let most = FILE_BYTES_BESIDE + FILE_BYTES_A_PIXEL * u64::from(size.0) * u64::from(size.1);
    input_file::read(file, most).map_err(|source| unread(file, role, source))?.ok_or_else(|| {
        let problem =
            format!("has more than {most} bytes for {} x {} pixels; replace it with a plain image", size.0, size.1);
        CaptureError::Invalid { path: file.into(), field: role.name().into(), problem }
    })
}

fn unread(file: &Path, role: Role, source: std::io::Error) -> CaptureError {
    CaptureError::Io {
        path: file.into(),
        action: if role == Role::Mask { "read the mask" } else { "read the image" },
        source,
        remedy: "add the file, or remove its camera or frame from the splits",
    }
}

/// Bytes at the end of a file that contain the end marker of a complete PNG or JPEG.
const TAIL: u64 = 4096;

/// Checks that a file is an image of `size` pixels (width, height) and not truncated, from its header and its end alone
/// if these are conclusive.
pub(crate) fn check(file: &Path, role: Role, size: (u32, u32)) -> Result<(), CaptureError> {
    let mut opened = input_file::open(file).map_err(|source| unread(file, role, source))?;
    if guarded(|| has_header_and_end(&mut opened, size)).map_err(|refusal| refusal.of(file, role, size))? {
        return Ok(());
    }
    // The end marker of a PNG or JPEG may be further inside: some programs append data.
    decode(file, role, &read_bytes(file, role, size)?, size).map(|_| ())
}

/// Whether the end looks like that of a complete file; an error if the header is invalid or has another size.
fn has_header_and_end(file: &mut File, size: (u32, u32)) -> Result<bool, Refusal> {
    let read = |error| Refusal::Broken(ImageError::IoError(error));
    let mut reader = ImageReader::new(BufReader::new(&mut *file)).with_guessed_format().map_err(read)?;
    let format = reader.format();
    reader.limits(limits(u64::from(size.0) * u64::from(size.1)));
    let mut decoder = reader.into_decoder().map_err(Refusal::Broken)?;
    oriented(&mut decoder, size)?;
    drop(decoder);
    let mark: &[u8] = match format {
        Some(ImageFormat::Png) => b"IEND",
        Some(ImageFormat::Jpeg) => &END_OF_JPEG,
        // EXR has no end marker, and its pixels may all be NaN.
        Some(ImageFormat::OpenExr) => return Ok(false),
        _ => return Ok(true),
    };
    let length = file.seek(SeekFrom::End(0)).map_err(read)?;
    file.seek(SeekFrom::Start(length.saturating_sub(TAIL))).map_err(read)?;
    let mut tail = Vec::new();
    file.take(TAIL).read_to_end(&mut tail).map_err(read)?;
    Ok(tail.windows(mark.len()).any(|bytes| bytes == mark))
}

/// Whether an image has an alpha channel, from its header; `None` if it cannot be read.
pub(crate) fn has_alpha(file: &Path, size: (u32, u32)) -> Option<bool> {
    let read = || {
        let opened = input_file::open(file).map_err(|error| Refusal::Broken(ImageError::IoError(error)))?;
        let read = |error| Refusal::Broken(ImageError::IoError(error));
        let mut reader = ImageReader::new(BufReader::new(opened)).with_guessed_format().map_err(read)?;
        reader.limits(limits(u64::from(size.0) * u64::from(size.1)));
        Ok(reader.into_decoder().map_err(Refusal::Broken)?.color_type().has_alpha())
    };
    guarded(read).ok()
}

/// How an image of `size` pixels is to be turned, as OpenCV and browsers do: what its EXIF orientation says.
fn oriented(decoder: &mut impl ImageDecoder, size: (u32, u32)) -> Result<Orientation, Refusal> {
    let orientation = decoder.orientation().unwrap_or(Orientation::NoTransforms);
    let (width, height) = decoder.dimensions();
    let is_upright = |orientation| {
        use Orientation::{FlipHorizontal, FlipVertical, NoTransforms, Rotate180};
        [NoTransforms, Rotate180, FlipHorizontal, FlipVertical].contains(&orientation)
    };
    let found = if is_upright(orientation) { (width, height) } else { (height, width) };
    if found != size {
        return Err(Refusal::OtherSize { found, orientation });
    }
    Ok(orientation)
}

/// Why bytes are not an image.
enum Refusal {
    Broken(ImageError),
    OtherSize { found: (u32, u32), orientation: Orientation },
    NotNumbers,
}

/// The image of these bytes, turned as its EXIF orientation says; it must then be of `size` pixels. `file` is for messages.
/// The first that is turned is told.
pub(crate) fn decode(file: &Path, role: Role, bytes: &[u8], size: (u32, u32)) -> Result<DynamicImage, CaptureError> {
    static TOLD: AtomicBool = AtomicBool::new(false);
    let (picture, orientation) =
        guarded(|| decode_sized(bytes, size)).map_err(|refusal| refusal.of(file, role, size))?;
    if orientation != Orientation::NoTransforms && !TOLD.swap(true, Ordering::Relaxed) {
        log::warn!(
            "{}: turned as its EXIF orientation {} says, as OpenCV does; so are others with that tag",
            file.display(),
            orientation.to_exif()
        );
    }
    Ok(picture)
}

/// Hostile files may trigger bugs in decoders.
fn guarded<T>(read: impl FnOnce() -> Result<T, Refusal>) -> Result<T, Refusal> {
    let failed = |_| Err(broken(ImageFormatHint::Unknown, "the decoder failed"));
    catch_unwind(AssertUnwindSafe(read)).unwrap_or_else(failed)
}

impl Refusal {
    /// The error of a file that should have `size` pixels.
    fn of(self, file: &Path, role: Role, size: (u32, u32)) -> CaptureError {
        match self {
            Refusal::Broken(source) => CaptureError::Image { path: file.into(), what: role.name(), source },
            Refusal::OtherSize { found: (width, height), orientation } => {
                let (turned, remedy) = match orientation {
                    Orientation::NoTransforms => (String::new(), "resize it or"),
                    tag => {
                        let turned = format!(", turned as its EXIF orientation {} says,", tag.to_exif());
                        (turned, "remove that tag if the calibration is for the pixels as stored, or")
                    }
                };
                let problem = format!(
                    "is {width} x {height} pixels{turned} but its camera says {} x {}; {remedy} correct width, height and \
                     intrinsics of the camera",
                    size.0, size.1
                );
                CaptureError::Invalid { path: file.into(), field: role.name().into(), problem }
            }
            Refusal::NotNumbers => {
                let problem = "has only NaN pixels; render or export it again";
                CaptureError::Invalid { path: file.into(), field: role.name().into(), problem: problem.into() }
            }
        }
    }
}

fn broken(hint: ImageFormatHint, problem: &str) -> Refusal {
    Refusal::Broken(ImageError::Decoding(DecodingError::new(hint, problem)))
}

fn decode_sized(bytes: &[u8], size: (u32, u32)) -> Result<(DynamicImage, Orientation), Refusal> {
    let pixels = u64::from(size.0) * u64::from(size.1);
    let mut reader = ImageReader::new(Cursor::new(bytes))
        .with_guessed_format()
        .map_err(|error| Refusal::Broken(ImageError::IoError(error)))?;
    match reader.format() {
        Some(ImageFormat::OpenExr) => check_exr(bytes, pixels)?,
        Some(ImageFormat::Jpeg) if !has_end(bytes) => {
            return Err(broken(ImageFormatHint::Exact(ImageFormat::Jpeg), "it is truncated"));
        }
        _ => {}
    }
    reader.limits(limits(pixels));
    let mut decoder = reader.into_decoder().map_err(Refusal::Broken)?;
    // Only the header has been read here.
    let orientation = oriented(&mut decoder, size)?;
    let mut picture = DynamicImage::from_decoder(decoder).map_err(Refusal::Broken)?;
    picture.apply_orientation(orientation);
    if has_numbers(&picture) { Ok((picture, orientation)) } else { Err(Refusal::NotNumbers) }
}

/// Whether any pixel has numbers for red, green and blue.
fn has_numbers(picture: &DynamicImage) -> bool {
    let any = |values: &[f32], channels: usize| {
        values.chunks_exact(channels).any(|pixel| pixel.iter().take(3).all(|v| !v.is_nan()))
    };
    match picture {
        DynamicImage::ImageRgb32F(image) => any(image.as_raw(), 3),
        DynamicImage::ImageRgba32F(image) => any(image.as_raw(), 4),
        _ => true,
    }
}

/// Memory limit of a decoder for an image of this many pixels.
fn limits(pixels: u64) -> Limits {
    let mut limits = Limits::no_limits();
    limits.max_alloc = Some(FILE_BYTES_BESIDE + FILE_BYTES_A_PIXEL * pixels);
    limits
}

/// The end marker of a JPEG.
const END_OF_JPEG: [u8; 2] = [0xFF, 0xD9];

/// Whether a JPEG has its end marker. The decoder fills missing parts of a truncated file with grey.
fn has_end(jpeg: &[u8]) -> bool {
    const START_OF_SCAN: u8 = 0xDA;
    // Segments with their lengths come first; their content (such as a thumbnail) may have its own end marker.
    let mut rest = jpeg.get(2..).unwrap_or_default();
    while let &[0xFF, marker, high, low, ..] = rest {
        if marker == START_OF_SCAN {
            // From here on, a byte 0xFF starts a marker and is never part of the picture.
            return rest.windows(2).any(|pair| pair == END_OF_JPEG);
        }
        // Any number of bytes 0xFF may precede a marker.
        let length = if marker == 0xFF { 1 } else { 2 + usize::from(u16::from_be_bytes([high, low])) };
        rest = rest.get(length..).unwrap_or_default();
    }
    false
}

/// Largest ratio of stored to visible pixels of an EXR; more is a mistake or an attack on memory.
const EXR_OVERSCAN: u64 = 4;

/// An EXR stores a data window that may differ from its display window; the limits of the image library ignore it.
fn check_exr(bytes: &[u8], pixels: u64) -> Result<(), Refusal> {
    let hint = || ImageFormatHint::Exact(ImageFormat::OpenExr);
    let meta = exr::meta::MetaData::read_from_buffered(Cursor::new(bytes), false)
        .map_err(|error| broken(hint(), &error.to_string()))?;
    let too_large = meta.headers.iter().any(|header| {
        let stored = header.layer_size.width() as u64 * header.layer_size.height() as u64;
        stored > EXR_OVERSCAN * pixels
    });
    if too_large { Err(broken(hint(), "it stores far more pixels than it shows")) } else { Ok(()) }
}

#[cfg(test)]
mod tests {
    use image::codecs::jpeg::JpegEncoder;
    use image::codecs::png::PngEncoder;
    use image::{ExtendedColorType, ImageEncoder};

    use super::*;

    /// A TIFF header with one entry, the orientation.
    fn exif(tag: u8) -> Vec<u8> {
        [&b"II*\0\x08\0\0\0\x01\0\x12\x01\x03\0\x01\0\0\0"[..], &[tag, 0, 0, 0], &[0; 4]].concat()
    }

    fn encoded(mut encoder: impl ImageEncoder, tag: u8, picture: &DynamicImage) {
        encoder.set_exif_metadata(exif(tag)).unwrap();
        let size = [picture.width(), picture.height()];
        encoder.write_image(picture.as_bytes(), size[0], size[1], ExtendedColorType::Rgb8).unwrap();
    }

    fn read(bytes: &[u8], size: (u32, u32)) -> Result<DynamicImage, String> {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("image");
        std::fs::write(&file, bytes).unwrap();
        let checked = check(&file, Role::Image, size).map_err(|error| error.to_string());
        let decoded = decode(&file, Role::Image, bytes, size).map_err(|error| error.to_string());
        assert_eq!(checked.err(), decoded.as_ref().err().cloned());
        decoded
    }

    #[test]
    fn images_are_turned_as_their_exif_orientation_says() {
        let colors: Vec<u8> = (0..12 * 8 * 3).map(|k| (k * 7 % 251) as u8).collect();
        let stored = DynamicImage::from(image::RgbImage::from_raw(12, 8, colors).unwrap());
        for tag in 1..=8 {
            let mut expected = stored.clone();
            expected.apply_orientation(Orientation::from_exif(tag).unwrap());
            let size = (expected.width(), expected.height());
            let mut png = vec![];
            encoded(PngEncoder::new(&mut png), tag, &stored);
            assert_eq!(read(&png, size).unwrap(), expected, "{tag}");
            let mut jpeg = vec![];
            encoded(JpegEncoder::new_with_quality(&mut jpeg, 100), tag, &stored);
            assert_eq!(read(&jpeg, size).unwrap().width(), size.0, "{tag}");
            if tag >= 5 {
                let error = read(&jpeg, (12, 8)).unwrap_err();
                let says =
                    format!("8 x 12 pixels, turned as its EXIF orientation {tag} says, but its camera says 12 x 8");
                assert!(error.contains(&says), "{error}");
            }
        }
        // What is stored at the top left of a picture with tag 6 is seen at the top right, with tag 3 at the bottom right.
        for (tag, size, at) in [(6, (8, 12), [7, 0]), (3, (12, 8), [11, 7])] {
            let mut png = vec![];
            encoded(PngEncoder::new(&mut png), tag, &stored);
            let seen = read(&png, size).unwrap().into_rgb8();
            assert_eq!(seen.get_pixel(at[0], at[1]), stored.to_rgb8().get_pixel(0, 0), "{tag}");
        }
    }
}
