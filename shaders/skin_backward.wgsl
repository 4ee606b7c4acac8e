// Gradient of corrected skinning with respect to points and residual weights, and the moments whose weighted sums are
// the gradients of the bones. CPU twin: `ghand_core::skinning::skin_vjp`.

import package::shared::bones::{PLAIN, bone_row, residual_bone_row, residual_weight_row};
import package::shared::d_skin::store_d_skin;
import package::shared::dispatch::flat_index;
import package::shared::points4::{points4, in_range4, invocations};
import package::shared::offsets::offset_row;
import package::shared::pose::{ROW_D_POINT, ROW_MOMENT, ROW_POINT, pose};
import package::shared::weights::{joint_at, joints_of, weight_row};

@group(0) @binding(6) var<storage, read> d_gaussians: array<f32>;
@group(0) @binding(8) var<storage, read_write> d_residual_weights: array<f32>;

fn d_gaussian_row(row: u32, p: vec4<u32>) -> vec4<f32> {
    let at = vec4(row * pose.table_columns + pose.table_first) + p;
    return vec4(d_gaussians[at.x], d_gaussians[at.y], d_gaussians[at.z], d_gaussians[at.w]);
}

fn store_weight(k: u32, p: vec4<u32>, stored: vec4<bool>, value: vec4<f32>) {
    let at = vec4(k * pose.gaussian_count) + p;
    if stored.x { d_residual_weights[at.x] = value.x; }
    if stored.y { d_residual_weights[at.y] = value.y; }
    if stored.z { d_residual_weights[at.z] = value.z; }
    if stored.w { d_residual_weights[at.w] = value.w; }
}

@compute @workgroup_size(64)
fn skin_backward(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                 @builtin(local_invocation_index) local: u32) {
    let i = flat_index(group, groups, local, 64u);
    let n = pose.gaussian_count;
    if i >= invocations(n) {
        return;
    }
    let p = points4(i, n);
    let stored = in_range4(i, n);
    let x = offset_row(ROW_POINT, p);
    let y = offset_row(ROW_POINT + 1u, p);
    let z = offset_row(ROW_POINT + 2u, p);
    let dx = d_gaussian_row(0u, p);
    let dy = d_gaussian_row(1u, p);
    let dz = d_gaussian_row(2u, p);
    var d_x = vec4(0.0);
    var d_y = vec4(0.0);
    var d_z = vec4(0.0);
    let joints = joints_of(p);
    for (var j = joints.x; j < joints.y; j++) {
        let k = joint_at(j);
        let w = weight_row(k, p);
        let bx = bone_row(k, 0u);
        let by = bone_row(k, 1u);
        let bz = bone_row(k, 2u);
        d_x += w * (dx * bx.x + dy * by.x + dz * bz.x);
        d_y += w * (dx * bx.y + dy * by.y + dz * bz.y);
        d_z += w * (dx * bx.z + dy * by.z + dz * bz.z);
    }
    if !PLAIN {
        for (var k = 0u; k < pose.joint_count; k++) {
            let v = residual_weight_row(k, p);
            let rx = residual_bone_row(k, 0u);
            let ry = residual_bone_row(k, 1u);
            let rz = residual_bone_row(k, 2u);
            let residual_x = dx * rx.x + dy * ry.x + dz * rz.x;
            let residual_y = dx * rx.y + dy * ry.y + dz * rz.y;
            let residual_z = dx * rx.z + dy * ry.z + dz * rz.z;
            d_x += v * residual_x;
            d_y += v * residual_y;
            d_z += v * residual_z;
            let shift = dx * rx.w + dy * ry.w + dz * rz.w;
            store_weight(k, p, stored, residual_x * x + residual_y * y + residual_z * z + shift);
        }
    }
    store_d_skin(ROW_D_POINT, p, stored, d_x);
    store_d_skin(ROW_D_POINT + 1u, p, stored, d_y);
    store_d_skin(ROW_D_POINT + 2u, p, stored, d_z);
    store_d_skin(ROW_MOMENT, p, stored, dx * x);
    store_d_skin(ROW_MOMENT + 1u, p, stored, dx * y);
    store_d_skin(ROW_MOMENT + 2u, p, stored, dx * z);
    store_d_skin(ROW_MOMENT + 3u, p, stored, dx);
    store_d_skin(ROW_MOMENT + 4u, p, stored, dy * x);
    store_d_skin(ROW_MOMENT + 5u, p, stored, dy * y);
    store_d_skin(ROW_MOMENT + 6u, p, stored, dy * z);
    store_d_skin(ROW_MOMENT + 7u, p, stored, dy);
    store_d_skin(ROW_MOMENT + 8u, p, stored, dz * x);
    store_d_skin(ROW_MOMENT + 9u, p, stored, dz * y);
    store_d_skin(ROW_MOMENT + 10u, p, stored, dz * z);
    store_d_skin(ROW_MOMENT + 11u, p, stored, dz);
}
