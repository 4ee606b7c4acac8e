//! Calibrations that other tools wrote (`tests/data/calibrations`), damaged copies of them, and hostile files.
#![allow(clippy::unwrap_used, clippy::indexing_slicing, reason = "tests")]

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use ghand_capture::CaptureError;
use ghand_capture::cameras::calibration_files::{
    CalibrationFormat, FoundCalibration, LengthUnit, Projection, read_calibration,
};
use ghand_capture::cameras::distortion::Distortion;
use ghand_capture::cameras::list::{LensCamera, read_cameras};
use glam::{DVec2, DVec3};
use rand::seq::IndexedRandom;
use rand::{RngExt, SeedableRng};
use serde::Deserialize;

/// Pixels are read back within this; EasyMocap's files have six digits, glTF's numbers are single.
const TOLERANCE: f64 = 1e-3;
/// The size of Blender's pictures, which its files do not have.
const PICTURE: [u32; 2] = [1280, 720];

fn data() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/calibrations")
}

/// Points in the unit and the world of a calibration, and where the tool's own formulas see them.
#[derive(Deserialize)]
struct Truth {
    points: Vec<[f64; 3]>,
    pixels: BTreeMap<String, Vec<[f64; 2]>>,
}

fn truth() -> BTreeMap<String, Truth> {
    serde_json::from_slice(&std::fs::read(data().join("truth.json")).unwrap()).unwrap()
}

fn read(name: &str) -> FoundCalibration {
    read_calibration(&data().join(name)).unwrap_or_else(|error| panic!("{error}"))
}

/// Where a camera sees a point.
fn project(lens: &LensCamera, point: DVec3) -> DVec2 {
    let inside = lens.camera.camera_from_world(point);
    let ray = DVec2::new(inside.x, inside.y) / inside.z;
    lens.distortion.map_or(ray, |lens| lens.distorted(ray)) * lens.camera.focal + lens.camera.principal
}

/// The largest distance of a calibration's pixels from the true ones.
fn largest_error(found: &FoundCalibration, truth: &Truth) -> f64 {
    let ids: Vec<&str> = found.cameras.iter().map(|camera| camera.id.as_str()).collect();
    assert_eq!(ids, truth.pixels.keys().collect::<Vec<_>>(), "{}", found.path.display());
    let mut largest: f64 = 0.0;
    for camera in &found.cameras {
        let size = camera.size.unwrap_or(PICTURE);
        // In the calibration's own unit.
        let lens = match camera.extrinsics {
            Some(_) => found.lens_camera(camera, size, 1.0).unwrap(),
            None => found.lens_at_origin(camera, size).unwrap(),
        };
        for (point, pixel) in truth.points.iter().zip(&truth.pixels[&camera.id]) {
            largest = largest.max(project(&lens, DVec3::from(*point)).distance(DVec2::from(*pixel)));
        }
    }
    largest
}

#[test]
fn every_tools_cameras_see_points_where_the_tool_does() {
    let truth = truth();
    assert!(truth.len() >= 25);
    for (name, truth) in &truth {
        let error = largest_error(&read(name), truth);
        assert!(error < TOLERANCE, "{name}: {error} px");
    }
    // The comparison finds half a pixel, and another camera's pixels.
    let mut wrong = read("anipose/calibration.toml");
    let right = wrong.clone();
    for camera in &mut wrong.cameras {
        let Projection::Pixels { principal, .. } = &mut camera.projection else { panic!() };
        principal.x -= 0.5;
    }
    assert!(largest_error(&wrong, &truth["anipose/calibration.toml"]) > 0.4);
    assert!(largest_error(&right, &truth["anipose/calibration.toml"]) < TOLERANCE);
}

