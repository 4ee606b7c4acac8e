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

/// Distortion of a lens by one of OpenCV's models: where the ray of the pinhole camera `(x, y, 1)` with `r² = x² + y²` is
/// seen, before the camera's intrinsics are applied.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Distortion {
    /// `x q + 2 p1 x y + p2 (r² + 2 x²) + s1 r² + s2 r⁴` and `y q + p1 (r² + 2 y²) + 2 p2 x y + s3 r² + s4 r⁴` with
    /// `q = (1 + k1 r² + k2 r⁴ + k3 r⁶) / (1 + k4 r² + k5 r⁴ + k6 r⁶)`.
    Pinhole {
        /// k1 to k6.
        radial: [f64; 6],
        /// p1 and p2.
        tangential: [f64; 2],
        /// s1 to s4.
        prism: [f64; 4],
    },
    /// `(x, y) θ (1 + k1 θ² + k2 θ⁴ + k3 θ⁶ + k4 θ⁸) / r` with `θ = atan r`.
    Fisheye([f64; 4]),
}

impl Distortion {
    /// The distortion of OpenCV's coefficients: k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4, of which 4, 5, 8 or 12 are
    /// given, and the tilt of the sensor, which must be 0. Zeros behind do not count.
    ///
    /// # Errors
    /// What is wrong, as the end of a sentence about them.
    pub fn from_opencv(coefficients: &[f64]) -> Result<Distortion, String> {
        let count = coefficients.len();
        let needed = coefficients.iter().rposition(|c| *c != 0.0).map_or(0, |last| last + 1);
        if count < 4 || (needed > 5 && ![8, 12, 14].contains(&count)) {
            return Err(format!(
                "has {count} numbers; give OpenCV's 4, 5, 8 or 12: k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4, in this \
                 order; a fisheye lens has a field `fisheye` instead"
            ));
        }
        if needed > 12 {
            return Err(
                "has a tilted sensor (numbers 13 and 14), which is not read; undistort the images and omit it".into()
            );
        }
        let at = |k: usize| coefficients.get(k).copied().unwrap_or(0.0);
        Ok(Distortion::Pinhole {
            radial: [0, 1, 4, 5, 6, 7].map(at),
            tangential: [2, 3].map(at),
            prism: [8, 9, 10, 11].map(at),
        })
    }

    /// The coefficients in OpenCV's order, as few as there must be; `None` for a fisheye lens.
    pub fn to_opencv(self) -> Option<Vec<f64>> {
        let Distortion::Pinhole { radial: [k1, k2, k3, k4, k5, k6], tangential: [p1, p2], prism } = self else {
            return None;
        };
        let mut all = vec![k1, k2, p1, p2, k3, k4, k5, k6];
        all.extend(prism);
        let needed = all.iter().rposition(|c| *c != 0.0).map_or(0, |last| last + 1);
        all.truncate([5, 8, 12].into_iter().find(|count| needed <= *count).unwrap_or(12));
        Some(all)
    }

    /// How much farther from the axis than the pinhole camera's the ray of a squared radius is seen, and a number that is
    /// positive as long as rays farther out are seen farther out.
    fn radial_part(&self, r2: f64) -> (f64, f64) {
        match self {
            Distortion::Pinhole { radial: [k1, k2, k3, k4, k5, k6], .. } => {
                let above = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
                let below = 1.0 + r2 * (k4 + r2 * (k5 + r2 * k6));
                let d_above = k1 + r2 * (2.0 * k2 + r2 * 3.0 * k3);
                let d_below = k4 + r2 * (2.0 * k5 + r2 * 3.0 * k6);
                // The derivative of r q, times the square of the denominator.
                let slope = above * below + 2.0 * r2 * (d_above * below - above * d_below);
                (above / below, if below > 0.0 { slope } else { -1.0 })
            }
            Distortion::Fisheye([k1, k2, k3, k4]) => {
                let r = r2.sqrt();
                let angle = r.atan();
                let a2 = angle * angle;
                let factor = 1.0 + a2 * (k1 + a2 * (k2 + a2 * (k3 + a2 * k4)));
                let slope = 1.0 + a2 * (3.0 * k1 + a2 * (5.0 * k2 + a2 * (7.0 * k3 + a2 * 9.0 * k4)));
                (if r > 0.0 { factor * angle / r } else { 1.0 }, slope)
            }
        }
    }

