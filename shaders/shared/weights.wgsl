// Skinning weights, four points per invocation (`shared/four.wgsl`).

import package::shared::pose::pose;

// [joints][N]
@group(0) @binding(21) var<storage, read> weights: array<f32>;

fn weight_row(k: u32, p: vec4<u32>) -> vec4<f32> {
    let at = vec4(k * pose.gaussian_count) + p;
    return vec4(weights[at.x], weights[at.y], weights[at.z], weights[at.w]);
}
