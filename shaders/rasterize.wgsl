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
// Of the tiles whose loop the driver ended early, the largest number of entries.
const COUNTER_CUT_SHORT: u32 = 4u;

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
    let x = vec4<f32>(column) + 0.5;
    let y = vec4<f32>(row) + 0.5;

    var transmittance = vec4(1.0);
    var red = vec4(0.0);
    var green = vec4(0.0);
    var blue = vec4(0.0);
    var depth = vec4(0.0);
    var end = vec4(0u);
    var live = inside;
    let range = tile_ranges[tile];
    var i = range.x;
    for (; i < range.y; i++) {
        let splat = splats[entries[i].x];
        let dx = splat.mean.x - x;
        let dy = splat.mean.y - y;
        let power = -0.5 * (splat.conic.x * dx * dx + splat.conic.z * dy * dy) - splat.conic.y * dx * dy;
        let alpha = min(vec4(ALPHA_MAX), splat.opacity * exp(power));
        let next = transmittance * (1.0 - alpha);
        let hit = live & (alpha >= vec4(ALPHA_MIN));
        let enough = next > vec4(TRANSMITTANCE_MIN);
        let take = hit & enough;
        live = live & (enough | !hit);
        let weight = select(vec4(0.0), alpha * transmittance, take);
        red += weight * splat.color.x;
        green += weight * splat.color.y;
        blue += weight * splat.color.z;
        if DEPTH {
            depth += weight * splat.depth;
        }
        transmittance = select(transmittance, next, take);
        end = select(end, vec4(i + 1u), take);
        if !any(live) {
            break;
        }
    }
    if i < range.y && any(live) {
        atomicMax(&counters[COUNTER_CUT_SHORT], range.y - range.x);
    }
    red += transmittance * view.background.x;
    green += transmittance * view.background.y;
    blue += transmittance * view.background.z;
    for (var k = 0; k < 4; k++) {
        if inside[k] {
            let pixel = row[k] * view.size.x + column[k];
            image[pixel] = vec4(red[k], green[k], blue[k], 1.0 - transmittance[k]);
            transmittances[pixel] = transmittance[k];
            ends[pixel] = end[k];
            if DEPTH {
                depths[pixel] = select(0.0, depth[k] / (1.0 - transmittance[k]), end[k] > 0u);
            }
        }
    }
}
