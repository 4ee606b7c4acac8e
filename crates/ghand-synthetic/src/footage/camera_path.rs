//! Where cameras are: standing in an arc in front of the arm, or a phone in a hand that walks around it.

use std::f64::consts::TAU;

use ghand_core::Camera;
use glam::{DQuat, DVec3};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use crate::noise::{noise, smoothstep};

/// Angles between neighbouring cameras, and from the first to the last, at most; radians.
const LARGEST_STEP: f64 = 60.0_f64.to_radians();
const LARGEST_ARC: f64 = 200.0_f64.to_radians();
/// Distances of cameras from the hand where it usually is, metres, and how high they look down on it, radians.
const DISTANCES: [f64; 2] = [0.46, 0.56];
const ELEVATIONS: [f64; 2] = [0.06, 0.50];
/// How far a standing camera is turned about its axis, at most, radians.
const ROLL: f64 = 0.07;
/// How far its aim is off, at most, metres.
const AIM: f64 = 0.015;

/// The walk: its angle, radians; the phone's distance and elevation with their changes; seconds that these take.
const WALK: f64 = 300.0_f64.to_radians();
const WALK_DISTANCE: [f64; 2] = [0.45, 0.05];
const WALK_ELEVATION: [f64; 2] = [0.22, 0.22];
const WALK_SECONDS: f64 = 2.2;
/// How a hand shakes: metres, radians, and seconds that a movement takes.
const SHAKE: f64 = 0.003;
const SHAKE_ANGLE: f64 = 0.008;
const SHAKE_SECONDS: f64 = 0.25;

/// The middle of the hand where it usually is.
pub(super) const HAND: DVec3 = DVec3::new(0.0, -0.01, 0.0);

/// Where a camera is at any time. Its intrinsics do not matter.
#[derive(Debug, Clone)]
pub(crate) enum CameraPath {
    /// Always at the same place.
    Standing(Camera),
    /// Around the hand.
    Walking {
        /// Azimuth in the middle of the walk, radians.
        middle: f64,
        /// Duration of the walk, from the time 0.
        seconds: f64,
        seed: u64,
    },
}

impl CameraPath {
    /// One of `count` cameras that stand.
    pub(crate) fn standing(index: usize, count: usize, rng: &mut ChaCha8Rng) -> CameraPath {
        let step = if count > 1 { arc(count) / (count - 1) as f64 } else { 0.0 };
        let mut even = || 2.0 * rng.random::<f64>() - 1.0;
        let azimuth = (index as f64 - 0.5 * (count as f64 - 1.0)) * step + 0.2 * step * even();
        let mut between = |[low, high]: [f64; 2]| low + (high - low) * (0.5 + 0.5 * even());
        let eye = HAND + between(DISTANCES) * direction(azimuth, between(ELEVATIONS));
        let target = HAND + AIM * DVec3::new(even(), even(), even());
        let up = rolled(eye - target, ROLL * even());
        CameraPath::Standing(look(eye, target, up))
    }

    /// A phone that is carried around the hand.
    pub(crate) fn walking(seconds: f64, seed: u64, rng: &mut ChaCha8Rng) -> CameraPath {
        CameraPath::Walking { middle: 0.6 * (rng.random::<f64>() - 0.5), seconds, seed }
    }

    /// Whether it stands.
    pub(crate) fn is_standing(&self) -> bool {
        matches!(self, CameraPath::Standing(_))
    }

    /// Where the camera is at a time, seconds.
    pub(crate) fn at(&self, time: f64) -> Camera {
        let (middle, seconds, seed) = match self {
            CameraPath::Standing(camera) => return camera.clone(),
            CameraPath::Walking { middle, seconds, seed } => (*middle, *seconds, *seed),
        };
        let wave = |k: u64, period: f64| noise(DVec3::new(time + 100.0, 0.5, 0.5), period, seed.wrapping_add(k));
        let shake = |k: u64| DVec3::new(wave(k, SHAKE_SECONDS), wave(k + 1, SHAKE_SECONDS), wave(k + 2, SHAKE_SECONDS));
        let azimuth = middle + WALK * (smoothstep(-0.3, 1.3, time / seconds) - 0.5);
        let elevation = WALK_ELEVATION[0] + WALK_ELEVATION[1] * wave(0, WALK_SECONDS);
        let distance = WALK_DISTANCE[0] + WALK_DISTANCE[1] * wave(1, WALK_SECONDS);
        let eye = HAND + distance * direction(azimuth, elevation) + SHAKE * shake(2);
        let target = HAND + distance * SHAKE_ANGLE * shake(5);
        look(eye, target, rolled(eye - target, ROLL * wave(8, WALK_SECONDS)))
    }
}

/// Angle from the first to the last of so many cameras that stand, radians.
pub(super) fn arc(count: usize) -> f64 {
    LARGEST_ARC.min(LARGEST_STEP * count.saturating_sub(1) as f64)
}

/// Unit vector from the hand to a camera. At azimuth 0 it sees the back of a hand that is not turned.
pub(super) fn direction(azimuth: f64, elevation: f64) -> DVec3 {
    let (sin, cos) = azimuth.rem_euclid(TAU).sin_cos();
    DVec3::new(cos * elevation.cos(), -elevation.sin(), sin * elevation.cos())
}

/// The direction that is up in the image of a camera that is turned about its axis.
fn rolled(axis: DVec3, angle: f64) -> DVec3 {
    DQuat::from_axis_angle(axis.normalize(), angle) * DVec3::NEG_Y
}

fn look(eye: DVec3, target: DVec3, up: DVec3) -> Camera {
    Camera::look_at(eye, target, up, 1.0, 1, 1)
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;

    use super::*;

    #[test]
    fn standing_cameras_are_apart_and_above_and_a_walk_goes_around_smoothly() {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let eyes: Vec<DVec3> = (0..4).map(|i| CameraPath::standing(i, 4, &mut rng).at(1.0).center()).collect();
        for pair in eyes.windows(2) {
            let angle = pair[0].with_y(0.0).angle_between(pair[1].with_y(0.0)).to_degrees();
            assert!((35.0..85.0).contains(&angle), "{angle}");
        }
        assert!(eyes.iter().all(|eye| eye.y < 0.0 && (0.44..0.6).contains(&eye.length())));
        let walk = CameraPath::walking(8.0, 3, &mut rng);
        let steps: Vec<f64> = (0..240)
            .map(|k| f64::from(k) / 30.0)
            .map(|t| walk.at(t).center().with_y(0.0).angle_between(walk.at(t + 1.0 / 30.0).center().with_y(0.0)))
            .collect();
        assert!(steps.iter().sum::<f64>().to_degrees() > 200.0);
        assert!(steps.iter().all(|step| step.to_degrees() < 4.0), "{:?}", steps.iter().copied().fold(0.0, f64::max));
    }
}
