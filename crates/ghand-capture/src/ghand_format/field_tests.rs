//! Unknown fields, impossible values, and lens distortion.

use std::path::Path;

use serde_json::{Value, json};

use super::tests::{assert_contains, message_after, read_json, sample, write_image};
use crate::cameras::distortion::Distortion;
use crate::capture::Capture;

/// The sample, opened after a change of its `capture.json`.
fn opened_after(change: impl FnOnce(&mut Value)) -> Capture {
    let folder = tempfile::tempdir().unwrap();
    sample(folder.path()).save().unwrap();
    change_file(&folder.path().join("capture.json"), change);
    Capture::open(folder.path()).unwrap()
}

fn change_file(file: &Path, change: impl FnOnce(&mut Value)) {
    let mut value = read_json(file);
    change(&mut value);
    std::fs::write(file, value.to_string()).unwrap();
}

/// Renames a field.
fn rename(object: &mut Value, from: &str, to: &str) {
    let fields = object.as_object_mut().unwrap();
    let value = fields.remove(from).unwrap();
    fields.insert(to.into(), value);
}

#[test]
fn unknown_fields_at_every_level_are_errors_that_name_the_nearest_known_one() {
    type Change = fn(&mut Value);
    let cases: [(Change, &[&str]); 11] = [
        (|v| rename(v, "mask_path", "mask_paht"), &["mask_paht: is not a field", "nearest", "\"mask_path\""]),
        // The message does not name the field that is therefore missing.
        (|v| rename(v, "image_path", "imagepath"), &["imagepath: is not a field", "\"image_path\""]),
        (|v| v["scale"] = json!(2), &["scale: is not a field", "known fields are format, version, units"]),
        (|v| v["hand_model"]["joint_names"] = json!([]), &["hand_model.joint_names", "\"joints\""]),
        (|v| v["hand_model"]["paths"] = json!("hand.glb"), &["hand_model.paths", "\"path\""]),
        (|v| v["cameras"][1]["Distortions"] = json!([0.1]), &["cameras[1].Distortions", "\"distortion\""]),
        (|v| v["cameras"][2]["dist_coeffs"] = json!([0.1]), &["cameras[2].dist_coeffs", "distortion"]),
        (|v| rename(&mut v["cameras"][0], "rotation", "rotations"), &["cameras[0].rotations", "\"rotation\""]),
        (|v| v["frames"][1]["shapes"] = json!([]), &["frames[1].shapes", "\"shape\""]),
        (|v| rename(&mut v["splits"]["test"], "cameras", "camera"), &["splits.test.camera:", "\"cameras\""]),
        (|v| v["splits"]["test"]["pairs"] = json!([]), &["splits.test.pairs", "known fields are cameras, frames"]),
    ];
    for (change, parts) in cases {
        assert_contains(&message_after(change), parts);
    }
}

#[test]
fn fields_with_a_comment_prefix_are_comments_at_every_level() {
    let plain = opened_after(|_| ());
    let commented = opened_after(|v| {
        v["$schema"] = json!("x");
        v["_made_by"] = json!({"distortion": [1.0]});
        v["hand_model"]["_from"] = json!("a ruler");
        v["cameras"][0]["//"] = json!("on the left");
        v["frames"][0]["_blurred"] = json!(true);
        v["splits"]["train"]["_"] = json!(null);
    });
    assert_eq!(
        (commented.frames, commented.hand_model.joint_names, commented.splits),
        (plain.frames, plain.hand_model.joint_names, plain.splits)
    );
}

#[test]
fn a_field_of_another_kind_of_hand_model_is_rejected() {
    assert_contains(
        &message_after(|v| v["hand_model"]["kind"] = json!("mano")),
        &["hand_model.path", "\"gltf\"", "\"mano\"", "remove it"],
    );
}

#[test]
fn impossible_numbers_are_named_with_file_frame_and_joint() {
    type Change = fn(&mut Value);
    let cases: [(Change, &[&str]); 6] = [
        (
            |v| v["frames"][1]["pose"][2] = json!([0.0, 1e30, 0.0]),
            &["capture.json: frames[\"0001\"].pose: joint \"index2\"", "1e30 rad", "radians"],
        ),
        (
            |v| v["frames"][0]["translation"] = json!([0.0, 0.0, -1e30]),
            &["frames[\"0000\"].translation", "1e30 m", "metres"],
        ),
        (|v| v["frames"][1]["shape"] = json!([0.0, 1e30]), &["frames[\"0001\"].shape", "number 1 is 1e30"]),
        (|v| v["cameras"][2]["translation"] = json!([1e30, 0.0, 0.0]), &["cameras[\"cam2\"].translation", "metres"]),
        (|v| v["cameras"][0]["intrinsics"][0][0] = json!(1e30), &["cameras[\"cam0\"].intrinsics", "1e7", "pixels"]),
        (|v| v["cameras"][0]["intrinsics"][1][2] = json!(-1e30), &["cameras[\"cam0\"].intrinsics", "1e7", "pixels"]),
    ];
    for (change, parts) in cases {
        assert_contains(&message_after(change), parts);
    }
    let folder = tempfile::tempdir().unwrap();
    sample(folder.path()).save().unwrap();
    change_file(&folder.path().join("truth.json"), |v| v["frames"][0]["pose"][15] = json!([500.0, 0.0, 0.0]));
    assert_contains(
        &Capture::open(folder.path()).unwrap_err().to_string(),
        &["truth.json: frames[\"0001\"].pose: joint \"thumb3\" rotates by 500.0 rad"],
    );
}

