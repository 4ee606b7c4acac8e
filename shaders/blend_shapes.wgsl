// Hand Gaussian Blend Shapes: offsets from bases and coefficients, and back. CPU twin: `ghand_core::blend_shapes`.

import package::shared::dispatch::flat_index;
import package::shared::pose::{ROW_D_POINT, ROW_OFFSET, ROW_POINT, pose};

// There is one coefficient for all three components of a basis, or one per component as in the paper.
override COEFFICIENT_ROWS: u32 = 1u;

// [3][N]
@group(0) @binding(1) var<storage, read> rest: array<f32>;
// [bases * 3][N]
@group(0) @binding(2) var<storage, read> shape_basis: array<f32>;
// [bases * COEFFICIENT_ROWS][N]
@group(0) @binding(3) var<storage, read> coefficients: array<f32>;
@group(0) @binding(4) var<storage, read_write> offsets: array<f32>;
@group(0) @binding(5) var<storage, read> d_skin: array<f32>;
@group(0) @binding(6) var<storage, read_write> d_shape_basis: array<f32>;
@group(0) @binding(7) var<storage, read_write> d_coefficients: array<f32>;

// A row of the table for each component.
fn coefficient_of(basis: u32, p: u32) -> vec3<f32> {
    let at = basis * COEFFICIENT_ROWS * pose.gaussian_count + p;
    if COEFFICIENT_ROWS == 1u {
        return vec3(coefficients[at]);
    }
    return vec3(coefficients[at], coefficients[at + pose.gaussian_count], coefficients[at + 2u * pose.gaussian_count]);
}

fn basis_of(basis: u32, p: u32) -> vec3<f32> {
    let at = 3u * basis * pose.gaussian_count + p;
    return vec3(shape_basis[at], shape_basis[at + pose.gaussian_count], shape_basis[at + 2u * pose.gaussian_count]);
}

@compute @workgroup_size(64)
fn blend_shapes(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                @builtin(local_invocation_index) local: u32) {
    let p = flat_index(group, groups, local, 64u);
    let n = pose.gaussian_count;
    if p >= n {
        return;
    }
    var offset = vec3(0.0);
    for (var i = 0u; i < pose.basis_count; i++) {
        offset += coefficient_of(i, p) * basis_of(i, p);
    }
    for (var c = 0u; c < 3u; c++) {
        offsets[(ROW_OFFSET + c) * n + p] = offset[c];
        offsets[(ROW_POINT + c) * n + p] = rest[c * n + p] + offset[c];
    }
}

@compute @workgroup_size(64)
fn blend_shapes_backward(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                         @builtin(local_invocation_index) local: u32) {
    let p = flat_index(group, groups, local, 64u);
    let n = pose.gaussian_count;
    if p >= n {
        return;
    }
    let d_offset = vec3(d_skin[ROW_D_POINT * n + p], d_skin[(ROW_D_POINT + 1u) * n + p],
                        d_skin[(ROW_D_POINT + 2u) * n + p]);
    for (var i = 0u; i < pose.basis_count; i++) {
        let d_basis = coefficient_of(i, p) * d_offset;
        let d_coefficient = basis_of(i, p) * d_offset;
        for (var c = 0u; c < 3u; c++) {
            d_shape_basis[(3u * i + c) * n + p] = d_basis[c];
            if COEFFICIENT_ROWS == 3u {
                d_coefficients[(3u * i + c) * n + p] = d_coefficient[c];
            }
        }
        if COEFFICIENT_ROWS == 1u {
            d_coefficients[i * n + p] = d_coefficient.x + d_coefficient.y + d_coefficient.z;
        }
    }
}