#[test]
fn the_format_and_the_unit_are_told() {
    use CalibrationFormat as Format;
    use LengthUnit::{Metre, Millimetre, Unknown};
    for (name, format, unit) in [
        ("opencv_yml", Format::OpenCv, Unknown),
        ("opencv_xml", Format::OpenCv, Unknown),
        ("opencv_json", Format::OpenCv, Unknown),
        ("opencv_stereo", Format::OpenCv, Unknown),
        ("ros", Format::Ros, Unknown),
        ("dat_files", Format::DatFiles, Unknown),
        ("colmap_text", Format::Colmap, Unknown),
        ("colmap_binary", Format::Colmap, Unknown),
        ("anipose", Format::Anipose, Millimetre),
        ("freemocap", Format::FreeMoCap, Millimetre),
        ("caliscope", Format::Caliscope, Metre),
        ("caliscope_config", Format::Caliscope, Metre),
        ("kalibr", Format::Kalibr, Metre),
        ("easymocap", Format::EasyMocap, Metre),
        ("meshroom_1214", Format::Meshroom, Unknown),
        ("blender_glb", Format::Gltf, Metre),
        ("blender_gltf", Format::Gltf, Metre),
    ] {
        let found = read(name);
        assert_eq!((found.format, found.unit), (format, unit), "{name}");
        // Half a pixel is told wherever it is added.
        let is_shifted = found.remarks.iter().any(|remark| remark.contains("half a pixel"));
        assert_eq!(is_shifted, !matches!(format, Format::Colmap | Format::Gltf), "{name}");
        let is_told =
            found.remarks.iter().any(|remark| remark.contains("unit") || remark.contains("where the cameras"));
        assert_eq!(is_told, unit == Unknown, "{name}: {:?}", found.remarks);
    }
}

#[test]
fn a_part_of_a_calibration_stands_for_all_of_it() {
    for (folder, part) in [
        ("colmap_text", "images.txt"),
        ("colmap_binary", "cameras.bin"),
        ("dat_files", "c1.dat"),
        ("easymocap", "intri.yml"),
        ("easymocap", "extri.yml"),
        ("opencv_stereo", "intrinsics.yml"),
        ("opencv_stereo", "extrinsics.yml"),
        ("kalibr", "camchain.yaml"),
        ("meshroom_128", "cameras.sfm"),
    ] {
        let whole = read(folder);
        let found = read(&format!("{folder}/{part}"));
        assert_eq!(found.cameras, whole.cameras, "{folder}/{part}");
    }
    let one = read("opencv_yml/cam1.yml");
    assert_eq!(one.cameras, read("opencv_yml").cameras[1..2]);
    // A model may be in a project's folder.
    let project = tempfile::tempdir().unwrap();
    copy(&data().join("colmap_text"), &project.path().join("sparse/0"));
    assert_eq!(read_calibration(project.path()).unwrap().cameras, read("colmap_text").cameras);
    // COLMAP before version 3.12 has no rigs.
    for file in ["rigs.txt", "frames.txt"] {
        std::fs::remove_file(project.path().join("sparse/0").join(file)).unwrap();
    }
    assert_eq!(read_calibration(project.path()).unwrap().cameras, read("colmap_text").cameras);
}

/// Copies the files of a folder.
fn copy(from: &Path, to: &Path) {
    std::fs::create_dir_all(to).unwrap();
    for entry in std::fs::read_dir(from).unwrap() {
        let entry = entry.unwrap();
        std::fs::copy(entry.path(), to.join(entry.file_name())).unwrap();
    }
}

/// The error of a folder after a change of one of its files.
fn error_after(folder: &str, file: &str, change: impl Fn(&str) -> String) -> String {
    let place = tempfile::tempdir().unwrap();
    copy(&data().join(folder), place.path());
    let path = place.path().join(file);
    let text = std::fs::read_to_string(&path).unwrap();
    let changed = change(&text);
    assert_ne!(changed, text, "{folder}/{file}");
    std::fs::write(&path, changed).unwrap();
    let error = match read_calibration(place.path()) {
        Err(error) => error.to_string(),
        Ok(found) => panic!("{folder}/{file}: {found:?}"),
    };
    assert!(error.starts_with(place.path().to_str().unwrap()) && !error.contains('\n'), "{error}");
    error
}

