// Corrected linear blend skinning. CPU twin: `ghand_core::skinning`.

import package::shared::bones::{PLAIN, bone_row, residual_bone_row, residual_weight_row};
import package::shared::dispatch::flat_index;
import package::shared::points4::{points4, in_range4, invocations};
import package::shared::offsets::offset_row;
import package::shared::pose::{ROW_POINT, pose};
import package::shared::weights::{joint_at, joints_of, weight_row};

@group(0) @binding(6) var<storage, read> poses: array<f32>;
@group(0) @binding(7) var<storage, read_write> gaussians: array<f32>;
// Skinned points before the translation, [3][N], metres: far away only their differences are exact.
@group(0) @binding(8) var<storage, read_write> skinned: array<f32>;

// With a translation, to the splatter's table, where the mean is in the first three rows.
fn store(row: u32, p: vec4<u32>, stored: vec4<bool>, value: vec4<f32>, translation: f32) {
    let here = vec4(row * pose.gaussian_count) + p;
    if stored.x { skinned[here.x] = value.x; }
    if stored.y { skinned[here.y] = value.y; }
    if stored.z { skinned[here.z] = value.z; }
    if stored.w { skinned[here.w] = value.w; }
    let at = vec4(row * pose.table_columns + pose.table_first) + p;
    if stored.x { gaussians[at.x] = value.x + translation; }
    if stored.y { gaussians[at.y] = value.y + translation; }
    if stored.z { gaussians[at.z] = value.z + translation; }
    if stored.w { gaussians[at.w] = value.w + translation; }
}

@compute @workgroup_size(64)
fn skin(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
        @builtin(local_invocation_index) local: u32) {
    let i = flat_index(group, groups, local, 64u);
    let n = pose.gaussian_count;
    if i >= invocations(n) {
        return;
    }
    let p = points4(i, n);
    // Rows of the blended map: one column for each entry of the row, one component for each point.
    var row_x = mat4x4<f32>();
    var row_y = mat4x4<f32>();
    var row_z = mat4x4<f32>();
    let joints = joints_of(p);
    for (var j = joints.x; j < joints.y; j++) {
        let k = joint_at(j);
        let w = weight_row(k, p);
        let bx = bone_row(k, 0u);
        let by = bone_row(k, 1u);
        let bz = bone_row(k, 2u);
        row_x += mat4x4(w * bx.x, w * bx.y, w * bx.z, w * bx.w);
        row_y += mat4x4(w * by.x, w * by.y, w * by.z, w * by.w);
        row_z += mat4x4(w * bz.x, w * bz.y, w * bz.z, w * bz.w);
    }
    if !PLAIN {
        for (var k = 0u; k < pose.joint_count; k++) {
            let v = residual_weight_row(k, p);
            let rx = residual_bone_row(k, 0u);
            let ry = residual_bone_row(k, 1u);
            let rz = residual_bone_row(k, 2u);
            row_x += mat4x4(v * rx.x, v * rx.y, v * rx.z, v * rx.w);
            row_y += mat4x4(v * ry.x, v * ry.y, v * ry.z, v * ry.w);
            row_z += mat4x4(v * rz.x, v * rz.y, v * rz.z, v * rz.w);
        }
    }
    let x = offset_row(ROW_POINT, p);
    let y = offset_row(ROW_POINT + 1u, p);
    let z = offset_row(ROW_POINT + 2u, p);
    let stored = in_range4(i, n);
    let t = pose.pose_offset + 3u * pose.joint_count;
    store(0u, p, stored, row_x[0] * x + row_x[1] * y + row_x[2] * z + row_x[3], poses[t]);
    store(1u, p, stored, row_y[0] * x + row_y[1] * y + row_y[2] * z + row_y[3], poses[t + 1u]);
    store(2u, p, stored, row_z[0] * x + row_z[1] * y + row_z[2] * z + row_z[3], poses[t + 2u]);
}
