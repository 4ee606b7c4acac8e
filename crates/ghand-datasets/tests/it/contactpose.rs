use std::path::{Path, PathBuf};

use ghand_core::{Camera, Side};
use ghand_datasets::{Dataset, Options, recognise};
use ghand_motion::image_landmarks::MEDIAPIPE_TIP_INSET;
use glam::{DMat3, DQuat, DVec2, DVec3};
use image::imageops::{rotate90, rotate180, rotate270};
use serde_json::{Value, json};

use crate::mano::{Mano, check_vertices, numbers, vectors};
use crate::scene::{Scene, Shown, check, folder, import, last_number, options, put, refused, rows, save};

pub const FRAMES: usize = 12;
/// The size of the sensors' images.
const SENSOR: (u32, u32) = (960, 540);
/// In the order of a JSON object of serde, by name.
const CAMERAS: [&str; 3] = ["kinect2_left", "kinect2_middle", "kinect2_right"];

/// Rigid motions, for the tree of the data set: world, object, hand.
#[derive(Clone, Copy)]
pub struct Motion(DMat3, DVec3);

impl Motion {
    fn some(seed: usize) -> Motion {
        let [turn, shift] = [vectors(1, seed, 1.0)[0], vectors(1, seed + 500, 0.3)[0]];
        Motion(ghand_core::rotation::rotation_from_axis_angle(turn), shift)
    }

    fn apply(&self, point: DVec3) -> DVec3 {
        self.0 * point + self.1
    }

    fn inverse(&self) -> Motion {
        Motion(self.0.transpose(), -(self.0.transpose() * self.1))
    }

    fn json(&self) -> Value {
        let q = DQuat::from_mat3(&self.0);
        json!({"translation": self.1.to_array(), "rotation": [q.w, q.x, q.y, q.z]})
    }
}

/// The world to the object at a moment, and the object to a hand that does not move in its own axes.
fn object_from_world(frame: usize) -> Motion {
    Motion::some(10 + frame)
}

/// Fingertips as trackers of images see them, inside of the fingers.
fn inset(mut joints: [DVec3; 21]) -> [DVec3; 21] {
    for tip in [4, 8, 12, 16, 20] {
        joints[tip] -= MEDIAPIPE_TIP_INSET * (joints[tip] - joints[tip - 1]).normalize();
    }
    joints
}

/// Writes a grasp by one hand; `fit` is MANO's of it.
pub fn write(root: &Path, scene: &Scene, hand: Option<&dyn Fn(usize) -> Motion>, fit: &Value) -> PathBuf {
    let folder = root.join("full28_use/bowl");
    let number = usize::from(scene.model.side == Side::Right);
    // Joints are constant in the hand's axes, so that all frames have one pose.
    let hand_from_object = |f: usize| hand.map_or(Motion(DMat3::IDENTITY, DVec3::ZERO), |hand| hand(f));
    let joints = inset(scene.joints(0)).map(|point| hand_from_object(0).apply(object_from_world(0).apply(point)));
    let own = json!({"valid": true, "moving": hand.is_some(), "joints": rows(&joints)});
    let other = json!({"valid": false});
    let hands = if number == 1 { json!([other, own]) } else { json!([own, other]) };
    let frame = |f: usize| {
        let [own, other] = [hand_from_object(f).json(), Value::Null];
        let hto = if number == 1 { json!([other, own]) } else { json!([own, other]) };
        json!({"oTw": object_from_world(f).json(), "hTo": hto, "object_pose_optimized": true})
    };
    let mut cameras = serde_json::Map::new();
    for (c, name) in CAMERAS.iter().enumerate() {
        let [fx, _, cx, _, fy, cy, ..] = scene.opencv_matrix(c);
        let camera = &scene.cameras[c];
        let world_from_camera = Motion(camera.rotation.transpose(), camera.center());
        let k = json!({"fx": fx, "fy": fy, "cx": cx, "cy": cy});
        cameras.insert((*name).into(), json!({"valid": true, "K": k, "wTc": world_from_camera.json()}));
    }
    cameras.insert("kinect2_broken".into(), json!({"valid": false}));
    let frames: Vec<Value> = (0..FRAMES).map(frame).collect();
    let annotations = json!({"object": "bowl", "frames": frames, "hands": hands, "cameras": cameras});
    put(folder.join("annotations.json"), annotations.to_string());
    put(folder.join("mano_fits_15.json"), fit.to_string());
    for (c, name) in CAMERAS.iter().enumerate() {
        for f in 0..FRAMES {
            let picture = scene.picture(c, f);
            let turned = match *name {
                "kinect2_left" => rotate90(&picture),
                "kinect2_right" => rotate270(&picture),
                _ => rotate180(&picture),
            };
            save(&turned, folder.join(format!("images_full/{name}/color/frame{f:03}.png")));
        }
    }
    folder
}

