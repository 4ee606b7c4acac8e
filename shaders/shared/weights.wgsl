// Skinning weights, four points per invocation (`shared/points4.wgsl`), and the joints that have any there.

import package::shared::points4::BLOCK;
import package::shared::pose::pose;

// [joints][N], then for each block of points where the list of its joints begins, and where the last one ends, then the
// lists. Host part: `ghand_avatar::deform::weight_table`.
@group(0) @binding(21) var<storage, read> weights: array<f32>;

fn weight_row(k: u32, p: vec4<u32>) -> vec4<f32> {
    let at = vec4(k * pose.gaussian_count) + p;
    return vec4(weights[at.x], weights[at.y], weights[at.z], weights[at.w]);
}

// Where the list of the joints that move any point of the block of p begins and ends; see `joint_at`.
fn joints_of(p: vec4<u32>) -> vec2<u32> {
    let starts = pose.joint_count * pose.gaussian_count;
    let blocks = (pose.gaussian_count + BLOCK - 1u) / BLOCK;
    let block = starts + p.x / BLOCK;
    return vec2(u32(weights[block]), u32(weights[block + 1u])) + (starts + blocks + 1u);
}

fn joint_at(i: u32) -> u32 {
    return u32(weights[i]);
}
