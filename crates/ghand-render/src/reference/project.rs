//! Twin of `project.wgsl` and `project_backward.wgsl`, with matrices in place of the shaders' unrolled sums.

use ghand_core::Camera;
use glam::{DMat2, DMat3, DVec2, DVec3, DVec4};

use super::spherical_harmonics::{basis, basis_gradient};
use crate::splat::NEAR;

/// Blur added to projected covariances, pixels^2: as 3D Gaussian Splatting has it, and as Mip-Splatting has it.
pub(crate) const BLUR: f64 = 0.3;
pub(crate) const NARROW_BLUR: f64 = 0.1;
/// Splats below this alpha are invisible.
pub(super) const ALPHA_MIN: f64 = 1.0 / 255.0;

/// How projected Gaussians are kept from being smaller than a pixel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Filter {
    /// Whether opacity compensates for the blur.
    pub antialias: bool,
    /// Added to projected covariances, pixels^2.
    pub blur: f64,
}

/// A Gaussian in the world, of the most general kind. The other kinds are special cases of it.
#[derive(Debug, Clone, PartialEq)]
pub struct Gaussian {
    /// Centre, metres.
    pub mean: DVec3,
    /// Standard deviations along the axes of `rotation`, metres.
    pub scales: DVec3,
    /// Quaternion x, y, z, w of any non-zero norm.
    pub rotation: DVec4,
    /// Opacity, 0 to 1.
    pub opacity: f64,
    /// A plain colour, or the coefficients of 1, 4, 9 or 16 spherical harmonics.
    pub color: Color,
}

/// The colour of a Gaussian.
#[derive(Debug, Clone, PartialEq)]
pub enum Color {
    /// The same in all directions.
    Rgb(DVec3),
    /// Dependent on the viewing direction.
    SphericalHarmonics(Vec<DVec3>),
}

impl Gaussian {
    /// An isotropic Gaussian of one colour.
    pub fn round(mean: DVec3, scale: f64, opacity: f64, color: DVec3) -> Gaussian {
        Gaussian { mean, scales: DVec3::splat(scale), rotation: DVec4::W, opacity, color: Color::Rgb(color) }
    }

    /// The zero gradient of this Gaussian, to be summed into.
    pub(super) fn zero_like(&self) -> Gaussian {
        let color = match &self.color {
            Color::Rgb(_) => Color::Rgb(DVec3::ZERO),
            Color::SphericalHarmonics(c) => Color::SphericalHarmonics(vec![DVec3::ZERO; c.len()]),
        };
        Gaussian { mean: DVec3::ZERO, scales: DVec3::ZERO, rotation: DVec4::ZERO, opacity: 0.0, color }
    }

    /// The plain colour, or the harmonics' coefficients.
    pub fn coefficients(&self) -> &[DVec3] {
        match &self.color {
            Color::Rgb(color) => std::slice::from_ref(color),
            Color::SphericalHarmonics(coefficients) => coefficients,
        }
    }
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
    /// Half size of the box outside which alpha is below 1/255, pixels.
    pub reach: DVec2,
    /// Opacity.
    pub opacity: f64,
    /// Colour.
    pub color: DVec3,
}

/// Gradients of a splat's fields.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct SplatGradient {
    /// dL/d(centre).
    pub mean: DVec2,
    /// dL/d(conic), for three independent numbers.
    pub conic: DVec3,
    /// dL/d(opacity).
    pub opacity: f64,
    /// dL/d(colour).
    pub color: DVec3,
}

/// dL/d(camera).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CameraGradient {
    /// dL/d(rotation), for nine independent numbers.
    pub rotation: DMat3,
    /// dL/d(translation).
    pub translation: DVec3,
}

impl CameraGradient {
    /// The initial value of a sum.
    pub const ZERO: CameraGradient = CameraGradient { rotation: DMat3::ZERO, translation: DVec3::ZERO };
}

struct Footprint {
    p: DVec3,
    /// The rotation's matrix.
    axes: DMat3,
    /// `d(pixel)/d(camera point)`, 2 x 3, as two rows.
    jacobian: [DVec3; 2],
    slope: DVec2,
    free: [bool; 2],
    /// Covariance before the blur.
    sharp: DMat2,
    covariance: DMat2,
    /// sqrt(det sharp / det covariance), or 1.
    compensation: f64,
}

/// The rotation matrix of a quaternion of any norm.
fn rotation_matrix(q: DVec4) -> DMat3 {
    DMat3::from_quat(glam::DQuat::from_vec4(q.normalize()))
}

