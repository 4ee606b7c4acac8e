//! What may be unknown of the cameras: how contours in an image change with it.

use ghand_core::Camera;
use ghand_core::rotation::rotation_from_axis_angle;
use glam::{DVec2, DVec3};
use serde::{Deserialize, Serialize};

use crate::alignment::outlines::contour::ContourPoint;

/// Numbers of a camera.
pub const NUMBERS: usize = 10;
/// Where the moment of the images is among them.
const TIME: usize = 9;

/// A part of a camera's calibration.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Part {
    /// Where it stands and how it is turned.
    Extrinsics,
    /// The focal length; the ratio of both axes stays.
    FocalLength,
    /// The principal point.
    PrincipalPoint,
    /// When its images were taken, relative to the frames.
    Time,
}

impl Part {
    /// Its name, for people.
    pub fn name(self) -> &'static str {
        match self {
            Part::Extrinsics => "position and direction",
            Part::FocalLength => "focal length",
            Part::PrincipalPoint => "principal point",
            Part::Time => "time",
        }
    }

    /// The places of its numbers.
    pub fn places(self) -> std::ops::Range<usize> {
        match self {
            Part::Extrinsics => 0..6,
            Part::FocalLength => 6..7,
            Part::PrincipalPoint => 7..9,
            Part::Time => TIME..NUMBERS,
        }
    }
}

/// How a camera differs from what is given: rotation (a vector in its axes, radians) and then translation (in its axes,
/// metres), logarithm of the focal length, principal point (pixels), and time (frames).
pub type CameraChange = [f64; NUMBERS];

/// A camera with a change; the time has no part in it.
pub fn changed(camera: &Camera, change: &CameraChange) -> Camera {
    let [rx, ry, rz, tx, ty, tz, focal, cx, cy, _] = *change;
    let turn = rotation_from_axis_angle(DVec3::new(rx, ry, rz));
    Camera {
        rotation: turn * camera.rotation,
        translation: turn * camera.translation + DVec3::new(tx, ty, tz),
        focal: camera.focal * focal.exp(),
        principal: camera.principal + DVec2::new(cx, cy),
        ..camera.clone()
    }
}

/// The unknowns of some cameras, in a frame.
pub struct CameraUnknowns<'a> {
    /// Ids of the cameras.
    pub cameras: &'a [&'a str],
    /// What is unknown of each.
    pub parts: &'a [Part],
    /// How the vertices move in this frame, metres per frame; empty if that is not known.
    pub velocities: &'a [DVec3],
    /// How much later each of the cameras takes its images, frames; empty if none does.
    pub times: &'a [f64],
}

impl CameraUnknowns<'_> {
    /// Number of unknowns.
    pub fn count(&self) -> usize {
        self.cameras.len() * per_camera(self.parts).count()
    }

    /// Where the vertices were when a camera took its image, given where they are in the frame's pose; `None` for the same.
    pub fn at_time_of(&self, camera: &Camera, vertices: &[DVec3]) -> Option<Vec<DVec3>> {
        let time = *self.times.get(self.number(camera)?)?;
        let moved = vertices.iter().zip(self.velocities).map(|(vertex, velocity)| *vertex + time * *velocity);
        (self.velocities.len() == vertices.len()).then(|| moved.collect())
    }

    fn number(&self, camera: &Camera) -> Option<usize> {
        self.cameras.iter().position(|id| *id == camera.id)
    }

    /// Appends the non-zero derivatives of a contour point's residual; the unknowns begin at `first`.
    pub fn row(&self, camera: &Camera, point: &ContourPoint, first: usize, row: &mut Vec<(usize, f64)>) {
        let Some(number) = self.number(camera) else { return };
        let at = point.in_camera;
        let seen = DVec2::new(at.x, at.y) / at.z;
        let pull = camera.rotation * point.gradient;
        let turn = at.cross(pull);
        let velocity = |v: u32| self.velocities.get(v as usize).copied().unwrap_or(DVec3::ZERO);
        let time = point.gradient.dot(0.5 * (velocity(point.edge[0]) + velocity(point.edge[1])));
        let focal = point.slope.dot(camera.focal * seen);
        let all = [turn.x, turn.y, turn.z, pull.x, pull.y, pull.z, focal, point.slope.x, point.slope.y, time];
        let first = first + number * per_camera(self.parts).count();
        row.extend(per_camera(self.parts).enumerate().map(|(k, place)| (first + k, all[place])));
    }
}

/// The places of the numbers that are unknown of each camera.
pub fn per_camera(parts: &[Part]) -> impl Iterator<Item = usize> + '_ {
    parts.iter().flat_map(|part| part.places())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn derivatives_are_those_of_where_a_point_is_seen() {
        let eye = DVec3::new(0.1, -0.2, -0.5);
        let camera = Camera {
            id: "a".into(),
            focal: DVec2::new(310.0, 290.0),
            ..Camera::look_at(eye, DVec3::new(0.02, 0.01, 0.1), DVec3::Y, 0.6, 200, 160)
        };
        let place = DVec3::new(0.06, -0.03, 0.13);
        let slope = DVec2::new(0.6, -0.8);
        let velocity = DVec3::new(0.01, 0.02, -0.005);
        let residual = |change: &CameraChange| {
            let at = place + change[TIME] * velocity;
            changed(&camera, change).project(at).0.dot(slope)
        };
        let step = 1e-6;
        let derivative = |k: usize| {
            let [mut low, mut high] = [[0.0; NUMBERS]; 2];
            (low[k], high[k]) = (-step, step);
            (residual(&high) - residual(&low)) / (2.0 * step)
        };
        let by_place = DVec3::from([DVec3::X, DVec3::Y, DVec3::Z].map(|axis| {
            let seen = |by: f64| camera.project(place + by * axis).0.dot(slope);
            (seen(step) - seen(-step)) / (2.0 * step)
        }));
        let in_camera = camera.camera_from_world(place);
        let point = ContourPoint { edge: [0, 1], residual: 0.0, gradient: by_place, slope, in_camera, length: 1.0 };
        let parts = [Part::Extrinsics, Part::FocalLength, Part::PrincipalPoint, Part::Time];
        let unknowns =
            CameraUnknowns { cameras: &["b", "a"], parts: &parts, velocities: &[velocity, velocity], times: &[] };
        let mut row = vec![];
        unknowns.row(&camera, &point, 5, &mut row);
        assert_eq!((row.len(), unknowns.count()), (NUMBERS, 2 * NUMBERS));
        for (k, (place, found)) in row.into_iter().enumerate() {
            let expected = derivative(k);
            assert_eq!(place, 5 + NUMBERS + k, "the second camera");
            assert!((found - expected).abs() < 1e-4 * (1.0 + expected.abs()), "{k}: {found} for {expected}");
        }
    }
}
