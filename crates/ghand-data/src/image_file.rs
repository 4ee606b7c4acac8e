//! Images and masks from files, within bounds: neither a file's length nor what it claims to hold decides how much memory
//! is used, and a decoder that fails is an error like any other.

use std::io::{Cursor, Read};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

use ghand_core::input_file;
use image::error::{DecodingError, ImageFormatHint};
use image::{DynamicImage, ImageDecoder, ImageError, ImageFormat, ImageReader, Limits};

use crate::error::CaptureError;

/// Most bytes that a pixel takes in a file: an EXR with four floats has 16, and may have other layers.
const FILE_BYTES_A_PIXEL: u64 = 64;
/// Room for what is in a file beside pixels.
const FILE_BYTES_BESIDE: u64 = 1 << 20;

/// Bytes that are read to find the header of an image: of nearly all the first, of one with a picture or a profile before its
/// header the second.
const HEADER_BYTES: [u64; 2] = [1 << 16, 1 << 24];
/// Memory for what stands before the header's end.
const HEADER_MEMORY: u64 = 1 << 26;

/// What a file is to its capture, for messages.
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
    input_file::read(file, most).map_err(io(file, role))?.ok_or_else(|| {
        let problem =
            format!("has more than {most} bytes for {} x {} pixels; replace it by a plain image", size.0, size.1);
        CaptureError::Invalid { path: file.into(), field: role.name().into(), problem }
    })
}

fn io(file: &Path, role: Role) -> impl Fn(std::io::Error) -> CaptureError {
    move |source| CaptureError::Io {
        path: file.into(),
        action: if role == Role::Mask { "read the mask" } else { "read the image" },
        source,
        remedy: "add the file, or take its camera or frame out of the splits",
    }
}

/// Width and height that the header of an image says. Of most files, only the beginning is read.
pub(crate) fn header_size(file: &Path, role: Role) -> Result<(u32, u32), CaptureError> {
    let mut refusal = broken(ImageFormatHint::Unknown, "its header cannot be read");
    for most in HEADER_BYTES {
        let mut bytes = Vec::new();
        input_file::open(file).and_then(|f| f.take(most).read_to_end(&mut bytes)).map_err(io(file, role))?;
        match guarded(|| Ok(decoder(&bytes, HEADER_MEMORY)?.dimensions())) {
            Ok(size) => return Ok(size),
            Err(error) => refusal = error,
        }
        if (bytes.len() as u64) < most {
            break;
        }
    }
    Err(refusal.error(file, role, (0, 0)))
}

/// Refuses an image that is not there, or whose header is broken or of another size, without decoding it. What is cut short
/// behind its header passes.
pub(crate) fn check_header(file: &Path, role: Role, size: (u32, u32)) -> Result<(), CaptureError> {
    let found = header_size(file, role)?;
    if found == size { Ok(()) } else { Err(Refusal::OtherSize(found.0, found.1).error(file, role, size)) }
}

/// Why bytes are no image.
enum Refusal {
    Broken(ImageError),
    OtherSize(u32, u32),
}

impl Refusal {
    /// `size` is the camera's.
    fn error(self, file: &Path, role: Role, size: (u32, u32)) -> CaptureError {
        match self {
            Refusal::Broken(source) => CaptureError::Image { path: file.into(), what: role.name(), source },
            Refusal::OtherSize(width, height) => {
                let problem = format!(
                    "is {width} x {height} pixels but its camera says {} x {}; resize it or correct width, height and intrinsics \
                     of the camera",
                    size.0, size.1
                );
                CaptureError::Invalid { path: file.into(), field: role.name().into(), problem }
            }
        }
    }
}

/// The image of these bytes, which must be of `size` pixels. `file` is for messages.
pub(crate) fn decode(file: &Path, role: Role, bytes: &[u8], size: (u32, u32)) -> Result<DynamicImage, CaptureError> {
    guarded(|| decode_sized(bytes, size)).map_err(|refusal| refusal.error(file, role, size))
}

/// Hostile files run decoders into bugs of their own.
fn guarded<T>(read: impl FnOnce() -> Result<T, Refusal>) -> Result<T, Refusal> {
    let gave_up = |_| Err(broken(ImageFormatHint::Unknown, "the decoder gave up on the file"));
    catch_unwind(AssertUnwindSafe(read)).unwrap_or_else(gave_up)
}

fn broken(hint: ImageFormatHint, problem: &str) -> Refusal {
    Refusal::Broken(ImageError::Decoding(DecodingError::new(hint, problem)))
}

fn decode_sized(bytes: &[u8], size: (u32, u32)) -> Result<DynamicImage, Refusal> {
    let pixels = u64::from(size.0) * u64::from(size.1);
    match image::guess_format(bytes) {
        Ok(ImageFormat::OpenExr) => check_exr(bytes, pixels)?,
        Ok(ImageFormat::Jpeg) if !has_end(bytes) => {
            return Err(broken(ImageFormatHint::Exact(ImageFormat::Jpeg), "it is cut short"));
        }
        _ => {}
    }
    let decoder = decoder(bytes, FILE_BYTES_BESIDE + FILE_BYTES_A_PIXEL * pixels)?;
    let (width, height) = decoder.dimensions();
    if (width, height) != size {
        return Err(Refusal::OtherSize(width, height));
    }
    DynamicImage::from_decoder(decoder).map_err(Refusal::Broken)
}

/// A decoder that has read the header, and may take so much memory.
fn decoder(bytes: &[u8], memory: u64) -> Result<impl ImageDecoder, Refusal> {
    let mut reader = ImageReader::new(Cursor::new(bytes))
        .with_guessed_format()
        .map_err(|error| Refusal::Broken(ImageError::IoError(error)))?;
    let mut limits = Limits::no_limits();
    limits.max_alloc = Some(memory);
    reader.limits(limits);
    reader.into_decoder().map_err(Refusal::Broken)
}

/// Whether the end of the picture is in a JPEG. The decoder fills what is missing of a truncated one with grey.
fn has_end(jpeg: &[u8]) -> bool {
    const START_OF_SCAN: u8 = 0xDA;
    const END_OF_IMAGE: [u8; 2] = [0xFF, 0xD9];
    // Segments with their lengths come first; what they hold (a thumbnail, say) may have an end of its own.
    let mut rest = jpeg.get(2..).unwrap_or_default();
    while let &[0xFF, marker, high, low, ..] = rest {
        if marker == START_OF_SCAN {
            // From here a byte of 0xFF is a mark, never part of the picture.
            return rest.windows(2).any(|pair| pair == END_OF_IMAGE);
        }
        // A mark may be preceded by any number of bytes of 0xFF.
        let length = if marker == 0xFF { 1 } else { 2 + usize::from(u16::from_be_bytes([high, low])) };
        rest = rest.get(length..).unwrap_or_default();
    }
    false
}

/// Most times that the pixels an EXR stores may be as many as those it shows; more are a mistake, or made to use up memory.
const EXR_OVERSCAN: u64 = 4;

/// An EXR shows a window, but stores another one, which the limits of the image library do not look at.
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
