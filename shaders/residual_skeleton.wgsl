// The Neural Residual Skeleton: joints regressed from the offsets, and back. CPU twin: `ghand_core::residual_skeleton`.

@group(0) @binding(0) var<uniform> pose: PoseUniforms;
@group(0) @binding(1) var<storage, read> joints: array<f32>;
// Regressor times offsets, [joints][3].
@group(0) @binding(2) var<storage, read> regressed: array<f32>;
@group(0) @binding(3) var<storage, read_write> residual_joints: array<f32>;
// [joints][N]
@group(0) @binding(4) var<storage, read> regressor: array<f32>;
@group(0) @binding(5) var<storage, read> offsets: array<f32>;
@group(0) @binding(6) var<storage, read> d_residual_joints: array<f32>;
// In: gradient of the points; out: gradient of the offsets.
@group(0) @binding(7) var<storage, read_write> d_skin: array<f32>;
@group(0) @binding(8) var<storage, read_write> d_regressor: array<f32>;

@compute @workgroup_size(32)
fn place_residual_joints(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x < 3u * pose.joint_count {
        residual_joints[id.x] = f32(pose.anchored) * joints[id.x] + regressed[id.x];
    }
}

@compute @workgroup_size(64)
fn residual_joints_backward(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                            @builtin(local_invocation_index) local: u32) {
    let p = flat_index(group, groups, local, 64u);
    let n = pose.gaussian_count;
    if p >= n {
        return;
    }
    let offset = vec3(offsets[p], offsets[n + p], offsets[2u * n + p]);
    var d_offset = vec3(d_skin[p], d_skin[n + p], d_skin[2u * n + p]) + pose.offset_weight * offset;
    for (var k = 0u; k < pose.joint_count; k++) {
        let d = vec3(d_residual_joints[3u * k], d_residual_joints[3u * k + 1u], d_residual_joints[3u * k + 2u]);
        d_regressor[k * n + p] = dot(d, offset);
        d_offset += regressor[k * n + p] * d;
    }
    d_skin[p] = d_offset.x;
    d_skin[n + p] = d_offset.y;
    d_skin[2u * n + p] = d_offset.z;
}
