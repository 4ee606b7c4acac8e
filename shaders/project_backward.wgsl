// Sums each Gaussian's slots in order and carries the gradient through the projection to its properties.

const CELLS: u32 = 4u;

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<storage, read> gaussians: array<f32>;
@group(0) @binding(2) var<storage, read> slot_ranges: array<vec2<u32>>;
@group(0) @binding(3) var<storage, read> slot_gradients: array<vec4<f32>>;
// Rows as in `gaussians`.
@group(0) @binding(4) var<storage, read_write> d_gaussians: array<f32>;

@compute @workgroup_size(64)
fn project_backward(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                    @builtin(local_invocation_index) local: u32) {
    let i = flat_index(group, groups, local, 64u);
    let n = view.gaussian_count;
    if i >= n {
        return;
    }
    let slots = slot_ranges[i];
    var first = vec4(0.0);
    var second = vec4(0.0);
    for (var s = slots.x * CELLS; s < slots.y * CELLS; s++) {
        first += slot_gradients[2u * s];
        second += slot_gradients[2u * s + 1u];
    }
    var d_mean = vec3(0.0);
    var d_scale = 0.0;
    if slots.x < slots.y {
        let mean = vec3(gaussians[i], gaussians[n + i], gaussians[2u * n + i]);
        let scale = gaussians[ROW_SCALE * n + i];
        let p = camera_from_world(view, mean);
        let foot = footprint(view, p, scale);
        let c = foot.covariance;
        let determinant = c.x * c.z - c.y * c.y;
        // conic = covariance^-1, so d_covariance = -conic d_conic conic with d_conic symmetric.
        let k = vec3(c.z, -c.y, c.x) / determinant;
        let g = vec3(second.y, 0.5 * second.z, second.w);
        let kg_xx = k.x * g.x + k.y * g.y;
        let kg_xy = k.x * g.y + k.y * g.z;
        let kg_yx = k.y * g.x + k.z * g.y;
        let kg_yy = k.y * g.y + k.z * g.z;
        let d_xx = -(kg_xx * k.x + kg_xy * k.y);
        let d_xy = -2.0 * (kg_xx * k.y + kg_xy * k.z);
        let d_yy = -(kg_yx * k.y + kg_yy * k.z);

        let f = view.focal;
        let r = foot.slope;
        let inverse_z = 1.0 / p.z;
        let ratio = scale * inverse_z;
        let d_u = d_xx * f.x * f.x * (1.0 + r.x * r.x) + d_xy * f.x * f.y * r.x * r.y
            + d_yy * f.y * f.y * (1.0 + r.y * r.y);
        let d_slope = ratio * ratio * vec2(2.0 * d_xx * f.x * f.x * r.x + d_xy * f.x * f.y * r.y,
                                           2.0 * d_yy * f.y * f.y * r.y + d_xy * f.x * f.y * r.x);
        d_scale = 2.0 * d_u * ratio * inverse_z;
        let slope = p.xy * inverse_z;
        let free = (slope >= view.slope_min) & (slope <= view.slope_max);
        let d_xy_over_z = first.xy * f + select(vec2(0.0), d_slope, free);
        let d_p = vec3(d_xy_over_z * inverse_z,
                       -dot(d_xy_over_z, slope) * inverse_z - 2.0 * d_u * ratio * ratio * inverse_z);
        d_mean = view.row_x.xyz * d_p.x + view.row_y.xyz * d_p.y + view.row_z.xyz * d_p.z;
    }
    d_gaussians[i] = d_mean.x;
    d_gaussians[n + i] = d_mean.y;
    d_gaussians[2u * n + i] = d_mean.z;
    d_gaussians[ROW_SCALE * n + i] = d_scale;
    d_gaussians[ROW_COLOR * n + i] = first.z;
    d_gaussians[(ROW_COLOR + 1u) * n + i] = first.w;
    d_gaussians[(ROW_COLOR + 2u) * n + i] = second.x;
}
