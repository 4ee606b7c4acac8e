// The Neural Residual Skeleton: joints regressed from the offsets, and the gradients. CPU twin:
// `ghand_core::residual_skeleton`.

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

fn skin_row(row: u32, p: vec4<u32>) -> vec4<f32> {
    let at = vec4(row * pose.gaussian_count) + p;
    return vec4(d_skin[at.x], d_skin[at.y], d_skin[at.z], d_skin[at.w]);
}

fn offset_row(row: u32, p: vec4<u32>) -> vec4<f32> {
    let at = vec4(row * pose.gaussian_count) + p;
    return vec4(offsets[at.x], offsets[at.y], offsets[at.z], offsets[at.w]);
}

fn regressor_row(k: u32, p: vec4<u32>) -> vec4<f32> {
    let at = vec4(k * pose.gaussian_count) + p;
    return vec4(regressor[at.x], regressor[at.y], regressor[at.z], regressor[at.w]);
}

fn store_regressor(k: u32, p: vec4<u32>, stored: vec4<bool>, value: vec4<f32>) {
    let at = vec4(k * pose.gaussian_count) + p;
    if stored.x { d_regressor[at.x] = value.x; }
    if stored.y { d_regressor[at.y] = value.y; }
    if stored.z { d_regressor[at.z] = value.z; }
    if stored.w { d_regressor[at.w] = value.w; }
}

fn store_skin(row: u32, p: vec4<u32>, stored: vec4<bool>, value: vec4<f32>) {
    let at = vec4(row * pose.gaussian_count) + p;
    if stored.x { d_skin[at.x] = value.x; }
    if stored.y { d_skin[at.y] = value.y; }
    if stored.z { d_skin[at.z] = value.z; }
    if stored.w { d_skin[at.w] = value.w; }
}

@compute @workgroup_size(64)
fn residual_joints_backward(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                            @builtin(local_invocation_index) local: u32) {
    let i = flat_index(group, groups, local, 64u);
    let n = pose.gaussian_count;
    if i >= quarter(n) {
        return;
    }
    let p = four_points(i, n);
    let stored = four_stored(i, n);
    let x = offset_row(ROW_OFFSET, p);
    let y = offset_row(ROW_OFFSET + 1u, p);
    let z = offset_row(ROW_OFFSET + 2u, p);
    var d_x = skin_row(ROW_D_POINT, p) + pose.offset_weight * x;
    var d_y = skin_row(ROW_D_POINT + 1u, p) + pose.offset_weight * y;
    var d_z = skin_row(ROW_D_POINT + 2u, p) + pose.offset_weight * z;
    for (var k = 0u; k < pose.joint_count; k++) {
        let d = vec3(d_residual_joints[3u * k], d_residual_joints[3u * k + 1u], d_residual_joints[3u * k + 2u]);
        store_regressor(k, p, stored, d.x * x + d.y * y + d.z * z);
        let r = regressor_row(k, p);
        d_x += r * d.x;
        d_y += r * d.y;
        d_z += r * d.z;
    }
    store_skin(ROW_D_POINT, p, stored, d_x);
    store_skin(ROW_D_POINT + 1u, p, stored, d_y);
    store_skin(ROW_D_POINT + 2u, p, stored, d_z);
}
