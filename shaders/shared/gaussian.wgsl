// A Gaussian's row of numbers, for every kind of Gaussian, and its footprint on the image. Used forward and backward,
// so that both compute the same bits.

import package::shared::camera::{BLUR, NARROW_BLUR, view};

// The kind of the scene, see `ghand_render::splat::SplatModel`.
override ANISOTROPIC: bool = false;
override FLAT: bool = false;
override FLATNESS: f32 = 1.0;
override FREE_OPACITY: bool = false;
// Spherical harmonics: 1, 4, 9 or 16; 0 for a plain colour.
override COLOR_BASES: u32 = 0u;
// Scales are logarithms and opacities logits.
override UNBOUNDED: bool = false;
override ANTIALIAS: bool = false;
override NARROW: bool = false;
// Rows of the table of Gaussians; the mean is in the first three.
override ROW_SCALE: u32 = 3u;
override ROW_ROTATION: u32 = 4u;
override ROW_OPACITY: u32 = 4u;
override ROW_COLOR: u32 = 4u;

// See `ghand_render::splat::SplatModel::index`.
@group(0) @binding(1) var<storage, read> gaussians: array<f32>;

// Standard deviations, opacity and rotation, decoded from their stored form.
struct Gaussian {
    mean: vec3<f32>,
    scales: vec3<f32>,
    opacity: f32,
    // Of an anisotropic Gaussian: its unit quaternion (x, y, z, w) and the length of the stored one.
    quaternion: vec4<f32>,
    length: f32,
    // Of a flat Gaussian.
    normal: vec3<f32>,
}

fn is_finite(x: f32) -> bool {
    return (bitcast<u32>(x) & 0x7f800000u) != 0x7f800000u;
}

fn are_finite(v: vec3<f32>) -> bool {
    return is_finite(v.x) && is_finite(v.y) && is_finite(v.z);
}

fn stored(row: u32, i: u32) -> f32 {
    return gaussians[row * view.gaussian_count + i];
}

fn stored_scale(row: u32, i: u32) -> f32 {
    let value = stored(row, i);
    if UNBOUNDED {
        return exp(value);
    }
    return value;
}

fn load_gaussian(i: u32) -> Gaussian {
    var g: Gaussian;
    g.mean = vec3(stored(0u, i), stored(1u, i), stored(2u, i));
    g.opacity = view.opacity;
    if FREE_OPACITY {
        g.opacity = stored(ROW_OPACITY, i);
        if UNBOUNDED {
            g.opacity = 1.0 / (1.0 + exp(-g.opacity));
        }
    }
    g.length = 1.0;
    g.quaternion = vec4(0.0, 0.0, 0.0, 1.0);
    if ANISOTROPIC {
        g.scales = vec3(stored_scale(ROW_SCALE, i), stored_scale(ROW_SCALE + 1u, i), stored_scale(ROW_SCALE + 2u, i));
        let q = vec4(stored(ROW_ROTATION + 1u, i), stored(ROW_ROTATION + 2u, i), stored(ROW_ROTATION + 3u, i),
                     stored(ROW_ROTATION, i));
        // Squares of huge or tiny numbers would overflow or underflow.
        let largest = max(max(abs(q.x), abs(q.y)), max(abs(q.z), abs(q.w)));
        let scaled = q / largest;
        let length = sqrt(dot(scaled, scaled));
        g.quaternion = scaled / length;
        g.length = largest * length;
    } else {
        g.scales = vec3(stored_scale(ROW_SCALE, i));
    }
    if FLAT {
        g.normal = vec3(stored(ROW_ROTATION, i), stored(ROW_ROTATION + 1u, i), stored(ROW_ROTATION + 2u, i));
    }
    return g;
}

// Whether every number of the Gaussian is usable. A quaternion of 0 is not a rotation: its length is NaN.
fn is_sound(g: Gaussian) -> bool {
    return are_finite(g.mean) && are_finite(g.scales) && is_finite(g.opacity) && is_finite(g.length) && g.length > 0.0
        && are_finite(g.quaternion.xyz) && is_finite(g.quaternion.w) && are_finite(g.normal);
}

