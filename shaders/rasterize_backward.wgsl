// Gradients of the splats from the gradient of the image. An invocation owns a 4x4 cell of pixels and walks its tile's
// entries back to front; what it adds up for an entry goes to that (slot, cell) alone, so there is nothing to race for
// and the sum over slots and cells later has one order.

const CELLS: u32 = 4u;
// Vectors a (slot, cell): the third is for the opacity.
override SLOT_VECTORS: u32 = 2u;

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<storage, read> splats: array<Splat>;
@group(0) @binding(2) var<storage, read> entries: array<vec2<u32>>;
@group(0) @binding(3) var<storage, read> tile_ranges: array<vec2<u32>>;
@group(0) @binding(4) var<storage, read> transmittances: array<f32>;
@group(0) @binding(5) var<storage, read> ends: array<u32>;
// dL/d(colour, coverage).
@group(0) @binding(6) var<storage, read> d_image: array<vec4<f32>>;
// For each (slot, cell): (mean x, mean y, red, green), (blue, covariance xx, xy, yy), and (opacity times its gradient, 0, 0, 0)
// if it is wanted. Cleared before.
@group(0) @binding(7) var<storage, read_write> slot_gradients: array<vec4<f32>>;

@compute @workgroup_size(32)
fn rasterize_backward(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                      @builtin(local_invocation_index) local: u32) {
    let index = flat_index(group, groups, local, 32u);
    let tile = index / CELLS;
    let cell = index % CELLS;
    if tile >= view.tiles.x * view.tiles.y {
        return;
    }
    let range = tile_ranges[tile];
    if range.x >= range.y {
        return;
    }
    let corner = vec2(tile % view.tiles.x, tile / view.tiles.x) * TILE_SIZE + vec2(cell & 1u, cell >> 1u) * 4u;
    let x = vec4<f32>(vec4(corner.x) + vec4(0u, 1u, 2u, 3u)) + 0.5;

    // Four rows of four pixels. `behind` is dL/dT of what lies behind, times T: sum of weight * (color . d_color) of the
    // splats behind plus the background's part.
    var transmittance: array<vec4<f32>, 4>;
    var behind: array<vec4<f32>, 4>;
    var d_red: array<vec4<f32>, 4>;
    var d_green: array<vec4<f32>, 4>;
    var d_blue: array<vec4<f32>, 4>;
    var end: array<vec4<u32>, 4>;
    var last = range.x;
    for (var r = 0u; r < 4u; r++) {
        for (var c = 0u; c < 4u; c++) {
            let at = corner + vec2(c, r);
            if at.x < view.size.x && at.y < view.size.y {
                let pixel = at.y * view.size.x + at.x;
                let d = d_image[pixel];
                transmittance[r][c] = transmittances[pixel];
                end[r][c] = ends[pixel];
                last = max(last, ends[pixel]);
                d_red[r][c] = d.x;
                d_green[r][c] = d.y;
                d_blue[r][c] = d.z;
                behind[r][c] = transmittances[pixel] * (dot(view.background.xyz, d.xyz) - d.w);
            }
        }
    }
    for (var i = last; i > range.x;) {
        i--;
        let entry = entries[i];
        let splat = splats[entry.x];
        let dx = splat.mean.x - x;
        var d_mean_x = vec4(0.0);
        var d_mean_y = vec4(0.0);
        var sum_red = vec4(0.0);
        var sum_green = vec4(0.0);
        var sum_blue = vec4(0.0);
        var d_xx = vec4(0.0);
        var d_xy = vec4(0.0);
        var d_yy = vec4(0.0);
        var sum_power = vec4(0.0);
        var touched = false;
        for (var r = 0u; r < 4u; r++) {
            let dy = splat.mean.y - (f32(corner.y + r) + 0.5);
            let power = -0.5 * (splat.conic.x * dx * dx + splat.conic.z * dy * dy) - splat.conic.y * dx * dy;
            let raw = splat.opacity * exp(power);
            let alpha = min(vec4(ALPHA_MAX), raw);
            let hit = (vec4(i) < end[r]) & (alpha >= vec4(ALPHA_MIN));
            touched = touched || any(hit);
            let through = 1.0 / (1.0 - alpha);
            let before = transmittance[r] * through;
            let weight = select(vec4(0.0), alpha * before, hit);
            let d_value = splat.color.x * d_red[r] + splat.color.y * d_green[r] + splat.color.z * d_blue[r];
            let d_alpha = before * d_value - behind[r] * through;
            sum_red += weight * d_red[r];
            sum_green += weight * d_green[r];
            sum_blue += weight * d_blue[r];
            behind[r] += weight * d_value;
            transmittance[r] = select(transmittance[r], before, hit);
            // Where alpha is cut at ALPHA_MAX it does not depend on the power.
            let d_power = select(vec4(0.0), d_alpha * raw, hit & (raw <= vec4(ALPHA_MAX)));
            if SLOT_VECTORS > 2u {
                sum_power += d_power;
            }
            // With k = conic d: d(power)/d(mean) = -k and d(power)/d(covariance) = k k^T / 2. By the conic it would be -d d^T / 2,
            // whose way back to the covariance cancels when a splat is long and thin.
            let k_x = splat.conic.x * dx + splat.conic.y * dy;
            let k_y = splat.conic.y * dx + splat.conic.z * dy;
            let d_x = d_power * k_x;
            let d_y = d_power * k_y;
            d_mean_x -= d_x;
            d_mean_y -= d_y;
            d_xx += 0.5 * d_x * k_x;
            d_xy += d_x * k_y;
            d_yy += 0.5 * d_y * k_y;
        }
        if touched {
            let one = vec4(1.0);
            let at = (entry.y * CELLS + cell) * SLOT_VECTORS;
            slot_gradients[at] = vec4(dot(d_mean_x, one), dot(d_mean_y, one), dot(sum_red, one), dot(sum_green, one));
            slot_gradients[at + 1u] =
                vec4(dot(sum_blue, one), dot(d_xx, one), dot(d_xy, one), dot(d_yy, one));
            if SLOT_VECTORS > 2u {
                slot_gradients[at + 2u] = vec4(dot(sum_power, one), 0.0, 0.0, 0.0);
            }
        }
    }
}
