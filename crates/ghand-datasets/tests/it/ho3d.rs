use std::path::{Path, PathBuf};

use ghand_core::Side;
use ghand_core::rotation::{axis_angle_from_rotation, rotation_from_axis_angle};
use ghand_datasets::{Dataset, Options, recognise};
use ghand_test_support::mano_files::python::{Py, array, dictionary, pickle, string};
use glam::{DMat3, DVec3};
use image::{Rgb, RgbImage};

use crate::mano::{Mano, check_vertices, numbers, vectors};
use crate::scene::{Label, Scene, Shown, check, flat, folder, import, last_number, options, put, refused, save};

pub const FRAMES: usize = 12;
/// MANO's joint or tip at each of MediaPipe's landmarks.
const ORDER: [usize; 21] = [0, 13, 14, 15, 16, 1, 2, 3, 17, 4, 5, 6, 18, 10, 11, 12, 19, 7, 8, 9, 20];
/// Frame 2 has no annotation.
const WITHOUT: usize = 2;

fn opengl(point: DVec3) -> DVec3 {
    DVec3::new(point.x, -point.y, -point.z)
}

fn numbers_array(shape: &[usize], values: &[f64]) -> Py {
    Py::Array(array("<f4", shape, false, values))
}

/// The folder of a camera; `shift` moves what it annotates.
fn write_camera(
    root: &Path,
    name: &str,
    scene: &Scene,
    camera: usize,
    shift: DVec3,
    mano: impl Fn(usize) -> [Vec<f64>; 3],
) {
    let folder = root.join("train").join(name);
    for f in 0..FRAMES {
        let mut joints = [DVec3::ZERO; 21];
        for (landmark, joint) in ORDER.into_iter().enumerate() {
            joints[joint] = opengl(scene.joints_in_camera(camera, f)[landmark] + shift);
        }
        let k = numbers_array(&[3, 3], &scene.opencv_matrix(camera));
        let [pose, place, shape] = mano(f);
        let known = |value: Py| if f == WITHOUT { Py::None } else { value };
        let meta = dictionary(vec![
            ("objName", string("021_bleach_cleanser")),
            ("camIDList", Py::List(vec![string("0"), string("1")])),
            ("camMat", k),
            ("handJoints3D", known(numbers_array(&[21, 3], &flat(&joints)))),
            ("handPose", known(numbers_array(&[48], &pose))),
            ("handTrans", known(numbers_array(&[3], &place))),
            ("handBeta", known(numbers_array(&[10], &shape))),
            ("objRot", known(numbers_array(&[3, 1], &[0.0; 3]))),
        ]);
        put(folder.join(format!("meta/{f:04}.pkl")), pickle(&meta));
        save(&scene.picture(camera, f), folder.join(format!("rgb/{f:04}.jpg")));
        let label = scene.labels(camera, f);
        let colors = RgbImage::from_fn(640, 480, |x, y| {
            Rgb(match label(x, y) {
                Label::Hand => [0, 0, 255],
                Label::Object => [0, 255, 0],
                Label::Room => [0, 0, 0],
            })
        });
        save(&colors, folder.join(format!("seg/{f:04}.png")));
    }
}

fn zeros(_: usize) -> [Vec<f64>; 3] {
    [vec![0.0; 48], vec![0.0; 3], vec![0.0; 10]]
}

fn text(rows: &[f64], width: usize) -> String {
    let line = |row: &[f64]| row.iter().map(|v| format!("{v:.12e}")).collect::<Vec<_>>().join(" ");
    rows.chunks(width).map(|row| line(row) + "\n").collect()
}

/// Three cameras, the numbers 0, 2 and 4 of a scene with 5 in all, of which the last annotates another place.
fn write_scene(root: &Path, scene: &Scene) -> PathBuf {
    std::fs::create_dir_all(root.join("evaluation")).unwrap();
    let calibration = root.join("calibration/ABF1/calibration");
    put(calibration.join("cam_orders.txt"), "2\n0\n4\n3\n1\n");
    for (place, camera) in [2, 0, 4, 3, 1].into_iter().enumerate() {
        put(calibration.join(format!("trans_{place}.txt")), text(&scene.world_from_camera(camera), 4));
    }
    write_camera(root, "ABF10", scene, 0, DVec3::ZERO, zeros);
    write_camera(root, "ABF12", scene, 2, DVec3::ZERO, zeros);
    write_camera(root, "ABF14", scene, 4, DVec3::new(0.0, 0.03, 0.0), zeros);
    root.join("train/ABF12")
}

