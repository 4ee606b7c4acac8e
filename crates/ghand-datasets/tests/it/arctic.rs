use std::path::{Path, PathBuf};

use ghand_core::Side;
use ghand_datasets::{Dataset, Options, recognise};
use ghand_test_support::mano_files::python::{Array, Py, array, dictionary, npy};
use glam::DVec3;
use serde_json::json;

use crate::mano::{Mano, check_vertices, numbers, vectors};
use crate::scene::{Scene, flat, folder, import, last_number, mark_in, options, put, refused, save, square};

pub const FRAMES: usize = 12;
/// The first frame is image 3.
const OFFSET: usize = 3;
/// Views with images, of 1 to 8.
const VIEWS: [usize; 2] = [1, 6];

type Parts = (DVec3, Vec<DVec3>, DVec3);

fn parts(side: Side, f: usize) -> Parts {
    let seed = if side == Side::Right { 0 } else { 500 } + f;
    (vectors(1, seed, 0.8)[0], vectors(15, 60 + seed, 0.3), vectors(1, 200 + seed, 0.05)[0])
}

fn shape(side: Side) -> Vec<f64> {
    numbers(10, if side == Side::Right { 1 } else { 2 }, 1.0)
}

fn hand(side: Side) -> Py {
    let all: Vec<Parts> = (0..FRAMES).map(|f| parts(side, f)).collect();
    let rows = |width: usize, values: Vec<f64>| -> Array { array("<f8", &[FRAMES, width], false, &values) };
    dictionary(vec![
        ("rot", Py::Array(rows(3, flat(&all.iter().map(|p| p.0).collect::<Vec<_>>())))),
        ("pose", Py::Array(rows(45, flat(&all.iter().flat_map(|p| p.1.clone()).collect::<Vec<_>>())))),
        ("trans", Py::Array(rows(3, flat(&all.iter().map(|p| p.2).collect::<Vec<_>>())))),
        ("shape", Py::Array(array("<f8", &[10], false, &shape(side)))),
        ("fitting_err", Py::Array(array("<f8", &[FRAMES], false, &[0.0; FRAMES]))),
    ])
}

pub fn write(root: &Path, scene: &Scene) -> PathBuf {
    let cameras = || 0..8;
    let world2cam: Vec<_> = cameras().map(|c| square(&scene.camera_from_world(c), 4)).collect();
    let intrinsics: Vec<_> = cameras().map(|c| square(&scene.opencv_matrix(c), 3)).collect();
    let sizes = [[320, 240]; 9];
    let subject = json!({"world2cam": world2cam, "intris_mat": intrinsics, "ioi_offset": OFFSET, "image_size": sizes,
                         "gender": "female"});
    put(root.join("meta/misc.json"), json!({"s01": subject, "s02": {}}).to_string());
    let motion = dictionary(vec![("right", hand(Side::Right)), ("left", hand(Side::Left))]);
    put(root.join("raw_seqs/s01/box_grab_01.mano.npy"), npy(&motion));
    let sequence = root.join("images/s01/box_grab_01");
    for view in VIEWS {
        // The images begin before the motion.
        for image in 1..FRAMES + OFFSET {
            let picture = scene.picture(view - 1, image.saturating_sub(OFFSET));
            save(&picture, sequence.join(format!("{view}/{image:05}.jpg")));
        }
    }
    save(&scene.picture(0, 0), sequence.join("0/00003.jpg"));
    sequence
}

#[test]
fn both_hands_are_read_of_the_still_views_by_the_offset_of_images() {
    let (folder, out) = folder();
    let root = folder.path().join("arctic_data/data");
    let scene = Scene::new(Side::Right, 8, (320, 240), FRAMES);
    let sequence = write(&root, &scene);
    assert_eq!([&root, &sequence].map(|path| recognise(path)), [Some(Dataset::Arctic); 2]);
    for side in [Side::Right, Side::Left] {
        let mano = Mano::new(folder.path(), side);
        let own = (side == Side::Left).then_some(side);
        let options = Options { side: own, hand_model: Some(mano.path.clone()), ..options(&out) };
        let written = import(&sequence, &options);
        assert_eq!((written.capture.side, written.annotated), (side, FRAMES));
        let ids: Vec<&str> = written.capture.cameras.iter().map(|camera| camera.id.as_str()).collect();
        assert_eq!(ids, ["view1", "view6"]);
        for (c, view) in VIEWS.into_iter().enumerate() {
            check_vertices(&written, c, &scene.cameras[view - 1], |id| {
                let (turn, fingers, place) = parts(side, last_number(id) - OFFSET);
                let posed = mano.posed(turn, &mano.with_mean(&fingers), &shape(side)).0;
                posed.iter().map(|vertex| *vertex + place).collect()
            });
            let camera = &written.capture.cameras[c];
            for (f, frame) in written.capture.frames.iter().enumerate() {
                let wrist = scene.joints(last_number(&frame.id) - OFFSET)[0];
                let mark = mark_in(&written.capture.image_file(c, f).unwrap());
                assert!(mark.distance(camera.project(wrist).0) < 1.0);
            }
        }
    }
}

#[test]
fn without_manos_file_and_of_cropped_images_it_says_what_is_needed() {
    let (folder, out) = folder();
    let root = folder.path().join("data");
    let scene = Scene::new(Side::Right, 8, (320, 240), FRAMES);
    let sequence = write(&root, &scene);
    let error = refused(&sequence, &options(&out));
    assert!(
        error.starts_with("ARCTIC: has no joints")
            && error.contains("MANO_RIGHT.pkl")
            && error.contains("mano.is.tue.mpg.de"),
        "{error}"
    );
    assert!(!out.exists());
    let cropped = root.join("cropped_images/s01/box_grab_01");
    save(&scene.picture(0, 0), cropped.join("1/00003.jpg"));
    let error = refused(&cropped, &options(&out));
    assert!(error.contains("are cropped images"), "{error}");
}