#[test]
fn wrong_numbers_are_errors_with_their_place() {
    for (folder, file, from, to, says) in [
        ("opencv_yml", "cam2.yml", "520.25", "-520.25", "focal length"),
        ("opencv_yml", "cam2.yml", "520.25", ".Nan", "not finite"),
        ("opencv_yml", "cam2.yml", "520.25", "x", "not a number"),
        ("opencv_yml", "cam2.yml", "rows: 3", "rows: 4", "rows of"),
        ("opencv_yml", "cam2.yml", "520.25, 0.", "520.25, 0.1", "skew"),
        ("opencv_json", "cam2.json", "520.25, ", "", "camera_matrix"),
        ("ros", "cam0_info.yaml", "plumb_bob", "double_sphere", "double_sphere"),
        ("dat_files", "c0.dat", "905.5", "nan", "intrinsic"),
        ("colmap_text", "cameras.txt", "FULL_OPENCV", "OPENCV", "parameters"),
        ("colmap_text", "cameras.txt", "FULL_OPENCV", "CYLINDER", "CYLINDER"),
        ("colmap_text", "cameras.txt", "2 FULL", "9 FULL", "camera 2"),
        ("colmap_text", "images.txt", " 1 cam0/0001.jpg", " 1", "line 7: has no name"),
        ("anipose", "calibration.toml", "905.5", "nan", "matrix"),
        ("anipose", "calibration.toml", "-0.0013,", "-0.0013, 1.0,", "fisheye"),
        ("anipose", "calibration.toml", "\"cam1\"", "\"cam0\"", "twice"),
        ("kalibr", "camchain.yaml", "pinhole", "omni", "omni"),
        ("kalibr", "camchain.yaml", "radtan", "fov", "fov"),
        ("kalibr", "camchain.yaml", "- [0.0, 0.0, 0.0, 1.0]", "- [0.0, 0.0, 0.0, 2.0]", "4 rows"),
        ("easymocap", "extri.yml", "T_02", "Q_02", "T_02"),
        ("easymocap", "intri.yml", "K_02", "L_02", "K_02"),
        ("meshroom_1214", "cameras.sfm", "\"fisheye4\"", "\"fisheye1\"", "fisheye1"),
        ("meshroom_1214", "cameras.sfm", "\"viewId\"", "\"rigId\": \"1\", \"viewId\"", "rig"),
        ("blender_gltf", "scene.gltf", "\"yfov\":0.", "\"yfov\":4.", "field of view"),
    ] {
        let error = error_after(folder, file, |text| text.replacen(from, to, 1));
        assert!(error.contains(says), "{folder}/{file}: {error}");
    }
}

#[test]
fn what_is_not_a_rotation_is_refused() {
    // The first row of R is made longer, or its sign changed: a left-handed system.
    let scaled = |text: &str, row: &str, factor: f64| {
        let numbers: Vec<f64> =
            row.split_whitespace().map(|n| n.trim_matches(['[', ']', ',']).parse().unwrap()).collect();
        let changed: Vec<String> = numbers.iter().map(|n| format!("{:.17}", n * factor)).collect();
        text.replacen(row, &changed.join(if row.contains(',') { ", " } else { " " }), 1)
    };
    for (folder, file) in [("opencv_xml", "cam0.xml"), ("dat_files", "rot_trans_c0.dat"), ("kalibr", "camchain.yaml")] {
        let text = std::fs::read_to_string(data().join(folder).join(file)).unwrap();
        let line = match folder {
            "opencv_xml" => text.lines().skip_while(|line| !line.contains("<R ")).nth(5).unwrap().trim().to_owned(),
            "dat_files" => text.lines().nth(1).unwrap().trim().to_owned(),
            _ => {
                let row = text.lines().find(|line| line.starts_with("  - [")).unwrap();
                row.trim_start_matches("  - [").rsplit_once(',').unwrap().0.to_owned()
            }
        };
        for factor in [-1.0, 1.01] {
            let error = error_after(folder, file, |text| scaled(text, &line, factor));
            assert!(error.contains("not a rotation"), "{folder}/{file}: {error}");
        }
    }
    let error = error_after("colmap_text", "images.txt", |text| {
        let line = text.lines().find(|line| line.ends_with("cam1/0000.jpg")).unwrap();
        text.replacen(line, "4 0 0 0 0 1 2 3 2 cam1/0000.jpg", 1)
    });
    assert!(error.contains("quaternion of length 0"), "{error}");
}

