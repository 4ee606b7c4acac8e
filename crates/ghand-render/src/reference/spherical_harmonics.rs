//! Twin of `shared/spherical_harmonics.wgsl`: real spherical harmonics up to degree 3, in the order and with the signs
//! that 3D Gaussian Splatting files use.

use glam::DVec3;

/// Values of the 16 basis functions in a unit direction.
pub fn basis(d: DVec3) -> [f64; 16] {
    let (x, y, z) = (d.x, d.y, d.z);
    let (xx, yy, zz) = (x * x, y * y, z * z);
    // K_lm of the normalised associated Legendre functions: sqrt((2l+1)/(4 pi) (l-|m|)!/(l+|m|)!), times sqrt(2) for m
    // != 0, and times the constant factors of the polynomials.
    let k = |factor: f64| (factor / std::f64::consts::PI).sqrt();
    [
        k(0.25),
        -k(0.75) * y,
        k(0.75) * z,
        -k(0.75) * x,
        k(3.75) * x * y,
        -k(3.75) * y * z,
        k(0.3125) * (2.0 * zz - xx - yy),
        -k(3.75) * x * z,
        k(0.9375) * (xx - yy),
        -k(35.0 / 32.0) * y * (3.0 * xx - yy),
        k(26.25) * x * y * z,
        -k(21.0 / 32.0) * y * (4.0 * zz - xx - yy),
        k(7.0 / 16.0) * z * (2.0 * zz - 3.0 * xx - 3.0 * yy),
        -k(21.0 / 32.0) * x * (4.0 * zz - xx - yy),
        k(105.0 / 16.0) * z * (xx - yy),
        -k(35.0 / 32.0) * x * (xx - 3.0 * yy),
    ]
}

/// Gradients of the 16 polynomials of [`basis`] with respect to the direction's components, treated as independent.
pub fn basis_gradient(d: DVec3) -> [DVec3; 16] {
    let (x, y, z) = (d.x, d.y, d.z);
    let (xx, yy, zz) = (x * x, y * y, z * z);
    let k = |factor: f64| (factor / std::f64::consts::PI).sqrt();
    let v = DVec3::new;
    [
        DVec3::ZERO,
        v(0.0, -k(0.75), 0.0),
        v(0.0, 0.0, k(0.75)),
        v(-k(0.75), 0.0, 0.0),
        k(3.75) * v(y, x, 0.0),
        -k(3.75) * v(0.0, z, y),
        k(0.3125) * v(-2.0 * x, -2.0 * y, 4.0 * z),
        -k(3.75) * v(z, 0.0, x),
        k(0.9375) * v(2.0 * x, -2.0 * y, 0.0),
        -k(35.0 / 32.0) * v(6.0 * x * y, 3.0 * xx - 3.0 * yy, 0.0),
        k(26.25) * v(y * z, x * z, x * y),
        -k(21.0 / 32.0) * v(-2.0 * x * y, 4.0 * zz - xx - 3.0 * yy, 8.0 * y * z),
        k(7.0 / 16.0) * v(-6.0 * x * z, -6.0 * y * z, 6.0 * zz - 3.0 * xx - 3.0 * yy),
        -k(21.0 / 32.0) * v(4.0 * zz - 3.0 * xx - yy, -2.0 * x * y, 8.0 * x * z),
        k(105.0 / 16.0) * v(2.0 * x * z, -2.0 * y * z, xx - yy),
        -k(35.0 / 32.0) * v(3.0 * xx - 3.0 * yy, -6.0 * x * y, 0.0),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_functions_are_orthonormal_on_the_sphere() {
        // Gauss-Legendre quadrature would be exact; a fine midpoint grid in cos(theta) and phi is enough for 1e-3.
        let (rows, columns) = (200, 200);
        let mut products = [[0.0; 16]; 16];
        for i in 0..rows {
            let z = (i as f64 + 0.5) / rows as f64 * 2.0 - 1.0;
            let r = (1.0 - z * z).sqrt();
            for j in 0..columns {
                let phi = (j as f64 + 0.5) / columns as f64 * std::f64::consts::TAU;
                let b = basis(DVec3::new(r * phi.cos(), r * phi.sin(), z));
                let area = 4.0 * std::f64::consts::PI / f64::from(rows * columns);
                for m in 0..16 {
                    for n in 0..16 {
                        products[m][n] += b[m] * b[n] * area;
                    }
                }
            }
        }
        for (m, row) in products.iter().enumerate() {
            for (n, product) in row.iter().enumerate() {
                assert!((product - f64::from(u8::from(m == n))).abs() < 1e-3, "{m} {n}: {product}");
            }
        }
    }

    #[test]
    fn the_gradients_agree_with_central_differences() {
        let d = DVec3::new(0.48, -0.6, 0.64);
        for axis in 0..3 {
            let mut step = DVec3::ZERO;
            step[axis] = 1e-6;
            let above = basis(d + step);
            let below = basis(d - step);
            for (m, gradient) in basis_gradient(d).iter().enumerate() {
                let numeric = (above[m] - below[m]) / 2e-6;
                assert!((gradient[axis] - numeric).abs() < 1e-8, "{m} {axis}");
            }
        }
    }
}
