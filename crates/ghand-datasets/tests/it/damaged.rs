//! Damaged, missing and foreign files are one sentence each, and nothing is half-written.

use std::fs;
use std::path::{Path, PathBuf};

use ghand_core::Side;
use ghand_datasets::recognise;
use ghand_test_support::mano_files::python::{Py, array, dictionary, pickle};
use serde_json::json;

use crate::mano::Mano;
use crate::scene::{Scene, flat, folder, options, put, refused, rows, save, square};
use crate::{arctic, contactpose, dexycb, hanco};

pub const FRAMES: usize = 2;

/// A small sequence of each kind that needs no MANO file.
fn freihand(root: &Path, scene: &Scene) -> PathBuf {
    let k: Vec<_> = (0..FRAMES).map(|_| square(&scene.opencv_matrix(0), 3)).collect();
    let xyz: Vec<_> = (0..FRAMES).map(|f| rows(&scene.joints_in_camera(0, f))).collect();
    put(root.join("training_K.json"), json!(k).to_string());
    put(root.join("training_xyz.json"), json!(xyz).to_string());
    (0..FRAMES).for_each(|f| save(&scene.picture(0, f), root.join(format!("training/rgb/{f:08}.jpg"))));
    root.into()
}

fn ho3d(root: &Path, scene: &Scene) -> PathBuf {
    let folder = root.join("train/SM1");
    for f in 0..FRAMES {
        let numbers = |shape: &[usize], values: &[f64]| Py::Array(array("<f8", shape, false, values));
        let meta = dictionary(vec![
            ("camMat", numbers(&[3, 3], &scene.opencv_matrix(0))),
            ("handJoints3D", numbers(&[21, 3], &flat(&scene.joints_in_camera(0, f)))),
        ]);
        put(folder.join(format!("meta/{f:04}.pkl")), pickle(&meta));
        save(&scene.picture(0, f), folder.join(format!("rgb/{f:04}.jpg")));
    }
    folder
}

/// Every file of a folder.
fn files(folder: &Path) -> Vec<PathBuf> {
    let mut found = vec![];
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() { found.extend(files(&path)) } else { found.push(path) }
    }
    found.sort();
    found
}

#[test]
fn a_truncated_empty_or_foreign_file_is_named_with_a_remedy() {
    let (folder, out) = folder();
    let scene = Scene::new(Side::Right, 1, (64, 48), FRAMES);
    for name in ["freihand", "ho3d"] {
        let root = folder.path().join(name);
        let sequence = if name == "freihand" { freihand(&root, &scene) } else { ho3d(&root, &scene) };
        let all = files(&root);
        assert!(all.len() >= 4);
        for file in all {
            let whole = fs::read(&file).unwrap();
            for broken in [&whole[..whole.len() / 2], &[], b"version https://git-lfs.github.com/spec/v1\n"] {
                fs::write(&file, broken).unwrap();
                let error = refused(&sequence, &options(&out));
                assert!(!error.contains('\n') && error.len() < 400, "{error}");
                let is_named = error.contains(&*file.file_name().unwrap().to_string_lossy());
                // Pictures without a readable header are named by the folder of the first.
                assert!(is_named, "{}: {error}", file.display());
                assert!(!out.join("capture.json").exists());
            }
            fs::write(&file, whole).unwrap();
        }
        assert!(ghand_datasets::write_capture(&sequence, &options(&out), &mut |_| false).is_err());
    }
}

#[test]
fn a_matrix_that_does_not_turn_and_numbers_of_another_count_are_named() {
    let (folder, out) = folder();
    let scene = Scene::new(Side::Right, 1, (64, 48), FRAMES);
    let root = folder.path().join("FreiHAND");
    let sequence = freihand(&root, &scene);
    put(root.join("training_xyz.json"), json!([rows(&scene.joints(0))]).to_string());
    let error = refused(&sequence, &options(&out));
    assert!(error.contains("training_xyz.json: has 1 samples, training_K.json 2"), "{error}");
    put(root.join("training_xyz.json"), "[[[1, 2, 3]], [[1, 2, NaN]]]");
    let error = refused(&sequence, &options(&out));
    assert!(error.contains("training_xyz.json: has a number that is not finite"), "{error}");
    put(root.join("training_xyz.json"), "{\"a\": [1, 2]}");
    let error = refused(&sequence, &options(&out));
    assert!(error.contains("training_xyz.json: is a map of 1 names, expected numbers"), "{error}");
}

