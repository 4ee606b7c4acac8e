// Lights the colours of a hand: each is multiplied with the shade of its Gaussian, interpolated between the corners of its
// triangle, then gloss is added in linear light. CPU twins: `ghand_core::light::lit`, `lit_vjp`.

import package::shared::dispatch::flat_index;
import package::shared::pose::pose;

// Number of vertices of the hand's mesh.
override VERTEX_COUNT: u32;
// Whether the vertices have gloss.
override GLOSSY: bool = false;

// Corners of each Gaussian's triangle, [3][N].
@group(0) @binding(1) var<storage, read> corners: array<u32>;
// Place on that triangle, [3][N].
@group(0) @binding(2) var<storage, read> barycentric: array<f32>;
// One RGB per vertex and frame, [frames][V][3].
@group(0) @binding(3) var<storage, read> vertex_shades: array<f32>;
@group(0) @binding(4) var<storage, read> color: array<f32>;
@group(0) @binding(5) var<storage, read_write> gaussians: array<f32>;
@group(0) @binding(6) var<storage, read> d_gaussians: array<f32>;
@group(0) @binding(7) var<storage, read_write> d_color: array<f32>;
// One RGB per vertex in the current frame and view, linear light, [V][3].
@group(0) @binding(8) var<storage, read> vertex_gloss: array<f32>;

// First row of the colours in the splatter's table.
override ROW_COLOR: u32;

// As `ghand_core::light::DISPLAY_EXPONENT`.
const DISPLAY_EXPONENT: f32 = 1.0 / 2.2;

// A Gaussian's triangle, as its corners' places in a table of the frame's vertices, and its place on it.
struct Place {
    corners: vec3<u32>,
    weights: vec3<f32>,
}

fn place(p: u32) -> Place {
    let n = pose.gaussian_count;
    return Place(vec3(corners[p], corners[n + p], corners[2u * n + p]),
                 vec3(barycentric[p], barycentric[n + p], barycentric[2u * n + p]));
}

fn shade_at(vertex: u32) -> vec3<f32> {
    let frame = pose.pose_offset / (3u * pose.joint_count + 3u);
    let at = 3u * (frame * VERTEX_COUNT + vertex);
    return vec3(vertex_shades[at], vertex_shades[at + 1u], vertex_shades[at + 2u]);
}

fn shade(at: Place) -> vec3<f32> {
    return at.weights.x * shade_at(at.corners.x) + at.weights.y * shade_at(at.corners.y)
        + at.weights.z * shade_at(at.corners.z);
}

fn gloss_at(vertex: u32) -> vec3<f32> {
    return vec3(vertex_gloss[3u * vertex], vertex_gloss[3u * vertex + 1u], vertex_gloss[3u * vertex + 2u]);
}

fn gloss(at: Place) -> vec3<f32> {
    return at.weights.x * gloss_at(at.corners.x) + at.weights.y * gloss_at(at.corners.y)
        + at.weights.z * gloss_at(at.corners.z);
}

fn with_gloss(display: vec3<f32>, gloss: vec3<f32>) -> vec3<f32> {
    let sum = pow(max(display, vec3(0.0)), vec3(1.0 / DISPLAY_EXPONENT)) + gloss;
    return select(display, pow(sum, vec3(DISPLAY_EXPONENT)), gloss > vec3(0.0));
}

// The derivative of `with_gloss` to the display value.
fn with_gloss_vjp(display: vec3<f32>, gloss: vec3<f32>) -> vec3<f32> {
    let ratio = max(display, vec3(0.0)) / with_gloss(display, gloss);
    return select(vec3(1.0), pow(ratio, vec3(1.0 / DISPLAY_EXPONENT - 1.0)), gloss > vec3(0.0));
}

fn unlit(p: u32) -> vec3<f32> {
    let n = pose.gaussian_count;
    return vec3(color[p], color[n + p], color[2u * n + p]);
}

fn table_index(channel: u32, p: u32) -> u32 {
    return (ROW_COLOR + channel) * pose.table_columns + pose.table_first + p;
}

@compute @workgroup_size(64)
fn light_colors(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                @builtin(local_invocation_index) local: u32) {
    let p = flat_index(group, groups, local, 64u);
    if p >= pose.gaussian_count {
        return;
    }
    let at = place(p);
    var lit = shade(at) * unlit(p);
    if GLOSSY {
        lit = with_gloss(lit, gloss(at));
    }
    gaussians[table_index(0u, p)] = lit.x;
    gaussians[table_index(1u, p)] = lit.y;
    gaussians[table_index(2u, p)] = lit.z;
}

@compute @workgroup_size(64)
fn light_colors_backward(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                         @builtin(local_invocation_index) local: u32) {
    let p = flat_index(group, groups, local, 64u);
    let n = pose.gaussian_count;
    if p >= n {
        return;
    }
    let at = place(p);
    var factor = shade(at);
    if GLOSSY {
        factor *= with_gloss_vjp(factor * unlit(p), gloss(at));
    }
    d_color[p] = factor.x * d_gaussians[table_index(0u, p)];
    d_color[n + p] = factor.y * d_gaussians[table_index(1u, p)];
    d_color[2u * n + p] = factor.z * d_gaussians[table_index(2u, p)];
}
