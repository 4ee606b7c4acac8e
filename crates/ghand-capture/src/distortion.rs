//! Lens distortion: images of distorted cameras are resampled to pinhole cameras, which everything else uses.

use ghand_core::Camera;
use glam::DVec2;

/// Points per axis at which [`Distortion::visible_part`] samples an image.
const GRID: u32 = 32;
/// Number of steps of the search for the fold, in squared radius, from the axis to the farthest corner.
const FOLD_STEPS: u32 = 4096;
/// Steps of the iteration for the inverse, and its largest error, in focal lengths: a thousandth of a pixel.
const INVERSE_STEPS: usize = 100;
const INVERSE_ERROR: f64 = 1e-6;

/// Distortion of a lens by OpenCV's model of five coefficients: a ray of the pinhole camera, `(x, y, 1)` with
/// `r² = x² + y²`, is seen at `x (1 + k1 r² + k2 r⁴ + k3 r⁶) + 2 p1 x y + p2 (r² + 2 x²)` and
/// `y (1 + k1 r² + k2 r⁴ + k3 r⁶) + p1 (r² + 2 y²) + 2 p2 x y`, to which the camera's intrinsics are applied.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Distortion {
    /// k1, k2 and k3.
    pub radial: [f64; 3],
    /// p1 and p2.
    pub tangential: [f64; 2],
}

impl Distortion {
    /// The distortion of coefficients in OpenCV's order.
    pub fn from_opencv([k1, k2, p1, p2, k3]: [f64; 5]) -> Distortion {
        Distortion { radial: [k1, k2, k3], tangential: [p1, p2] }
    }

    /// The coefficients in OpenCV's order: k1, k2, p1, p2, k3.
    pub fn to_opencv(self) -> [f64; 5] {
        let ([k1, k2, k3], [p1, p2]) = (self.radial, self.tangential);
        [k1, k2, p1, p2, k3]
    }

    /// The position at which the ray `(x, y, 1)` is seen, as a ray of an undistorted camera.
    pub fn distorted(&self, ray: DVec2) -> DVec2 {
        let ([k1, k2, k3], [p1, p2]) = (self.radial, self.tangential);
        let (x, y) = (ray.x, ray.y);
        let r2 = ray.length_squared();
        let radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
        let tangential =
            DVec2::new(2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x), p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y);
        ray * radial + tangential
    }

    /// The ray that is seen at a position, as a ray of an undistorted camera: the inverse of [`Self::distorted`]. `None`
    /// if there is none, because the model's polynomial turns back before.
    pub fn undistorted_ray(&self, seen: DVec2) -> Option<DVec2> {
        let [p1, p2] = self.tangential;
        let [k1, k2, k3] = self.radial;
        let mut ray = seen;
        for _ in 0..INVERSE_STEPS {
            let r2 = ray.length_squared();
            let radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
            let tangential = DVec2::new(
                2.0 * p1 * ray.x * ray.y + p2 * (r2 + 2.0 * ray.x * ray.x),
                p1 * (r2 + 2.0 * ray.y * ray.y) + 2.0 * p2 * ray.x * ray.y,
            );
            ray = (seen - tangential) / radial;
        }
        (self.distorted(ray).distance(seen) < INVERSE_ERROR).then_some(ray)
    }

    /// The part of an undistorted image, `[0, 1]`, that is visible in the distorted one; both have the camera's
    /// intrinsics and size.
    pub fn visible_part(&self, camera: &Camera) -> f64 {
        let source = Source::new(*self, camera);
        let size = DVec2::new(f64::from(camera.width), f64::from(camera.height));
        let at = |i: u32| (f64::from(i) + 0.5) / f64::from(GRID);
        let points = (0..GRID).flat_map(|y| (0..GRID).map(move |x| DVec2::new(at(x), at(y)) * size));
        points.filter(|point| source.of(*point).is_some()).count() as f64 / f64::from(GRID * GRID)
    }

    /// The undistorted image of a distorted one, row-major: the image of the pinhole camera, with bilinear
    /// interpolation. Pixels outside the distorted image are `outside`.
    pub(crate) fn undistorted(&self, camera: &Camera, pixels: &[[u8; 4]], outside: [u8; 4]) -> Vec<[u8; 4]> {
        let source = Source::new(*self, camera);
        let rows = 0..camera.height;
        rows.flat_map(|y| (0..camera.width).map(move |x| DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5)))
            .map(|center| source.of(center).map_or(outside, |at| source.sample(pixels, at)))
            .collect()
    }
}

