//! Images of other lenses, as pictures of pinhole cameras.

use ghand_core::Camera;
use glam::DVec2;
use image::RgbImage;

/// What an image's camera is other than the sequence's.
#[derive(Debug, Clone)]
pub(crate) enum Warp {
    /// A pinhole camera of other intrinsics: `(focal, principal)` of the image and of the sequence's camera.
    Zoom { from: (DVec2, DVec2), to: (DVec2, DVec2) },
    /// A lens seen through this pinhole camera of the same place.
    Fisheye(Box<Fisheye624>, Camera),
}

impl Warp {
    /// Where a pixel of the sequence's camera is in the image; centres of pixels at halves.
    pub fn source_of(&self, pixel: DVec2) -> DVec2 {
        match self {
            Warp::Zoom { from, to } => (pixel - to.1) / to.0 * from.0 + from.1,
            Warp::Fisheye(lens, camera) => lens.pixel((pixel - camera.principal) / camera.focal),
        }
    }
}

/// The lens of Aria and Quest: `FISHEYE624` of Project Aria, six radial, two tangential and four thin-prism numbers on the
/// angle from the axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Fisheye624 {
    pub focal: DVec2,
    /// Centres of pixels at halves.
    pub principal: DVec2,
    pub radial: [f64; 6],
    pub tangential: [f64; 2],
    pub prism: [f64; 4],
}

impl Fisheye624 {
    /// Where the ray `(x, y, 1)` is seen.
    pub fn pixel(&self, ray: DVec2) -> DVec2 {
        let r = ray.length();
        let angle = r.atan();
        let straight = if r > 0.0 { ray * (angle / r) } else { ray };
        let a2 = angle * angle;
        let radial = 1.0 + self.radial.iter().rev().fold(0.0, |sum, k| (sum + k) * a2);
        let bent = straight * radial;
        let r2 = bent.length_squared();
        let [p1, p2] = self.tangential;
        let [s1, s2, s3, s4] = self.prism;
        let tangential = bent * 2.0 * DVec2::new(p1, p2).dot(bent) + DVec2::new(p1, p2) * r2;
        let prism = DVec2::new(s1 * r2 + s2 * r2 * r2, s3 * r2 + s4 * r2 * r2);
        (bent + tangential + prism) * self.focal + self.principal
    }
}

/// The image that the sequence's camera would have taken, with bilinear interpolation; black where there is none.
pub(crate) fn warped(image: &RgbImage, warp: &Warp, size: (u32, u32)) -> RgbImage {
    let mut out = RgbImage::new(size.0, size.1);
    let last = DVec2::new(f64::from(image.width()), f64::from(image.height())) - 1.0;
    for (x, y, pixel) in out.enumerate_pixels_mut() {
        let at = warp.source_of(DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5)) - 0.5;
        // Half a pixel beyond the outermost centres still is the image.
        if !(at.cmpge(DVec2::splat(-0.5)).all() && at.cmple(last + 0.5).all()) {
            continue;
        }
        let at = at.clamp(DVec2::ZERO, last);
        let (low, part) = (at.floor(), at - at.floor());
        let high = (low + 1.0).min(last);
        let channel = |x: f64, y: f64, k: usize| f64::from(image.get_pixel(x as u32, y as u32).0[k]);
        for k in 0..3 {
            let above = channel(low.x, low.y, k) * (1.0 - part.x) + channel(high.x, low.y, k) * part.x;
            let below = channel(low.x, high.y, k) * (1.0 - part.x) + channel(high.x, high.y, k) * part.x;
            pixel.0[k] = (above * (1.0 - part.y) + below * part.y).round() as u8;
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_zoom_takes_points_where_the_other_camera_sees_them() {
        let [from, to] = [(100.0, 30.0), (130.0, 20.0)].map(|(f, c)| (DVec2::splat(f), DVec2::splat(c)));
        let ray = DVec2::new(0.1, -0.07);
        let warp = Warp::Zoom { from, to };
        assert!(warp.source_of(ray * to.0 + to.1).distance(ray * from.0 + from.1) < 1e-12);
        // A gradient stays one, at the places that the zoom says.
        let image = RgbImage::from_fn(60, 60, |x, y| image::Rgb([(4 * x) as u8, (4 * y) as u8, 7]));
        let out = warped(&image, &warp, (40, 40));
        let [x, y] = warp.source_of(DVec2::new(25.5, 12.5)).to_array();
        let expected = [x, y].map(|v| (4.0 * (v - 0.5)).round() as u8);
        assert_eq!(out.get_pixel(25, 12).0, [expected[0], expected[1], 7]);
    }

    #[test]
    fn a_fisheye_without_coefficients_is_equidistant_and_outside_is_black() {
        let lens = Fisheye624 {
            focal: DVec2::splat(200.0),
            principal: DVec2::new(50.0, 40.0),
            radial: [0.0; 6],
            tangential: [0.0; 2],
            prism: [0.0; 4],
        };
        let ray = DVec2::new(0.3_f64.tan(), 0.0);
        assert!(lens.pixel(ray).distance(DVec2::new(50.0 + 60.0, 40.0)) < 1e-9);
        // p1 acts along x, s3 along y, as in Project Aria's projection.
        let bent = Fisheye624 { tangential: [0.01, 0.0], prism: [0.0, 0.0, 0.02, 0.0], ..lens };
        let moved = bent.pixel(ray) - lens.pixel(ray);
        assert!(moved.distance(DVec2::new(3.0 * 0.01, 0.02) * 0.09 * 200.0) < 1e-9, "{moved}");
        let camera = Camera::look_at(glam::DVec3::ZERO, glam::DVec3::Z, -glam::DVec3::Y, 1.2, 20, 20);
        let image = RgbImage::from_pixel(100, 80, image::Rgb([200; 3]));
        let out = warped(&image, &Warp::Fisheye(Box::new(lens), camera), (20, 20));
        assert_eq!([out.get_pixel(10, 10).0, out.get_pixel(0, 0).0], [[200; 3], [0; 3]]);
    }
}