    /// What is added to a ray beside its radial part.
    fn sideways(&self, ray: DVec2) -> DVec2 {
        let Distortion::Pinhole { tangential: [p1, p2], prism: [s1, s2, s3, s4], .. } = self else {
            return DVec2::ZERO;
        };
        let (x, y) = (ray.x, ray.y);
        let r2 = ray.length_squared();
        let tangential =
            DVec2::new(2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x), p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y);
        tangential + DVec2::new(r2 * (s1 + r2 * s2), r2 * (s3 + r2 * s4))
    }

    /// The position at which the ray `(x, y, 1)` is seen, as a ray of an undistorted camera.
    pub fn distorted(&self, ray: DVec2) -> DVec2 {
        ray * self.radial_part(ray.length_squared()).0 + self.sideways(ray)
    }

    /// The ray that is seen at a position, as a ray of an undistorted camera: the inverse of [`Self::distorted`]. `None`
    /// if there is none, because the model's polynomial turns back before.
    pub fn undistorted_ray(&self, seen: DVec2) -> Option<DVec2> {
        let mut ray = seen;
        for _ in 0..INVERSE_STEPS {
            let next = (seen - self.sideways(ray)) / self.radial_part(ray.length_squared()).0;
            if next == ray {
                break;
            }
            ray = next;
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
    /// Squared radius at which the polynomial turns back towards the middle of the image. Beyond it, the model
    /// does not describe a lens.
    fold: f64,
}

impl Source<'_> {
    fn new(distortion: Distortion, camera: &Camera) -> Source<'_> {
        let size = DVec2::new(f64::from(camera.width), f64::from(camera.height));
        let corners = [DVec2::ZERO, DVec2::new(size.x, 0.0), DVec2::new(0.0, size.y), size];
        let squared = corners.map(|corner| ((corner - camera.principal) / camera.focal).length_squared());
        let farthest = squared.into_iter().fold(0.0, f64::max);
        let steps = (1..=FOLD_STEPS).map(|i| farthest * f64::from(i) / f64::from(FOLD_STEPS));
        let fold = steps.into_iter().find(|r2| distortion.radial_part(*r2).1 <= 0.0).unwrap_or(f64::INFINITY);
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
        let at = (at - DVec2::splat(0.5)).clamp(DVec2::ZERO, self.size - DVec2::ONE);
        let [x, y] = at.to_array().map(|v| v as usize);
        let (u, v) = (at.x - x as f64, at.y - y as f64);
        let [width, height] = [self.camera.width, self.camera.height].map(|size| size as usize);
        let (right, below) = ((x + 1).min(width - 1), (y + 1).min(height - 1));
        let pixel = |x: usize, y: usize| pixels.get(y * width + x).copied().unwrap_or_default().map(f64::from);
        let corners = [pixel(x, y), pixel(right, y), pixel(x, below), pixel(right, below)];
        std::array::from_fn(|i| {
            let [a, b, c, d] = corners.map(|corner| corner[i]);
            let top = a + (b - a) * u;
            let bottom = c + (d - c) * u;
            // To the nearest: the values are not negative.
            (top + (bottom - top) * v + 0.5) as u8
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

    fn lens(coefficients: &[f64]) -> Distortion {
        Distortion::from_opencv(coefficients).unwrap()
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
            let found = lens(&coefficients).undistorted(&camera, &distorted, [1, 2, 3, 0]);
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
        let seen = lens(&[0.1, 0.2, 0.01, 0.02, 0.4]).distorted(DVec2::new(0.3, 0.4));
        assert!((seen - DVec2::new(0.324125, 0.428)).length() < 1e-12, "{seen}");
    }

    #[test]
    fn points_that_the_lens_does_not_see_are_outside() {
        let camera = camera(96, 72);
        let white = vec![[255; 4]; 96 * 72];
        // Pincushion: the corners of the pinhole image lie beyond those of the distorted one.
        let pincushion = lens(&[0.5, 0.0, 0.0, 0.0, 0.0]);
        let found = pincushion.undistorted(&camera, &white, [0, 9, 0, 0]);
        assert_eq!((found[0], found[36 * 96 + 48]), ([0, 9, 0, 0], [255; 4]));
        assert!((0.6..0.95).contains(&pincushion.visible_part(&camera)), "{}", pincushion.visible_part(&camera));
        // Barrel by one coefficient: r (1 - 0.9 r²) turns back at r = 0.61, and points beyond are not seen a second
        // time.
        let barrel = lens(&[-0.9, 0.0, 0.0, 0.0, 0.0]);
        assert_eq!(barrel.undistorted(&camera, &white, [0; 4])[0], [0; 4]);
        assert_eq!(lens(&[0.0; 5]).visible_part(&camera), 1.0);
        for broken in [1e30, -1e30, f64::NAN] {
            assert!(lens(&[broken, 0.0, 0.0, 0.0, 0.0]).visible_part(&camera) < 0.01, "{broken}");
        }
    }

    #[test]
    fn no_distortion_changes_no_pixel() {
        let camera = camera(13, 7);
        let pixels: Vec<[u8; 4]> = (0..13 * 7).map(|i| [i as u8, 255 - i as u8, 3 * (i % 80) as u8, 7]).collect();
        assert_eq!(lens(&[0.0; 5]).undistorted(&camera, &pixels, [0; 4]), pixels);
    }

    #[test]
    fn rational_prism_and_fisheye_lenses_are_undistorted() {
        let camera = camera(96, 72);
        let twelve = [0.3, 0.05, 0.002, -0.003, 0.01, 0.55, 0.08, 0.01, 0.004, -0.002, -0.003, 0.001];
        // OpenCV's formulas, written down again.
        let seen = lens(&twelve).distorted(DVec2::new(0.3, 0.4));
        let q = (1.0 + 0.3 * 0.25 + 0.05 * 0.0625 + 0.01 * 0.015625)
            / (1.0 + 0.55 * 0.25 + 0.08 * 0.0625 + 0.01 * 0.015625);
        let x = 0.3 * q + 2.0 * 0.002 * 0.12 - 0.003 * (0.25 + 0.18) + 0.004 * 0.25 - 0.002 * 0.0625;
        let y = 0.4 * q + 0.002 * (0.25 + 0.32) - 2.0 * 0.003 * 0.12 - 0.003 * 0.25 + 0.001 * 0.0625;
        assert!((seen - DVec2::new(x, y)).length() < 1e-12, "{seen}");
        let fisheye = Distortion::Fisheye([0.05, -0.02, 0.004, -0.001]);
        let angle = 0.5f64.atan();
        let r =
            angle * (1.0 + 0.05 * angle.powi(2) - 0.02 * angle.powi(4) + 0.004 * angle.powi(6) - 0.001 * angle.powi(8));
        assert!((fisheye.distorted(DVec2::new(0.3, 0.4)) - DVec2::new(0.6, 0.8) * r).length() < 1e-12);
        assert_eq!(fisheye.distorted(DVec2::ZERO), DVec2::ZERO);
        for lens in [lens(&twelve), lens(&twelve[..8]), fisheye] {
            let ray_seen_at = |seen: DVec2| lens.undistorted_ray(seen).unwrap();
            let found = lens.undistorted(&camera, &picture(&camera, ray_seen_at), [1, 2, 3, 0]);
            let ideal = picture(&camera, |ray| ray);
            let pairs = || found.iter().zip(&ideal).filter(|(a, _)| **a != [1, 2, 3, 0]);
            let worst = pairs().flat_map(|(a, b)| [0, 1, 2].map(|i| a[i].abs_diff(b[i]))).max().unwrap();
            assert!(worst <= 3 && pairs().count() > 5000, "{lens:?}: {worst} {}", pairs().count());
        }
    }

    #[test]
    fn coefficients_are_told_apart_by_their_number_and_zeros_behind_do_not_count() {
        let five = lens(&[-0.2, 0.05, 0.001, 0.002, 0.0]);
        for zeros in [0, 1, 2, 3, 4, 8, 10] {
            assert_eq!(lens(&[&[-0.2, 0.05, 0.001, 0.002][..], &vec![0.0; zeros]].concat()), five, "{zeros}");
        }
        assert_eq!(five.to_opencv(), Some(vec![-0.2, 0.05, 0.001, 0.002, 0.0]));
        let eight = [0.1, 0.2, 0.0, 0.0, 0.3, 0.4, 0.5, 0.6];
        assert_eq!(lens(&eight).to_opencv(), Some(eight.to_vec()));
        let twelve = [&eight[..], &[0.0, 0.0, 0.0, 0.1]].concat();
        assert_eq!(lens(&[&twelve[..], &[0.0; 2]].concat()).to_opencv(), Some(twelve.clone()));
        for (wrong, says) in [
            (vec![-0.2], "has 1 numbers"),
            (vec![-0.2, 0.1, 0.0, 0.0, 0.0, 0.1], "has 6 numbers"),
            ([&twelve[..], &[0.01, 0.0]].concat(), "tilted sensor"),
        ] {
            assert!(Distortion::from_opencv(&wrong).unwrap_err().contains(says), "{wrong:?}");
        }
    }
}
