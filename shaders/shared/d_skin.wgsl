// Gradients of points and moments, four points per invocation (`shared/points4.wgsl`).

import package::shared::pose::pose;

// Rows ROW_D_POINT and ROW_MOMENT, [15][N].
@group(0) @binding(22) var<storage, read_write> d_skin: array<f32>;

fn d_skin_row(row: u32, p: vec4<u32>) -> vec4<f32> {
    let at = vec4(row * pose.gaussian_count) + p;
    return vec4(d_skin[at.x], d_skin[at.y], d_skin[at.z], d_skin[at.w]);
}

fn store_d_skin(row: u32, p: vec4<u32>, stored: vec4<bool>, value: vec4<f32>) {
    let at = vec4(row * pose.gaussian_count) + p;
    if stored.x { d_skin[at.x] = value.x; }
    if stored.y { d_skin[at.y] = value.y; }
    if stored.z { d_skin[at.z] = value.z; }
    if stored.w { d_skin[at.w] = value.w; }
}
