//! Images of all formats, and files that claim to be images.

use std::path::{Path, PathBuf};

use ghand_capture::Capture;
use ghand_capture::capture::ImagePaths;
use image::{ImageBuffer, Rgb, RgbImage, Rgba};
use rand::{RngExt, SeedableRng};
use tempfile::TempDir;

use crate::fixtures::{assert_says, synthetic};

/// The synthetic capture with its images in another folder.
fn capture_in(folder: &Path, image: &str, mask: Option<&str>) -> Capture {
    Capture {
        root: folder.into(),
        images: ImagePaths::plain(image, mask),
        background: [0.0, 0.5, 1.0],
        ..synthetic().clone()
    }
}

fn sample(extension: &str) -> (TempDir, PathBuf, Capture) {
    let folder = tempfile::tempdir().unwrap();
    let name = format!("image.{extension}");
    let capture = capture_in(folder.path(), &name, None);
    let path = folder.path().join(name);
    (folder, path, capture)
}

fn message(capture: &Capture) -> String {
    capture.load_view(0, 0).unwrap_err().to_string()
}

#[test]
fn exr_has_linear_light_and_premultiplied_alpha() {
    let (folder, path, capture) = sample("exr");
    let pixel = |x: u32, _: u32| match x {
        0 => Rgba([0.0f32, 0.5, 1.0, 1.0]),
        1 => Rgba([0.0, 0.25, 2.0, 0.5]),
        2 => Rgba([0.0, 0.0, 0.0, 0.0]),
        _ => Rgba([0.002, -1.0, f32::NAN, 1.0]),
    };
    ImageBuffer::from_fn(128, 192, pixel).save(&path).unwrap();
    let view = capture.load_view(0, 0).unwrap();
    // 0.5 of linear light is displayed as 188; half of it is in front of half of the background (0, 127.5, 255).
    assert_eq!(view.rgba[0], [0, 188, 255, 255]);
    assert_eq!(view.rgba[1], [0, 158, 255, 255]);
    assert_eq!(view.rgba[2], [0, 128, 255, 0]);
    // 12.92 x 0.002 x 255 = 6.6
    assert_eq!(view.rgba[3], [7, 0, 0, 255]);
    // Without alpha, and as a mask.
    ImageBuffer::from_fn(128, 192, |x, _| if x < 9 { Rgb([0.6f32; 3]) } else { Rgb([0.4; 3]) }).save(&path).unwrap();
    let capture = capture_in(folder.path(), "image.exr", Some("image.exr"));
    let view = capture.load_view(0, 0).unwrap();
    assert_eq!((view.rgba[0], view.rgba[9]), ([203, 203, 203, 255], [0, 128, 255, 0]));
}

#[test]
fn sixteen_bit_png_and_grey_jpeg_are_read() {
    let (_folder, path, capture) = sample("png");
    ImageBuffer::from_fn(128, 192, |x, _| Rgb([x as u16 * 257, 0, 65535])).save(&path).unwrap();
    assert_eq!(capture.load_view(0, 0).unwrap().rgba[77], [77, 0, 255, 255]);
    let (_folder, path, capture) = sample("jpg");
    image::GrayImage::from_pixel(128, 192, image::Luma([99])).save(&path).unwrap();
    assert_eq!(capture.load_view(0, 0).unwrap().rgba[5], [99, 99, 99, 255]);
}

#[test]
fn a_header_of_a_gigantic_image_is_rejected_before_any_pixel_is_read() {
    let (_folder, path, capture) = sample("png");
    RgbImage::new(128, 192).save(&path).unwrap();
    let mut bytes = std::fs::read(&path).unwrap();
    // Width and height of the header chunk, and its checksum.
    bytes[16..24].copy_from_slice(&[0, 1, 0x86, 0xA0, 0, 1, 0x86, 0xA0]);
    let crc = crc32(&bytes[12..29]);
    bytes[29..33].copy_from_slice(&crc.to_be_bytes());
    std::fs::write(&path, &bytes).unwrap();
    assert_says(&message(&capture), &["image.png", "100000 x 100000", "128 x 192"]);
    let (_folder, path, capture) = sample("jpg");
    RgbImage::new(20_000, 20).save(&path).unwrap();
    assert_says(&message(&capture), &["image.jpg", "20000 x 20"]);
}

