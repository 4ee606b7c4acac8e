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

fn coefficient_row(basis: u32, component: u32) -> u32 {
    return basis * COEFFICIENT_ROWS + min(component, COEFFICIENT_ROWS - 1u);
}

@compute @workgroup_size(64)
fn blend_shapes(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                @builtin(local_invocation_index) local: u32) {
    let p = flat_index(group, groups, local, 64u);
    let n = pose.gaussian_count;
    if p >= n {
        return;
    }
    for (var c = 0u; c < 3u; c++) {
        var offset = 0.0;
        for (var i = 0u; i < pose.basis_count; i++) {
            offset += coefficients[coefficient_row(i, c) * n + p] * shape_basis[(3u * i + c) * n + p];
        }
        offsets[(ROW_OFFSET + c) * n + p] = offset;
        offsets[(ROW_POINT + c) * n + p] = rest[c * n + p] + offset;
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
    for (var i = 0u; i < pose.basis_count; i++) {
        var shared_gradient = 0.0;
        for (var c = 0u; c < 3u; c++) {
            let d_offset = d_skin[(ROW_D_POINT + c) * n + p];
            let at = (3u * i + c) * n + p;
            d_shape_basis[at] = coefficients[coefficient_row(i, c) * n + p] * d_offset;
            shared_gradient += shape_basis[at] * d_offset;
            if COEFFICIENT_ROWS == 3u {
                d_coefficients[coefficient_row(i, c) * n + p] = shape_basis[at] * d_offset;
            }
        }
        if COEFFICIENT_ROWS == 1u {
            d_coefficients[i * n + p] = shared_gradient;
        }
    }
}
