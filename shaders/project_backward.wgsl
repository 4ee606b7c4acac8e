// Sums each Gaussian's slots in order and propagates the gradient through the projection to its properties and, if
// requested, to the camera.

import package::shared::camera::{camera_from_world, view};
import package::shared::counters::Counters;
import package::shared::dispatch::flat_index;
import package::shared::gaussian::{
    ANISOTROPIC, ANTIALIAS, COLOR_BASES, FLAT, FREE_OPACITY, Gaussian, ROW_COLOR, ROW_OPACITY, ROW_ROTATION, ROW_SCALE,
    UNBOUNDED, axes_of, compensation, flattened, are_finite, footprint, load_gaussian, stored,
    world_direction
};
import package::shared::sigmoid::sigmoid_slope;
import package::shared::spherical_harmonics::{coefficient, direction_to, harmonic, stored_color};
import package::shared::splat::{Splat, slot_of};
import package::shared::tile_rects::{first_tile, tile_count};

// Whether slots have a gradient of the opacity, as in rasterize_backward.wgsl.
override SLOT_OPACITY: bool = false;
// Cells of a slot, as there: 4, or 1 if the workgroup adds them up.
override SLOT_CELLS: u32 = 4u;
override CAMERA_GRADIENT: bool = false;

@group(0) @binding(2) var<storage, read> tile_rects: array<vec2<u32>>;
@group(0) @binding(3) var<storage, read> splats: array<Splat>;
// As in rasterize_backward.wgsl.
@group(0) @binding(4) var<storage, read> slot_gradients: array<vec4<f32>>;
@group(0) @binding(5) var<storage, read> slot_marks: array<u32>;
// Rows as in `gaussians`.
@group(0) @binding(6) var<storage, read_write> d_gaussians: array<f32>;
// Contribution of each Gaussian to the gradient of the camera's rotation and translation, six rows.
@group(0) @binding(7) var<storage, read_write> camera_rows: array<f32>;
@group(0) @binding(8) var<storage, read_write> counters: Counters;

fn store(row: u32, i: u32, value: f32) {
    d_gaussians[row * view.gaussian_count + i] = value;
}

fn store_vector(row: u32, i: u32, value: vec3<f32>) {
    store(row, i, value.x);
    store(row + 1u, i, value.y);
    store(row + 2u, i, value.z);
}

fn store_color(k: u32, i: u32, d_color: vec3<f32>) {
    if COLOR_BASES == 0u {
        store_vector(ROW_COLOR, i, d_color);
        return;
    }
    let at = coefficient(k, i);
    d_gaussians[at] = d_color.x;
    d_gaussians[at + 1u] = d_color.y;
    d_gaussians[at + 2u] = d_color.z;
}

fn store_camera(i: u32, turn: vec3<f32>, translation: vec3<f32>) {
    if CAMERA_GRADIENT {
        let n = view.gaussian_count;
        camera_rows[i] = turn.x;
        camera_rows[n + i] = turn.y;
        camera_rows[2u * n + i] = turn.z;
        camera_rows[3u * n + i] = translation.x;
        camera_rows[4u * n + i] = translation.y;
        camera_rows[5u * n + i] = translation.z;
    }
}

fn store_scale(row: u32, i: u32, scale: f32, d_scale: f32) {
    if UNBOUNDED {
        store(row, i, d_scale * scale);
    } else {
        store(row, i, d_scale);
    }
}

// dL/d(stored quaternion x, y, z, w) from the gradients of the axes.
fn quaternion_gradient(g: Gaussian, x_axis: vec3<f32>, y_axis: vec3<f32>, z_axis: vec3<f32>) -> vec4<f32> {
    let q = g.quaternion;
    let xy = y_axis.x + x_axis.y;
    let xz = z_axis.x + x_axis.z;
    let yz = z_axis.y + y_axis.z;
    let turn = vec3(y_axis.z - z_axis.y, z_axis.x - x_axis.z, x_axis.y - y_axis.x);
    let unit = 2.0 * vec4(-2.0 * q.x * (y_axis.y + z_axis.z) + q.y * xy + q.z * xz + q.w * turn.x,
                          -2.0 * q.y * (x_axis.x + z_axis.z) + q.x * xy + q.z * yz + q.w * turn.y,
                          -2.0 * q.z * (x_axis.x + y_axis.y) + q.x * xz + q.y * yz + q.w * turn.z,
                          dot(q.xyz, turn));
    return (unit - q * dot(q, unit)) / g.length;
}

