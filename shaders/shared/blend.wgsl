// Shared by the rasterize stages of both tiers, so that they compute the same bits: blends splats front to back into
// 2x2 pixels, held as the components of vectors. A loaded splat serves four pixels, and selects instead of branches
// keep lanes together.

import package::shared::camera::{ALPHA_MAX, ALPHA_MIN, TILE_SIZE, TRANSMITTANCE_MIN, view};
import package::shared::counters::Counters;
import package::shared::falloff::{exponent, falloff};
import package::shared::splat::Splat;

@group(0) @binding(1) var<storage, read> splats: array<Splat>;
// The Gaussians of the tiles, front to back, tile after tile.
@group(0) @binding(2) var<storage, read> entries: array<u32>;
@group(0) @binding(3) var<storage, read> tile_ranges: array<vec2<u32>>;
// Colour over the background, and coverage.
@group(0) @binding(4) var<storage, read_write> image: array<vec4<f32>>;
// For the backward pass: the bits of the transmittance, and one past the last entry that a pixel blended.
@group(0) @binding(5) var<storage, read_write> pixel_states: array<vec2<u32>>;
// Expected camera z of the splats that cover a pixel, metres; 0 where none does.
@group(0) @binding(6) var<storage, read_write> depths: array<f32>;
@group(0) @binding(7) var<storage, read_write> counters: Counters;
// The bits of the largest weight with which a pixel takes each Gaussian, for positive floats sort like their bits.
@group(0) @binding(8) var<storage, read_write> largest_weights: array<atomic<u32>>;

override DEPTH: bool = false;
override LARGEST_WEIGHTS: bool = false;
// Most entries of a tile that the backward pass can process.
override BACKWARD_ENTRIES: u32 = 0xffffffffu;

// Records a tile that could not be processed completely, now or in the backward pass.
fn report_cut_short(pixels: ptr<function, Pixels>, range: vec2<u32>, cut_short: bool) {
    let end = ends(pixels, range);
    let last = max(max(end.x, end.y), max(end.z, end.w));
    if cut_short || (last > range.x && last - range.x > BACKWARD_ENTRIES) {
        atomicMax(&counters.cut_short, range.y - range.x);
    }
}

// What four pixels have accumulated so far.
struct Pixels {
    x: vec4<f32>,
    y: vec4<f32>,
    transmittance: vec4<f32>,
    red: vec4<f32>,
    green: vec4<f32>,
    blue: vec4<f32>,
    depth: vec4<f32>,
    // The least alpha that a pixel takes: ALPHA_MIN while it is open. An opaque pixel is closed, by more than any alpha:
    // its bits are CLOSED plus the entry at which it closed.
    gate: vec4<f32>,
}

// The bits of 2.
const CLOSED: u32 = 0x40000000u;

// Columns and rows of the four pixels of an invocation.
struct Area {
    column: vec4<u32>,
    row: vec4<u32>,
    inside: vec4<bool>,
}

fn area_of(tile: u32, local: u32) -> Area {
    let corner = vec2(tile % view.tiles.x, tile / view.tiles.x) * TILE_SIZE + vec2(local & 3u, local >> 2u) * 2u;
    let column = vec4(corner.x, corner.x + 1u, corner.x, corner.x + 1u);
    let row = vec4(corner.y, corner.y, corner.y + 1u, corner.y + 1u);
    return Area(column, row, (column < vec4(view.size.x)) & (row < vec4(view.size.y)));
}

fn empty_pixels(area: Area) -> Pixels {
    var pixels = Pixels();
    pixels.x = vec4<f32>(area.column) + 0.5;
    pixels.y = vec4<f32>(view.first_row + area.row) + 0.5;
    pixels.transmittance = vec4(1.0);
    pixels.gate = select(vec4(bitcast<f32>(CLOSED)), vec4(ALPHA_MIN), area.inside);
    return pixels;
}

fn splat_at(i: u32) -> Splat {
    var splat = splats[entries[i]];
    splat.conic = falloff(splat.conic);
    return splat;
}

fn is_open(pixels: ptr<function, Pixels>) -> bool {
    return any((*pixels).gate < vec4(1.0));
}

// Blends the splat of entry i, with its falloff for its conic. Each condition is one comparison: software rasterisers
// keep those in mask registers.
fn blend(pixels: ptr<function, Pixels>, i: u32, splat: Splat) {
    let dx = splat.mean.x - (*pixels).x;
    let dy = splat.mean.y - (*pixels).y;
    let raw = splat.opacity * exp2(exponent(splat.conic, dx, dy));
    let clamped = select(raw, vec4(ALPHA_MAX), raw > vec4(ALPHA_MAX));
    let alpha = select(vec4(0.0), clamped, clamped >= (*pixels).gate);
    let transmittance = (*pixels).transmittance;
    let next = transmittance * (1.0 - alpha);
    let weight = select(vec4(0.0), alpha * transmittance, next > vec4(TRANSMITTANCE_MIN));
    (*pixels).gate = select(vec4(bitcast<f32>(CLOSED + i)), (*pixels).gate, next > vec4(TRANSMITTANCE_MIN));
    (*pixels).transmittance = select(transmittance, next, next > vec4(TRANSMITTANCE_MIN));
    (*pixels).red += weight * splat.color.x;
    (*pixels).green += weight * splat.color.y;
    (*pixels).blue += weight * splat.color.z;
    if DEPTH {
        (*pixels).depth += weight * splat.depth;
    }
    if LARGEST_WEIGHTS {
        let largest = max(max(weight.x, weight.y), max(weight.z, weight.w));
        if largest > 0.0 {
            atomicMax(&largest_weights[entries[i]], bitcast<u32>(largest));
        }
    }
}

// One past the last entry that each pixel may have blended.
fn ends(pixels: ptr<function, Pixels>, range: vec2<u32>) -> vec4<u32> {
    let gate = (*pixels).gate;
    let open = select(vec4(range.y), vec4(range.x), (*pixels).transmittance == vec4(1.0));
    return select(bitcast<vec4<u32>>(gate) - CLOSED, open, gate < vec4(1.0));
}

fn store_pixels(pixels: ptr<function, Pixels>, area: Area, range: vec2<u32>) {
    let end = ends(pixels, range);
    let transmittance = (*pixels).transmittance;
    let red = (*pixels).red + transmittance * view.background.x;
    let green = (*pixels).green + transmittance * view.background.y;
    let blue = (*pixels).blue + transmittance * view.background.z;
    for (var k = 0; k < 4; k++) {
        if area.inside[k] {
            let pixel = area.row[k] * view.size.x + area.column[k];
            let coverage = 1.0 - transmittance[k];
            image[pixel] = vec4(red[k], green[k], blue[k], coverage);
            pixel_states[pixel] = vec2(bitcast<u32>(transmittance[k]), end[k]);
            if DEPTH {
                depths[pixel] = select(0.0, (*pixels).depth[k] / coverage, coverage > 0.0);
            }
        }
    }
}
