//! Rotations as axis-angle vectors (Rodrigues' formula) with their derivative, and their inverse.

use glam::{DMat3, DVec3, DVec4, Vec4Swizzles};

/// `R = cos I + sin [u]x + versine u u^T` along a vector u, and the coefficients of its derivative
/// `dL/dv = sin_v vee + versine_v (G + G^T) u + along u`.
///
/// For small angles `u = v`, so that nothing is divided by the angle: then `sin` and `versine` stand for sin(angle) /
/// angle and (1 - cos(angle)) / angle^2. For other angles u is the unit axis, so that no large number is squared.
struct Rodrigues {
    u: DVec3,
    /// |u|^2
    u_squared: f64,
    cos: f64,
    sin: f64,
    versine: f64,
    /// d(sin u)/dv and d(versine u)/dv across u.
    sin_v: f64,
    versine_v: f64,
    /// Additions to these along u, per unit of `u . vee` and of the rest.
    sin_along: f64,
    versine_along: f64,
}

/// Below this squared angle the closed forms of the derivatives cancel; the series, cut after nine terms, is exact to
/// f64 there (the first omitted term is below 0.25^9 / 19! = 4e-23).
const SERIES_BELOW: f64 = 0.25;

impl Rodrigues {
    fn new(v: DVec3) -> Rodrigues {
        let s = v.length_squared();
        if s < SERIES_BELOW { Rodrigues::near_zero(v, s) } else { Rodrigues::about_unit_axis(v) }
    }

    fn near_zero(v: DVec3, s: f64) -> Rodrigues {
        // a = sin(angle) / angle = sum (-s)^k / (2k+1)!, b = (1 - cos(angle)) / s = sum (-s)^k / (2k+2)!
        let mut a = 0.0;
        let mut b = 0.0;
        let mut a_s = 0.0;
        let mut b_s = 0.0;
        let mut power = 1.0;
        let mut previous_power = 0.0;
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
        Rodrigues {
            u: v,
            u_squared: s,
            cos: 1.0 - b * s,
            sin: a,
            versine: b,
            sin_v: a,
            versine_v: b,
            sin_along: 2.0 * a_s,
            versine_along: 2.0 * b_s,
        }
    }

    fn about_unit_axis(v: DVec3) -> Rodrigues {
        let (angle, rest) = length(v);
        // Rounding the angle alone would change the rotation by 2^-53 of it.
        let (sin, cos) = angle.sin_cos();
        let (rest_sin, rest_cos) = rest.sin_cos();
        let (sin, cos) = (sin * rest_cos + cos * rest_sin, cos * rest_cos - sin * rest_sin);
        let versine = 1.0 - cos;
        let (sin_v, versine_v) = (sin / angle, versine / angle);
        Rodrigues {
            u: v / angle,
            u_squared: 1.0,
            cos,
            sin,
            versine,
            sin_v,
            versine_v,
            sin_along: cos - sin_v,
            versine_along: sin - 2.0 * versine_v,
        }
    }
}

/// The length of a vector as a number and its rounding error: together they are exact to about 2^-104 of the length,
/// for every vector of finite length. Not for tiny lengths.
fn length(v: DVec3) -> (f64, f64) {
    // Squares of larger numbers overflow; products with powers of two are exact.
    let scale = if v.abs().max_element() > 1e150 { 2.0_f64.powi(-600) } else { 1.0 };
    let v = v * scale;
    let mut sum = 0.0;
    let mut lost = 0.0;
    for x in v.to_array() {
        let square = x * x;
        let total = sum + square;
        // The exact rounding errors of the sum and the product; squares are not negative, so the larger summand is
        // known.
        lost += if sum > square { (sum - total) + square } else { (square - total) + sum };
        lost += x.mul_add(x, -square);
        sum = total;
    }
    let root = sum.sqrt();
    let rest = ((-root).mul_add(root, sum) + lost) / (2.0 * root);
    (root / scale, rest / scale)
}

/// The rotation about `v` by `|v|` radians: within a few units in the last place at 0, beyond 2 pi and up to 1e15 rad.
///
/// A vector that is not finite, or whose length is not, gives a matrix of NaN values.
pub fn rotation_from_axis_angle(v: DVec3) -> DMat3 {
    let r = Rodrigues::new(v);
    let (u, a, b) = (r.u, r.u * r.sin, r.u * r.versine);
    DMat3::from_cols(
        DVec3::new(r.cos + b.x * u.x, b.y * u.x + a.z, b.z * u.x - a.y),
        DVec3::new(b.x * u.y - a.z, r.cos + b.y * u.y, b.z * u.y + a.x),
        DVec3::new(b.x * u.z + a.y, b.y * u.z - a.x, r.cos + b.z * u.z),
    )
}

/// dL/dv from dL/dR for `R = rotation_from_axis_angle(v)`, as exact as the rotation; NaN where the rotation is NaN.
pub fn rotation_from_axis_angle_vjp(v: DVec3, d_rotation: &DMat3) -> DVec3 {
    let g = d_rotation;
    let r = Rodrigues::new(v);
    let u = r.u;
    // <G, [u]x> = u . vee
    let vee = DVec3::new(g.y_axis.z - g.z_axis.y, g.z_axis.x - g.x_axis.z, g.x_axis.y - g.y_axis.x);
    let trace = g.x_axis.x + g.y_axis.y + g.z_axis.z;
    let symmetric = *g * u + g.transpose() * u;
    let quadratic = 0.5 * u.dot(symmetric);
    let along =
        r.sin_along * u.dot(vee) + r.versine_along * (quadratic - r.u_squared * trace) - 2.0 * r.versine_v * trace;
    vee * r.sin_v + symmetric * r.versine_v + u * along
}

/// The axis-angle vector of a rotation, at most pi long: the inverse of [`rotation_from_axis_angle`]. Of the two
/// vectors of a half turn, one is returned.
///
/// For a matrix that is a rotation only up to rounding, the result has an error of that size. A matrix that is not
/// finite gives a vector of NaN values.
pub fn axis_angle_from_rotation(rotation: &DMat3) -> DVec3 {
    let quaternion = quaternion_from_rotation(rotation);
    let (w, axis) =
        if quaternion.w < 0.0 { (-quaternion.w, -quaternion.xyz()) } else { (quaternion.w, quaternion.xyz()) };
    // The squares of tiny components would underflow.
    let largest = axis.abs().max_element();
    if largest == 0.0 {
        // Zero, or NaN where a matrix that is not finite has no angle.
        return axis * w;
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