fn camera_direction(v: vec3<f32>) -> vec3<f32> {
    return vec3(dot(view.row_x.xyz, v), dot(view.row_y.xyz, v), dot(view.row_z.xyz, v));
}

// The contents of one cell of a slot.
struct SlotGradient {
    first: vec4<f32>,
    second: vec4<f32>,
    power: f32,
}

fn slot_cell(cell: u32) -> SlotGradient {
    var gradient: SlotGradient;
    let mark = select(cell, 2u * cell, SLOT_OPACITY);
    if slot_marks[mark] != 0u {
        gradient.first = slot_gradients[2u * cell];
        gradient.second = slot_gradients[2u * cell + 1u];
        if SLOT_OPACITY {
            gradient.power = bitcast<f32>(slot_marks[mark + 1u]);
        }
    }
    return gradient;
}

fn joined(a: SlotGradient, b: SlotGradient) -> SlotGradient {
    return SlotGradient(a.first + b.first, a.second + b.second, a.power + b.power);
}

// A Gaussian that the image does not depend on.
fn store_nothing(i: u32) {
    for (var row = 0u; row < ROW_COLOR; row++) {
        store(row, i, 0.0);
    }
    for (var b = 0u; b < max(COLOR_BASES, 1u); b++) {
        store_color(b, i, vec3(0.0));
    }
    store_camera(i, vec3(0.0), vec3(0.0));
}

