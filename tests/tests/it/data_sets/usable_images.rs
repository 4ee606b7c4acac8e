//! Unusable images that are detected without decoding, so that captures keep only usable ones.

use std::path::Path;

use ghand_capture::Capture;
use ghand_capture::capture::ImagePaths;
use ghand_capture::images::skipped::SkipReason;
use image::{GrayImage, RgbImage};

use crate::fixtures::{assert_says, synthetic, write};

/// The synthetic capture with copies of its images and masks in a folder.
fn copied(folder: &Path) -> Capture {
    let paths = ImagePaths::plain("{camera}/{frame}.png", Some("{camera}/{frame}_mask.png"));
    let capture = Capture { root: folder.into(), images: paths, ..synthetic().clone() };
    for view in capture.splits.values().flat_map(|split| &split.views) {
        let file = capture.image_file(view.camera, view.frame).unwrap();
        std::fs::create_dir_all(file.parent().unwrap()).unwrap();
        RgbImage::new(128, 192).save(file).unwrap();
        GrayImage::new(128, 192).save(capture.mask_file(view.camera, view.frame).unwrap().unwrap()).unwrap();
    }
    capture
}

#[test]
fn a_complete_capture_is_unchanged() {
    let mut capture = synthetic().clone();
    let counts = capture.skip_unusable_images(&["train", "test"]).unwrap();
    assert_eq!((counts.checked, counts.total()), (18 + 4, 0));
    assert_eq!(capture, *synthetic());
}

#[test]
fn missing_and_broken_files_are_dropped_with_one_count() {
    let folder = tempfile::tempdir().unwrap();
    let whole = copied(folder.path());
    let train = whole.splits["train"].clone();
    let pair = |k: usize| (train.views[k].camera, train.views[k].frame);
    let image = |k: usize| whole.image_file(pair(k).0, pair(k).1).unwrap();
    let mask = |k: usize| whole.mask_file(pair(k).0, pair(k).1).unwrap().unwrap();
    std::fs::remove_file(image(0)).unwrap();
    std::fs::remove_file(mask(1)).unwrap();
    RgbImage::new(64, 192).save(image(2)).unwrap();
    GrayImage::new(128, 100).save(mask(3)).unwrap();
    write(&image(4), b"no image");
    write(&image(5), b"");
    std::fs::remove_file(image(6)).unwrap();
    std::fs::create_dir(image(6)).unwrap();
    // Only a header, or a part of it.
    let bytes = std::fs::read(image(7)).unwrap();
    write(&image(7), &bytes[..20]);
    let mut capture = whole.clone();
    let counts = capture.skip_unusable_images(&["train", "test"]).unwrap();
    let reasons: Vec<(SkipReason, usize)> = counts.reasons.clone().into_iter().collect();
    assert_eq!(reasons, [(SkipReason::Missing, 2), (SkipReason::Broken, 6)]);
    let said = counts.to_string();
    assert_says(&said, &["8 of 22 images are skipped: 2 without a file, 6 with a broken file; the first: "]);
    let left: Vec<(usize, usize)> = capture.splits["train"].views.iter().map(|v| (v.camera, v.frame)).collect();
    let mut expected: Vec<(usize, usize)> = (8..train.views.len()).map(pair).collect();
    expected.sort_unstable_by_key(|(camera, frame)| (*frame, *camera));
    assert_eq!(left, expected);
    assert_eq!(capture.splits["test"], whole.splits["test"]);
    // Splits that were not requested lose known unusable images, and are not checked otherwise.
    for (camera, frame) in left {
        std::fs::remove_file(whole.mask_file(camera, frame).unwrap().unwrap()).unwrap();
    }
    assert_says(
        &whole.clone().skip_unusable_images(&["train"]).unwrap_err().to_string(),
        &["\"train\"", "18 of 18 images"],
    );
    assert_eq!(whole.clone().skip_unusable_images(&["test"]).unwrap().total(), 0);
    assert_says(&whole.clone().skip_unusable_images(&["none"]).unwrap_err().to_string(), &["\"none\"", "test, train"]);
}

#[test]
fn truncated_images_are_skipped() {
    for extension in ["png", "jpg", "exr"] {
        let folder = tempfile::tempdir().unwrap();
        let name = format!("image.{extension}");
        let root = folder.path().to_path_buf();
        let images = ImagePaths::plain(&name, None);
        let mut capture = Capture { root: root.clone(), images, ..synthetic().clone() };
        let file = root.join(&name);
        // A file longer than the part that is read for most headers.
        let noise =
            |x: u32, y: u32| image::Rgb([(x * 7919 + y * 104_729) as u8, (x * y * 31) as u8, (x ^ (y * 17)) as u8]);
        let picture = image::DynamicImage::from(RgbImage::from_fn(128, 192, noise));
        match extension {
            "exr" => picture.into_rgb32f().save(&file).unwrap(),
            _ => picture.save(&file).unwrap(),
        }
        assert_eq!(capture.skip_unusable_images(&["train"]).unwrap().total(), 0, "{extension}");
        let bytes = std::fs::read(&file).unwrap();
        std::fs::write(&file, &bytes[..bytes.len() * 3 / 4]).unwrap();
        let error = capture.skip_unusable_images(&["train"]).unwrap_err().to_string();
        assert_says(&error, &["no images are left", "18 with a broken file", &name]);
        assert_says(&capture.load_view(0, 0).unwrap_err().to_string(), &[&name, "replace the file"]);
    }
}

#[test]
fn a_header_after_a_long_profile_is_found() {
    let folder = tempfile::tempdir().unwrap();
    let images = ImagePaths::plain("image.jpg", None);
    let mut capture = Capture { root: folder.path().into(), images, ..synthetic().clone() };
    let file = folder.path().join("image.jpg");
    RgbImage::new(128, 192).save(&file).unwrap();
    let bytes = std::fs::read(&file).unwrap();
    // Comments of 64 kB each after the start marker.
    let comment = [&[0xFF, 0xFE, 0xFF, 0xFF][..], &[b' '; 65_533]].concat();
    let long = [&bytes[..2], &comment, &comment, &bytes[2..]].concat();
    std::fs::write(&file, long).unwrap();
    assert_eq!(capture.skip_unusable_images(&["train"]).unwrap().total(), 0);
    capture.load_view(0, 0).unwrap();
}