#[test]
fn opencvs_values_are_read_in_the_layouts_of_users() {
    const K: &str = "[[100, 0, 31.5], [0, 110, 23.5], [0, 0, 1]]";
    let found = |files: &[(&str, String)]| {
        let place = tempfile::tempdir().unwrap();
        files.iter().for_each(|(name, text)| std::fs::write(place.path().join(name), text).unwrap());
        read_calibration(place.path()).map_err(|error| error.to_string())
    };
    let summary = |found: &FoundCalibration| -> Vec<(String, Option<DVec3>)> {
        found.cameras.iter().map(|c| (c.id.clone(), c.extrinsics.map(|at| at.translation))).collect()
    };
    let at = |x: f64| Some(DVec3::new(x, 2.0, 3.0));
    let camera = |x: u8| format!(r#"{{"K": {K}, "dist": [0, 0, 0, 0, 0], "R": [0.1, 0, 0], "t": [{x}, 2, 3]}}"#);
    // One group for each camera.
    let groups = found(&[("rig.json", format!(r#"{{"left": {}, "right": {}}}"#, camera(1), camera(4)))]).unwrap();
    assert_eq!(summary(&groups), [("left".into(), at(1.0)), ("right".into(), at(4.0))]);
    assert!(groups.cameras.iter().all(|camera| camera.distortion.is_none()));
    // A pair in one file, whose R and T lead from the first to the second.
    let pair = format!("cameraMatrix1: {K}\ncameraMatrix2: {K}\nR: [0.1, 0, 0]\nT: [1, 2, 3]\nimageSize: [64, 48]\n");
    let pair = found(&[("stereo.yml", pair)]).unwrap();
    assert_eq!(summary(&pair), [("camera1".into(), Some(DVec3::ZERO)), ("camera2".into(), at(1.0))]);
    assert_eq!(pair.cameras[1].size, Some([64, 48]));
    // Lenses and places in files of their own.
    let lens = |more: &str| format!("K: {K}\nD: [0.1, 0, 0, 0]\n{more}");
    let place = |x: u8| format!("rvec: [0.1, 0, 0]\ntvec: [{x}, 2, 3]\n");
    let files = [
        ("a_intrinsics.yml", lens("")),
        ("b_intrinsics.yml", lens("fisheye_model: 1\n")),
        ("b_extrinsics.yml", place(7)),
        ("a_extrinsics.yml", place(5)),
    ];
    let separate = found(&files).unwrap();
    assert_eq!(summary(&separate), [("a".into(), at(5.0)), ("b".into(), at(7.0))]);
    let lenses: Vec<_> = separate.cameras.iter().map(|camera| camera.distortion.unwrap()).collect();
    assert_eq!(lenses[0], Distortion::from_opencv(&[0.1, 0.0, 0.0, 0.0]).unwrap());
    assert_eq!(lenses[1], Distortion::Fisheye([0.1, 0.0, 0.0, 0.0]));
    let error = found(&[files[0].clone(), files[1].clone(), ("c_extrinsics.yml", place(1))]).unwrap_err();
    assert!(error.contains("c_extrinsics.yml") && error.contains("no camera matrix"), "{error}");
}

#[test]
fn a_camera_that_moves_is_refused_but_a_rig_may() {
    let error = read_calibration(&data().join("colmap_moving")).unwrap_err().to_string();
    assert!(error.contains("\"cam0\" moves"), "{error}");
    let rig = read("colmap_rig_text");
    assert!(rig.remarks.iter().any(|remark| remark.contains("rig")));
    assert_eq!(rig.cameras[0].extrinsics.unwrap().inverse().translation, DVec3::ZERO);
    for file in ["rigs.txt", "frames.txt"] {
        let place = tempfile::tempdir().unwrap();
        copy(&data().join("colmap_rig_text"), place.path());
        std::fs::remove_file(place.path().join(file)).unwrap();
        // Without the rig its cameras' images are from elsewhere each time; frames tell nothing more.
        assert_eq!(read_calibration(place.path()).is_ok(), file == "frames.txt");
    }
}

#[test]
fn lens_models_that_cannot_be_modelled_are_named() {
    let error = read_calibration(&data().join("colmap_models/fov")).unwrap_err().to_string();
    assert!(error.contains("FOV") && error.contains("camera 1"), "{error}");
}

/// A calibration in one file, after a change of it.
fn changed(folder: &str, file: &str, change: impl Fn(&str) -> String) -> FoundCalibration {
    let place = tempfile::tempdir().unwrap();
    let text = std::fs::read_to_string(data().join(folder).join(file)).unwrap();
    let changed = change(&text);
    assert_ne!(changed, text);
    std::fs::write(place.path().join(file), changed).unwrap();
    read_calibration(place.path()).unwrap_or_else(|error| panic!("{error}"))
}

#[test]
fn the_unit_of_a_board_is_not_guessed() {
    // anipose's layout in metres, as Caliscope exports it.
    let found = changed("anipose", "calibration.toml", |text| {
        let line = |line: &str| match line.strip_prefix("translation = [ ") {
            Some(numbers) => {
                let numbers = numbers.trim_end_matches(",]").split(", ").map(|n| n.parse::<f64>().unwrap() / 1000.0);
                format!("translation = {:?}\n", numbers.collect::<Vec<_>>())
            }
            None => format!("{line}\n"),
        };
        text.lines().map(line).collect()
    });
    assert_eq!((found.format, found.unit), (CalibrationFormat::Anipose, LengthUnit::Unknown));
    // FreeMoCap with the default size of its board's squares.
    let found =
        changed("freemocap", "recording_camera_calibration.toml", |text| text.replace("size = 43.0", "size = 1"));
    assert_eq!((found.format, found.unit), (CalibrationFormat::FreeMoCap, LengthUnit::Unknown));
}

#[test]
fn what_is_not_read_is_told() {
    let told = |found: &FoundCalibration, says: &str| found.remarks.iter().any(|remark| remark.contains(says));
    let ignored =
        changed("caliscope_config", "config.toml", |text| text.replacen("ignore = false", "ignore = true", 1));
    assert!(ignored.cameras.len() == 1 && told(&ignored, "cam_0 is not read"), "{ignored:?}");
    let turned =
        changed("caliscope_config", "config.toml", |text| text.replacen("rotation_count = 0", "rotation_count = 1", 1));
    assert!(told(&turned, "as filmed"), "{turned:?}");
    assert!(told(&read("ros"), "rectification") && told(&read("opencv_stereo"), "rectification"));
    assert!(told(&read("dat_files"), "rot_trans_c1.dat") && told(&read("blender_glb"), "axes are turned"));
    let place = tempfile::tempdir().unwrap();
    copy(&data().join("opencv_xml"), place.path());
    std::fs::write(place.path().join("cam2.xml"), "<opencv_storage>").unwrap();
    let fewer = read_calibration(place.path()).unwrap();
    assert!(fewer.cameras.len() == 2 && told(&fewer, "cam2.xml"), "{fewer:?}");
}

#[test]
fn complete_calibrations_are_cameras_and_others_say_what_they_lack() {
    let truth = truth();
    for (name, metres) in [("anipose", 1e-3), ("caliscope/camera_array.toml", 1.0), ("kalibr/camchain.yaml", 1.0)] {
        let cameras = read_cameras(&data().join(name)).unwrap();
        let truth = truth.get(name).unwrap_or(&truth["anipose/calibration.toml"]);
        for lens in &cameras {
            let at = project(lens, DVec3::from(truth.points[1]) * metres);
            assert!(at.distance(DVec2::from(truth.pixels[&lens.camera.id][1])) < TOLERANCE, "{name}");
        }
    }
    for (name, lacks) in [
        ("opencv_yml", "unit of lengths"),
        ("colmap_text", "unit of lengths"),
        ("dat_files", "width and height"),
        ("easymocap", "width and height"),
        ("blender_glb", "width and height"),
        ("blender_gltf/scene.gltf", "width and height"),
        ("ros", "where this camera stands"),
    ] {
        let error = read_cameras(&data().join(name)).unwrap_err().to_string();
        assert!(error.contains(lacks), "{name}: {error}");
    }
}

#[test]
fn images_of_another_size_are_refused() {
    let found = read("kalibr");
    let error = found.lens_camera(&found.cameras[0], [640, 360], 1.0).unwrap_err().to_string();
    assert!(error.contains("1280x720") && error.contains("640x360"), "{error}");
    let blender = read("blender_glb");
    assert!(blender.lens_camera(&blender.cameras[0], [1920, 1080], 1.0).is_ok());
    let error = blender.lens_camera(&blender.cameras[0], [640, 480], 1.0).unwrap_err().to_string();
    assert!(error.contains("1.778"), "{error}");
    // Lengths in millimetres are no metres.
    let anipose = read("anipose");
    let error = anipose.lens_camera(&anipose.cameras[0], [1280, 720], 1000.0).unwrap_err().to_string();
    assert!(error.contains("metres"), "{error}");
}

#[test]
fn ghands_own_cameras_are_read_as_they_are() {
    let camera = r#"{"cameras":[{"id":"a","width":64,"height":48,"intrinsics":[[100,0,32],[0,110,24],[0,0,1]],
        "rotation":[[0,1,0],[-1,0,0],[0,0,1]],"translation":[0.1,0.2,0.3],"fisheye":[0.1,0,0,0]}]}"#;
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("capture.json"), camera).unwrap();
    let found = read_calibration(folder.path()).unwrap();
    assert_eq!((found.format, found.unit), (CalibrationFormat::Ghand, LengthUnit::Metre));
    assert_eq!(found.lens_cameras().unwrap(), read_cameras(folder.path()).unwrap());
}

#[test]
fn folders_and_files_without_a_calibration_say_what_to_give() {
    let folder = tempfile::tempdir().unwrap();
    let error = |path: &Path| read_calibration(path).unwrap_err().to_string();
    assert!(error(folder.path()).contains("no calibration"));
    assert!(error(&folder.path().join("none.toml")).contains("none.toml"));
    for (name, content) in [
        ("a.toml", "x = 1\n"),
        ("a.json", "{}"),
        ("a.yml", "x: 1\n"),
        ("a.xml", "<a>1</a>"),
        ("a.txt", ""),
        ("a.json", "[]"),
    ] {
        let path = folder.path().join(name);
        std::fs::write(&path, content).unwrap();
        assert!(error(&path).contains("is not a calibration"), "{}", error(&path));
        assert!(error(folder.path()).contains("no calibration"));
    }
    for name in ["anipose/calibration.toml", "kalibr/camchain.yaml"] {
        let from = data().join(name);
        std::fs::copy(&from, folder.path().join(from.file_name().unwrap())).unwrap();
    }
    let several = error(folder.path());
    assert!(several.contains("calibration.toml") && several.contains("camchain.yaml"), "{several}");
    std::fs::write(folder.path().join("wide.yml"), vec![0xff, 0xfe, 0, 0]).unwrap();
    assert!(error(&folder.path().join("wide.yml")).contains("UTF-16"));
    // Sparse: it takes no disk space.
    let large = folder.path().join("large.json");
    std::fs::File::create(&large).unwrap().set_len(1 << 40).unwrap();
    assert!(error(&large).contains("larger than 16 MiB"));
}

#[test]
fn hostile_counts_take_no_memory() {
    let folder = tempfile::tempdir().unwrap();
    copy(&data().join("colmap_binary"), folder.path());
    for name in ["cameras.bin", "images.bin", "rigs.bin"] {
        let path = folder.path().join(name);
        let before = std::fs::read(&path).unwrap();
        let mut bytes = before.clone();
        bytes[..8].fill(0xff);
        std::fs::write(&path, bytes).unwrap();
        let error = read_calibration(folder.path()).unwrap_err().to_string();
        assert!(
            error.contains("truncated") || error.contains("lens model") || error.contains("another sensor"),
            "{error}"
        );
        std::fs::write(&path, before).unwrap();
    }
    // Keypoints of an image: a length beyond all memory.
    let path = folder.path().join("images.bin");
    let mut bytes = std::fs::read(&path).unwrap();
    let name = bytes.windows(14).position(|window| window == b"cam0/0000.jpg\0").unwrap();
    bytes[name + 14..name + 22].fill(0xff);
    std::fs::write(&path, bytes).unwrap();
    assert!(read_calibration(folder.path()).unwrap_err().to_string().contains("truncated"));
    let glb = folder.path().join("scene.glb");
    std::fs::write(&glb, b"glTF\x02\0\0\0\xff\xff\xff\xff\xff\xff\xff\xffJSON{}").unwrap();
    assert!(read_calibration(&glb).unwrap_err().to_string().contains("damaged GLB"));
}

#[test]
fn damaged_files_are_errors_in_one_sentence() {
    let tried = ghand_test_support::cases(1_500, 400_000);
    let files: Vec<(String, PathBuf)> = [
        "anipose",
        "blender_glb",
        "blender_gltf",
        "caliscope",
        "colmap_binary",
        "colmap_rig_binary",
        "colmap_rig_text",
        "colmap_text",
        "dat_files",
        "easymocap",
        "freemocap",
        "kalibr",
        "meshroom_100",
        "meshroom_128",
        "opencv_json",
        "opencv_stereo",
        "opencv_xml",
        "opencv_yml",
        "ros",
    ]
    .iter()
    .flat_map(|folder| {
        std::fs::read_dir(data().join(folder)).unwrap().map(|file| ((*folder).to_owned(), file.unwrap().path()))
    })
    .collect();
    let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(47);
    let mut good = 0;
    let mut bad = 0;
    for _ in 0..tried {
        let (folder, file) = files.choose(&mut random).unwrap();
        let is_binary = file.extension().is_some_and(|end| end == "bin" || end == "glb");
        let kind = if is_binary {
            ghand_test_support::fuzz_corpus::Content::Binary
        } else {
            ghand_test_support::fuzz_corpus::Content::Text
        };
        let changed = ghand_test_support::fuzz_corpus::changed(&std::fs::read(file).unwrap(), kind, &mut random);
        let place = tempfile::tempdir().unwrap();
        copy(&data().join(folder), place.path());
        let path = place.path().join(file.file_name().unwrap());
        std::fs::write(&path, changed).unwrap();
        let found = read_calibration(if random.random() { place.path() } else { &path });
        match check(found) {
            true => good += 1,
            false => bad += 1,
        }
    }
    // Neither all nor none are detected.
    assert!(good > tried / 20 && bad > tried / 20, "{good} {bad}");
}

/// Whether a calibration was read; sound cameras, or an error of one line.
fn check(found: Result<FoundCalibration, CaptureError>) -> bool {
    match found {
        Ok(found) => {
            assert!(!found.cameras.is_empty());
            for camera in &found.cameras {
                if let Some(at) = camera.extrinsics {
                    assert!((at.rotation.determinant() - 1.0).abs() < 1e-9 && at.translation.is_finite());
                }
                if let Projection::Pixels { focal, principal } = camera.projection {
                    assert!(focal.min_element() > 0.0 && focal.is_finite() && principal.is_finite());
                }
                // Must not panic, whatever it says.
                let _ = found.lens_camera(camera, camera.size.unwrap_or(PICTURE), 1.0);
            }
            true
        }
        Err(error) => {
            let text = error.to_string();
            assert!(!text.contains('\n') && text.len() < 1000, "{text}");
            false
        }
    }
}
