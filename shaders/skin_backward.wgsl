// Gradient of corrected skinning to points and residual weights, and the moments whose weighted sums are the gradients
// of the bones. CPU twin: `ghand_core::skinning::skin_vjp`.

@group(0) @binding(0) var<uniform> pose: PoseUniforms;
@group(0) @binding(1) var<storage, read> offsets: array<f32>;
@group(0) @binding(2) var<storage, read> weights: array<f32>;
@group(0) @binding(3) var<storage, read> residual_weights: array<f32>;
@group(0) @binding(4) var<storage, read> chain: array<f32>;
@group(0) @binding(5) var<storage, read> residual_chain: array<f32>;
@group(0) @binding(6) var<storage, read> d_gaussians: array<f32>;
@group(0) @binding(7) var<storage, read_write> d_skin: array<f32>;
@group(0) @binding(8) var<storage, read_write> d_residual_weights: array<f32>;

@compute @workgroup_size(64)
fn skin_backward(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                 @builtin(local_invocation_index) local: u32) {
    let p = flat_index(group, groups, local, 64u);
    let n = pose.gaussian_count;
    if p >= n {
        return;
    }
    let x = vec4(offsets[ROW_POINT * n + p], offsets[(ROW_POINT + 1u) * n + p], offsets[(ROW_POINT + 2u) * n + p], 1.0);
    let d = vec3(d_gaussians[p], d_gaussians[n + p], d_gaussians[2u * n + p]);
    let mean = f32(pose.zero_sum) * residual_mean(p);
    var d_x = vec3(0.0);
    var d_mean = 0.0;
    for (var k = 0u; k < pose.joint_count; k++) {
        let w = weights[k * n + p];
        let v = residual_weights[k * n + p] - mean;
        let d_bone = d.x * bone_row(k, 0u) + d.y * bone_row(k, 1u) + d.z * bone_row(k, 2u);
        let d_residual_bone =
            d.x * residual_bone_row(k, 0u) + d.y * residual_bone_row(k, 1u) + d.z * residual_bone_row(k, 2u);
        d_x += w * d_bone.xyz + v * d_residual_bone.xyz;
        let d_weight = dot(d_residual_bone, x);
        d_mean += d_weight;
        d_residual_weights[k * n + p] = d_weight;
    }
    d_mean *= f32(pose.zero_sum) / f32(pose.joint_count);
    if pose.zero_sum != 0u {
        for (var k = 0u; k < pose.joint_count; k++) {
            d_residual_weights[k * n + p] -= d_mean;
        }
    }
    for (var c = 0u; c < 3u; c++) {
        d_skin[(ROW_D_POINT + c) * n + p] = d_x[c];
        for (var b = 0u; b < 4u; b++) {
            d_skin[(ROW_MOMENT + 4u * c + b) * n + p] = d[c] * x[b];
        }
    }
}
