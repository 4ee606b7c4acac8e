//! Rotations as axis-angle vectors (Rodrigues' formula) and their derivative.

use glam::{DMat3, DVec3, DVec4, Vec4Swizzles};

/// Coefficients of `R = (1 - b s) I + a [v]x + b v v^T` with `s = |v|^2`, and their derivatives to `s`.
struct Coefficients {
    /// sin(angle) / angle
    a: f64,
    /// (1 - cos(angle)) / angle^2
    b: f64,
    /// da/ds
    a_s: f64,
    /// db/ds
    b_s: f64,
}

/// Below this squared angle the closed forms of the derivatives cancel; the series, cut after eight terms, is exact to
/// f64 there (the first term left out is below 0.25^8 / 17! = 4e-20).
const SERIES_BELOW: f64 = 0.25;

fn coefficients(s: f64) -> Coefficients {
    if s < SERIES_BELOW {
        // a = sum (-s)^k / (2k+1)!, b = sum (-s)^k / (2k+2)!
        let (mut a, mut b, mut a_s, mut b_s) = (0.0, 0.0, 0.0, 0.0);
        let (mut power, mut previous_power) = (1.0, 0.0);
        let mut factorial = 1.0; // (2k+1)!
        for k in 0..9 {
            let k = f64::from(k);
            a += power / factorial;
            b += power / (factorial * (2.0 * k + 2.0));
            a_s -= k * previous_power / factorial;
            b_s -= k * previous_power / (factorial * (2.0 * k + 2.0));
            previous_power = power;
            power *= -s;
            factorial *= (2.0 * k + 2.0) * (2.0 * k + 3.0);
        }
        Coefficients { a, b, a_s, b_s }
    } else {
        let angle = s.sqrt();
        let (sin, cos) = angle.sin_cos();
        let a = sin / angle;
        // 1 - cos as 2 sin^2(angle/2): no cancellation near multiples of 2 pi.
        let half = (0.5 * angle).sin();
        let b = 2.0 * half * half / s;
        Coefficients { a, b, a_s: (cos - a) / (2.0 * s), b_s: (0.5 * a - b) / s }
    }
}

/// The rotation about `v` by `|v|` radians, exact at 0 and beyond 2 pi.
pub fn rotation_from_axis_angle(v: DVec3) -> DMat3 {
    let s = v.length_squared();
    let c = coefficients(s);
    let d = 1.0 - c.b * s;
    let (a, b) = (v * c.a, v * c.b);
    DMat3::from_cols(
        DVec3::new(d + b.x * v.x, b.y * v.x + a.z, b.z * v.x - a.y),
        DVec3::new(b.x * v.y - a.z, d + b.y * v.y, b.z * v.y + a.x),
        DVec3::new(b.x * v.z + a.y, b.y * v.z - a.x, d + b.z * v.z),
    )
}

/// dL/dv from dL/dR for `R = rotation_from_axis_angle(v)`.
pub fn rotation_from_axis_angle_vjp(v: DVec3, d_rotation: &DMat3) -> DVec3 {
    let g = d_rotation;
    let s = v.length_squared();
    let c = coefficients(s);
    // <G, [v]x> = v . vee
    let vee = DVec3::new(g.y_axis.z - g.z_axis.y, g.z_axis.x - g.x_axis.z, g.x_axis.y - g.y_axis.x);
    let trace = g.x_axis.x + g.y_axis.y + g.z_axis.z;
    let symmetric = *g * v + g.transpose() * v;
    let quadratic = 0.5 * v.dot(symmetric);
    let d_s = c.a_s * v.dot(vee) + c.b_s * (quadratic - s * trace) - c.b * trace;
    vee * c.a + symmetric * c.b + v * (2.0 * d_s)
}

/// The axis-angle vector of a rotation, at most pi long: the inverse of [`rotation_from_axis_angle`]. Of the two vectors
/// of a half turn, one is taken.
///
/// For a matrix that is a rotation only up to rounding, the result is as far off.
pub fn axis_angle_from_rotation(rotation: &DMat3) -> DVec3 {
    let quaternion = quaternion_from_rotation(rotation);
    let (w, axis) =
        if quaternion.w < 0.0 { (-quaternion.w, -quaternion.xyz()) } else { (quaternion.w, quaternion.xyz()) };
    // The squares of tiny components would vanish.
    let largest = axis.abs().max_element();
    if largest == 0.0 {
        return DVec3::ZERO;
    }
    let sin = (axis / largest).length() * largest;
    // atan2(sin, cos) / sin is smooth down to the smallest numbers: both operands are exact there.
    axis * (2.0 * sin.atan2(w) / sin)
}

