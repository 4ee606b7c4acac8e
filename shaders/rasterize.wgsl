// Blends each tile's splats front to back. A workgroup is a tile and an invocation 2x2 pixels, held as the components
// of vectors: loading a splat is shared by four pixels, and selects instead of branches keep lanes together.

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<storage, read> splats: array<Splat>;
@group(0) @binding(2) var<storage, read> entries: array<vec2<u32>>;
@group(0) @binding(3) var<storage, read> tile_ranges: array<vec2<u32>>;
// Colour over the background, and coverage.
@group(0) @binding(4) var<storage, read_write> image: array<vec4<f32>>;
@group(0) @binding(5) var<storage, read_write> transmittances: array<f32>;
// One past the last entry that a pixel took.
@group(0) @binding(6) var<storage, read_write> ends: array<u32>;
// Expected camera z of what covers a pixel, metres; 0 where nothing does.
@group(0) @binding(7) var<storage, read_write> depths: array<f32>;

@group(0) @binding(8) var<storage, read_write> counters: array<atomic<u32>>;

override DEPTH: bool = false;
// How many entries of a tile the backward pass can go through.
override BACKWARD_ENTRIES: u32 = 0xffffffffu;
// Of the tiles with too many entries for the driver, the largest number.
const COUNTER_CUT_SHORT: u32 = 4u;

// What four pixels have gathered so far.
struct Pixels {
    x: vec4<f32>,
    y: vec4<f32>,
    transmittance: vec4<f32>,
    red: vec4<f32>,
    green: vec4<f32>,
    blue: vec4<f32>,
    depth: vec4<f32>,
    end: vec4<u32>,
    live: vec4<bool>,
}

fn blend(pixels: ptr<function, Pixels>, i: u32) {
    let splat = splats[entries[i].x];
    let dx = splat.mean.x - (*pixels).x;
    let dy = splat.mean.y - (*pixels).y;
    let power = -0.5 * (splat.conic.x * dx * dx + splat.conic.z * dy * dy) - splat.conic.y * dx * dy;
    let alpha = min(vec4(ALPHA_MAX), splat.opacity * exp(power));
    let transmittance = (*pixels).transmittance;
    let next = transmittance * (1.0 - alpha);
    let hit = (*pixels).live & (alpha >= vec4(ALPHA_MIN));
    let enough = next > vec4(TRANSMITTANCE_MIN);
    let take = hit & enough;
    (*pixels).live = (*pixels).live & (enough | !hit);
    let weight = select(vec4(0.0), alpha * transmittance, take);
    (*pixels).red += weight * splat.color.x;
    (*pixels).green += weight * splat.color.y;
    (*pixels).blue += weight * splat.color.z;
    if DEPTH {
        (*pixels).depth += weight * splat.depth;
    }
    (*pixels).transmittance = select(transmittance, next, take);
    (*pixels).end = select((*pixels).end, vec4(i + 1u), take);
}

@compute @workgroup_size(16)
fn rasterize(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
             @builtin(local_invocation_index) local: u32) {
    let tile = group.x + group.y * groups.x;
    if tile >= view.tiles.x * view.tiles.y {
        return;
    }
    let corner = vec2(tile % view.tiles.x, tile / view.tiles.x) * TILE_SIZE + vec2(local & 3u, local >> 2u) * 2u;
    let column = vec4<u32>(corner.x, corner.x + 1u, corner.x, corner.x + 1u);
    let row = vec4<u32>(corner.y, corner.y, corner.y + 1u, corner.y + 1u);
    let inside = (column < vec4(view.size.x)) & (row < vec4(view.size.y));

    var pixels = Pixels();
    pixels.x = vec4<f32>(column) + 0.5;
    pixels.y = vec4<f32>(row) + 0.5;
    pixels.transmittance = vec4(1.0);
    pixels.live = inside;
    let range = tile_ranges[tile];
    // Two entries a round: half as many rounds, of which software rasterisers allow only so many.
    var i = range.x;
    for (; i + 1u < range.y; i += 2u) {
        blend(&pixels, i);
        blend(&pixels, i + 1u);
        if !any(pixels.live) {
            break;
        }
    }
    let cut_short = i + 1u < range.y && any(pixels.live);
    if !cut_short && i < range.y && any(pixels.live) {
        blend(&pixels, i);
    }
    let last = max(max(pixels.end.x, pixels.end.y), max(pixels.end.z, pixels.end.w));
    if cut_short || last > range.x && last - range.x > BACKWARD_ENTRIES {
        atomicMax(&counters[COUNTER_CUT_SHORT], range.y - range.x);
    }
    let red = pixels.red + pixels.transmittance * view.background.x;
    let green = pixels.green + pixels.transmittance * view.background.y;
    let blue = pixels.blue + pixels.transmittance * view.background.z;
    for (var k = 0; k < 4; k++) {
        if inside[k] {
            let pixel = row[k] * view.size.x + column[k];
            image[pixel] = vec4(red[k], green[k], blue[k], 1.0 - pixels.transmittance[k]);
            transmittances[pixel] = pixels.transmittance[k];
            ends[pixel] = pixels.end[k];
            if DEPTH {
                depths[pixel] = select(0.0, pixels.depth[k] / (1.0 - pixels.transmittance[k]), pixels.end[k] > 0u);
            }
        }
    }
}
