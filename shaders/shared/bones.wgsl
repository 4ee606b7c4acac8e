// Access to the two chains for the skinning stages, which handle four points per invocation: a bone is loaded once for
// four points.

import package::shared::pose::{CHAIN_POSED, CHAIN_STRIDE, pose};

// Whether skinning is plain: residual weights and the residual chain are not there.
override PLAIN: bool = false;

// [joints][N]
@group(0) @binding(3) var<storage, read> residual_weights: array<f32>;
@group(0) @binding(4) var<storage, read> chain: array<f32>;
@group(0) @binding(5) var<storage, read> residual_chain: array<f32>;

fn bone_row(k: u32, row: u32) -> vec4<f32> {
    let at = k * CHAIN_STRIDE + CHAIN_POSED + 4u * row;
    return vec4(chain[at], chain[at + 1u], chain[at + 2u], chain[at + 3u]);
}

fn residual_bone_row(k: u32, row: u32) -> vec4<f32> {
    let at = k * CHAIN_STRIDE + CHAIN_POSED + 4u * row;
    return vec4(residual_chain[at], residual_chain[at + 1u], residual_chain[at + 2u], residual_chain[at + 3u]);
}

fn residual_weight_row(k: u32, p: vec4<u32>) -> vec4<f32> {
    let at = vec4(k * pose.gaussian_count) + p;
    return vec4(residual_weights[at.x], residual_weights[at.y], residual_weights[at.z], residual_weights[at.w]);
}
