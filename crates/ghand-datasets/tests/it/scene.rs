//! A hand in known poses before known cameras, with pictures that show where its wrist is, and the comparison of a capture
//! with it.

use std::f64::consts::TAU;
use std::fs;
use std::path::{Path, PathBuf};

use ghand_core::posing::shape_hand;
use ghand_core::rotation::rotation_from_axis_angle;
use ghand_core::{Camera, HandModel, Pose, Side};
use ghand_datasets::{Options, Written, write_capture};
use ghand_hand_model::builtin::builtin_hand;
use ghand_hand_model::joints::names::{Finger, JointRole};
use ghand_motion::RestSkeleton;
use ghand_motion::ik::HandIk;
use glam::{DMat3, DVec2, DVec3};
use image::{GrayImage, Luma, Rgb, RgbImage};

pub const WRIST: usize = 0;
pub const MIDDLE_KNUCKLE: usize = 9;
pub const INDEX_TIP: usize = 8;
/// Half the width of the marks in pictures and masks, pixels.
const MARK: f64 = 3.0;
const SPOT: f64 = 12.0;

pub struct Scene {
    pub model: HandModel,
    pub poses: Vec<Pose>,
    pub cameras: Vec<Camera>,
}

impl Scene {
    /// A hand that bends its fingers and turns, before cameras around it.
    pub fn new(side: Side, cameras: usize, size: (u32, u32), frames: usize) -> Scene {
        let model = builtin_hand(side).unwrap();
        let rig = RestSkeleton::of(&model).unwrap();
        let pose = |frame: usize| {
            let t = frame as f64 / frames as f64;
            let mut pose = Pose::rest(model.joint_count());
            pose.rotations[0] = DVec3::new(0.4 * (TAU * t).sin(), 0.5 * t, 0.3 * (TAU * t).cos());
            pose.translation = DVec3::new(0.02 * t, 0.05 - 0.03 * t, 0.01 * (TAU * t).cos());
            for (f, finger) in Finger::ALL.into_iter().enumerate() {
                let bend = if f == 0 { 0.2 } else { 0.55 } * (1.0 + (TAU * t + f as f64).sin()) * 0.5;
                for k in 1..=3u8 {
                    let joint = rig.joint(JointRole::Bend(finger, k)).unwrap();
                    let aside = if k == 1 { 0.1 * (TAU * t + 2.0 * f as f64).cos() } else { 0.0 };
                    let flexion = bend * [1.0, 1.1, 0.75][usize::from(k) - 1];
                    pose.rotations[joint] = rig.axes[joint].rotation(DVec3::new(flexion, aside, 0.0));
                }
            }
            pose
        };
        let camera = |k: usize| {
            let angle = TAU * (0.1 + k as f64 / cameras as f64);
            let eye = DVec3::new(0.6 * angle.cos(), 0.1, 0.6 * angle.sin());
            let mut camera = Camera::look_at(eye, DVec3::new(0.01, -0.04, 0.0), DVec3::Y, 0.55, size.0, size.1);
            // No two numbers of a camera are alike, so that none can stand for another.
            camera.focal *= DVec2::new(1.0 + 0.01 * k as f64, 1.02);
            camera.principal += DVec2::new(5.0 + k as f64, -4.0);
            camera.id = format!("scene{k}");
            camera
        };
        Scene { poses: (0..frames).map(pose).collect(), cameras: (0..cameras).map(camera).collect(), model }
    }

    /// The landmarks of a frame, in the scene's world, MediaPipe's order.
    pub fn joints(&self, frame: usize) -> [DVec3; 21] {
        HandIk::new(&RestSkeleton::of(&self.model).unwrap()).landmarks(&self.poses[frame])
    }

    /// The same in the axes of a camera, metres.
    pub fn joints_in_camera(&self, camera: usize, frame: usize) -> [DVec3; 21] {
        self.joints(frame).map(|joint| self.cameras[camera].camera_from_world(joint))
    }

    pub fn pixel(&self, camera: usize, frame: usize, landmark: usize) -> DVec2 {
        self.cameras[camera].project(self.joints(frame)[landmark]).0
    }

    /// A picture with a red mark at the wrist.
    pub fn picture(&self, camera: usize, frame: usize) -> RgbImage {
        let (camera, at) = (&self.cameras[camera], self.pixel(camera, frame, WRIST));
        marked(camera.width, camera.height, at)
    }

    /// Where the hand is seen, by pixel: around a knuckle, except where an object, around a fingertip, is before it.
    pub fn labels(&self, camera: usize, frame: usize) -> impl Fn(u32, u32) -> Label + use<> {
        let [tip, knuckle] = [INDEX_TIP, MIDDLE_KNUCKLE].map(|landmark| self.pixel(camera, frame, landmark));
        move |x, y| match (within(x, y, tip, SPOT), within(x, y, knuckle, SPOT)) {
            (true, _) => Label::Object,
            (false, true) => Label::Hand,
            (false, false) => Label::Room,
        }
    }