fn footprint(g: &Gaussian, camera: &Camera, filter: Filter) -> Footprint {
    let Filter { antialias, blur } = filter;
    let p = camera.camera_from_world(g.mean);
    let size = DVec2::new(f64::from(camera.width), f64::from(camera.height));
    let low = -(camera.principal + 0.15 * size) / camera.focal;
    let high = (size - camera.principal + 0.15 * size) / camera.focal;
    let raw = DVec2::new(p.x, p.y) / p.z;
    let slope = raw.clamp(low, high);
    let f = camera.focal;
    let jacobian = [DVec3::new(1.0, 0.0, -slope.x) * (f.x / p.z), DVec3::new(0.0, 1.0, -slope.y) * (f.y / p.z)];
    let axes = rotation_matrix(g.rotation);
    let half = camera.rotation * axes * DMat3::from_diagonal(g.scales);
    let sigma = half * half.transpose();
    let entry = |i: usize, j: usize| jacobian[i].dot(sigma * jacobian[j]);
    let sharp = DMat2::from_cols_array(&[entry(0, 0), entry(0, 1), entry(0, 1), entry(1, 1)]);
    let covariance = sharp + DMat2::from_diagonal(DVec2::splat(blur));
    let compensation = if antialias { (sharp.determinant().max(0.0) / covariance.determinant()).sqrt() } else { 1.0 };
    let free = [raw.x == slope.x, raw.y == slope.y];
    Footprint { p, axes, jacobian, slope, free, sharp, covariance, compensation }
}

/// The splat of a Gaussian, or `None` if it is culled.
pub fn project(g: &Gaussian, camera: &Camera, filter: Filter) -> Option<Splat> {
    let finite = g.mean.is_finite()
        && g.scales.is_finite()
        && g.rotation.is_finite()
        && g.opacity.is_finite()
        && g.coefficients().iter().all(|c| c.is_finite());
    if !finite || g.rotation == DVec4::ZERO {
        return None;
    }
    let f = footprint(g, camera, filter);
    let opacity = g.opacity * f.compensation;
    if !f.p.is_finite() || f.p.z < f64::from(NEAR) || opacity < ALPHA_MIN {
        return None;
    }
    let mean = DVec2::new(f.p.x, f.p.y) / f.p.z * camera.focal + camera.principal;
    let q = 2.0 * (opacity / ALPHA_MIN).ln();
    let c = f.covariance;
    let reach = DVec2::new((q * c.x_axis.x).sqrt(), (q * c.y_axis.y).sqrt());
    let conic = c.inverse();
    let conic = DVec3::new(conic.x_axis.x, conic.x_axis.y, conic.y_axis.y);
    Some(Splat { mean, depth: f.p.z, conic, reach, opacity, color: seen_color(g, camera) })
}

/// The direction from the camera to a Gaussian, and its distance.
fn direction(g: &Gaussian, camera: &Camera) -> (DVec3, f64) {
    let offset = g.mean - camera.center();
    (offset.normalize(), offset.length())
}

fn seen_color(g: &Gaussian, camera: &Camera) -> DVec3 {
    match &g.color {
        Color::Rgb(color) => *color,
        Color::SphericalHarmonics(coefficients) => {
            let values = basis(direction(g, camera).0);
            let sum: DVec3 = coefficients.iter().zip(values).map(|(c, y)| *c * y).sum();
            (sum + 0.5).max(DVec3::ZERO)
        }
    }
}

