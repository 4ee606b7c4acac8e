// Shared by both rasterize_backward stages: removes the entries of a tile back to front, one row of four
// pixels at a time.

import package::shared::camera::{ALPHA_MAX, ALPHA_MIN, view};
import package::shared::falloff::{exponent, falloff};
import package::shared::splat::Splat;

@group(0) @binding(1) var<storage, read> splats: array<Splat>;
// The Gaussians of the tiles, front to back, tile after tile.
@group(0) @binding(2) var<storage, read> entries: array<u32>;
@group(0) @binding(3) var<storage, read> tile_ranges: array<vec2<u32>>;
// The bits of the transmittance, and one past the last entry that a pixel blended.
@group(0) @binding(4) var<storage, read> pixel_states: array<vec2<u32>>;
// dL/d(colour, coverage).
@group(0) @binding(5) var<storage, read> d_image: array<vec4<f32>>;

// Whether the gradient of the opacity is requested.
override SLOT_OPACITY: bool = false;

// Rows that an invocation owns.
@if(subgroups)
const ROWS: u32 = 2u;
@if(!subgroups)
const ROWS: u32 = 4u;

// State of four pixels side by side, after the entries behind.
struct Row {
    transmittance: vec4<f32>,
    // dL/dT of everything behind, times T: sum of weight * (color . d_color) of the splats behind plus the background's
    // part.
    behind: vec4<f32>,
    d_red: vec4<f32>,
    d_green: vec4<f32>,
    d_blue: vec4<f32>,
    // One past the last entry that each pixel blended.
    end: vec4<u32>,
}

// The gradient of a splat, pixel column by pixel column.
struct Sums {
    mean_x: vec4<f32>,
    mean_y: vec4<f32>,
    red: vec4<f32>,
    green: vec4<f32>,
    blue: vec4<f32>,
    xx: vec4<f32>,
    xy: vec4<f32>,
    yy: vec4<f32>,
    // The opacity times its gradient.
    power: vec4<f32>,
    touched: bool,
}

fn load_row(corner: vec2<u32>) -> Row {
    var row = Row();
    for (var c = 0u; c < 4u; c++) {
        let at = corner + vec2(c, 0u);
        if at.x < view.size.x && at.y < view.size.y {
            let pixel = at.y * view.size.x + at.x;
            let d = d_image[pixel];
            let state = pixel_states[pixel];
            let transmittance = bitcast<f32>(state.x);
            row.transmittance[c] = transmittance;
            row.end[c] = state.y;
            row.d_red[c] = d.x;
            row.d_green[c] = d.y;
            row.d_blue[c] = d.z;
            row.behind[c] = transmittance * (dot(view.background.xyz, d.xyz) - d.w);
        }
    }
    return row;
}

fn last_end(row: Row) -> u32 {
    return max(max(row.end.x, row.end.y), max(row.end.z, row.end.w));
}

// Removes the splat of entry i from row r, whose pixels are at (dx, dy) from its mean.
fn unblend(rows: ptr<function, array<Row, ROWS>>, r: u32, sums: ptr<function, Sums>, i: u32, splat: Splat,
           dx: vec4<f32>, dy: f32) {
    let row = (*rows)[r];
    let raw = splat.opacity * exp2(exponent(falloff(splat.conic), dx, vec4(dy)));
    let alpha = min(vec4(ALPHA_MAX), raw);
    let hit = (vec4(i) < row.end) & (alpha >= vec4(ALPHA_MIN));
    (*sums).touched = (*sums).touched || any(hit);
    let through = 1.0 / (1.0 - alpha);
    let before = row.transmittance * through;
    let weight = select(vec4(0.0), alpha * before, hit);
    let d_value = splat.color.x * row.d_red + splat.color.y * row.d_green + splat.color.z * row.d_blue;
    let d_alpha = before * d_value - row.behind * through;
    (*sums).red += weight * row.d_red;
    (*sums).green += weight * row.d_green;
    (*sums).blue += weight * row.d_blue;
    (*rows)[r].behind = row.behind + weight * d_value;
    (*rows)[r].transmittance = select(row.transmittance, before, hit);
    // Where alpha is clamped to ALPHA_MAX it does not depend on the power.
    let d_power = select(vec4(0.0), d_alpha * raw, hit & (raw <= vec4(ALPHA_MAX)));
    if SLOT_OPACITY {
        (*sums).power += d_power;
    }
    // With k = conic d: d(power)/d(mean) = -k and d(power)/d(covariance) = k k^T / 2. With respect to the conic it
    // would be -d d^T / 2, from which the gradient of the covariance suffers cancellation when a splat is long and
    // thin.
    let k_x = splat.conic.x * dx + splat.conic.y * dy;
    let k_y = splat.conic.y * dx + splat.conic.z * dy;
    let d_x = d_power * k_x;
    let d_y = d_power * k_y;
    (*sums).mean_x -= d_x;
    (*sums).mean_y -= d_y;
    (*sums).xx += 0.5 * d_x * k_x;
    (*sums).xy += d_x * k_y;
    (*sums).yy += 0.5 * d_y * k_y;
}

fn row_sum(v: vec4<f32>) -> f32 {
    return dot(v, vec4(1.0));
}
