use std::path::Path;

use ghand_core::{Camera, Side};
use ghand_datasets::{Dataset, Options, recognise};
use glam::{DMat3, DQuat, DVec2, DVec3};
use serde_json::{Value, json};

use crate::mano::{Mano, check_vertices, numbers, vectors};
use crate::scene::{Scene, folder, import, last_number, mark_in, marked, options, refused};

pub const FRAMES: usize = 12;
const SIZE: (u32, u32) = (400, 360);
const FOCAL: f64 = 300.0;
const PRINCIPAL: DVec2 = DVec2::new(203.25, 176.75);
/// k1 to k6, p1, p2, s1 to s4.
const LENS: [f64; 12] = [0.05, -0.02, 0.01, -0.003, 0.002, -0.001, 0.004, -0.003, 0.002, -0.001, 0.003, 0.001];

/// A motion as the data set writes it.
fn motion(rotation: DMat3, translation: DVec3) -> Value {
    let q = DQuat::from_mat3(&rotation);
    json!({"quaternion_wxyz": [q.w, q.x, q.y, q.z], "translation_xyz": translation.to_array()})
}

/// Project Aria's projection, written out; pixels with the first one's centre at (0, 0).
fn projected(at: DVec3) -> DVec2 {
    let r = at.truncate().length();
    let theta = r.atan2(at.z);
    let [k1, k2, k3, k4, k5, k6, p1, p2, s1, s2, s3, s4] = LENS;
    let t2 = theta * theta;
    let radial =
        1.0 + k1 * t2 + k2 * t2.powi(2) + k3 * t2.powi(3) + k4 * t2.powi(4) + k5 * t2.powi(5) + k6 * t2.powi(6);
    let DVec2 { x, y } = at.truncate() / r * theta * radial;
    let r2 = x * x + y * y;
    let u = x + 2.0 * p2 * x * y + p1 * (r2 + 2.0 * x * x) + s1 * r2 + s2 * r2 * r2;
    let v = y + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * y * y) + s3 * r2 + s4 * r2 * r2;
    DVec2::new(u, v) * FOCAL + PRINCIPAL
}

/// The headset: where its colour camera is in it, and its world at each moment.
struct Headset {
    device_from_camera: (DMat3, DVec3),
    camera: Camera,
}

impl Headset {
    fn new(scene: &Scene) -> Headset {
        let turn = ghand_core::rotation::rotation_from_axis_angle(vectors(1, 31, 1.0)[0]);
        Headset { device_from_camera: (turn, vectors(1, 32, 0.1)[0]), camera: scene.cameras[0].clone() }
    }

    /// Rotation and translation from the camera to the world: the headset nods.
    fn world_from_camera(&self, f: usize) -> (DMat3, DVec3) {
        let nod = DMat3::from_rotation_x(0.01 * f as f64);
        (self.camera.rotation.transpose() * nod, self.camera.center() + DVec3::new(0.0, 0.002 * f as f64, 0.0))
    }

    fn camera_from_world(&self, f: usize, at: DVec3) -> DVec3 {
        let (rotation, translation) = self.world_from_camera(f);
        rotation.transpose() * (at - translation)
    }
}

fn parts(f: usize) -> (DVec3, Vec<f64>, DVec3) {
    (vectors(1, f, 0.8)[0], numbers(15, 60 + f, 0.5), vectors(1, 200 + f, 0.05)[0])
}

fn shape() -> Vec<f64> {
    numbers(10, 8, 1.0)
}

