//! A lens with its unknowns: where it sees a point, and how that changes with them.

use ghand_capture::cameras::distortion::Distortion;
use ghand_capture::cameras::list::LensCamera;
use ghand_capture::cameras::rigid::Rigid;
use ghand_core::Camera;
use glam::{DMat3, DVec2, DVec3};

/// Unknowns of a lens: logarithms of the focal length and of the pixels' aspect, principal point, k1, k2, p1, p2, k3.
pub(super) const LENS_NUMBERS: usize = 9;
pub(super) const FOCAL: usize = 0;
pub(super) const PRINCIPAL: usize = 2;
pub(super) const FIRST_COEFFICIENT: usize = 4;
/// The usual focal length, relative to the longer edge of an image.
const USUAL_FOCAL: f64 = 0.85;
/// Points nearer to a camera than this are not seen, metres.
const NEAREST: f64 = 1e-3;

/// How many of OpenCV's coefficients are unknown; the others are 0.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Coefficients {
    None,
    First,
    Four,
    Five,
}

impl Coefficients {
    /// Numbers of the lens that are unknown.
    pub(super) fn unknown(self) -> std::ops::Range<usize> {
        let count = match self {
            Coefficients::None => 0,
            Coefficients::First => 1,
            Coefficients::Four => 4,
            Coefficients::Five => 5,
        };
        0..FIRST_COEFFICIENT + count
    }
}

/// A lens.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Lens {
    pub size: [u32; 2],
    pub focal: DVec2,
    pub principal: DVec2,
    /// k1, k2, p1, p2, k3.
    pub coefficients: [f64; 5],
}

/// Where a lens sees a point.
pub(super) struct Projected {
    pub pixel: DVec2,
    /// Derivatives of the pixel's coordinates by the point.
    pub by_point: [DVec3; 2],
    /// The same by the lens.
    pub by_lens: [[f64; LENS_NUMBERS]; 2],
}

impl Lens {
    /// A lens of which nothing is known but a focal length.
    pub(super) fn plain(size: [u32; 2], focal: f64) -> Lens {
        let principal = 0.5 * DVec2::from_array(size.map(f64::from));
        Lens { size, focal: DVec2::splat(focal), principal, coefficients: [0.0; 5] }
    }

    /// The usual focal length of images of a size, pixels.
    pub(super) fn usual_focal(size: [u32; 2]) -> f64 {
        USUAL_FOCAL * f64::from(size[0].max(size[1]))
    }

    /// Length of the image's diagonal, pixels.
    pub(super) fn diagonal(&self) -> f64 {
        DVec2::from_array(self.size.map(f64::from)).length()
    }

    /// Where a point in the camera's axes is seen; `None` if it is behind the camera.
    pub(super) fn project(&self, at: DVec3) -> Option<Projected> {
        if at.z < NEAREST {
            return None;
        }
        let (x, y) = (at.x / at.z, at.y / at.z);
        let [k1, k2, p1, p2, k3] = self.coefficients;
        let r2 = x * x + y * y;
        let radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
        let slope = k1 + r2 * (2.0 * k2 + 3.0 * r2 * k3);
        let ray = DVec2::new(
            x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
            y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y,
        );
        let mixed = 2.0 * (x * y * slope + p1 * x + p2 * y);
        let by_ray = [
            DVec2::new(radial + 2.0 * x * x * slope + 2.0 * p1 * y + 6.0 * p2 * x, mixed),
            DVec2::new(mixed, radial + 2.0 * y * y * slope + 6.0 * p1 * y + 2.0 * p2 * x),
        ];
        let by_coefficients = [
            [x * r2, x * r2 * r2, 2.0 * x * y, r2 + 2.0 * x * x, x * r2 * r2 * r2],
            [y * r2, y * r2 * r2, r2 + 2.0 * y * y, 2.0 * x * y, y * r2 * r2 * r2],
        ];
        let offset = ray * self.focal;
        let mut by_lens = [[0.0; LENS_NUMBERS]; 2];
        by_lens[0][..4].copy_from_slice(&[offset.x, 0.5 * offset.x, 1.0, 0.0]);
        by_lens[1][..4].copy_from_slice(&[offset.y, -0.5 * offset.y, 0.0, 1.0]);
        let by_point = [0, 1].map(|axis| {
            let focal = self.focal[axis];
            for (number, by) in by_lens[axis][FIRST_COEFFICIENT..].iter_mut().zip(by_coefficients[axis]) {
                *number = focal * by;
            }
            let by = by_ray[axis] * focal / at.z;
            DVec3::new(by.x, by.y, -by.x * x - by.y * y)
        });
        Some(Projected { pixel: offset + self.principal, by_point, by_lens })
    }