@compute @workgroup_size(64)
fn project_backward(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                    @builtin(local_invocation_index) local: u32) {
    let i = flat_index(group, groups, local, 64u);
    if i >= view.gaussian_count {
        return;
    }
    let rect = tile_rects[i];
    if tile_count(rect) == 0u {
        store_nothing(i);
        return;
    }
    let first_slot = slot_of(splats[i], first_tile(rect));
    // Of an incomplete frame, not all have room.
    let end_slot = min(first_slot + tile_count(rect), view.intersection_capacity);
    var first = vec4(0.0);
    var second = vec4(0.0);
    var d_power = 0.0;
    for (var s = first_slot; s < end_slot; s++) {
        var sum = slot_cell(s * SLOT_CELLS);
        // The loop over a slot's cells is unrolled: software rasterisers end a loop after 65,535 iterations.
        if SLOT_CELLS == 4u {
            sum = joined(joined(sum, slot_cell(s * SLOT_CELLS + 1u)),
                         joined(slot_cell(s * SLOT_CELLS + 2u), slot_cell(s * SLOT_CELLS + 3u)));
        }
        first += sum.first;
        second += sum.second;
        d_power += sum.power;
    }
    let d_color = vec3(first.zw, second.x);

    let g = load_gaussian(i);
    let p = camera_from_world(view, g.mean);
    let foot = footprint(g, p);
    let c = foot.covariance;
    var d_xx = second.y;
    var d_xy = second.z;
    var d_yy = second.w;
    var d_row_x = vec3(0.0);
    var d_row_y = vec3(0.0);
    let kept = compensation(foot);
    // The sum of d_alpha * alpha over the pixels: alpha is proportional to opacity.
    let d_opacity = d_power / (g.opacity * kept);
    if ANTIALIAS {
        // kept = |X| / sqrt(det) with X = row_x x row_y.
        let d_kept = d_opacity * g.opacity;
        let normal = cross(foot.row_x, foot.row_y) / max(foot.area, 1e-30);
        let d_normal = normal * (d_kept / sqrt(foot.determinant));
        d_row_x = cross(foot.row_y, d_normal);
        d_row_y = cross(d_normal, foot.row_x);
        let d_determinant = -0.5 * d_kept * kept / foot.determinant;
        d_xx += d_determinant * c.z;
        d_xy -= 2.0 * d_determinant * c.y;
        d_yy += d_determinant * c.x;
    }
    d_row_x += 2.0 * d_xx * foot.row_x + d_xy * foot.row_y;
    d_row_y += 2.0 * d_yy * foot.row_y + d_xy * foot.row_x;

    // To the sizes, the axes and the Jacobian (in camera axes).
    var d_jacobian_x: vec3<f32>;
    var d_jacobian_y: vec3<f32>;
    if ANISOTROPIC {
        let axes = axes_of(g.quaternion);
        let world_x = world_direction(foot.jacobian_x);
        let world_y = world_direction(foot.jacobian_y);
        let d_scales = d_row_x * (world_x * axes) + d_row_y * (world_y * axes);
        store_scale(ROW_SCALE, i, g.scales.x, d_scales.x);
        store_scale(ROW_SCALE + 1u, i, g.scales.y, d_scales.y);
        store_scale(ROW_SCALE + 2u, i, g.scales.z, d_scales.z);
        let sx = g.scales * d_row_x;
        let sy = g.scales * d_row_y;
        let d_q = quaternion_gradient(g, sx.x * world_x + sy.x * world_y, sx.y * world_x + sy.y * world_y,
                                      sx.z * world_x + sy.z * world_y);
        store(ROW_ROTATION, i, d_q.w);
        store_vector(ROW_ROTATION + 1u, i, d_q.xyz);
        d_jacobian_x = camera_direction(axes * sx);
        d_jacobian_y = camera_direction(axes * sy);
    } else if FLAT {
        // The map is its own transpose.
        let across_x = flattened(d_row_x, g.normal);
        let across_y = flattened(d_row_y, g.normal);
        d_jacobian_x = g.scales.x * camera_direction(across_x);
        d_jacobian_y = g.scales.x * camera_direction(across_y);
        store_scale(ROW_SCALE, i, g.scales.x, dot(across_x, world_direction(foot.jacobian_x))
            + dot(across_y, world_direction(foot.jacobian_y)));
        store_vector(ROW_ROTATION, i, vec3(0.0));
    } else {
        d_jacobian_x = g.scales.x * d_row_x;
        d_jacobian_y = g.scales.x * d_row_y;
        store_scale(ROW_SCALE, i, g.scales.x, dot(d_row_x, foot.jacobian_x) + dot(d_row_y, foot.jacobian_y));
    }

    // To the camera point: jacobian_x = (fx / z) (1, 0, -slope.x) and so on, centre = (x / z, y / z) f + principal.
    let inverse_z = 1.0 / p.z;
    let slope = p.xy * inverse_z;
    let free = (slope >= view.slope_min) & (slope <= view.slope_max);
    let through = -vec2(d_jacobian_x.z, d_jacobian_y.z) * view.focal * inverse_z;
    let d_slope = first.xy * view.focal + select(vec2(0.0), through, free);
    let d_p = vec3(d_slope * inverse_z,
                   -(dot(d_slope, slope) + dot(d_jacobian_x, foot.jacobian_x) + dot(d_jacobian_y, foot.jacobian_y)) * inverse_z);
    var d_mean = world_direction(d_p);
    var d_translation = d_p;

    if COLOR_BASES == 0u {
        store_color(0u, i, d_color);
    } else {
        let direction = direction_to(p);
        // Negative colours were set to 0.
        let d_sum = select(vec3(0.0), d_color, splats[i].color > vec3(0.0));
        var d_direction = vec3(0.0);
        for (var b = 0u; b < COLOR_BASES; b++) {
            let function = harmonic(b, direction);
            d_direction += function.gradient * dot(stored_color(b, i), d_sum);
            store_color(b, i, d_sum * function.value);
        }
        let d_offset = (d_direction - direction * dot(direction, d_direction)) / length(p);
        d_mean += d_offset;
        // A rotation about the camera's centre does not change the viewing direction; a translation does.
        d_translation += camera_direction(d_offset);
    }
    store_vector(0u, i, d_mean);
    if FREE_OPACITY {
        let d_plain = d_opacity * kept;
        if UNBOUNDED {
            store(ROW_OPACITY, i, d_plain * sigmoid_slope(stored(ROW_OPACITY, i)));
        } else {
            store(ROW_OPACITY, i, d_plain);
        }
    }
    // A small rotation w of the camera moves p by w x p and rotates the Jacobian's rows against the Gaussian's axes.
    var turn = cross(p, d_p);
    if ANISOTROPIC || FLAT {
        turn += cross(d_jacobian_x, foot.jacobian_x) + cross(d_jacobian_y, foot.jacobian_y);
    }
    store_camera(i, turn, d_translation);
    // All of a Gaussian's gradients come from these.
    let all = abs(d_mean) + abs(d_color) + abs(d_row_x) + abs(d_row_y) + abs(d_power);
    if !are_finite(all) {
        atomicAdd(&counters.bad_gradients, 1u);
    }
}
