//! A hand that moves in front of cameras, as a tracker with errors sees it.

use ghand_capture::cameras::list::LensCamera;
use ghand_core::rotation::rotation_from_axis_angle;
use ghand_core::{Camera, HandModel, Pose, Side};
use ghand_hand_model::builtin::builtin_hand;
use ghand_import::rig::LANDMARKS;
use ghand_import::track::{Sighting, Track};
use ghand_motion::ik::HandIk;
use ghand_motion::{PoseSequence, RestSkeleton, motions};
use glam::{DVec2, DVec3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// The hand model of all tests.
pub fn hand() -> HandModel {
    builtin_hand(Side::Right).unwrap()
}

/// A hand in motion.
pub struct Motion {
    ik: HandIk,
    fingers: PoseSequence,
    phase: f64,
    /// After how many seconds fingers and wrist do the same again.
    period: f64,
}

impl Motion {
    pub fn new(seed: u64) -> Motion {
        Motion::repeated(seed, f64::INFINITY)
    }

    pub fn repeated(seed: u64, period: f64) -> Motion {
        let model = hand();
        let fingers = motions::motion("tour", &model, 30.0).unwrap().unwrap();
        Motion { ik: HandIk::new(&RestSkeleton::of(&model).unwrap()), fingers, phase: seed as f64, period }
    }

    /// Landmarks at a time, metres.
    pub fn at(&self, time: f64) -> [DVec3; LANDMARKS] {
        let place_time = time + self.phase;
        let t = if self.period.is_finite() { place_time.rem_euclid(self.period) } else { place_time };
        // Never the same twice.
        let finger_time = (1.0 + 0.3 * (0.11 * t).sin()) * t + 0.9 * (0.83 * t).sin();
        let mut pose: Pose = self.fingers.pose_at(finger_time.rem_euclid(self.fingers.duration())).unwrap();
        pose.rotations[0] = DVec3::new(0.7 * (0.9 * t).sin(), 1.1 * (0.6 * t + 1.0).sin(), 0.8 * (0.75 * t).sin());
        let t = place_time;
        pose.translation = 0.08 * DVec3::new((0.7 * t).sin(), (0.9 * t).cos(), 1.3 * (0.5 * t).sin());
        let mut points = self.ik.landmarks(&pose);
        for tip in (4..LANDMARKS).step_by(4) {
            points[tip] -= 0.006 * (points[tip] - points[tip - 1]).normalize();
        }
        points
    }
}

/// Cameras around the hand, 0.6 m away.
pub fn cameras(count: usize) -> Vec<Camera> {
    let camera = |k: usize| {
        let angle = 0.75 * (k as f64 - 0.5 * (count as f64 - 1.0));
        let eye = 0.6 * DVec3::new(angle.sin(), 0.25 * (k % 2) as f64, angle.cos());
        let mut camera = Camera::look_at(eye, DVec3::ZERO, DVec3::Y, 0.8, 640, 480);
        camera.focal *= 1.0 + 0.07 * k as f64;
        camera.id = format!("cam{k}");
        camera
    };
    (0..count).map(camera).collect()
}

pub fn lenses(cameras: &[Camera]) -> Vec<LensCamera> {
    cameras.iter().map(|camera| LensCamera { camera: camera.clone(), distortion: None }).collect()
}

/// A standard normal number.
fn normal(random: &mut ChaCha8Rng) -> f64 {
    (0..12).map(|_| random.random::<f64>()).sum::<f64>() - 6.0
}

fn normal3(random: &mut ChaCha8Rng) -> DVec3 {
    DVec3::new(normal(random), normal(random), normal(random))
}

/// What a tracker with errors sees of a motion: noise of `noise` metres at the hand, of which half stays with a landmark
/// for long, guesses of depth that are 15 degrees off, and one frame in twenty that is all wrong.
pub fn track(motion: &Motion, camera: &Camera, rate: f64, seconds: f64, offset: f64, noise: f64, seed: u64) -> Track {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let bias: [DVec2; LANDMARKS] =
        std::array::from_fn(|_| 0.5 * noise * DVec2::new(normal(&mut random), normal(&mut random)));
    let times: Vec<f64> = (0..(seconds * rate) as usize).map(|k| k as f64 / rate).collect();
    let sightings = times.iter().map(|time| {
        let points = motion.at(time - offset);
        let middle = points.iter().sum::<DVec3>() / LANDMARKS as f64;
        let scale = camera.focal.x / camera.camera_from_world(middle).z;
        let is_wrong = random.random_range(0..20) == 0;
        let mut off = |k: usize| {
            let jitter = noise * if is_wrong { 8.0 } else { 1.0 };
            (bias[k] + jitter * DVec2::new(normal(&mut random), normal(&mut random))) * scale
        };
        let pixels = std::array::from_fn(|k| camera.project(points[k]).0 + off(k));
        let tilt = rotation_from_axis_angle(0.25 * normal3(&mut random));
        let world =
            points.map(|point| 0.95 * (tilt * (camera.rotation * (point - middle))) + noise * normal3(&mut random));
        Some(Sighting { pixels, world, presence: 1.0, sharpness: 1.0, others: vec![] })
    });
    let sightings = sightings.collect();
    Track { times, sightings }
}
