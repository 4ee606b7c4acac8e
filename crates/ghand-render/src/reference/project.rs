//! Twin of `project.wgsl` and `project_backward.wgsl`.

use ghand_core::Camera;
use glam::{DVec2, DVec3};

use crate::splat::NEAR;

/// Blur added to projected covariances, pixels^2.
const BLUR: f64 = 0.3;

/// An isotropic Gaussian in the world.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Gaussian {
    /// Centre, metres.
    pub mean: DVec3,
    /// Standard deviation, metres.
    pub scale: f64,
    /// Colour.
    pub color: DVec3,
}

/// A Gaussian on the image plane.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Splat {
    /// Centre, pixels.
    pub mean: DVec2,
    /// Camera z, metres.
    pub depth: f64,
    /// Inverse covariance xx, xy, yy, pixels^-2.
    pub conic: DVec3,
    /// Half size of the box beyond which alpha stays below 1/255, pixels.
    pub reach: DVec2,
    /// Colour.
    pub color: DVec3,
}

struct Footprint {
    p: DVec3,
    slope: DVec2,
    free: [bool; 2],
    covariance: DVec3,
}

fn footprint(g: &Gaussian, camera: &Camera) -> Footprint {
    let p = camera.camera_from_world(g.mean);
    let size = DVec2::new(f64::from(camera.width), f64::from(camera.height));
    let low = -(camera.principal + 0.15 * size) / camera.focal;
    let high = (size - camera.principal + 0.15 * size) / camera.focal;
    let raw = DVec2::new(p.x, p.y) / p.z;
    let slope = raw.clamp(low, high);
    let f = camera.focal;
    let u = (g.scale / p.z).powi(2);
    let covariance = DVec3::new(
        u * f.x * f.x * (1.0 + slope.x * slope.x) + BLUR,
        u * f.x * f.y * slope.x * slope.y,
        u * f.y * f.y * (1.0 + slope.y * slope.y) + BLUR,
    );
    Footprint { p, slope, free: [raw.x == slope.x, raw.y == slope.y], covariance }
}

fn inverse(c: DVec3) -> DVec3 {
    DVec3::new(c.z, -c.y, c.x) / (c.x * c.z - c.y * c.y)
}

/// The splat of a Gaussian, or nothing where it is culled.
pub fn project(g: &Gaussian, camera: &Camera, opacity: f64) -> Option<Splat> {
    let f = footprint(g, camera);
    let finite = f.p.is_finite() && g.scale.is_finite() && g.color.is_finite();
    if !finite || f.p.z < f64::from(NEAR) || opacity < 1.0 / 255.0 {
        return None;
    }
    let mean = DVec2::new(f.p.x, f.p.y) / f.p.z * camera.focal + camera.principal;
    let q = 2.0 * (opacity * 255.0).ln();
    let reach = DVec2::new((q * f.covariance.x).sqrt(), (q * f.covariance.z).sqrt());
    Some(Splat { mean, depth: f.p.z, conic: inverse(f.covariance), reach, color: g.color })
}

/// Gradient of a Gaussian's properties from the gradient of its splat's mean, conic and colour.
pub fn project_vjp(g: &Gaussian, camera: &Camera, d_mean: DVec2, d_conic: DVec3, d_color: DVec3) -> Gaussian {
    let Footprint { p, slope: r, free, covariance } = footprint(g, camera);
    let k = inverse(covariance);
    let k = glam::DMat2::from_cols_array(&[k.x, k.y, k.y, k.z]);
    let d = glam::DMat2::from_cols_array(&[d_conic.x, 0.5 * d_conic.y, 0.5 * d_conic.y, d_conic.z]);
    let d_covariance = -(k * d * k);
    let (xx, xy, yy) = (d_covariance.x_axis.x, 2.0 * d_covariance.x_axis.y, d_covariance.y_axis.y);
    let f = camera.focal;
    let u = (g.scale / p.z).powi(2);
    let d_u = xx * f.x * f.x * (1.0 + r.x * r.x) + xy * f.x * f.y * r.x * r.y + yy * f.y * f.y * (1.0 + r.y * r.y);
    let d_slope = u * DVec2::new(
        if free[0] { 2.0 * xx * f.x * f.x * r.x + xy * f.x * f.y * r.y } else { 0.0 },
        if free[1] { 2.0 * yy * f.y * f.y * r.y + xy * f.x * f.y * r.x } else { 0.0 },
    );
    let d_ratio = d_mean * f + d_slope;
    let d_z = -(d_ratio.x * p.x + d_ratio.y * p.y) / (p.z * p.z) - 2.0 * d_u * u / p.z;
    let d_p = DVec3::new(d_ratio.x / p.z, d_ratio.y / p.z, d_z);
    Gaussian { mean: camera.rotation.transpose() * d_p, scale: 2.0 * d_u * g.scale / (p.z * p.z), color: d_color }
}