    /// The mask that a capture must have.
    pub fn mask(&self, camera: usize, frame: usize) -> GrayImage {
        let Camera { width, height, .. } = self.cameras[camera];
        let label = self.labels(camera, frame);
        let value = |x, y| if label(x, y) == Label::Hand { 255 } else { 0 };
        GrayImage::from_fn(width, height, |x, y| Luma([value(x, y)]))
    }

    /// K with the first pixel's centre at (0, 0), row by row.
    pub fn opencv_matrix(&self, camera: usize) -> [f64; 9] {
        let Camera { focal, principal, .. } = &self.cameras[camera];
        [focal.x, 0.0, principal.x - 0.5, 0.0, focal.y, principal.y - 0.5, 0.0, 0.0, 1.0]
    }

    /// The four rows of the motion from the world to a camera.
    pub fn camera_from_world(&self, camera: usize) -> [f64; 16] {
        matrix(&self.cameras[camera].rotation, self.cameras[camera].translation)
    }

    /// The four rows of the motion from a camera to the world.
    pub fn world_from_camera(&self, camera: usize) -> [f64; 16] {
        let Camera { rotation, .. } = &self.cameras[camera];
        matrix(&rotation.transpose(), self.cameras[camera].center())
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Label {
    Hand,
    Object,
    Room,
}

/// A grey picture with a red mark.
pub fn marked(width: u32, height: u32, at: DVec2) -> RgbImage {
    let color = |x, y| if within(x, y, at, MARK) { [230, 20, 20] } else { [60, 60, 60] };
    RgbImage::from_fn(width, height, |x, y| Rgb(color(x, y)))
}

fn within(x: u32, y: u32, center: DVec2, radius: f64) -> bool {
    (DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5) - center).abs().max_element() <= radius
}

/// The middle of the red pixels, pixels with centres at halves.
pub fn mark_in(path: &Path) -> DVec2 {
    let image = image::open(path).unwrap().into_rgb8();
    let red = image.enumerate_pixels().filter(|(_, _, p)| p.0[0] > 130 && p.0[1] < 60);
    let places: Vec<DVec2> = red.map(|(x, y, _)| DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5)).collect();
    assert!(!places.is_empty(), "{} has no mark", path.display());
    places.iter().sum::<DVec2>() / places.len() as f64
}

pub fn matrix(rotation: &DMat3, translation: DVec3) -> [f64; 16] {
    let [x, y, z] = rotation.transpose().to_cols_array_2d();
    let row = |r: [f64; 3], t: f64| [r[0], r[1], r[2], t];
    let rows = [row(x, translation.x), row(y, translation.y), row(z, translation.z), [0.0, 0.0, 0.0, 1.0]];
    rows.concat().try_into().unwrap()
}

/// All coordinates in a row.
pub fn flat(points: &[DVec3]) -> Vec<f64> {
    points.iter().flat_map(DVec3::to_array).collect()
}

pub fn rows(points: &[DVec3]) -> Vec<[f64; 3]> {
    points.iter().map(DVec3::to_array).collect()
}

pub fn square(numbers: &[f64], width: usize) -> Vec<Vec<f64>> {
    numbers.chunks(width).map(<[f64]>::to_vec).collect()
}

/// Writes a file and the folders above it.
pub fn put(path: impl AsRef<Path>, bytes: impl AsRef<[u8]>) {
    fs::create_dir_all(path.as_ref().parent().unwrap()).unwrap();
    fs::write(path, bytes).unwrap();
}

pub fn save(image: &RgbImage, path: impl AsRef<Path>) {
    fs::create_dir_all(path.as_ref().parent().unwrap()).unwrap();
    match path.as_ref().extension().unwrap().to_str() {
        Some("jpg") => {
            let file = fs::File::create(path).unwrap();
            let encoder = image::codecs::jpeg::JpegEncoder::new_with_quality(file, 98);
            image.write_with_encoder(encoder).unwrap();
        }
        _ => image.save(path).unwrap(),
    }
}

pub fn options(out: &Path) -> Options {
    Options { side: None, hand_model: None, frames: 64, out: out.into() }
}

pub fn import(folder: &Path, options: &Options) -> Written {
    write_capture(folder, options, &mut |_| true).unwrap()
}

pub fn refused(folder: &Path, options: &Options) -> String {
    match write_capture(folder, options, &mut |_| true) {
        Ok(written) => panic!("a capture of {} frames was written", written.capture.frames.len()),
        Err(error) => error.to_string(),
    }
}

