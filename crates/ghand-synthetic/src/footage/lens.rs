//! Lenses of cameras: what they see of the world where the pinhole camera would see it elsewhere.

use ghand_capture::cameras::distortion::Distortion;
use ghand_capture::cameras::list::LensCamera;
use ghand_core::Camera;
use glam::{DVec2, DVec3};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

/// Focal length relative to the image's diagonal, and how much it differs from camera to camera.
const FOCAL: f64 = 0.72;
const FOCAL_SPREAD: f64 = 0.08;
/// Largest distance of the principal point from the image's middle, relative to the image.
const OFF_CENTER: f64 = 0.015;
/// How far lenses move the image's corners towards its middle, relative to their distance from it.
const LEAST_BARREL: f64 = 0.01;
const LARGEST_BARREL: f64 = 0.03;
/// Rays farther from the axis, in focal lengths, are as much nearer to it as these: no image shows them.
const FARTHEST: f64 = 1.4;

/// A lens with its sensor.
#[derive(Debug, Clone)]
pub(crate) struct Lens {
    /// The camera without distortion, with any position.
    camera: Camera,
    distortion: Distortion,
}

impl Lens {
    /// A random lens for images of a size.
    pub(crate) fn random([width, height]: [u32; 2], rng: &mut ChaCha8Rng) -> Lens {
        let size = DVec2::new(f64::from(width), f64::from(height));
        let mut even = || 2.0 * rng.random::<f64>() - 1.0;
        let focal = FOCAL * size.length() * (1.0 + FOCAL_SPREAD * even());
        let principal = size * (0.5 + OFF_CENTER * DVec2::new(even(), even()));
        let barrel = LEAST_BARREL + (LARGEST_BARREL - LEAST_BARREL) * rng.random::<f64>();
        // The corner's squared radius; k2 takes back a fifth of what k1 does there.
        let corner = 0.25 * size.length_squared() / (focal * focal);
        let k1 = -1.25 * barrel / corner;
        let k2 = 0.25 * barrel / (corner * corner);
        let camera = Camera::look_at(DVec3::NEG_Z, DVec3::ZERO, DVec3::NEG_Y, 1.0, width, height);
        let distortion =
            Distortion::Pinhole { radial: [k1, k2, 0.0, 0.0, 0.0, 0.0], tangential: [0.0; 2], prism: [0.0; 4] };
        Lens { camera: Camera { focal: DVec2::splat(focal), principal, ..camera }, distortion }
    }

    /// The camera with this lens where another one is.
    pub(crate) fn at(&self, place: &Camera, id: String) -> LensCamera {
        let camera = Camera { id, rotation: place.rotation, translation: place.translation, ..self.camera.clone() };
        LensCamera { camera, distortion: Some(self.distortion) }
    }

    /// Columns of the image.
    pub(crate) fn columns(&self) -> usize {
        self.camera.width as usize
    }

    /// For each pixel, the ray that its middle sees, as x/z and y/z of camera axes.
    pub(crate) fn rays(&self) -> Vec<DVec2> {
        let Camera { width, height, focal, principal, .. } = self.camera;
        let ray = |i: u32| {
            let pixel = DVec2::new(f64::from(i % width) + 0.5, f64::from(i / width) + 0.5);
            let seen = (pixel - principal) / focal;
            self.distortion.undistorted_ray(seen).unwrap_or(seen)
        };
        (0..width * height).map(ray).collect()
    }
}

/// The world point that the camera without its lens sees where the camera with it sees the given one; metres.
pub(crate) fn bent(lens: &LensCamera, point: DVec3) -> DVec3 {
    let Some(distortion) = &lens.distortion else { return point };
    let seen = lens.camera.camera_from_world(point);
    if seen.z <= 0.0 {
        return point;
    }
    let ray = seen.truncate() / seen.z;
    let near = ray.clamp_length_max(FARTHEST);
    let nearer = if near == DVec2::ZERO { 1.0 } else { distortion.distorted(near).length() / near.length() };
    let moved = (ray * nearer * seen.z).extend(seen.z);
    lens.camera.rotation.transpose() * (moved - lens.camera.translation)
}

/// The pixel at which a camera with a lens sees a world point; `None` if it is behind the camera.
pub(crate) fn pixel(lens: &LensCamera, point: DVec3) -> Option<DVec2> {
    let (pixel, depth) = lens.camera.project(bent(lens, point));
    (depth > 0.0).then_some(pixel)
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;

    use super::*;

    #[test]
    fn lenses_move_corners_by_one_to_three_percent_and_rays_are_their_inverse() {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        for _ in 0..ghand_test_support::cases(4, 20) {
            let lens = Lens::random([640, 480], &mut rng);
            let place = Camera::look_at(DVec3::new(0.5, -0.2, 0.3), DVec3::ZERO, DVec3::NEG_Y, 1.0, 640, 480);
            let camera = lens.at(&place, "a".into());
            let pinhole = |pixel: DVec2| {
                let ray = ((pixel - camera.camera.principal) / camera.camera.focal).extend(1.0);
                camera.camera.center() + camera.camera.rotation.transpose() * ray
            };
            let corner = camera.camera.principal + DVec2::new(320.0, 240.0);
            let seen = pixel(&camera, pinhole(corner)).unwrap();
            let part = 1.0 - seen.distance(camera.camera.principal) / 400.0;
            assert!((0.0099..0.0301).contains(&part), "{part}");
            // Distortion as the reader of the cameras' file takes it away.
            assert!(camera.undistorted(seen).unwrap().distance(corner) < 1e-3);
            let rays = lens.rays();
            for (x, y) in [(0, 0), (100, 300), (639, 479)] {
                let ray: DVec2 = rays[y * 640 + x];
                let world = camera.camera.center() + camera.camera.rotation.transpose() * ray.extend(1.0);
                let found = pixel(&camera, world).unwrap();
                assert!(found.distance(DVec2::new(x as f64 + 0.5, y as f64 + 0.5)) < 1e-2, "{found}");
            }
        }
    }
}