/// Gradient of a Gaussian's properties from that of its splat; the camera's gradient is added to `d_camera`.
pub fn project_vjp(
    g: &Gaussian,
    camera: &Camera,
    filter: Filter,
    d: &SplatGradient,
    d_camera: &mut CameraGradient,
) -> Gaussian {
    let f = footprint(g, camera, filter);
    let mut gradient = g.zero_like();
    let mut d_p = DVec3::ZERO;
    // Opacity and, with antialiasing, the covariance that it depends on: c = sqrt(det S / det C), dc = c/2 (tr(S^-1 dS)
    // - tr(C^-1 dC)).
    gradient.opacity = d.opacity * f.compensation;
    let conic = f.covariance.inverse();
    let d_conic = DMat2::from_cols_array(&[d.conic.x, 0.5 * d.conic.y, 0.5 * d.conic.y, d.conic.z]);
    let mut d_covariance = -(conic * d_conic * conic);
    if filter.antialias && f.sharp.determinant() > 0.0 {
        d_covariance += (f.sharp.inverse() - conic) * (0.5 * d.opacity * g.opacity * f.compensation);
    }
    // cov = J W A S S A^T W^T J^T with the rotation's matrix A.
    let world = |row: DVec3| camera.rotation.transpose() * row;
    let rows = [world(f.jacobian[0]), world(f.jacobian[1])];
    let half = f.axes * DMat3::from_diagonal(g.scales);
    let sigma = half * half.transpose();
    let mut d_sigma = DMat3::ZERO;
    let mut d_rows = [DVec3::ZERO; 2];
    for i in 0..2 {
        for j in 0..2 {
            let weight = d_covariance.col(i)[j];
            d_sigma += outer(rows[i], rows[j]) * weight;
            d_rows[i] += 2.0 * weight * (sigma * rows[j]);
        }
    }
    let d_half = 2.0 * d_sigma * half;
    gradient.scales = DVec3::from_array(std::array::from_fn(|k| f.axes.col(k).dot(d_half.col(k))));
    let d_axes = d_half * DMat3::from_diagonal(g.scales);
    gradient.rotation = rotation_matrix_vjp(g.rotation, &d_axes);
    // rows = W^T J.
    let mut d_jacobian = [DVec3::ZERO; 2];
    for i in 0..2 {
        d_jacobian[i] = camera.rotation * d_rows[i];
        d_camera.rotation += outer(f.jacobian[i], d_rows[i]);
    }
    // J_0 = (fx / z) (1, 0, -slope.x), J_1 = (fy / z) (0, 1, -slope.y), centre = slope f + principal.
    for axis in 0..2 {
        let focal = camera.focal[axis];
        let z = f.p.z;
        d_p.z -= d_jacobian[axis].dot(f.jacobian[axis]) / z;
        let through_jacobian = if f.free[axis] { -d_jacobian[axis].z * focal / z } else { 0.0 };
        let d_slope = d.mean[axis] * focal + through_jacobian;
        d_p[axis] += d_slope / z;
        d_p.z -= d_slope * f.p[axis] / (z * z);
        debug_assert!(!f.free[axis] || f.slope[axis] == f.p[axis] / z);
    }
    gradient.mean = camera.rotation.transpose() * d_p;
    d_camera.rotation += outer(d_p, g.mean);
    d_camera.translation += d_p;
    match (&g.color, &mut gradient.color) {
        (Color::SphericalHarmonics(coefficients), Color::SphericalHarmonics(d_coefficients)) => {
            let (toward, distance) = direction(g, camera);
            let color = seen_color(g, camera);
            let d_sum = DVec3::select(color.cmpgt(DVec3::ZERO), d.color, DVec3::ZERO);
            let mut d_toward = DVec3::ZERO;
            let functions = basis(toward).into_iter().zip(basis_gradient(toward));
            for ((c, d_c), (y, y_gradient)) in coefficients.iter().zip(d_coefficients).zip(functions) {
                *d_c = d_sum * y;
                d_toward += y_gradient * c.dot(d_sum);
            }
            let d_offset = (d_toward - toward * toward.dot(d_toward)) / distance;
            gradient.mean += d_offset;
            // The camera's centre is -W^T t.
            d_camera.translation += camera.rotation * d_offset;
            d_camera.rotation += outer(camera.translation, d_offset);
        }
        (_, Color::Rgb(d_color)) => *d_color = d.color,
        _ => {}
    }
    gradient
}

/// dL/d(quaternion) from dL/d(its matrix), by the matrix's entries as polynomials of the unit quaternion.
fn rotation_matrix_vjp(q: DVec4, d: &DMat3) -> DVec4 {
    let length = q.length();
    let DVec4 { x, y, z, w } = q / length;
    let (c0, c1, c2) = (d.x_axis, d.y_axis, d.z_axis);
    let unit = 2.0
        * DVec4::new(
            -2.0 * x * (c1.y + c2.z) + y * (c1.x + c0.y) + z * (c2.x + c0.z) + w * (c1.z - c2.y),
            -2.0 * y * (c0.x + c2.z) + x * (c1.x + c0.y) + z * (c2.y + c1.z) + w * (c2.x - c0.z),
            -2.0 * z * (c0.x + c1.y) + x * (c2.x + c0.z) + y * (c2.y + c1.z) + w * (c0.y - c1.x),
            x * (c1.z - c2.y) + y * (c2.x - c0.z) + z * (c0.y - c1.x),
        );
    let direction = q / length;
    (unit - direction * direction.dot(unit)) / length
}

fn outer(a: DVec3, b: DVec3) -> DMat3 {
    DMat3::from_cols(a * b.x, a * b.y, a * b.z)
}