#[test]
fn folders_of_nothing_known_and_an_output_that_holds_the_data_are_refused() {
    let (folder, out) = folder();
    let scene = Scene::new(Side::Right, 1, (64, 48), FRAMES);
    assert_eq!(recognise(folder.path()), None);
    let error = refused(folder.path(), &options(&out));
    assert!(error.contains("is not a sequence of DexYCB, HO-3D"), "{error}");
    let error = refused(&folder.path().join("absent"), &options(&out));
    assert!(error.contains("absent: does not exist"), "{error}");
    let root = folder.path().join("HO3D");
    let sequence = ho3d(&root, &scene);
    let error = refused(&sequence, &options(&root));
    assert!(error.contains("holds the data set; give another folder with --out"), "{error}");
    let model = folder.path().join("hand.glb");
    fs::write(&model, b"glTF").unwrap();
    let error = refused(&sequence, &ghand_datasets::Options { hand_model: Some(model), ..options(&out) });
    assert!(error.contains("hand.glb"), "{error}");
}

/// The first file of each kind: of one extension, under one folder of the root.
fn kinds(root: &Path) -> Vec<PathBuf> {
    let mut seen = vec![];
    let mut kept = vec![];
    // ARCTIC's moving camera is not read, and DexYCB's first frame does not show the hand.
    let is_read = |file: &PathBuf| !file.ends_with("0/00003.jpg") && !file.ends_with("color_000000.jpg");
    for file in files(root).into_iter().filter(is_read) {
        let below = file.strip_prefix(root).unwrap();
        let kind =
            (below.iter().next().unwrap().to_owned(), below.extension().map(|e| e.to_owned()), below.iter().count());
        if !seen.contains(&kind) {
            seen.push(kind);
            kept.push(file);
        }
    }
    kept
}

#[test]
fn every_kind_of_file_of_the_other_data_sets_is_named_when_it_is_damaged() {
    let (folder, out) = folder();
    let model = Mano::new(folder.path(), Side::Right).path;
    let zeros = json!({"poses": [vec![0.0; 48]], "shapes": [vec![0.0; 10]], "global_t": [[[0, 0, 0]]]});
    let hands = json!([{"valid": false}, {"valid": false}]);
    let root = |name: &str| folder.path().join(name);
    let scene = |cameras, size, frames| Scene::new(Side::Right, cameras, size, frames);
    let sequences = [
        ("hanco", hanco::write(&root("hanco"), &scene(8, (224, 224), hanco::FRAMES), |_| zeros.clone())),
        (
            "dexycb",
            dexycb::write(&root("dexycb"), &scene(2, (640, 480), dexycb::FRAMES), &[0.0; 10], |_, _| vec![0.0; 51]),
        ),
        ("contactpose", contactpose::write(&root("contactpose"), &contactpose::scene(Side::Right, None), None, &hands)),
        ("arctic", arctic::write(&root("arctic"), &scene(8, (320, 240), arctic::FRAMES))),
    ];
    for (name, sequence) in sequences {
        let options =
            ghand_datasets::Options { hand_model: (name == "arctic").then(|| model.clone()), ..options(&out) };
        let kinds = kinds(&root(name));
        assert!(kinds.len() >= 2, "{name}: {kinds:?}");
        for file in kinds {
            let whole = fs::read(&file).unwrap();
            // Images are copied as they are; only their headers are read.
            let is_image = file.extension().is_some_and(|extension| extension == "jpg" || extension == "png");
            let half = if is_image { 0 } else { whole.len() / 2 };
            for broken in [&whole[..half], &[]] {
                fs::write(&file, broken).unwrap();
                let error = refused(&sequence, &options);
                assert!(!error.contains('\n') && error.len() < 400, "{error}");
                assert!(error.contains(&*file.file_name().unwrap().to_string_lossy()), "{}: {error}", file.display());
                assert!(!out.join("capture.json").exists());
            }
            fs::write(&file, whole).unwrap();
        }
        ghand_datasets::write_capture(&sequence, &options, &mut |_| true).unwrap();
        fs::remove_dir_all(&out).unwrap();
    }
}
