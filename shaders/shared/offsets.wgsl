// Offsets and points, four points per invocation (`shared/points4.wgsl`).

import package::shared::pose::pose;

// Rows ROW_OFFSET and ROW_POINT, [6][N], metres.
@group(0) @binding(20) var<storage, read> offsets: array<f32>;

fn offset_row(row: u32, p: vec4<u32>) -> vec4<f32> {
    let at = vec4(row * pose.gaussian_count) + p;
    return vec4(offsets[at.x], offsets[at.y], offsets[at.z], offsets[at.w]);
}
