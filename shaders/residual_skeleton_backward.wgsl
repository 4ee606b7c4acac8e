// Gradient of the residual skeleton: of its chain, then of the regressor and the offsets. CPU twin:
// `ghand_core::residual_skeleton::residual_joints_vjp`.

import package::shared::chain_backward::{d_bones, pose_chain_backward};
import package::shared::d_skin::{d_skin_row, store_d_skin};
import package::shared::dispatch::flat_index;
import package::shared::points4::{points4, in_range4, invocations};
import package::shared::offsets::offset_row;
import package::shared::pose::{ROW_D_POINT, ROW_OFFSET, pose};

// [joints][N]
@group(0) @binding(8) var<storage, read> regressor: array<f32>;
@group(0) @binding(10) var<storage, read> d_residual_joints: array<f32>;
@group(0) @binding(12) var<storage, read_write> d_regressor: array<f32>;

// Comes before the skeleton's and replaces d_local.
@compute @workgroup_size(1)
fn residual_skeleton_backward() {
    if pose.zero_sum != 0u {
        // The residual bones had their mean over the joints taken off.
        for (var c = 0u; c < 12u; c++) {
            var mean = 0.0;
            for (var k = 0u; k < pose.joint_count; k++) {
                mean += d_bones[12u * k + c];
            }
            mean /= f32(pose.joint_count);
            for (var k = 0u; k < pose.joint_count; k++) {
                d_bones[12u * k + c] -= mean;
            }
        }
    } else {
        // The residual bones had the root's translation taken off.
        for (var r = 0u; r < 3u; r++) {
            var sum = 0.0;
            for (var k = 0u; k < pose.joint_count; k++) {
                sum += d_bones[12u * k + 4u * r + 3u];
            }
            d_bones[4u * r + 3u] -= sum;
        }
    }
    pose_chain_backward(0.0);
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

// In `d_skin`, the gradient of the points becomes that of the offsets.
@compute @workgroup_size(64)
fn residual_joints_backward(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                            @builtin(local_invocation_index) local: u32) {
    let i = flat_index(group, groups, local, 64u);
    let n = pose.gaussian_count;
    if i >= invocations(n) {
        return;
    }
    let p = points4(i, n);
    let stored = in_range4(i, n);
    let x = offset_row(ROW_OFFSET, p);
    let y = offset_row(ROW_OFFSET + 1u, p);
    let z = offset_row(ROW_OFFSET + 2u, p);
    var d_x = d_skin_row(ROW_D_POINT, p);
    var d_y = d_skin_row(ROW_D_POINT + 1u, p);
    var d_z = d_skin_row(ROW_D_POINT + 2u, p);
    for (var k = 0u; k < pose.joint_count; k++) {
        let d = vec3(d_residual_joints[3u * k], d_residual_joints[3u * k + 1u], d_residual_joints[3u * k + 2u]);
        store_regressor(k, p, stored, d.x * x + d.y * y + d.z * z);
        let r = regressor_row(k, p);
        d_x += r * d.x;
        d_y += r * d.y;
        d_z += r * d.z;
    }
    store_d_skin(ROW_D_POINT, p, stored, d_x);
    store_d_skin(ROW_D_POINT + 1u, p, stored, d_y);
    store_d_skin(ROW_D_POINT + 2u, p, stored, d_z);
}