#[test]
fn the_cameras_of_a_scene_see_one_hand_and_one_that_disagrees_is_left_out() {
    let (folder, out) = folder();
    let root = folder.path().join("HO3D_v3");
    let scene = Scene::new(Side::Right, 5, (640, 480), FRAMES);
    let sequence = write_scene(&root, &scene);
    assert_eq!([&root, &sequence].map(|path| recognise(path)), [Some(Dataset::Ho3d); 2]);
    let written = import(&sequence, &options(&out));
    let ids: Vec<&str> = written.capture.cameras.iter().map(|camera| camera.id.as_str()).collect();
    assert_eq!(ids, ["ABF12", "ABF10"]);
    assert!(!written.capture.frames.iter().any(|frame| frame.id == format!("{WITHOUT:04}")));
    let shown = Shown { scene: &scene, cameras: vec![2, 0], frame: last_number, has_masks: true, has_pixels: true };
    check(&written, &shown);
    // The given camera is the world.
    assert_eq!(written.capture.cameras[0].rotation, DMat3::IDENTITY);
    let remark = written.remarks.iter().find(|remark| remark.contains("ABF14"));
    assert!(remark.is_some_and(|remark| remark.contains("30 mm elsewhere")), "{:?}", written.remarks);
}

#[test]
fn manos_pose_is_from_the_flat_hand_in_opengls_axes() {
    let (folder, out) = folder();
    let root = folder.path().join("HO3D_v3");
    let scene = Scene::new(Side::Right, 1, (640, 480), FRAMES);
    let mano = Mano::new(folder.path(), Side::Right);
    let parts = |f: usize| (vectors(1, f, 0.8)[0], vectors(15, 60 + f, 0.3), numbers(10, 5, 1.0));
    let place = |f: usize| DVec3::new(0.03, -0.02, -0.6 - 0.01 * f as f64);
    write_camera(&root, "SM1", &scene, 0, DVec3::ZERO, |f| {
        let (turn, fingers, shape) = parts(f);
        [flat(&[vec![turn], fingers].concat()), place(f).to_array().to_vec(), shape]
    });
    let sequence = root.join("train/SM1");
    let written = import(&sequence, &Options { hand_model: Some(mano.path.clone()), ..options(&out) });
    let here = ghand_core::Camera::look_at(DVec3::ZERO, DVec3::Z, -DVec3::Y, 0.5, 224, 224);
    check_vertices(&written, 0, &here, |id| {
        let (turn, fingers, shape) = parts(last_number(id));
        let vertices = mano.posed(turn, &fingers, &shape).0;
        vertices.iter().map(|vertex| opengl(*vertex + place(last_number(id)))).collect()
    });
    // Turning axes is turning the root.
    let flip = DMat3::from_diagonal(DVec3::new(1.0, -1.0, -1.0));
    let expected = axis_angle_from_rotation(&(flip * rotation_from_axis_angle(parts(0).0)));
    assert!(written.capture.frames[0].pose.rotations[0].distance(expected) < 1e-6);
}

#[test]
fn the_evaluation_split_has_no_poses() {
    let (folder, out) = folder();
    let root = folder.path().join("HO3D_v3");
    let scene = Scene::new(Side::Right, 1, (64, 48), 1);
    let sequence = root.join("evaluation/SM1");
    let wrist = opengl(scene.joints_in_camera(0, 0)[0]);
    let meta = dictionary(vec![
        ("camMat", numbers_array(&[3, 3], &scene.opencv_matrix(0))),
        ("handJoints3D", numbers_array(&[3], &wrist.to_array())),
    ]);
    put(sequence.join("meta/0000.pkl"), pickle(&meta));
    save(&scene.picture(0, 0), sequence.join("rgb/0000.png"));
    let error = refused(&sequence, &options(&out));
    assert!(error.contains("the evaluation split has only the wrist: give a sequence of train"), "{error}");
}
