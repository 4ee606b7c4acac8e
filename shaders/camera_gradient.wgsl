// Sums the six rows of camera gradients over the Gaussians: each of 64 strands adds its share in order, then one
// invocation per row adds the strands.

import package::shared::camera::view;

const STRANDS: u32 = 64u;

@group(0) @binding(1) var<storage, read> camera_rows: array<f32>;
@group(0) @binding(2) var<storage, read_write> strands: array<f32>;
@group(0) @binding(3) var<storage, read_write> d_camera: array<f32>;

@compute @workgroup_size(64)
fn camera_strands(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) strand: u32) {
    let n = view.gaussian_count;
    let share = (n + STRANDS - 1u) / STRANDS;
    let start = min(strand * share, n);
    let end = min(start + share, n);
    var sum = 0.0;
    for (var i = start; i < end; i++) {
        sum += camera_rows[group.x * n + i];
    }
    strands[group.x * STRANDS + strand] = sum;
}

@compute @workgroup_size(1)
fn camera_gradient(@builtin(workgroup_id) group: vec3<u32>) {
    var sum = 0.0;
    for (var s = 0u; s < STRANDS; s++) {
        sum += strands[group.x * STRANDS + s];
    }
    d_camera[group.x] = sum;
}