/// The quaternion (x, y, z, w) of a rotation, from the largest of its four components, which cannot cancel.
fn quaternion_from_rotation(r: &DMat3) -> DVec4 {
    let (xx, yy, zz) = (r.x_axis.x, r.y_axis.y, r.z_axis.z);
    // Four times the squares of w, x, y, z.
    let squares = [1.0 + xx + yy + zz, 1.0 + xx - yy - zz, 1.0 - xx + yy - zz, 1.0 - xx - yy + zz];
    let vee = DVec3::new(r.y_axis.z - r.z_axis.y, r.z_axis.x - r.x_axis.z, r.x_axis.y - r.y_axis.x);
    let (xy, yz, zx) = (r.x_axis.y + r.y_axis.x, r.y_axis.z + r.z_axis.y, r.z_axis.x + r.x_axis.z);
    let largest = (1..4).fold(0, |best, k| if squares[k] > squares[best] { k } else { best });
    let row = match largest {
        0 => vee.extend(squares[0]),
        1 => DVec4::new(squares[1], xy, zx, vee.x),
        2 => DVec4::new(xy, squares[2], yz, vee.y),
        _ => DVec4::new(zx, yz, squares[3], vee.z),
    };
    row * (0.5 / squares[largest].sqrt())
}

/// dL/dR from dL/dv for `v = axis_angle_from_rotation(R)`.
///
/// A rotation can only move along the rotations: of all matrices with the same effect on such moves this is the one
/// that is itself such a move.
pub fn axis_angle_from_rotation_vjp(rotation: &DMat3, d_axis_angle: DVec3) -> DMat3 {
    let v = axis_angle_from_rotation(rotation);
    // R exp([w]x) has the logarithm v + J^-1 w with J^-1 = 1 + [v]x / 2 + c [v]x^2, c = 1/s - (1 + cos) / (2 angle sin);
    // <R [u]x, R [w]x> = 2 u . w.
    let c = inverse_jacobian_coefficient(v.length_squared());
    let turned = d_axis_angle.cross(v);
    let u = d_axis_angle + 0.5 * turned + c * turned.cross(v);
    let half = 0.5 * u;
    *rotation
        * DMat3::from_cols(
            DVec3::new(0.0, half.z, -half.y),
            DVec3::new(-half.z, 0.0, half.x),
            DVec3::new(half.y, -half.x, 0.0),
        )
}

/// `(1 - (angle / 2) cot(angle / 2)) / angle^2` for angles up to pi, from the squared angle.
fn inverse_jacobian_coefficient(s: f64) -> f64 {
    if s < SERIES_BELOW {
        // sum |B_2k| s^(k-1) / (2k)! with Bernoulli's numbers; the first term left out is below 0.25^8 1e-14 = 2e-19.
        const TERMS: [f64; 8] = [
            1.0 / 12.0,
            1.0 / 720.0,
            1.0 / 30_240.0,
            1.0 / 1_209_600.0,
            1.0 / 47_900_160.0,
            691.0 / 1_307_674_368_000.0,
            1.0 / 74_724_249_600.0,
            3617.0 / 10_670_622_842_880_000.0,
        ];
        TERMS.iter().rev().fold(0.0, |sum, term| sum * s + term)
    } else {
        let half = 0.5 * s.sqrt();
        (1.0 - half / half.tan()) / s
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};

    fn random_matrix(rng: &mut rand_chacha::ChaCha8Rng) -> DMat3 {
        DMat3::from_cols_array(&std::array::from_fn(|_| rng.random_range(-1.0..1.0)))
    }

    fn inner(a: &DMat3, b: &DMat3) -> f64 {
        a.to_cols_array().iter().zip(b.to_cols_array()).map(|(x, y)| x * y).sum()
    }

    #[test]
    fn rotations_are_orthonormal_and_agree_with_glam() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(1);
        for angle in [1e-12, 1e-8, 1e-4, 0.3, 0.5, 0.500001, 1.0, std::f64::consts::PI, 6.3, 100.0] {
            let axis = DVec3::from_array(std::array::from_fn(|_| rng.random_range(-1.0..1.0))).normalize();
            let r = rotation_from_axis_angle(axis * angle);
            let expected = DMat3::from_axis_angle(axis, angle);
            assert!((r - expected).to_cols_array().iter().all(|e| e.abs() < 1e-14 * angle.max(1.0)), "angle {angle}");
            assert!((r * r.transpose() - DMat3::IDENTITY).to_cols_array().iter().all(|e| e.abs() < 1e-13));
        }
        assert_eq!(rotation_from_axis_angle(DVec3::ZERO), DMat3::IDENTITY);
    }

    #[test]
    fn the_derivative_agrees_with_central_differences_at_every_angle() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(2);
        for angle in
            [0.0, 1e-8, 1e-4, 0.1, 0.4999, 0.5001, 2.0, std::f64::consts::PI - 1e-9, std::f64::consts::TAU, 12.0]
        {
            for _ in 0..50 {
                let axis = DVec3::from_array(std::array::from_fn(|_| rng.random_range(-1.0..1.0))).normalize();
                let v = axis * angle;
                let g = random_matrix(&mut rng);
                let analytic = rotation_from_axis_angle_vjp(v, &g);
                let h = 1e-5;
                let numeric = DVec3::from_array(std::array::from_fn(|i| {
                    let mut e = DVec3::ZERO;
                    e[i] = h;
                    (inner(&g, &rotation_from_axis_angle(v + e)) - inner(&g, &rotation_from_axis_angle(v - e)))
                        / (2.0 * h)
                }));
                let error = (analytic - numeric).length() / (1.0 + numeric.length());
                assert!(error <= 1e-9, "angle {angle}: {analytic} against {numeric}");
            }
        }
    }
}
