// Corrected linear blend skinning. CPU twin: `ghand_core::skinning`.

@group(0) @binding(0) var<uniform> pose: PoseUniforms;
@group(0) @binding(1) var<storage, read> offsets: array<f32>;
// [joints][N]
@group(0) @binding(2) var<storage, read> weights: array<f32>;
@group(0) @binding(3) var<storage, read> residual_weights: array<f32>;
@group(0) @binding(4) var<storage, read> chain: array<f32>;
@group(0) @binding(5) var<storage, read> residual_chain: array<f32>;
@group(0) @binding(6) var<storage, read> poses: array<f32>;
@group(0) @binding(7) var<storage, read_write> gaussians: array<f32>;

@compute @workgroup_size(64)
fn skin(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
        @builtin(local_invocation_index) local: u32) {
    let p = flat_index(group, groups, local, 64u);
    let n = pose.gaussian_count;
    if p >= n {
        return;
    }
    let x = vec4(offsets[ROW_POINT * n + p], offsets[(ROW_POINT + 1u) * n + p], offsets[(ROW_POINT + 2u) * n + p], 1.0);
    let mean = f32(pose.zero_sum) * residual_mean(p);
    var row_x = vec4(0.0);
    var row_y = vec4(0.0);
    var row_z = vec4(0.0);
    for (var k = 0u; k < pose.joint_count; k++) {
        let w = weights[k * n + p];
        let v = residual_weights[k * n + p] - mean;
        row_x += w * bone_row(k, 0u) + v * residual_bone_row(k, 0u);
        row_y += w * bone_row(k, 1u) + v * residual_bone_row(k, 1u);
        row_z += w * bone_row(k, 2u) + v * residual_bone_row(k, 2u);
    }
    let t = pose.pose_offset + 3u * pose.joint_count;
    gaussians[p] = dot(row_x, x) + poses[t];
    gaussians[n + p] = dot(row_y, x) + poses[t + 1u];
    gaussians[2u * n + p] = dot(row_z, x) + poses[t + 2u];
}