#[test]
fn distortion_is_read_checked_and_written_and_zeros_count_as_none() {
    let folder = tempfile::tempdir().unwrap();
    sample(folder.path()).save().unwrap();
    let file = folder.path().join("capture.json");
    change_file(&file, |v| {
        v["cameras"][0]["distortion"] = json!([0, 0, 0, 0, 0]);
        v["cameras"][1]["distortion"] = json!([0.1, -0.02, 0.001, 0.002, 0.003]);
        v["cameras"][2]["fisheye"] = json!([0.1, 0.0, 0.0, 0.01]);
    });
    let read = Capture::open(folder.path()).unwrap();
    let expected = Distortion::from_opencv(&[0.1, -0.02, 0.001, 0.002, 0.003]).unwrap();
    assert_eq!(read.distortion, [None, Some(expected), Some(Distortion::Fisheye([0.1, 0.0, 0.0, 0.01]))]);
    read.save().unwrap();
    assert_eq!(Capture::open(folder.path()).unwrap().distortion, read.distortion);
    assert_eq!(opened_after(|v| v["cameras"][0]["distortion"] = json!([])).distortion, []);
    for (coefficients, parts) in [
        (json!([0.1, 0.2]), &["cameras[\"cam0\"].distortion", "has 2 numbers", "4, 5, 8 or 12"][..]),
        (json!([0.1, 0.2, 0.0, 0.0, 0.0, 0.1]), &["has 6 numbers"]),
        (json!([0.0, 0.0, 1000.0, 0.0, 0.0]), &["cameras[\"cam0\"].distortion", "coefficients in its order"]),
        (json!([1e300, 0.0, 0.0, 0.0, 0.0]), &["cameras[\"cam0\"].distortion"]),
        (json!("none"), &["the text \"none\""]),
    ] {
        assert_contains(&message_after(|v| v["cameras"][0]["distortion"] = coefficients), parts);
    }
    let both = |v: &mut Value| {
        v["cameras"][0]["distortion"] = json!([0.1, 0, 0, 0]);
        v["cameras"][0]["fisheye"] = json!([0.1, 0, 0, 0]);
    };
    assert_contains(&message_after(both), &["fisheye", "one of them"]);
    assert_contains(&message_after(|v| v["cameras"][0]["fisheye"] = json!([0.1])), &["fisheye", "has 1 numbers"]);
}

#[test]
fn pixel_centers_of_opencv_move_the_principal_point_by_half_a_pixel() {
    let principal = |capture: &Capture| capture.cameras[0].principal;
    let usual = opened_after(|_| {});
    for (center, shift) in [(0.5, 0.0), (0.0, 0.5)] {
        let capture = opened_after(|v| v["pixel_center"] = json!(center));
        assert_eq!(principal(&capture), principal(&usual) + shift);
    }
    // As written, it is in our own coordinates again.
    let folder = tempfile::tempdir().unwrap();
    sample(folder.path()).save().unwrap();
    change_file(&folder.path().join("capture.json"), |v| v["pixel_center"] = json!(0));
    let moved = Capture::open(folder.path()).unwrap();
    moved.save().unwrap();
    assert_eq!(principal(&Capture::open(folder.path()).unwrap()), principal(&moved));
    assert_contains(&message_after(|v| v["pixel_center"] = json!(1)), &["pixel_center", "must be 0.5, or 0"]);
}

#[test]
fn views_of_distorted_cameras_are_undistorted_with_their_masks() {
    let folder = tempfile::tempdir().unwrap();
    let mut capture = sample(folder.path());
    let (width, height) = (40, 30);
    let camera = &mut capture.cameras[0];
    (camera.width, camera.height) = (width, height);
    (camera.focal, camera.principal) = (glam::DVec2::splat(40.0), glam::DVec2::new(20.0, 15.0));
    // Pincushion: a point 10 pixels from the middle is seen at 10 (1 + 1.6 / 16) = 11.
    capture.distortion = vec![Distortion::from_opencv(&[1.6, 0.0, 0.0, 0.0, 0.0]).ok()];
    let red = |x: u32| if x >= 31 { 200 } else { 0 };
    let colors: Vec<u8> = (0..height).flat_map(|_| (0..width).flat_map(move |x| [red(x), 0, 0])).collect();
    let mask: Vec<u8> = (0..height).flat_map(|_| (0..width).map(move |x| if x >= 31 { 255 } else { 0 })).collect();
    write_image(&folder.path().join("images/cam0/0000.png"), &colors, width, height, image::ExtendedColorType::Rgb8);
    write_image(&folder.path().join("masks/cam0/0000.png"), &mask, width, height, image::ExtendedColorType::L8);
    let view = capture.load_view(0, 0).unwrap();
    let row = &view.rgba[15 * 40..16 * 40];
    let first = row.iter().position(|pixel| pixel[0] >= 100).unwrap();
    assert_eq!((first, row.iter().position(|pixel| pixel[3] == 255)), (30, Some(30)), "{row:?}");
    assert!(view.rgba.iter().all(|pixel| [0, 255].contains(&pixel[3])));
    // The corner is outside the file's image: it has the background (0, 0.5, 1) and is not hand.
    assert_eq!(view.rgba[0], [0, 128, 255, 0]);
    capture.images.mask = None;
    let (view, notes) = capture.load_view_with_notes(0, 0).unwrap();
    assert!(!notes.has_mask && view.rgba[0][3] == 0 && view.rgba[15 * 40 + 20][3] == 255);
}
