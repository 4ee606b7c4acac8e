//! InterHand2.6M: masks are made, cached and remade; images with unusable content are found.

use std::path::{Path, PathBuf};

use ghand_capture::Capture;
use ghand_capture::images::skipped::SkipReason;
use image::{GrayImage, RgbImage};

use crate::fixtures::{assert_says, synthetic, write_jpeg};
use crate::interhand_files::{camera_id, number, open_after, right};

/// The pair of the synthetic camera and training frame 0.
fn pair(capture: &Capture, camera: usize) -> (usize, usize) {
    let frame = capture.frame_index(&format!("ROM04_RT_Occlusion/{}", number(0))).unwrap();
    (capture.camera_index(&camera_id(camera)).unwrap(), frame)
}

fn kept_file(root: &Path, camera: usize) -> PathBuf {
    let below = format!("ghand-masks/test/Capture0/ROM04_RT_Occlusion/{}/{}.png", camera_id(camera), number(0));
    root.join(below)
}

fn mask_of(capture: &Capture, camera: usize) -> Vec<bool> {
    let (camera, frame) = pair(capture, camera);
    capture.load_view(camera, frame).unwrap().rgba.iter().map(|p| p[3] == 255).collect()
}

/// Intersection over union of two masks.
fn overlap(a: &[bool], b: &[bool]) -> f64 {
    let count = |f: fn((&bool, &bool)) -> bool| a.iter().zip(b).filter(|(a, b)| f((a, b))).count() as f64;
    count(|(a, b)| *a && *b) / count(|(a, b)| *a || *b)
}

#[test]
fn made_masks_cover_the_hand_and_exclude_its_surroundings() {
    let (opened, _folder) = open_after(|_| ());
    let capture = opened.unwrap().capture;
    let (camera, frame) = pair(&capture, 1);
    let view = capture.load_view(camera, frame).unwrap();
    assert!(view.rgba.iter().all(|p| p[3] == 255 || *p == [0; 4]));
    let mask = mask_of(&capture, 1);
    let synthetic_frame = synthetic().splits["train"].frames[0];
    let truth = image::open(synthetic().mask_file(1, synthetic_frame).unwrap().unwrap()).unwrap().into_luma8();
    let truth: Vec<bool> = truth.pixels().map(|p| p.0[0] == 255).collect();
    // The pose has 4 degrees of noise, and the hand another shape; black pixels of the image are never hand.
    let same = overlap(&mask, &truth);
    assert!(same > 0.7, "{same}");
    let shifted: Vec<bool> = truth.iter().cycle().skip(40).take(truth.len()).copied().collect();
    assert!(overlap(&mask, &shifted) < same);
    let beyond = mask.iter().zip(&truth).filter(|(m, t)| **m && !**t).count();
    assert!(beyond < mask.len() / 100, "{beyond} pixels are not hand");
}

#[test]
fn masks_are_cached_and_remade_for_another_pose_or_image() {
    let (opened, folder) = open_after(|_| ());
    let mut capture = opened.unwrap().capture;
    let first = mask_of(&capture, 1);
    let file = kept_file(folder.path(), 1);
    let bytes = std::fs::read(&file).unwrap();
    // The cached file is an ordinary image.
    let kept = image::load_from_memory(&bytes).unwrap().into_luma8();
    assert!(kept.pixels().zip(&first).all(|(p, m)| (p.0[0] == 255) == *m));
    // The cache is used: another picture with the same end is read as the mask.
    let mut other = Vec::new();
    GrayImage::new(128, 192).write_to(&mut std::io::Cursor::new(&mut other), image::ImageFormat::Png).unwrap();
    other.extend(&bytes[bytes.len() - 22..]);
    std::fs::write(&file, &other).unwrap();
    assert!(mask_of(&capture, 1).iter().all(|m| !m));
    // A mask that is truncated, or of another image, pose or camera, is remade.
    std::fs::write(&file, &bytes[..bytes.len() / 2]).unwrap();
    assert_eq!(mask_of(&capture, 1), first);
    assert_eq!(std::fs::read(&file).unwrap(), bytes);
    let (camera, frame) = pair(&capture, 1);
    capture.frames[frame].pose.translation.x += 0.02;
    let moved = mask_of(&capture, 1);
    assert_ne!(moved, first);
    assert_ne!(std::fs::read(&file).unwrap(), bytes);
    capture.frames[frame].pose.translation.x -= 0.02;
    let image = capture.image_file(camera, frame).unwrap();
    let mut changed = image::open(&image).unwrap().into_rgb8();
    changed.enumerate_pixels_mut().filter(|(_, y, _)| *y < 96).for_each(|(_, _, p)| p.0 = [0; 3]);
    write_jpeg(&image, &changed);
    let cut = mask_of(&capture, 1);
    assert!(cut.iter().take(80 * 128).all(|m| !m) && cut.iter().any(|m| *m));
}