/// The checksum of a PNG chunk.
pub fn crc32(bytes: &[u8]) -> u32 {
    let mut crc = u32::MAX;
    for byte in bytes {
        crc ^= u32::from(*byte);
        for _ in 0..8 {
            crc = if crc & 1 == 1 { (crc >> 1) ^ 0xEDB8_8320 } else { crc >> 1 };
        }
    }
    !crc
}

#[test]
fn an_exr_with_more_data_than_its_window_shows_is_rejected() {
    let (_folder, path, capture) = sample("exr");
    ImageBuffer::from_pixel(128, 192, Rgb([0.5f32; 3])).save(&path).unwrap();
    let mut bytes = std::fs::read(&path).unwrap();
    let name = b"dataWindow\0box2i\0";
    let at = bytes.windows(name.len()).position(|w| w == name).unwrap() + name.len() + 4;
    // The last column and row of the data window.
    bytes[at + 8..at + 16].copy_from_slice(&[0xFF, 0xFF, 0xFF, 0x0F, 0xFF, 0xFF, 0xFF, 0x0F]);
    std::fs::write(&path, &bytes).unwrap();
    assert_says(&message(&capture), &["image.exr", "replace the file"]);
}

#[test]
fn a_file_far_longer_than_its_image_is_rejected() {
    let (_folder, path, capture) = sample("jpg");
    // The file is sparse: it uses no disk space.
    let file = std::fs::File::create(&path).unwrap();
    file.set_len(1 << 40).unwrap();
    assert_says(&message(&capture), &["image.jpg", "128 x 192", "replace it"]);
}

#[test]
fn truncated_images_are_rejected_and_bytes_after_the_end_are_ignored() {
    for extension in ["png", "jpg", "exr"] {
        let (_folder, path, capture) = sample(extension);
        let noisy = |x: u32, y: u32| Rgb([(x * 7) as f32 / 896.0, (y * 5 % 192) as f32 / 192.0, 0.3]);
        let picture = image::DynamicImage::from(ImageBuffer::from_fn(128, 192, noisy));
        match extension {
            "exr" => picture.save(&path).unwrap(),
            _ => picture.into_rgb8().save(&path).unwrap(),
        }
        let whole = std::fs::read(&path).unwrap();
        for part in [0, 3, whole.len() / 4, whole.len() / 2, whole.len() - 40] {
            std::fs::write(&path, &whole[..part]).unwrap();
            assert_says(&message(&capture), &[&format!("image.{extension}"), "replace the file"]);
        }
        std::fs::write(&path, [whole.as_slice(), &[7; 100]].concat()).unwrap();
        capture.load_view(0, 0).unwrap();
    }
}

#[test]
fn damaged_images_are_errors_and_never_panics() {
    let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(5);
    for extension in ["png", "jpg", "exr"] {
        let (_folder, path, capture) = sample(extension);
        let picture =
            image::DynamicImage::from(RgbImage::from_fn(128, 192, |x, y| Rgb([x as u8, y as u8, (x * y) as u8])));
        match extension {
            "exr" => picture.into_rgb32f().save(&path).unwrap(),
            _ => picture.save(&path).unwrap(),
        }
        let whole = std::fs::read(&path).unwrap();
        assert!(capture.load_view(0, 0).is_ok());
        let mut refused = 0;
        for _ in 0..150 {
            let mut bytes = whole.clone();
            for _ in 0..random.random_range(1..20) {
                let at = random.random_range(0..bytes.len().min(2000));
                bytes[at] = random.random();
            }
            if random.random_range(0..3) == 0 {
                bytes.truncate(random.random_range(0..bytes.len()));
            }
            std::fs::write(&path, &bytes).unwrap();
            refused += usize::from(capture.load_view(0, 0).is_err());
        }
        assert!(refused > 50, "{extension}: {refused}");
    }
}
