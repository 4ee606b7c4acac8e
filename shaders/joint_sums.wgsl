// out[k][m] = sum over points of left[k][p] * right[m][p]: adds up per-point gradients for the joints. One invocation
// sums each of STRANDS strided strands of points for a block of 4 x 4 outputs; then the strands are added in order. Where
// skinning weights are 0, nothing is summed.

import package::shared::points4::BLOCK;

struct SumUniforms {
    count: u32,
    left_rows: u32,
    right_rows: u32,
    // First row of `right` that is used.
    right_offset: u32,
}

const STRANDS: u32 = 64u;
// Whether `left` holds skinning weights, with the lists of `shared/weights.wgsl` and others behind them: for each four
// joints, the blocks of points where they have weights.
override OF_WEIGHTS: bool = false;

@group(0) @binding(0) var<uniform> sums: SumUniforms;
@group(0) @binding(1) var<storage, read> left: array<f32>;
@group(0) @binding(2) var<storage, read> right: array<f32>;
@group(0) @binding(3) var<storage, read_write> partial: array<f32>;
@group(0) @binding(4) var<storage, read_write> total: array<f32>;

// Of the rows that begin at k and m, for point p.
fn products(k: vec4<u32>, m: vec4<u32>, p: u32) -> mat4x4<f32> {
    let l = vec4(left[k.x + p], left[k.y + p], left[k.z + p], left[k.w + p]);
    let r = vec4(right[m.x + p], right[m.y + p], right[m.z + p], right[m.w + p]);
    return mat4x4(l * r.x, l * r.y, l * r.z, l * r.w);
}

@compute @workgroup_size(64)
fn joint_sums_strands(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) strand: u32) {
    let blocks = (sums.right_rows + 3u) / 4u;
    let first_k = group.x / blocks * 4u;
    let first_m = group.x % blocks * 4u;
    let n = sums.count;
    // Rows beyond the last are read as the last and not written.
    let k = min(vec4(first_k) + vec4(0u, 1u, 2u, 3u), vec4(sums.left_rows - 1u)) * n;
    let m = (min(vec4(first_m) + vec4(0u, 1u, 2u, 3u), vec4(sums.right_rows - 1u)) + sums.right_offset) * n;
    var sum = mat4x4<f32>();
    if OF_WEIGHTS {
        let starts = sums.left_rows * n;
        let point_blocks = (n + BLOCK - 1u) / BLOCK;
        let joint_starts = starts + point_blocks + 1u + u32(left[starts + point_blocks]);
        let lists = joint_starts + (sums.left_rows + 3u) / 4u + 1u;
        let range = vec2(u32(left[joint_starts + first_k / 4u]), u32(left[joint_starts + first_k / 4u + 1u]));
        for (var i = range.x + strand / BLOCK; i < range.y; i += STRANDS / BLOCK) {
            let p = u32(left[lists + i]) * BLOCK + strand % BLOCK;
            if p < n {
                sum += products(k, m, p);
            }
        }
    } else {
        for (var p = strand; p < n; p += STRANDS) {
            sum += products(k, m, p);
        }
    }
    for (var j = 0u; j < 4u && first_m + j < sums.right_rows; j++) {
        for (var i = 0u; i < 4u && first_k + i < sums.left_rows; i++) {
            partial[((first_k + i) * sums.right_rows + first_m + j) * STRANDS + strand] = sum[j][i];
        }
    }
}

@compute @workgroup_size(64)
fn joint_sums_total(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= sums.left_rows * sums.right_rows {
        return;
    }
    var sum = 0.0;
    for (var s = 0u; s < STRANDS; s++) {
        sum += partial[id.x * STRANDS + s];
    }
    total[id.x] = sum;
}
