// Normals of the skinned surface: a normal turns as the cross product of two tangents does, by the cofactors of the blended
// map. CPU twin: `ghand_core::skinning::skin_normals`.

import package::shared::bones::{PLAIN, bone_row, residual_bone_row, residual_weight_row};
import package::shared::dispatch::flat_index;
import package::shared::points4::{points4, in_range4, invocations};
import package::shared::pose::pose;
import package::shared::weights::{joint_at, joints_of, weight_row};

// [3][N] each, unit length.
@group(0) @binding(6) var<storage, read> rest_normals: array<f32>;
@group(0) @binding(7) var<storage, read_write> normals: array<f32>;

fn rest_normal_row(row: u32, p: vec4<u32>) -> vec4<f32> {
    let at = vec4(row * pose.gaussian_count) + p;
    return vec4(rest_normals[at.x], rest_normals[at.y], rest_normals[at.z], rest_normals[at.w]);
}

fn store(row: u32, p: vec4<u32>, stored: vec4<bool>, value: vec4<f32>) {
    let at = vec4(row * pose.gaussian_count) + p;
    if stored.x { normals[at.x] = value.x; }
    if stored.y { normals[at.y] = value.y; }
    if stored.z { normals[at.z] = value.z; }
    if stored.w { normals[at.w] = value.w; }
}

// The triple product a x b . n; a column for each component, a lane for each point.
fn triple(a: mat3x4<f32>, b: mat3x4<f32>, n: mat3x4<f32>) -> vec4<f32> {
    return (a[1] * b[2] - a[2] * b[1]) * n[0] + (a[2] * b[0] - a[0] * b[2]) * n[1] + (a[0] * b[1] - a[1] * b[0]) * n[2];
}

@compute @workgroup_size(64)
fn skin_normals(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                @builtin(local_invocation_index) local: u32) {
    let i = flat_index(group, groups, local, 64u);
    let n = pose.gaussian_count;
    if i >= invocations(n) {
        return;
    }
    let p = points4(i, n);
    // Rows of the blended map without its translation.
    var row_x = mat3x4<f32>();
    var row_y = mat3x4<f32>();
    var row_z = mat3x4<f32>();
    let joints = joints_of(p);
    for (var j = joints.x; j < joints.y; j++) {
        let k = joint_at(j);
        let w = weight_row(k, p);
        let bx = bone_row(k, 0u);
        let by = bone_row(k, 1u);
        let bz = bone_row(k, 2u);
        row_x += mat3x4(w * bx.x, w * bx.y, w * bx.z);
        row_y += mat3x4(w * by.x, w * by.y, w * by.z);
        row_z += mat3x4(w * bz.x, w * bz.y, w * bz.z);
    }
    if !PLAIN {
        for (var k = 0u; k < pose.joint_count; k++) {
            let v = residual_weight_row(k, p);
            let rx = residual_bone_row(k, 0u);
            let ry = residual_bone_row(k, 1u);
            let rz = residual_bone_row(k, 2u);
            row_x += mat3x4(v * rx.x, v * rx.y, v * rx.z);
            row_y += mat3x4(v * ry.x, v * ry.y, v * ry.z);
            row_z += mat3x4(v * rz.x, v * rz.y, v * rz.z);
        }
    }
    let rest = mat3x4(rest_normal_row(0u, p), rest_normal_row(1u, p), rest_normal_row(2u, p));
    let x = triple(row_y, row_z, rest);
    let y = triple(row_z, row_x, rest);
    let z = triple(row_x, row_y, rest);
    let squared = x * x + y * y + z * z;
    // Zero where the map flattens the surface's neighbourhood to a line.
    let scale = select(vec4(0.0), inverseSqrt(squared), squared > vec4(1e-30));
    let stored = in_range4(i, n);
    store(0u, p, stored, x * scale);
    store(1u, p, stored, y * scale);
    store(2u, p, stored, z * scale);
}
