//! Findings that make training pointless, and findings that are only odd, each in a capture damaged in exactly that
//! way.

use std::path::Path;

use ghand_capture::Capture;
use ghand_capture::inspection::{CaptureInspection, Severity};
use glam::{DMat3, DVec3};
use image::{GrayImage, ImageBuffer, Luma, Rgb, RgbImage};

use super::inspection::copy;
use crate::fixtures::{assert_says, synthetic};

/// The findings of the training split: those that make training pointless, and those that are only odd.
fn found(capture: &Capture) -> [String; 2] {
    let found = CaptureInspection::of_split(capture, "train", 60).unwrap().findings;
    [Severity::Pointless, Severity::Odd].map(|severity| {
        let of = found.iter().filter(|finding| finding.severity == severity);
        of.map(ToString::to_string).collect::<Vec<_>>().join("; ")
    })
}

/// Asserts which findings make training pointless; none if `parts` is empty.
fn assert_pointless(capture: &Capture, parts: &[&str]) {
    let [pointless, odd] = found(capture);
    assert_eq!(pointless.is_empty(), parts.is_empty(), "{pointless} / {odd}");
    assert_says(&pointless, parts);
}

fn assert_only_odd(capture: &Capture, parts: &[&str]) {
    let [pointless, odd] = found(capture);
    assert!(pointless.is_empty(), "{pointless}");
    assert_says(&odd, parts);
    assert_eq!(odd.is_empty(), parts.is_empty(), "{odd}");
}

/// Replaces the first `count` images or masks of the training split.
fn rewrite(capture: &Capture, count: usize, write: impl Fn(&Path, &Path)) {
    for view in &capture.splits["train"].views[..count] {
        let mask = capture.mask_file(view.camera, view.frame).unwrap().unwrap();
        write(&capture.image_file(view.camera, view.frame).unwrap(), &mask);
    }
}

#[test]
fn a_valid_capture_has_no_findings_and_the_sample_limits_decoding() {
    assert_eq!(found(synthetic()), ["", ""]);
    let sampled = CaptureInspection::of_split(synthetic(), "train", 7).unwrap();
    assert_eq!(
        sampled.splits.iter().map(|split| (split.name.as_str(), split.views.len())).collect::<Vec<_>>(),
        [("train", 7)]
    );
    // A split that is part of another one is checked, too, if it is requested.
    let part = CaptureInspection::of_split(synthetic(), "train5", 60).unwrap();
    assert!(!part.splits[0].is_part && part.splits[0].views.len() == 15);
    assert!(CaptureInspection::of_split(synthetic(), "exam", 60).is_err());
}

#[test]
fn masks_of_zero_and_one_are_accepted_and_reported() {
    let (capture, _folder) = copy();
    let view = capture.splits["train"].views[3];
    let before = capture.load_view(view.camera, view.frame).unwrap();
    rewrite(&capture, 18, |_, mask| {
        let mut values = image::open(mask).unwrap().into_luma8();
        values.pixels_mut().for_each(|value| value.0[0] /= 255);
        values.save(mask).unwrap();
    });
    assert!(before == capture.load_view(view.camera, view.frame).unwrap());
    assert_only_odd(&capture, &["18 of 18 masks have 0 and 1"]);
}

#[test]
fn masks_of_any_bit_depth_and_with_palettes_give_the_same_findings() {
    let (capture, _folder) = copy();
    let view = capture.splits["train"].views[0];
    let mask = capture.mask_file(view.camera, view.frame).unwrap().unwrap();
    let before = capture.load_view(view.camera, view.frame).unwrap();
    let values = image::open(&mask).unwrap().into_luma8();
    let same = |name: &str| {
        let after = capture.load_view(view.camera, view.frame).unwrap();
        assert!(before.rgba.iter().any(|p| p[3] == 255) && before == after, "{name}");
    };
    let wide = |on: u16| {
        let wide = ImageBuffer::<Luma<u16>, Vec<u16>>::from_fn(128, 192, |x, y| {
            Luma([if values.get_pixel(x, y).0[0] >= 128 { on } else { 0 }])
        });
        wide.save(&mask).unwrap();
        same(&format!("16 bits with {on}"));
    };
    wide(65535);
    wide(255);
    wide(1);
    let on = |x: u32, y: u32| values.get_pixel(x, y).0[0] >= 128;
    std::fs::write(&mask, packed_png(128, 192, None, on)).unwrap();
    same("one bit");
    std::fs::write(&mask, packed_png(128, 192, Some([[0, 0, 0], [128, 0, 0]]), on)).unwrap();
    same("a palette with a dark red label");
    std::fs::write(&mask, packed_png(128, 192, Some([[0, 0, 0], [1, 1, 1]]), on)).unwrap();
    same("a palette of the labels themselves");
}

