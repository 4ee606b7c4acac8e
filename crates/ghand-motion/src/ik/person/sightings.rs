//! Where a tracker saw the landmarks of a frame, and how far a hand is from that.

use ghand_core::Camera;
use glam::{DMat3, DVec2, DVec3};

use crate::ik::LANDMARK_COUNT;

/// Degrees of freedom of Student's distribution, which bounds the influence of landmarks that are wrong. Four are the
/// usual choice (Lange, Little and Taylor, Robust statistical modeling using the t distribution, 1989).
const FREEDOM: f64 = 4.0;

/// A landmark that is this many times the noise from the fitted hand is wrong: of correct ones, with errors of Student's
/// distribution, one in fifty is.
pub(crate) const WRONG: f64 = 5.0;

/// How many times the noise of what is seen a guess is off: MediaPipe's depths are off by 10 to 20 mm, its pixels by 3 mm at
/// the hand.
const GUESS: f64 = 4.0;

/// The distance of a landmark that would be behind its camera, metres.
const BEHIND: f64 = 1.0;

/// Where one landmark was seen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum SightingPosition {
    /// In space, metres.
    Point(DVec3),
    /// In an image of the camera of that number, without distortion; pixels.
    Pixel(usize, DVec2),
    /// In space, metres, as guessed from one image: several times less sure than what is seen.
    Guess(DVec3),
}

/// One landmark, seen once.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Sighting {
    /// Number of the landmark.
    pub landmark: usize,
    /// How sure the tracker is, from 0 to 1.
    pub confidence: f64,
    pub place: SightingPosition,
}

/// All that was seen of a hand at one moment.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct SeenFrame {
    /// Id of the frame.
    pub id: String,
    pub sightings: Vec<Sighting>,
}

impl SeenFrame {
    /// The landmarks in space, if all were seen or guessed there.
    pub fn points(&self) -> Option<[DVec3; LANDMARK_COUNT]> {
        let mut points = [DVec3::NAN; LANDMARK_COUNT];
        for sighting in &self.sightings {
            if let SightingPosition::Point(at) | SightingPosition::Guess(at) = sighting.place {
                points[sighting.landmark] = at;
            }
        }
        points.iter().all(|point| point.is_finite()).then_some(points)
    }
}

/// How far a landmark is from where it was seen: its square, and what the normal equations need of it, square metres.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Gap {
    pub squared: f64,
    /// `J^T e`.
    pub pull: DVec3,
    /// `J^T J`.
    pub information: DMat3,
    /// Numbers that were measured.
    pub dimensions: f64,
}

impl Sighting {
    /// How far `at` (metres, world) is from here. `scales` are the metres per pixel at the hand, by camera.
    pub fn gap(&self, at: DVec3, cameras: &[Camera], scales: &[f64]) -> Gap {
        match self.place {
            SightingPosition::Point(point) => {
                let error = at - point;
                Gap { squared: error.length_squared(), pull: error, information: DMat3::IDENTITY, dimensions: 3.0 }
            }
            SightingPosition::Guess(point) => {
                let error = (at - point) / GUESS;
                let information = DMat3::IDENTITY * GUESS.powi(-2);
                Gap { squared: error.length_squared(), pull: error / GUESS, information, dimensions: 3.0 }
            }
            SightingPosition::Pixel(camera, pixel) => {
                let behind =
                    Gap { squared: BEHIND * BEHIND, pull: DVec3::ZERO, information: DMat3::ZERO, dimensions: 2.0 };
                let (Some(camera), Some(scale)) = (cameras.get(camera), scales.get(camera)) else { return behind };
                let p = camera.camera_from_world(at);
                if p.z < 1e-3 {
                    return behind;
                }
                let error = (camera.project(at).0 - pixel) * *scale;
                let focal = camera.focal * *scale / p.z;
                let turn = camera.rotation.transpose();
                let across = turn * DVec3::new(focal.x, 0.0, -focal.x * p.x / p.z);
                let down = turn * DVec3::new(0.0, focal.y, -focal.y * p.y / p.z);
                Gap {
                    squared: error.length_squared(),
                    pull: across * error.x + down * error.y,
                    information: outer(across) + outer(down),
                    dimensions: 2.0,
                }
            }
        }
    }

    /// Twice the negative logarithm of the probability of a gap, and the weight of its square. `noise` in metres.
    pub fn cost_and_weight(&self, gap: &Gap, noise: f64) -> (f64, f64) {
        let variance = noise * noise;
        let ratio = gap.squared / variance;
        let strength = self.confidence * (FREEDOM + gap.dimensions);
        (strength * (ratio / FREEDOM).ln_1p(), strength / (FREEDOM + ratio) / variance)
    }
}

fn outer(u: DVec3) -> DMat3 {
    DMat3::from_cols(u * u.x, u * u.y, u * u.z)
}