/// What a capture shows of a scene.
pub struct Shown<'a> {
    pub scene: &'a Scene,
    /// The scene's camera of each of the capture's.
    pub cameras: Vec<usize>,
    /// The scene's frame of a frame's name.
    pub frame: fn(&str) -> usize,
    /// Whether masks are the scene's.
    pub has_masks: bool,
    /// Whether pixels are the scene's.
    pub has_pixels: bool,
}

/// Checks that the hand of a capture is where the scene has it, in the axes of each camera, that its joints turn as there,
/// and that images and masks belong to it.
pub fn check(written: &Written, shown: &Shown) {
    let capture = &written.capture;
    assert_eq!(capture.side, shown.scene.model.side);
    assert_eq!(capture.cameras.len(), shown.cameras.len());
    let mut worst = [0.0_f64; 4];
    // Marks are whole pixels; only their mean tells half a pixel.
    let mut marks = vec![];
    for (f, frame) in capture.frames.iter().enumerate() {
        let number = (shown.frame)(&frame.id);
        let shaped = shape_hand(&capture.hand_model, &frame.shape).unwrap();
        let hand = HandModel { joints: shaped.joints, vertices: shaped.vertices, ..capture.hand_model.clone() };
        let landmarks = HandIk::new(&RestSkeleton::of(&hand).unwrap()).landmarks(&frame.pose);
        for (c, (camera, seen)) in capture.cameras.iter().zip(&shown.cameras).enumerate() {
            let scene_camera = &shown.scene.cameras[*seen];
            for (at, expected) in landmarks.iter().zip(shown.scene.joints_in_camera(*seen, number)) {
                worst[0] = worst[0].max(1e3 * camera.camera_from_world(*at).distance(expected));
            }
            let image = capture.image_file(c, f).unwrap();
            if !image.exists() {
                continue;
            }
            marks.push(mark_in(&image) - camera.project(landmarks[WRIST]).0);
            if shown.has_pixels {
                let pixel = scene_camera.project(shown.scene.joints(number)[WRIST]).0;
                worst[1] = worst[1].max(camera.project(landmarks[WRIST]).0.distance(pixel));
            }
            if shown.has_masks {
                let mask = image::open(capture.mask_file(c, f).unwrap().unwrap()).unwrap().into_luma8();
                assert_eq!(mask, shown.scene.mask(*seen, number), "{} {}", camera.id, frame.id);
            }
            // The root as a camera sees it; fingers in the hand.
            let turned = |turn: &DMat3, pose: &Pose| *turn * rotation_from_axis_angle(pose.rotations[0]);
            let truth = &shown.scene.poses[number];
            let root = [turned(&camera.rotation, &frame.pose), turned(&scene_camera.rotation, truth)];
            worst[2] = worst[2].max(degrees(&root[0], &root[1]));
        }
        for (own, truth) in frame.pose.rotations.iter().zip(&shown.scene.poses[number].rotations).skip(1) {
            let [own, truth] = [own, truth].map(|rotation| rotation_from_axis_angle(*rotation));
            worst[3] = worst[3].max(degrees(&own, &truth));
        }
    }
    let [place, pixel, root, fingers] = worst;
    let mark = marks.iter().sum::<DVec2>() / marks.len() as f64;
    println!(
        "place {place:.3} mm, pixel {pixel:.3}, mark {mark:.3}, root {root:.3} degrees, fingers {fingers:.3} degrees"
    );
    assert!(place < 1.0, "landmarks are {place} mm off");
    assert!(pixel < 0.05, "the wrist is {pixel} px off");
    let largest = marks.iter().map(|off| off.length()).fold(0.0, f64::max);
    assert!(mark.length() < 0.2 && largest < 0.9, "the wrist is {mark} px off its marks, {largest} px at most");
    assert!(root < 1.0 && fingers < 2.0, "the root is {root} and fingers are {fingers} degrees off");
    let held_out = &capture.splits["test"];
    assert_eq!(held_out.frames.len(), (capture.frames.len() + 2) / 5);
}

fn degrees(a: &DMat3, b: &DMat3) -> f64 {
    let turn = *a * b.transpose();
    (0.5 * (turn.x_axis.x + turn.y_axis.y + turn.z_axis.z - 1.0)).clamp(-1.0, 1.0).acos().to_degrees()
}

/// The number at the end of a frame's name.
pub fn last_number(id: &str) -> usize {
    let digits = id.trim_end_matches(|c: char| !c.is_ascii_digit());
    let start = digits.rfind(|c: char| !c.is_ascii_digit()).map_or(0, |at| at + 1);
    digits[start..].parse().unwrap()
}

pub fn folder() -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    (folder, out)
}