/// A PNG with one bit per pixel: grey, or indices into a palette.
fn packed_png(width: u32, height: u32, palette: Option<[[u8; 3]; 2]>, on: impl Fn(u32, u32) -> bool) -> Vec<u8> {
    let mut rows = Vec::new();
    for y in 0..height {
        // Filter type 0: none.
        rows.push(0);
        for byte in 0..width.div_ceil(8) {
            rows.push((0..8).fold(0, |bits, i| bits << 1 | u8::from(on(8 * byte + i, y))));
        }
    }
    let chunk = |name: &[u8], data: &[u8]| {
        let body = [name, data].concat();
        [&(data.len() as u32).to_be_bytes()[..], &body, &super::bad_images::crc32(&body).to_be_bytes()].concat()
    };
    let color = if palette.is_some() { 3 } else { 0 };
    let header = [&width.to_be_bytes()[..], &height.to_be_bytes(), &[1, color, 0, 0, 0]].concat();
    let palette = palette.map_or(vec![], |palette| chunk(b"PLTE", palette.as_flattened()));
    // Zlib's format without compression, in blocks of at most 65535 bytes: 3264 bytes fit into one.
    let length = (rows.len() as u16).to_le_bytes();
    let inverse = (!(rows.len() as u16)).to_le_bytes();
    let (a, b) = rows.iter().fold((1u32, 0u32), |(a, b), byte| {
        let a = (a + u32::from(*byte)) % 65521;
        (a, (b + a) % 65521)
    });
    let data = [&[0x78, 1, 1], &length[..], &inverse, &rows, &(b << 16 | a).to_be_bytes()].concat();
    [&b"\x89PNG\r\n\x1a\n"[..], &chunk(b"IHDR", &header), &palette, &chunk(b"IDAT", &data), &chunk(b"IEND", b"")]
        .concat()
}

#[test]
fn empty_and_full_masks_are_odd_and_pointless_if_nearly_all_are() {
    let (capture, _folder) = copy();
    rewrite(&capture, 3, |_, mask| GrayImage::new(128, 192).save(mask).unwrap());
    assert_only_odd(&capture, &["3 of 18 masks are empty"]);
    rewrite(&capture, 17, |_, mask| GrayImage::new(128, 192).save(mask).unwrap());
    assert_pointless(&capture, &["17 of 18 masks are empty", "128"]);
    let (capture, _folder) = copy();
    rewrite(&capture, 17, |_, mask| GrayImage::from_pixel(128, 192, Luma([255])).save(mask).unwrap());
    assert_pointless(&capture, &["17 of 18 masks are full"]);
}

#[test]
fn a_fault_of_one_split_is_found_among_the_others() {
    let (capture, _folder) = copy();
    for view in &capture.splits["test"].views {
        let mask = capture.mask_file(view.camera, view.frame).unwrap().unwrap();
        GrayImage::new(128, 192).save(mask).unwrap();
    }
    assert_only_odd(&capture, &[]);
    let all = CaptureInspection::of(&capture, 60).unwrap().findings;
    let empty = all.iter().find(|finding| finding.text.contains("4 of 22 masks are empty")).unwrap();
    assert_eq!(empty.severity, Severity::Pointless);
}

#[test]
fn black_images_and_images_of_one_colour_are_pointless() {
    let (capture, _folder) = copy();
    rewrite(&capture, 17, |image, _| RgbImage::from_pixel(128, 192, Rgb([19; 3])).save(image).unwrap());
    assert_pointless(&capture, &["17 of 18 images, or their hands, are black"]);
    rewrite(&capture, 17, |image, _| RgbImage::from_pixel(128, 192, Rgb([90, 200, 30])).save(image).unwrap());
    assert_pointless(&capture, &["17 of 18 images have a single colour"]);
    let (capture, _folder) = copy();
    rewrite(&capture, 2, |image, _| RgbImage::new(128, 192).save(image).unwrap());
    assert_only_odd(&capture, &["2 of 18 images, or their hands, are black"]);
}

#[test]
fn poses_in_degrees_are_pointless_and_a_single_long_rotation_is_odd() {
    let mut capture = synthetic().clone();
    for frame in &mut capture.frames {
        frame.pose.rotations.iter_mut().for_each(|rotation| *rotation *= 180.0 / std::f64::consts::PI);
    }
    assert_pointless(&capture, &["joint rotations are longer than a whole turn", "radians"]);
    let mut capture = synthetic().clone();
    // The same rotation plus a full turn.
    let rotation = &mut capture.frames[0].pose.rotations[1];
    *rotation += rotation.normalize() * std::f64::consts::TAU;
    assert_only_odd(&capture, &["1 of 48 joint rotations"]);
}

