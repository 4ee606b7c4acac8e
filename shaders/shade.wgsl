// Lights the colours of a hand: each is multiplied with the shade of its Gaussian, interpolated between the corners of its
// triangle. The backward pass multiplies the gradients of the lit colours with the same shades. CPU twin:
// `ghand_core::light::lit`.

import package::shared::dispatch::flat_index;
import package::shared::pose::pose;

// Number of vertices of the hand's mesh.
override VERTEX_COUNT: u32;

// Corners of each Gaussian's triangle, [3][N].
@group(0) @binding(1) var<storage, read> corners: array<u32>;
// Place on that triangle, [3][N].
@group(0) @binding(2) var<storage, read> barycentric: array<f32>;
// One RGB per vertex and frame, [frames][V][3].
@group(0) @binding(3) var<storage, read> vertex_shades: array<f32>;
@group(0) @binding(4) var<storage, read> color: array<f32>;
@group(0) @binding(5) var<storage, read_write> gaussians: array<f32>;
@group(0) @binding(6) var<storage, read> d_gaussians: array<f32>;
@group(0) @binding(7) var<storage, read_write> d_color: array<f32>;

// First row of the colours in the splatter's table.
const ROW_COLOR: u32 = 4u;

fn shade(p: u32) -> vec3<f32> {
    let n = pose.gaussian_count;
    let frame = pose.pose_offset / (3u * pose.joint_count + 3u);
    var sum = vec3(0.0);
    for (var c = 0u; c < 3u; c++) {
        let at = 3u * (frame * VERTEX_COUNT + corners[c * n + p]);
        sum += barycentric[c * n + p] * vec3(vertex_shades[at], vertex_shades[at + 1u], vertex_shades[at + 2u]);
    }
    return sum;
}

fn table_index(channel: u32, p: u32) -> u32 {
    return (ROW_COLOR + channel) * pose.table_columns + pose.table_first + p;
}

@compute @workgroup_size(64)
fn light_colors(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                @builtin(local_invocation_index) local: u32) {
    let p = flat_index(group, groups, local, 64u);
    let n = pose.gaussian_count;
    if p >= n {
        return;
    }
    let s = shade(p);
    gaussians[table_index(0u, p)] = s.x * color[p];
    gaussians[table_index(1u, p)] = s.y * color[n + p];
    gaussians[table_index(2u, p)] = s.z * color[2u * n + p];
}

@compute @workgroup_size(64)
fn light_colors_backward(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                         @builtin(local_invocation_index) local: u32) {
    let p = flat_index(group, groups, local, 64u);
    let n = pose.gaussian_count;
    if p >= n {
        return;
    }
    let s = shade(p);
    d_color[p] = s.x * d_gaussians[table_index(0u, p)];
    d_color[n + p] = s.y * d_gaussians[table_index(1u, p)];
    d_color[2u * n + p] = s.z * d_gaussians[table_index(2u, p)];
}