/// Sources of the pixels of an undistorted image.
struct Source<'a> {
    distortion: Distortion,
    camera: &'a Camera,
    size: DVec2,
    /// Squared radius at which the polynomial turns back towards the middle of the image. Beyond it, the polynomial
    /// does not describe a lens.
    fold: f64,
}

impl Source<'_> {
    fn new(distortion: Distortion, camera: &Camera) -> Source<'_> {
        let size = DVec2::new(f64::from(camera.width), f64::from(camera.height));
        let corners = [DVec2::ZERO, DVec2::new(size.x, 0.0), DVec2::new(0.0, size.y), size];
        let squared = corners.map(|corner| ((corner - camera.principal) / camera.focal).length_squared());
        let farthest = squared.into_iter().fold(0.0, f64::max);
        let [k1, k2, k3] = distortion.radial;
        // Derivative of r (1 + k1 r² + k2 r⁴ + k3 r⁶) with respect to r.
        let slope = |r2: f64| 1.0 + r2 * (3.0 * k1 + r2 * (5.0 * k2 + r2 * 7.0 * k3));
        let steps = (1..=FOLD_STEPS).map(|i| farthest * f64::from(i) / f64::from(FOLD_STEPS));
        let fold = steps.into_iter().find(|r2| slope(*r2) <= 0.0).unwrap_or(f64::INFINITY);
        Source { distortion, camera, size, fold }
    }

    /// The position in the distorted image of a point in the undistorted one (pixels, centres at half-integers).
    fn of(&self, point: DVec2) -> Option<DVec2> {
        let ray = (point - self.camera.principal) / self.camera.focal;
        if ray.length_squared() >= self.fold {
            return None;
        }
        let at = self.distortion.distorted(ray) * self.camera.focal + self.camera.principal;
        let inside = at.cmpge(DVec2::ZERO).all() && at.cmple(self.size).all();
        inside.then_some(at)
    }

    fn sample(&self, pixels: &[[u8; 4]], at: DVec2) -> [u8; 4] {
        let last = self.size - DVec2::ONE;
        let at = (at - DVec2::splat(0.5)).clamp(DVec2::ZERO, last);
        let low = at.floor();
        let part = at - low;
        let high = (low + DVec2::ONE).min(last);
        let pixel = |x: f64, y: f64| {
            let pixel = pixels.get(y as usize * self.camera.width as usize + x as usize);
            pixel.copied().unwrap_or_default().map(f64::from)
        };
        let corners = [pixel(low.x, low.y), pixel(high.x, low.y), pixel(low.x, high.y), pixel(high.x, high.y)];
        std::array::from_fn(|i| {
            let [a, b, c, d] = corners.map(|corner| corner[i]);
            let top = a + (b - a) * part.x;
            let bottom = c + (d - c) * part.x;
            (top + (bottom - top) * part.y).round().clamp(0.0, 255.0) as u8
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn camera(width: u32, height: u32) -> Camera {
        use glam::DVec3;
        let camera = Camera::look_at(DVec3::NEG_Z, DVec3::ZERO, DVec3::Y, 0.9, width, height);
        let middle = DVec2::new(f64::from(width), f64::from(height)) * 0.5;
        Camera { focal: DVec2::new(80.0, 90.0), principal: middle + DVec2::new(3.0, -2.0), ..camera }
    }

    /// A smooth picture of the rays that a pinhole camera sees, and a mask: a disc.
    fn scene(ray: DVec2) -> [f64; 4] {
        let wave = |phase: f64| 127.5 + 100.0 * (4.0 * ray.x + phase).sin() * (3.0 * ray.y - phase).cos();
        // Its edge is two pixels wide.
        let disc = 255.0 * (0.5 + 40.0 * (0.35 - (ray - DVec2::new(0.1, -0.05)).length())).clamp(0.0, 1.0);
        [wave(0.0), wave(0.7), wave(2.0), disc]
    }

    fn picture(camera: &Camera, ray_of: impl Fn(DVec2) -> DVec2) -> Vec<[u8; 4]> {
        let points = (0..camera.height).flat_map(|y| (0..camera.width).map(move |x| (x, y)));
        points
            .map(|(x, y)| {
                let center = DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5);
                scene(ray_of((center - camera.principal) / camera.focal)).map(|v| v.round() as u8)
            })
            .collect()
    }

    /// The ray that is seen at `seen`, by iterating the model as in OpenCV's documentation: the inverse of the tested
    /// direction.
    fn ray_seen_at(seen: DVec2, [k1, k2, p1, p2, k3]: [f64; 5]) -> DVec2 {
        let mut ray = seen;
        for _ in 0..200 {
            let (x, y) = (ray.x, ray.y);
            let r = x.hypot(y);
            let scale = 1.0 + k1 * r.powi(2) + k2 * r.powi(4) + k3 * r.powi(6);
            let dx = 2.0 * p1 * x * y + p2 * (r.powi(2) + 2.0 * x.powi(2));
            let dy = p1 * (r.powi(2) + 2.0 * y.powi(2)) + 2.0 * p2 * x * y;
            ray = DVec2::new((seen.x - dx) / scale, (seen.y - dy) / scale);
        }
        ray
    }

    #[test]
    fn undistorted_images_are_those_of_the_pinhole_camera() {
        let camera = camera(96, 72);
        for coefficients in [
            [-0.25, 0.08, 0.004, -0.006, -0.01],
            [0.15, -0.05, -0.003, 0.002, 0.02],
            [0.0, 0.0, 0.04, 0.0, 0.0],
            [0.0, 0.0, 0.0, 0.04, 0.0],
        ] {
            let distorted = picture(&camera, |seen| ray_seen_at(seen, coefficients));
            let ideal = picture(&camera, |ray| ray);
            let found = Distortion::from_opencv(coefficients).undistorted(&camera, &distorted, [1, 2, 3, 0]);
            let error = |a: &[[u8; 4]]| {
                let pairs = || a.iter().zip(&ideal).filter(|(a, _)| **a != [1, 2, 3, 0]);
                let worst = pairs().flat_map(|(a, b)| [0, 1, 2].map(|i| a[i].abs_diff(b[i]))).max().unwrap_or(255);
                let masks = pairs().filter(|(a, b)| (a[3] >= 128) != (b[3] >= 128)).count();
                (worst, masks, pairs().count())
            };
            let (worst, masks, seen) = error(&found);
            assert!(worst <= 2 && masks <= 4 && seen > 6000, "{coefficients:?}: {worst} {masks} {seen}");
            // Without undistortion, the picture differs.
            let (worst, masks, _) = error(&distorted);
            assert!(worst > 5 && masks > 12, "{coefficients:?}: {worst} {masks}");
        }
    }

    #[test]
    fn a_distorted_point_matches_a_hand_calculation() {
        // r² = 0.25; 1 + 0.1 x 0.25 + 0.2 x 0.0625 + 0.4 x 0.015625 = 1.04375.
        // x: 0.3 x 1.04375 + 2 x 0.01 x 0.12 + 0.02 x (0.25 + 0.18), y: 0.4 x 1.04375 + 0.01 x (0.25 + 0.32) + 2 x 0.02
        // x 0.12
        let seen = Distortion::from_opencv([0.1, 0.2, 0.01, 0.02, 0.4]).distorted(DVec2::new(0.3, 0.4));
        assert!((seen - DVec2::new(0.324125, 0.428)).length() < 1e-12, "{seen}");
    }

    #[test]
    fn points_that_the_lens_does_not_see_are_outside() {
        let camera = camera(96, 72);
        let white = vec![[255; 4]; 96 * 72];
        // Pincushion: the corners of the pinhole image lie beyond those of the distorted one.
        let pincushion = Distortion::from_opencv([0.5, 0.0, 0.0, 0.0, 0.0]);
        let found = pincushion.undistorted(&camera, &white, [0, 9, 0, 0]);
        assert_eq!((found[0], found[36 * 96 + 48]), ([0, 9, 0, 0], [255; 4]));
        assert!((0.6..0.95).contains(&pincushion.visible_part(&camera)), "{}", pincushion.visible_part(&camera));
        // Barrel by one coefficient: r (1 - 0.9 r²) turns back at r = 0.61, and points beyond are not seen a second
        // time.
        let barrel = Distortion::from_opencv([-0.9, 0.0, 0.0, 0.0, 0.0]);
        assert_eq!(barrel.undistorted(&camera, &white, [0; 4])[0], [0; 4]);
        assert_eq!(Distortion::from_opencv([0.0; 5]).visible_part(&camera), 1.0);
        for broken in [1e30, -1e30, f64::NAN] {
            assert!(Distortion::from_opencv([broken, 0.0, 0.0, 0.0, 0.0]).visible_part(&camera) < 0.01, "{broken}");
        }
    }

    #[test]
    fn no_distortion_changes_no_pixel() {
        let camera = camera(13, 7);
        let pixels: Vec<[u8; 4]> = (0..13 * 7).map(|i| [i as u8, 255 - i as u8, 3 * (i % 80) as u8, 7]).collect();
        assert_eq!(Distortion::from_opencv([0.0; 5]).undistorted(&camera, &pixels, [0; 4]), pixels);
    }
}