    /// The lens moved by a step of its numbers.
    pub(super) fn moved(&self, by: &[f64]) -> Lens {
        let mut lens = self.clone();
        let [focal, aspect] = [by[FOCAL], by[FOCAL + 1]];
        lens.focal *= DVec2::new((focal + 0.5 * aspect).exp(), (focal - 0.5 * aspect).exp());
        lens.principal += DVec2::new(by[PRINCIPAL], by[PRINCIPAL + 1]);
        lens.coefficients.iter_mut().zip(&by[FIRST_COEFFICIENT..]).for_each(|(k, by)| *k += by);
        lens
    }

    /// The ray, x/z and y/z, that is seen at a pixel; `None` if there is none.
    pub(super) fn ray(&self, pixel: DVec2) -> Option<DVec2> {
        let seen = (pixel - self.principal) / self.focal;
        match self.distortion() {
            Some(distortion) => distortion.undistorted_ray(seen),
            None => Some(seen),
        }
    }

    fn distortion(&self) -> Option<Distortion> {
        if self.coefficients == [0.0; 5] { None } else { Distortion::from_opencv(&self.coefficients).ok() }
    }

    /// The camera with this lens at a place.
    pub(super) fn at(&self, id: &str, camera_from_world: &Rigid) -> LensCamera {
        let [width, height] = self.size;
        let Rigid { rotation, translation } = *camera_from_world;
        let (focal, principal) = (self.focal, self.principal);
        let camera = Camera { id: id.into(), width, height, focal, principal, rotation, translation };
        LensCamera { camera, distortion: self.distortion() }
    }

    /// The part of the image without distortion that the lens has seen.
    pub(super) fn visible_part(&self) -> f64 {
        let camera = self.at("", &Rigid { rotation: DMat3::IDENTITY, translation: DVec3::ZERO }).camera;
        self.distortion().map_or(1.0, |distortion| distortion.visible_part(&camera))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn derivatives_of_a_projection_are_its_differences_and_the_projection_is_that_of_the_capture() {
        let focal = DVec2::new(500.0, 510.0);
        let principal = DVec2::new(310.0, 250.0);
        let lens = Lens { size: [640, 480], focal, principal, coefficients: [-0.2, 0.08, 0.003, -0.002, 0.01] };
        let at = DVec3::new(0.2, -0.13, 0.6);
        let found = lens.project(at).unwrap();
        let step = 1e-6;
        for k in 0..3 {
            let mut by = DVec3::ZERO;
            by[k] = step;
            let [more, less] = [at + by, at - by].map(|at| lens.project(at).unwrap().pixel);
            let difference = (more - less) / (2.0 * step);
            assert!((difference - DVec2::new(found.by_point[0][k], found.by_point[1][k])).length() < 1e-4, "{k}");
        }
        for k in 0..LENS_NUMBERS {
            let mut by = [0.0; LENS_NUMBERS];
            by[k] = step;
            let more = lens.moved(&by).project(at).unwrap().pixel;
            by[k] = -step;
            let less = lens.moved(&by).project(at).unwrap().pixel;
            let difference = (more - less) / (2.0 * step);
            assert!((difference - DVec2::new(found.by_lens[0][k], found.by_lens[1][k])).length() < 1e-4, "{k}");
        }
        let camera = lens.at("a", &Rigid { rotation: DMat3::IDENTITY, translation: DVec3::ZERO });
        let undistorted = camera.undistorted(found.pixel).unwrap();
        assert!(undistorted.distance(camera.camera.project(at).0) < 1e-3);
        assert!(lens.ray(found.pixel).unwrap().distance(at.truncate() / at.z) < 1e-6);
        assert!(lens.project(DVec3::new(0.1, 0.1, -1.0)).is_none());
    }
}
