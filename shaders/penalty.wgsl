// Gradient of a penalty weight / 2 * |value|^2, added to the gradient that is there. CPU twin:
// `ghand_render::reference::penalty`.

import package::shared::dispatch::flat_index;

struct PenaltyUniforms {
    count: u32,
    weight: f32,
    padding: vec2<u32>,
}

@group(0) @binding(0) var<uniform> penalty: PenaltyUniforms;
@group(0) @binding(1) var<storage, read> values: array<f32>;
@group(0) @binding(2) var<storage, read_write> gradients: array<f32>;

@compute @workgroup_size(64)
fn add_penalty(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
               @builtin(local_invocation_index) local: u32) {
    let i = flat_index(group, groups, local, 64u);
    if i < penalty.count {
        gradients[i] += penalty.weight * values[i];
    }
}
