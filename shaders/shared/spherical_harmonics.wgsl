// Real spherical harmonics up to degree 3, in the order and with the signs of 3D Gaussian Splatting files, and the
// gradient of each as a polynomial of the direction's components.

import package::shared::camera::view;
import package::shared::gaussian::{COLOR_BASES, ROW_COLOR, gaussians, stored, world_direction};

struct Harmonic {
    value: f32,
    gradient: vec3<f32>,
}

// Basis function k in the unit direction d.
fn harmonic(k: u32, d: vec3<f32>) -> Harmonic {
    let x = d.x;
    let y = d.y;
    let z = d.z;
    let xx = x * x;
    let yy = y * y;
    let zz = z * z;
    switch k {
        case 0u: { return Harmonic(0.28209479, vec3(0.0)); }
        case 1u: { return Harmonic(-0.48860251 * y, vec3(0.0, -0.48860251, 0.0)); }
        case 2u: { return Harmonic(0.48860251 * z, vec3(0.0, 0.0, 0.48860251)); }
        case 3u: { return Harmonic(-0.48860251 * x, vec3(-0.48860251, 0.0, 0.0)); }
        case 4u: { return Harmonic(1.0925485 * x * y, 1.0925485 * vec3(y, x, 0.0)); }
        case 5u: { return Harmonic(-1.0925485 * y * z, -1.0925485 * vec3(0.0, z, y)); }
        case 6u: { return Harmonic(0.31539157 * (2.0 * zz - xx - yy), 0.31539157 * vec3(-2.0 * x, -2.0 * y, 4.0 * z)); }
        case 7u: { return Harmonic(-1.0925485 * x * z, -1.0925485 * vec3(z, 0.0, x)); }
        case 8u: { return Harmonic(0.54627422 * (xx - yy), 0.54627422 * vec3(2.0 * x, -2.0 * y, 0.0)); }
        case 9u: {
            return Harmonic(-0.59004359 * y * (3.0 * xx - yy), -0.59004359 * vec3(6.0 * x * y, 3.0 * (xx - yy), 0.0));
        }
        case 10u: { return Harmonic(2.8906114 * x * y * z, 2.8906114 * vec3(y * z, x * z, x * y)); }
        case 11u: {
            return Harmonic(-0.45704580 * y * (4.0 * zz - xx - yy),
                            -0.45704580 * vec3(-2.0 * x * y, 4.0 * zz - xx - 3.0 * yy, 8.0 * y * z));
        }
        case 12u: {
            return Harmonic(0.37317633 * z * (2.0 * zz - 3.0 * xx - 3.0 * yy),
                            0.37317633 * vec3(-6.0 * x * z, -6.0 * y * z, 6.0 * zz - 3.0 * xx - 3.0 * yy));
        }
        case 13u: {
            return Harmonic(-0.45704580 * x * (4.0 * zz - xx - yy),
                            -0.45704580 * vec3(4.0 * zz - 3.0 * xx - yy, -2.0 * x * y, 8.0 * x * z));
        }
        case 14u: { return Harmonic(1.4453057 * z * (xx - yy), 1.4453057 * vec3(2.0 * x * z, -2.0 * y * z, xx - yy)); }
        default: {
            return Harmonic(-0.59004359 * x * (xx - 3.0 * yy), -0.59004359 * vec3(3.0 * (xx - yy), -6.0 * x * y, 0.0));
        }
    }
}

// The place of the coefficients of basis function k, red, green and blue, in the table of Gaussians.
fn coefficient(k: u32, i: u32) -> u32 {
    return ROW_COLOR * view.gaussian_count + 3u * (COLOR_BASES * i + k);
}

fn stored_color(k: u32, i: u32) -> vec3<f32> {
    if COLOR_BASES == 0u {
        return vec3(stored(ROW_COLOR, i), stored(ROW_COLOR + 1u, i), stored(ROW_COLOR + 2u, i));
    }
    let at = coefficient(k, i);
    return vec3(gaussians[at], gaussians[at + 1u], gaussians[at + 2u]);
}

// From the camera to a point whose camera coordinates are p, in world axes.
fn direction_to(p: vec3<f32>) -> vec3<f32> {
    return normalize(world_direction(p));
}

// The colour of Gaussian i seen along `direction`, before it is clamped at 0.
fn color_sum(i: u32, direction: vec3<f32>) -> vec3<f32> {
    if COLOR_BASES == 0u {
        return stored_color(0u, i);
    }
    // Band by band and not in a loop, so that each function is compiled alone: software rasterisers would compute all of
    // them for each.
    var sum = vec3(0.5) + term(0u, i, direction);
    if COLOR_BASES > 1u {
        sum += term(1u, i, direction);
        sum += term(2u, i, direction);
        sum += term(3u, i, direction);
    }
    if COLOR_BASES > 4u {
        sum += term(4u, i, direction);
        sum += term(5u, i, direction);
        sum += term(6u, i, direction);
        sum += term(7u, i, direction);
        sum += term(8u, i, direction);
    }
    if COLOR_BASES > 9u {
        sum += term(9u, i, direction);
        sum += term(10u, i, direction);
        sum += term(11u, i, direction);
        sum += term(12u, i, direction);
        sum += term(13u, i, direction);
        sum += term(14u, i, direction);
        sum += term(15u, i, direction);
    }
    return sum;
}

fn term(k: u32, i: u32, direction: vec3<f32>) -> vec3<f32> {
    return harmonic(k, direction).value * stored_color(k, i);
}