/// A scene in which the hand of the first frame moves with the object, and perhaps against it.
pub fn scene(side: Side, hand: Option<&dyn Fn(usize) -> Motion>) -> Scene {
    let mut scene = Scene::new(side, 3, SENSOR, FRAMES);
    let first = scene.poses[0].clone();
    let root = scene.model.joints[0];
    let hand = |f: usize| hand.map_or(Motion(DMat3::IDENTITY, DVec3::ZERO), |hand| hand(f));
    for f in 0..FRAMES {
        // World of frame 0, its object, its hand; then back in frame f.
        let [a, b, c, d] = [object_from_world(0), hand(0), hand(f).inverse(), object_from_world(f).inverse()];
        let whole = [b, c, d].iter().fold(a, |done, next| Motion(next.0 * done.0, next.apply(done.1)));
        scene.poses[f] = first.moved(&whole.0, whole.1, root);
    }
    // Cameras must still see it.
    let middle = scene.joints(0).iter().sum::<DVec3>() / 21.0;
    for (k, camera) in scene.cameras.iter_mut().enumerate() {
        let eye = middle + DVec3::new([1.6, -0.4, 0.5][k], [0.1, 1.7, -0.3][k], [0.3, 0.2, 1.8][k]);
        let up = if k == 1 { DVec3::Z } else { DVec3::Y };
        *camera = Camera { id: camera.id.clone(), ..Camera::look_at(eye, middle, up, 0.9, SENSOR.0, SENSOR.1) };
        camera.focal *= DVec2::new(1.0 + 0.01 * k as f64, 1.02);
        camera.principal += DVec2::new(7.0 + k as f64, -4.0);
    }
    scene
}

/// The scene's cameras as the turned images have them.
fn turned(scene: &Scene) -> Scene {
    let turn = |(k, camera): (usize, &Camera)| {
        let (rows, width, height) = match k {
            0 => ([-DVec3::Y, DVec3::X], SENSOR.1, SENSOR.0),
            1 => ([-DVec3::X, -DVec3::Y], SENSOR.0, SENSOR.1),
            _ => ([DVec3::Y, -DVec3::X], SENSOR.1, SENSOR.0),
        };
        let rotation = DMat3::from_cols(rows[0], rows[1], DVec3::Z).transpose();
        // A pixel (x, y) of the sensor goes where the image's does.
        let (w, h) = (f64::from(SENSOR.0), f64::from(SENSOR.1));
        let p = camera.principal;
        let principal = [DVec2::new(h - p.y, p.x), DVec2::new(w - p.x, h - p.y), DVec2::new(p.y, w - p.x)][k];
        let focal = if k == 1 { camera.focal } else { DVec2::new(camera.focal.y, camera.focal.x) };
        Camera {
            id: camera.id.clone(),
            width,
            height,
            focal,
            principal,
            rotation: rotation * camera.rotation,
            translation: rotation * camera.translation,
        }
    };
    let cameras = scene.cameras.iter().enumerate().map(turn).collect();
    Scene { model: scene.model.clone(), poses: scene.poses.clone(), cameras }
}

#[test]
fn turned_images_of_a_hand_that_moves_with_the_object_belong_to_turned_cameras() {
    let (folder, out) = folder();
    let scene = scene(Side::Left, None);
    let grasp =
        write(&folder.path().join("contactpose_data"), &scene, None, &json!([{"valid": false}, {"valid": false}]));
    let [whole, session] = [2, 1].map(|levels| grasp.ancestors().nth(levels).unwrap());
    assert_eq!([whole, session, &grasp].map(recognise), [Some(Dataset::ContactPose); 3]);
    let written = import(&grasp, &options(&out));
    let ids: Vec<&str> = written.capture.cameras.iter().map(|camera| camera.id.as_str()).collect();
    assert_eq!(ids, CAMERAS);
    let seen = turned(&scene);
    let shown = Shown { scene: &seen, cameras: vec![0, 1, 2], frame: last_number, has_masks: false, has_pixels: true };
    check(&written, &shown);
    let right = refused(&grasp, &Options { side: Some(Side::Right), ..options(&out) });
    assert!(right.ends_with("shows only a left hand; give --side left, or omit it"), "{right}");
}

#[test]
fn manos_fit_is_placed_by_a_hand_that_moves_in_the_objects_axes() {
    let (folder, out) = folder();
    let hand = |f: usize| Motion::some(40 + f);
    let scene = scene(Side::Right, Some(&hand));
    let mano = Mano::new(folder.path(), Side::Right);
    let (turn, components, shape) = (vectors(1, 3, 0.8)[0], numbers(15, 4, 0.5), numbers(10, 5, 1.0));
    let mano_from_hand = Motion::some(77);
    let pose = [turn.to_array().to_vec(), components.clone()].concat();
    let fit = json!([{"valid": false}, {"valid": true, "pose": pose, "betas": shape, "mTc": mano_from_hand.json()}]);
    let grasp = write(folder.path(), &scene, Some(&hand), &fit);
    let written = import(&grasp, &Options { hand_model: Some(mano.path.clone()), ..options(&out) });
    let fingers = mano.with_mean(&mano.of_components(&components));
    let vertices = mano.posed(turn, &fingers, &shape).0;
    check_vertices(&written, 1, &turned(&scene).cameras[1], |id| {
        let f = last_number(id);
        let world = [mano_from_hand.inverse(), hand(f).inverse(), object_from_world(f).inverse()];
        vertices.iter().map(|vertex| world.iter().fold(*vertex, |point, next| next.apply(point))).collect()
    });
}
