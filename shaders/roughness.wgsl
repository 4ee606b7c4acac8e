// Gradient of a penalty on differences between neighbours on a surface: for each pair of neighbours
// weight * width^2 * (sqrt(1 + (difference / width)^2) - 1), which is quadratic up to the width and linear beyond, so that
// edges stay. Added to the gradient that is there. CPU twin: `ghand_render::reference::roughness`.

import package::shared::dispatch::flat_index;

struct RoughnessUniforms {
    // N.
    count: u32,
    rows: u32,
    neighbors: u32,
    weight: f32,
    // 1 / width^2.
    inverse_squared_width: f32,
    padding_a: u32,
    padding_b: u32,
    padding_c: u32,
}

@group(0) @binding(0) var<uniform> roughness: RoughnessUniforms;
// Neighbours of each Gaussian, [neighbors][N]; a missing one is the Gaussian itself.
@group(0) @binding(1) var<storage, read> neighbors: array<u32>;
// [rows][N] each.
@group(0) @binding(2) var<storage, read> values: array<f32>;
@group(0) @binding(3) var<storage, read_write> gradients: array<f32>;

@compute @workgroup_size(64)
fn add_roughness(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                 @builtin(local_invocation_index) local: u32) {
    let i = flat_index(group, groups, local, 64u);
    let n = roughness.count;
    if i >= n * roughness.rows {
        return;
    }
    let p = i % n;
    let row = i - p;
    var sum = 0.0;
    for (var k = 0u; k < roughness.neighbors; k++) {
        let difference = values[i] - values[row + neighbors[k * n + p]];
        sum += difference * inverseSqrt(1.0 + difference * difference * roughness.inverse_squared_width);
    }
    gradients[i] += roughness.weight * sum;
}
