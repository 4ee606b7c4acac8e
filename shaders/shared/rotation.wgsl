// Rodrigues' formula: R = (1 - b s) I + a [v]x + b v v^T with s = |v|^2. CPU twin: `ghand_core::rotation`.

// a, b and their derivatives with respect to s. Below the limit the closed forms suffer cancellation in f32, and the
// series is used.
fn rotation_coefficients(s: f32) -> vec4<f32> {
    if s < 0.5 {
        let a = 1.0 + s * (-1.0 / 6.0 + s * (1.0 / 120.0 + s * (-1.0 / 5040.0 + s * (1.0 / 362880.0))));
        let b = 0.5 + s * (-1.0 / 24.0 + s * (1.0 / 720.0 + s * (-1.0 / 40320.0 + s * (1.0 / 3628800.0))));
        let a_s = -1.0 / 6.0 + s * (1.0 / 60.0 + s * (-1.0 / 1680.0 + s * (1.0 / 90720.0)));
        let b_s = -1.0 / 24.0 + s * (1.0 / 360.0 + s * (-1.0 / 13440.0 + s * (1.0 / 907200.0)));
        return vec4(a, b, a_s, b_s);
    }
    let angle = sqrt(s);
    let a = sin(angle) / angle;
    let half = sin(0.5 * angle);
    let b = 2.0 * half * half / s;
    return vec4(a, b, (cos(angle) - a) / (2.0 * s), (0.5 * a - b) / s);
}

fn rotation_from_axis_angle(v: vec3<f32>) -> mat3x3<f32> {
    let s = dot(v, v);
    let c = rotation_coefficients(s);
    let d = 1.0 - c.y * s;
    let a = v * c.x;
    let b = v * c.y;
    return mat3x3(vec3(d + b.x * v.x, b.y * v.x + a.z, b.z * v.x - a.y),
                  vec3(b.x * v.y - a.z, d + b.y * v.y, b.z * v.y + a.x),
                  vec3(b.x * v.z + a.y, b.y * v.z - a.x, d + b.z * v.z));
}

fn rotation_from_axis_angle_backward(v: vec3<f32>, g: mat3x3<f32>) -> vec3<f32> {
    let s = dot(v, v);
    let c = rotation_coefficients(s);
    let vee = vec3(g[1].z - g[2].y, g[2].x - g[0].z, g[0].y - g[1].x);
    let trace = g[0].x + g[1].y + g[2].z;
    let symmetric = g * v + transpose(g) * v;
    let d_s = c.z * dot(v, vee) + c.w * (0.5 * dot(v, symmetric) - s * trace) - c.y * trace;
    return vee * c.x + symmetric * c.y + v * (2.0 * d_s);
}
