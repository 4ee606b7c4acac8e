// Projects Gaussians to the image, culls those that cannot be seen, and finds the tiles that each may cover.

import package::shared::camera::{ALPHA_MIN, TILE_SIZE, camera_from_world, view};
import package::shared::counters::Counters;
import package::shared::dispatch::flat_index;
import package::shared::gaussian::{
    COLOR_BASES, are_finite, compensation, footprint, is_finite, is_sound, load_gaussian
};
import package::shared::spherical_harmonics::{color_sum, direction_to};
import package::shared::splat::Splat;

// Depth keys have 30 bits. Only culled Gaussians have the largest, so that they come last.
const DEPTH_KEY_MAX: u32 = 0x3fffffffu;
// So many of their lowest bits are dropped.
override DEPTH_KEY_SHIFT: u32 = 0u;

@group(0) @binding(2) var<storage, read_write> splats: array<Splat>;
// As in tile_rects.wgsl.
@group(0) @binding(3) var<storage, read_write> tile_rects: array<vec2<u32>>;
@group(0) @binding(4) var<storage, read_write> depth_keys: array<u32>;
@group(0) @binding(5) var<storage, read_write> counters: Counters;

@compute @workgroup_size(64)
fn project(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
           @builtin(local_invocation_index) local: u32) {
    let i = flat_index(group, groups, local, 64u);
    if i >= view.gaussian_count {
        return;
    }
    tile_rects[i] = vec2(0u, 0u);
    depth_keys[i] = DEPTH_KEY_MAX >> DEPTH_KEY_SHIFT;

    let g = load_gaussian(i);
    let p = camera_from_world(view, g.mean);
    let in_front = p.z >= view.near;
    var color = vec3(0.0);
    if is_sound(g) && in_front {
        color = color_sum(i, direction_to(p));
    }
    if !is_sound(g) || !are_finite(p) || !are_finite(color) {
        // Integers: the order of additions does not matter.
        atomicAdd(&counters.broken, 1u);
        return;
    }
    if !in_front {
        return;
    }
    if COLOR_BASES > 0u {
        color = max(color, vec3(0.0));
    }
    let foot = footprint(g, p);
    let opacity = g.opacity * compensation(foot);
    if !is_finite(foot.determinant) || !(opacity >= ALPHA_MIN) {
        return;
    }
    let c = foot.covariance;
    let center = p.xy / p.z * view.focal + view.principal;
    // Where opacity * exp(-q / 2) = ALPHA_MIN; a margin is added so that rounding never loses a pixel.
    let q = 2.0 * log(opacity / ALPHA_MIN) + 1e-3;
    let reach = sqrt(q * c.xz) + 1e-3;
    let origin = vec2(0u, view.first_row);
    let first = max(ceil(center - reach - 0.5), vec2<f32>(origin));
    let last = min(floor(center + reach - 0.5), vec2<f32>(origin + view.size) - 1.0);
    if !(first.x <= last.x && first.y <= last.y) {
        return;
    }
    let first_tile = (vec2<u32>(first) - origin) / TILE_SIZE;
    let end_tile = (vec2<u32>(last) - origin) / TILE_SIZE + 1u;
    tile_rects[i] = vec2(first_tile.x | (first_tile.y << 16u), end_tile.x | (end_tile.y << 16u));
    // The bits of positive floats sort like the floats. All depths beyond 3e36 m are equal.
    let depth_key = min(bitcast<u32>(p.z) - bitcast<u32>(view.near), DEPTH_KEY_MAX) >> DEPTH_KEY_SHIFT;
    depth_keys[i] = min(depth_key, (DEPTH_KEY_MAX >> DEPTH_KEY_SHIFT) - 1u);
    splats[i] = Splat(center, p.z, opacity, vec3(c.z, -c.y, c.x) / foot.determinant, 0u, color, 0u);
}
