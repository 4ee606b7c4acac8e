//! Cameras that are fitted together with the hand: their places and focal lengths.

use ghand_core::Camera;
use ghand_core::rotation::rotation_from_axis_angle;
use glam::DVec3;
use nalgebra::{DMatrix, DVector};

/// Numbers of a camera: a turn about its own axes, a shift along these, the logarithm of the focal length.
pub(crate) const NUMBERS: usize = 7;
/// Weight of what is known exactly: the place of the first camera.
const EXACT: f64 = 1e12;
/// A step of this size of any number is large.
const LARGE: f64 = 0.1;

/// A focal length before any landmark is seen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct UsualFocal {
    /// The likeliest one, pixels.
    pub pixels: f64,
    /// Standard deviation of the logarithm.
    pub deviation: f64,
}

impl UsualFocal {
    /// Standard deviation where footage does not state the focal length.
    pub const UNSTATED: f64 = 0.25;

    /// Standard deviation of the logarithms of a rig's focal lengths, relative to their likeliest ones, from one another. Most
    /// rigs have cameras of one kind; where only some state their focal length, they have not.
    pub fn spread(focals: &[UsualFocal]) -> f64 {
        let are_alike = focals.windows(2).all(|pair| pair[0].deviation == pair[1].deviation);
        if are_alike { 0.01 } else { 0.1 }
    }
}

/// What is known of cameras that are fitted.
#[derive(Debug, Clone)]
pub(crate) struct CameraFreedom {
    /// The likeliest focal length of each camera.
    pub usual_focals: Vec<UsualFocal>,
    /// Whether focal lengths stay as they are.
    pub focals_are_known: bool,
}

impl CameraFreedom {
    /// How many numbers are unknown.
    pub fn count(&self) -> usize {
        NUMBERS * self.usual_focals.len()
    }

    /// How a point (world) seems to move, for a camera, with each of the camera's numbers.
    pub fn moves(camera: &Camera, at: DVec3) -> [DVec3; NUMBERS] {
        let turned = camera.rotation * at;
        let seen = turned + camera.translation;
        let [x, y, z] = DVec3::AXES.map(|axis| axis.cross(turned));
        let [right, down, ahead] = DVec3::AXES;
        let back = camera.rotation.transpose();
        [x, y, z, right, down, ahead, seen.truncate().extend(0.0)].map(|moved| back * moved)
    }

    /// The cameras after a step.
    pub fn moved(cameras: &[Camera], step: &[f64]) -> Vec<Camera> {
        let moved = |(camera, by): (&Camera, &[f64; NUMBERS])| Camera {
            rotation: rotation_from_axis_angle(DVec3::from_slice(by)) * camera.rotation,
            translation: camera.translation + DVec3::from_slice(&by[3..]),
            focal: camera.focal * by[6].exp(),
            ..camera.clone()
        };
        cameras.iter().zip(step.as_chunks().0).map(moved).collect()
    }

    /// How large a step is, relative to what cameras may be wrong by.
    pub fn size_of(step: &[f64]) -> f64 {
        step.iter().fold(0.0, |most: f64, by| most.max((by / LARGE).abs()))
    }

    /// Logarithms of the focal lengths relative to the usual ones, and their mean.
    fn zooms(&self, cameras: &[Camera]) -> (Vec<f64>, f64) {
        let zooms: Vec<f64> =
            cameras.iter().zip(&self.usual_focals).map(|(c, usual)| (c.focal.x / usual.pixels).ln()).collect();
        let mean = zooms.iter().sum::<f64>() / zooms.len().max(1) as f64;
        (zooms, mean)
    }

    /// Twice the negative logarithm of the probability of cameras before any landmark is seen.
    pub fn prior_cost(&self, cameras: &[Camera]) -> f64 {
        if self.focals_are_known {
            return 0.0;
        }
        let (zooms, mean) = self.zooms(cameras);
        let spread = UsualFocal::spread(&self.usual_focals);
        let cost =
            |(zoom, usual): (&f64, &UsualFocal)| (zoom / usual.deviation).powi(2) + ((zoom - mean) / spread).powi(2);
        zooms.iter().zip(&self.usual_focals).map(cost).sum()
    }

    /// Adds the same to equations whose unknowns from `first` on are the cameras'.
    pub fn add_prior(&self, cameras: &[Camera], first: usize, matrix: &mut DMatrix<f64>, gradient: &mut DVector<f64>) {
        (first..first + NUMBERS - 1).for_each(|k| matrix[(k, k)] += EXACT);
        let (zooms, mean) = self.zooms(cameras);
        let place = |camera: usize| first + NUMBERS * camera + NUMBERS - 1;
        let spread = UsualFocal::spread(&self.usual_focals).powi(-2);
        for (camera, (zoom, usual)) in zooms.iter().zip(&self.usual_focals).enumerate() {
            let row = place(camera);
            if self.focals_are_known {
                matrix[(row, row)] += EXACT;
                continue;
            }
            let weight = usual.deviation.powi(-2);
            matrix[(row, row)] += weight + spread;
            gradient[row] += zoom * weight + (zoom - mean) * spread;
            for other in 0..zooms.len() {
                matrix[(row, place(other))] -= spread / zooms.len() as f64;
            }
        }
    }
}
