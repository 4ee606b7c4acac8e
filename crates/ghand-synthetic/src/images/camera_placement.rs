//! Cameras all around the hand.

use ghand_core::Camera;
use glam::{DVec2, DVec3};

/// Distance of the cameras from the middle of the hand, metres.
const RADIUS: f64 = 0.6;
/// Largest cosine between the viewing direction and the forearm, along which a hand hides itself.
const LARGEST_COSINE: f64 = 0.72;
/// Fraction of the image that the hand, in all frames together, fills along the tighter axis.
const FILL: f64 = 0.94;

/// `count` cameras, evenly spread around `points` (every vertex of every frame, world axes), each with the focal length that
/// just keeps all of them inside its image.
pub(crate) fn cameras(count: usize, width: u32, height: u32, points: &[DVec3]) -> Vec<Camera> {
    let (low, high) = points.iter().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(l, h), p| (l.min(*p), h.max(*p)));
    let middle = (low + high) * 0.5;
    let golden = std::f64::consts::PI * (3.0 - 5f64.sqrt());
    (0..count)
        .map(|i| {
            let y = LARGEST_COSINE * (1.0 - 2.0 * (i as f64 + 0.5) / count as f64);
            let (sin, cos) = (golden * i as f64).sin_cos();
            let across = (1.0 - y * y).sqrt();
            let eye = middle + RADIUS * DVec3::new(cos * across, y, sin * across);
            Camera { id: format!("cam{i:02}"), ..aimed(eye, middle, width, height, points) }
        })
        .collect()
}

/// A camera at `eye` that has the points in the middle of its image, as large as fits.
fn aimed(eye: DVec3, middle: DVec3, width: u32, height: u32, points: &[DVec3]) -> Camera {
    // Fingers point up in the images.
    let look_at = |target| Camera::look_at(eye, target, DVec3::NEG_Y, 0.5, width, height);
    let mut camera = look_at(middle);
    // Rotating the camera changes the perspective a little; the third rotation is below a pixel.
    for _ in 0..3 {
        let (low, high) = tangent_bounds(&camera, points);
        camera = look_at(eye + camera.rotation.transpose() * ((low + high) * 0.5).extend(1.0) * RADIUS);
    }
    let (low, high) = tangent_bounds(&camera, points);
    let reach = high.max(-low).max(DVec2::splat(1e-6));
    let focal = (FILL * camera.principal / reach).min_element();
    Camera { focal: DVec2::splat(focal), ..camera }
}

/// Bounds of x/z and y/z in camera axes.
fn tangent_bounds(camera: &Camera, points: &[DVec3]) -> (DVec2, DVec2) {
    points.iter().fold((DVec2::INFINITY, DVec2::NEG_INFINITY), |(low, high), p| {
        let c = camera.camera_from_world(*p);
        let tangent = DVec2::new(c.x, c.y) / c.z;
        (low.min(tangent), high.max(tangent))
    })
}
