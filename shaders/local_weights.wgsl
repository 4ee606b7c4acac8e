// Residual weights of the joints that move a Gaussian, less their mean; 0 for all other joints. In place; a projection, so
// that it serves gradients, too. CPU twin: `ghand_core::skinning::make_local`.

import package::shared::dispatch::flat_index;

struct LocalWeightsUniforms {
    // N.
    count: u32,
    joints: u32,
    padding_a: u32,
    padding_b: u32,
}

@group(0) @binding(0) var<uniform> local_weights_size: LocalWeightsUniforms;
// Skinning weights, [joints][N].
@group(0) @binding(1) var<storage, read> weights: array<f32>;
// [joints][N].
@group(0) @binding(2) var<storage, read_write> values: array<f32>;

@compute @workgroup_size(64)
fn local_weights(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                 @builtin(local_invocation_index) local: u32) {
    let p = flat_index(group, groups, local, 64u);
    let n = local_weights_size.count;
    if p >= n {
        return;
    }
    var sum = 0.0;
    var count = 0.0;
    for (var k = 0u; k < local_weights_size.joints; k++) {
        if weights[k * n + p] > 0.0 {
            sum += values[k * n + p];
            count += 1.0;
        }
    }
    let mean = sum / max(count, 1.0);
    for (var k = 0u; k < local_weights_size.joints; k++) {
        let i = k * n + p;
        values[i] = select(0.0, values[i] - mean, weights[i] > 0.0);
    }
}
