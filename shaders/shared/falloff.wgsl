// How a splat fades from its centre, the same in both passes: where alpha is near a threshold they must agree to the
// bit.

// -log2(e) / 2.
const SCALE: f32 = -0.72134752;

// The coefficients of dx^2, dx dy and dy^2 in the logarithm, to the base of 2, of a splat's falloff.
fn falloff(conic: vec3<f32>) -> vec3<f32> {
    return vec3(SCALE, 2.0 * SCALE, SCALE) * conic;
}

// That logarithm at distances from the centre, pixels.
fn exponent(falloff: vec3<f32>, dx: vec4<f32>, dy: vec4<f32>) -> vec4<f32> {
    return dx * (falloff.x * dx) + dy * (falloff.z * dy) + dy * (falloff.y * dx);
}