#[test]
fn existing_masks_are_read() {
    let (opened, folder) = open_after(|_| ());
    let mut capture = opened.unwrap().capture;
    let (camera, frame) = pair(&capture, 1);
    let file = capture.mask_file(camera, frame).unwrap().unwrap();
    std::fs::create_dir_all(file.parent().unwrap()).unwrap();
    // Written with three channels.
    let left = |x: u32, _| image::Rgb(if x < 64 { [255; 3] } else { [0; 3] });
    RgbImage::from_fn(128, 192, left).save(&file).unwrap();
    let mask = mask_of(&capture, 1);
    assert!(mask.iter().enumerate().all(|(i, m)| *m == (i % 128 < 64)));
    assert!(!kept_file(folder.path(), 1).exists());
    let counts = capture.skip_unusable_images(&["train"]).unwrap();
    assert_eq!(counts.total(), 0, "{counts}");
    // Only the facts of the image are cached then.
    assert!(std::fs::metadata(kept_file(folder.path(), 1)).unwrap().len() < 100);
    RgbImage::new(127, 192).save(&file).unwrap();
    assert_says(&capture.load_view(camera, frame).unwrap_err().to_string(), &["masks_removeblack", "127 x 192"]);
}

#[test]
fn images_with_unusable_content_are_dropped_and_counted() {
    let folder = tempfile::tempdir().unwrap();
    let data = right();
    data.write(folder.path());
    let file = |camera| data.image_file(folder.path(), 0, camera, 0);
    let cameras = synthetic().splits["train"].cameras.clone();
    let frame = synthetic().splits["train"].frames[0];
    assert_eq!(frame, 0);
    // A black image, one with hardly any hand, a truncated one, and one of another size.
    write_jpeg(&file(cameras[0]), &RgbImage::new(128, 192));
    let mut speck = RgbImage::new(128, 192);
    speck
        .enumerate_pixels_mut()
        .filter(|(x, y, _)| x.abs_diff(64) < 8 && y.abs_diff(96) < 8)
        .for_each(|(_, _, p)| p.0 = [120; 3]);
    write_jpeg(&file(cameras[1]), &speck);
    let whole = std::fs::read(file(cameras[2])).unwrap();
    std::fs::write(file(cameras[2]), &whole[..whole.len() / 2]).unwrap();
    write_jpeg(&file(cameras[3]), &RgbImage::from_pixel(64, 192, image::Rgb([120; 3])));
    let mut capture = Capture::open_with(folder.path(), &crate::interhand_files::options()).unwrap().capture;
    for pass in 0..2 {
        // The second pass uses the cache.
        let mut again = capture.clone();
        let counts = again.skip_unusable_images(&["train", "test"]).unwrap();
        let reasons: Vec<(SkipReason, usize)> = counts.reasons.into_iter().collect();
        assert_eq!(
            reasons,
            [(SkipReason::Broken, 2), (SkipReason::Dark, 1), (SkipReason::SmallMask, 1)],
            "pass {pass}"
        );
        assert_eq!(counts.checked, 19);
        assert_eq!((again.splits["train"].views.len(), again.splits["train"].frames.len()), (14, 3));
    }
    // A split without usable images is an error.
    for camera in synthetic().splits["test"].cameras.clone() {
        for frame in synthetic().splits["test"].frames.clone() {
            write_jpeg(&data.image_file(folder.path(), 1, camera, frame), &RgbImage::new(128, 192));
        }
    }
    assert_says(&capture.skip_unusable_images(&["test"]).unwrap_err().to_string(), &["\"test\"", "1 too dark"]);
    assert_says(&capture.skip_unusable_images(&["nonsense"]).unwrap_err().to_string(), &["nonsense"]);
}