// The axes of the Gaussian: the columns of its rotation.
fn axes_of(q: vec4<f32>) -> mat3x3<f32> {
    let d = 2.0 * q.xyz;
    let xx = q.x * d.x;
    let yy = q.y * d.y;
    let zz = q.z * d.z;
    let xy = q.x * d.y;
    let xz = q.x * d.z;
    let yz = q.y * d.z;
    let wx = q.w * d.x;
    let wy = q.w * d.y;
    let wz = q.w * d.z;
    return mat3x3(1.0 - yy - zz, xy + wz, xz - wy,
                  xy - wz, 1.0 - xx - zz, yz + wx,
                  xz + wy, yz - wx, 1.0 - xx - yy);
}

// A vector as a flat Gaussian of size 1 takes it: made shorter along the normal.
fn flattened(v: vec3<f32>, normal: vec3<f32>) -> vec3<f32> {
    return v - (1.0 - FLATNESS) * dot(v, normal) * normal;
}

// What both directions of a Gaussian's projection need. The covariance in the image is T T^T + blur with the rows of T
// = J W A S: kept as T to avoid cancellation when a Gaussian is long and thin.
struct Footprint {
    // Slopes x/z and y/z, clamped.
    slope: vec2<f32>,
    // Rows of the Jacobian of the projection, in camera axes (pixels per metre).
    jacobian_x: vec3<f32>,
    jacobian_y: vec3<f32>,
    // Rows of T, pixels: one number for each axis of the Gaussian (of a flat one: of the world).
    row_x: vec3<f32>,
    row_y: vec3<f32>,
    // Covariance in pixels^2 with the blur: xx, xy, yy.
    covariance: vec3<f32>,
    determinant: f32,
    // |row_x x row_y|: the square root of the determinant before the blur.
    area: f32,
}

// Converts a vector from camera axes to world axes.
fn world_direction(v: vec3<f32>) -> vec3<f32> {
    return view.row_x.xyz * v.x + view.row_y.xyz * v.y + view.row_z.xyz * v.z;
}

fn footprint(g: Gaussian, p: vec3<f32>) -> Footprint {
    var foot: Footprint;
    foot.slope = clamp(p.xy / p.z, view.slope_min, view.slope_max);
    let pixels = view.focal / p.z;
    foot.jacobian_x = vec3(pixels.x, 0.0, -pixels.x * foot.slope.x);
    foot.jacobian_y = vec3(0.0, pixels.y, -pixels.y * foot.slope.y);
    if ANISOTROPIC {
        let axes = axes_of(g.quaternion);
        foot.row_x = g.scales * (world_direction(foot.jacobian_x) * axes);
        foot.row_y = g.scales * (world_direction(foot.jacobian_y) * axes);
    } else if FLAT {
        foot.row_x = g.scales.x * flattened(world_direction(foot.jacobian_x), g.normal);
        foot.row_y = g.scales.x * flattened(world_direction(foot.jacobian_y), g.normal);
    } else {
        foot.row_x = g.scales.x * foot.jacobian_x;
        foot.row_y = g.scales.x * foot.jacobian_y;
    }
    let xx = dot(foot.row_x, foot.row_x);
    let yy = dot(foot.row_y, foot.row_y);
    foot.area = length(cross(foot.row_x, foot.row_y));
    let blur = select(BLUR, NARROW_BLUR, NARROW);
    foot.covariance = vec3(xx + blur, dot(foot.row_x, foot.row_y), yy + blur);
    foot.determinant = foot.area * foot.area + blur * (xx + yy) + blur * blur;
    return foot;
}

// The part of the opacity that antialiasing keeps.
fn compensation(foot: Footprint) -> f32 {
    if ANTIALIAS {
        return foot.area / sqrt(foot.determinant);
    }
    return 1.0;
}