fn files(scene: &Scene, headset: &Headset) -> Vec<(String, Vec<u8>)> {
    let mut files =
        vec![("__hand_shapes.json__".to_owned(), json!({"mano": shape(), "umetrack": {}}).to_string().into())];
    for f in 0..FRAMES {
        let (world_rotation, world_translation) = headset.world_from_camera(f);
        let stream = |name: &str, focals: &[f64]| {
            let params = [focals, &PRINCIPAL.to_array(), &LENS].concat();
            json!({
                "calibration": {"label": "camera", "stream_id": name, "image_width": SIZE.0, "image_height": SIZE.1,
                                "projection_model_type": "CameraModelType.FISHEYE624", "projection_params": params,
                                "T_device_from_camera": motion(headset.device_from_camera.0, headset.device_from_camera.1)},
                "T_world_from_camera": motion(world_rotation, world_translation)
            })
        };
        let cameras = json!({"1201-1": stream("1201-1", &[1.0, 1.0]), "214-1": stream("214-1", &[FOCAL])});
        let (turn, thetas, place) = parts(f);
        let wrist = [turn.to_array(), place.to_array()].concat();
        // In frame 4 the hand is hidden, in frame 5 MANO's registration failed.
        let visible = if f == 4 { 0.05 } else { 0.9 };
        let mut right = json!({"mano_pose": {"thetas": thetas, "wrist_xform": wrist},
                               "visibilities_modeled": {"214-1": visible, "1201-1": 1.0}, "boxes_amodal": {}});
        if f == 5 {
            right.as_object_mut().unwrap().remove("mano_pose");
        }
        let at = projected(headset.camera_from_world(f, scene.joints(f)[0])) + 0.5;
        let mut jpeg = std::io::Cursor::new(vec![]);
        let encoder = image::codecs::jpeg::JpegEncoder::new_with_quality(&mut jpeg, 98);
        marked(SIZE.0, SIZE.1, at).write_with_encoder(encoder).unwrap();
        let name = |part: &str| format!("{f:06}.{part}");
        files.push((name("cameras.json"), cameras.to_string().into()));
        files.push((name("hands.json"), json!({"right": right, "left": null}).to_string().into()));
        files.push((name("info.json"), b"{}".to_vec()));
        files.push((name("image_214-1.jpg"), jpeg.into_inner()));
        files.push((name("image_1201-1.jpg"), b"grey".to_vec()));
    }
    files
}

fn write_tar(path: &Path, files: &[(String, Vec<u8>)]) {
    let mut tar = tar::Builder::new(std::fs::File::create(path).unwrap());
    for (name, bytes) in files {
        let mut header = tar::Header::new_gnu();
        header.set_size(bytes.len() as u64);
        header.set_mode(0o644);
        tar.append_data(&mut header, name, bytes.as_slice()).unwrap();
    }
    tar.finish().unwrap();
}

#[test]
fn a_moving_headsets_clip_is_a_hand_that_moves_before_a_still_pinhole_camera() {
    let (folder, out) = folder();
    let scene = Scene::new(Side::Right, 1, SIZE, FRAMES);
    let headset = Headset::new(&scene);
    let files = files(&scene, &headset);
    let tar = folder.path().join("clip-000123.tar");
    write_tar(&tar, &files);
    let unpacked = folder.path().join("unpacked");
    files.iter().for_each(|(name, bytes)| crate::scene::put(unpacked.join(name), bytes));
    let mano = Mano::new(folder.path(), Side::Right);
    let options = Options { hand_model: Some(mano.path.clone()), ..options(&out) };
    for clip in [&tar, &unpacked] {
        assert_eq!(recognise(clip), Some(Dataset::Hot3d));
        let written = import(clip, &options);
        assert_eq!(written.annotated, FRAMES - 2);
        let [camera] = &written.capture.cameras[..] else { panic!("more than the camera in colour") };
        assert_eq!((camera.focal, camera.principal), (DVec2::splat(FOCAL), PRINCIPAL + 0.5));
        // Where the camera was at each moment is taken back.
        let here = Camera::look_at(DVec3::ZERO, DVec3::Z, -DVec3::Y, 0.5, SIZE.0, SIZE.1);
        check_vertices(&written, 0, &here, |id| {
            let f = last_number(id);
            let (turn, thetas, place) = parts(f);
            let posed = mano.posed(turn, &mano.with_mean(&mano.of_components(&thetas)), &shape()).0;
            posed.iter().map(|vertex| headset.camera_from_world(f, *vertex + place)).collect()
        });
        let mut marks = vec![];
        for (number, frame) in written.capture.frames.iter().enumerate() {
            let f = last_number(&frame.id);
            let at = headset.camera_from_world(f, scene.joints(f)[0]);
            let pixel = DVec2::new(at.x, at.y) / at.z * camera.focal + camera.principal;
            let mark = mark_in(&written.capture.image_file(0, number).unwrap());
            marks.push(mark - pixel);
        }
        // Marks are whole pixels; only their mean tells half a pixel.
        let mean = marks.iter().sum::<DVec2>() / marks.len() as f64;
        assert!(mean.length() < 0.2 && marks.iter().all(|off| off.length() < 0.9), "{marks:?}");
    }
    let bytes = std::fs::read(&tar).unwrap();
    std::fs::write(&tar, &bytes[..bytes.len() / 2]).unwrap();
    let error = refused(&tar, &options);
    assert!(error.contains("clip-000123.tar") && error.contains("download it again"), "{error}");
}