#[test]
fn hands_behind_or_far_from_most_cameras_are_pointless_and_from_some_odd() {
    let backwards = DMat3::from_diagonal(DVec3::new(1.0, -1.0, -1.0));
    let turned = |count: usize| {
        let mut capture = synthetic().clone();
        for camera in capture.cameras.iter_mut().take(count) {
            (camera.rotation, camera.translation) = (backwards * camera.rotation, backwards * camera.translation);
        }
        capture
    };
    assert_pointless(&turned(8), &["the hand is behind 6 of 6 cameras", "outside 18 of 18 images", "train (0.00)"]);
    let [_, odd] = found(&turned(1));
    assert_says(&odd, &["the hand is behind 1 of 6 cameras"]);
    let far = |count: usize| {
        let mut capture = synthetic().clone();
        capture.cameras.iter_mut().take(count).for_each(|camera| camera.translation *= 100.0);
        capture
    };
    assert_pointless(&far(8), &["6 of 6 cameras are not between", "metre"]);
    let [_, odd] = found(&far(1));
    assert_says(&odd, &["1 of 6 cameras are not between"]);
}

#[test]
fn translations_of_the_hand_in_millimetres_are_pointless_with_and_without_masks() {
    let mut capture = synthetic().clone();
    capture.frames.iter_mut().for_each(|frame| frame.pose.translation *= 1000.0);
    assert_pointless(&capture, &["the posed template is outside", "train (0.0"]);
    capture.images.mask = None;
    assert_pointless(&capture, &["the posed template is outside"]);
}

#[test]
fn transposed_rotations_still_overlap_and_are_odd() {
    let mut capture = synthetic().clone();
    // Rotated about the viewing axis, the synthetic hand stays in place.
    let quarter = DMat3::from_rotation_z(0.6);
    for camera in &mut capture.cameras {
        (camera.rotation, camera.translation) = (quarter * camera.rotation, quarter * camera.translation);
    }
    assert_only_odd(&capture, &["the posed template matches the masks of train (0."]);
}

#[test]
fn exr_images_of_nan_are_dropped_and_single_nan_pixels_become_black() {
    let (mut capture, folder) = copy();
    capture.images.image = "exr/{camera}-{frame}.exr".into();
    std::fs::create_dir(folder.path().join("exr")).unwrap();
    let write = |capture: &Capture, nan: &dyn Fn(usize, u32) -> bool| {
        for split in ["train", "test"] {
            for (index, view) in capture.splits[split].views.iter().enumerate() {
                let file = capture.image_file(view.camera, view.frame).unwrap();
                let value = |x: u32| if nan(index, x) { f32::NAN } else { x as f32 / 128.0 };
                ImageBuffer::from_fn(128, 192, |x, _| Rgb([value(x), 0.5, 0.2])).save(file).unwrap();
            }
        }
    };
    write(&capture, &|index, x| index == 0 && x == 64);
    assert_only_odd(&capture, &["1 of 18 images have NaN pixels"]);
    let view = capture.splits["train"].views[0];
    let rgba = capture.load_view(view.camera, view.frame).unwrap().rgba;
    let row = rgba.chunks_exact(128).find(|row| row[64][3] == 255 && row[65][3] == 255).unwrap();
    assert!(row[64][0] == 0 && row[65][0] > 100 && row[64][1] == row[65][1], "{:?}", &row[64..66]);

    write(&capture, &|index, _| index == 1);
    let view = capture.splits["train"].views[1];
    let file = capture.image_file(view.camera, view.frame).unwrap();
    assert_says(
        &capture.load_view(view.camera, view.frame).unwrap_err().to_string(),
        &[&file.display().to_string(), "NaN", "render or export it again"],
    );
    let mut rest = capture.clone();
    let counts = rest.skip_unusable_images(&["train"]).unwrap();
    assert_says(&counts.to_string(), &["1 of 18 images are skipped: 1 with a broken file", "NaN"]);
    assert_eq!(rest.splits["train"].views.len(), 17);

    write(&capture, &|_, _| true);
    let all = CaptureInspection::of(&capture, 60).unwrap();
    assert!(!all.has_usable_image());
    assert_says(&all.findings[0].text, &["none of the 22 images can be used", "22 broken"]);
    assert_says(
        &capture.skip_unusable_images(&["train"]).unwrap_err().to_string(),
        &["no images are left in split \"train\""],
    );
}

#[test]
fn a_capture_without_any_usable_image_or_without_images_is_pointless() {
    let capture = Capture { root: "/nowhere".into(), ..synthetic().clone() };
    for sample in [0, 60] {
        let found = CaptureInspection::of(&capture, sample).unwrap();
        assert!(!found.has_usable_image());
        assert_eq!((found.findings.len(), found.findings[0].severity), (1, Severity::Pointless));
        assert_says(&found.findings[0].text, &["none of the 22 images can be used (44 files are missing, 0 broken)"]);
    }
    assert!(CaptureInspection::of(synthetic(), 0).unwrap().has_usable_image());
    let capture = Capture { splits: Default::default(), ..synthetic().clone() };
    let found = CaptureInspection::of(&capture, 60).unwrap();
    assert!(!found.has_usable_image());
    assert_says(&found.findings[0].text, &["the splits have no images"]);
}
