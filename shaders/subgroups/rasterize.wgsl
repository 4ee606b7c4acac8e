// As rasterize.wgsl, for subgroups of eight or more: eight neighbours of a subgroup that belong to one tile load one splat each and share
// them. A software rasteriser spends much of its time on loads.

import package::shared::blend::{
    Area, Pixels, area_of, blend, empty_pixels, is_open, report_cut_short, splat_at, store_pixels, tile_ranges
};
import package::shared::camera::view;
import package::shared::dispatch::flat_index;
import package::shared::splat::Splat;
import package::shared::splat_lanes::splat_of;

// Invocations of a tile.
const TILE_LANES: u32 = 16u;

// A tile, and what an invocation knows of it.
struct Work {
    pixels: Pixels,
    area: Area,
    range: vec2<u32>,
    is_tile: bool,
}

fn begin(index: u32) -> Work {
    let tile = index / TILE_LANES;
    let is_tile = tile < view.tiles.x * view.tiles.y;
    var area = area_of(tile, index & (TILE_LANES - 1u));
    area.inside = area.inside & vec4(is_tile);
    var range = vec2(0u, 0u);
    if is_tile {
        range = tile_ranges[tile];
    }
    return Work(empty_pixels(area), area, range, is_tile);
}

// Splats beyond the end have opacity 0.
fn splat_in(range: vec2<u32>, i: u32) -> Splat {
    var splat = Splat();
    if i < range.y {
        splat = splat_at(i);
    }
    return splat;
}

fn finish(work: ptr<function, Work>, pixels: ptr<function, Pixels>, i: u32) {
    let range = (*work).range;
    report_cut_short(pixels, range, i < range.y && is_open(pixels));
    if (*work).is_tile {
        store_pixels(pixels, (*work).area, range);
    }
}

@compute @workgroup_size(32)
fn rasterize(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
             @builtin(subgroup_id) subgroup: u32, @builtin(subgroup_size) lanes: u32,
             @builtin(subgroup_invocation_id) lane: u32) {
    var work = begin(flat_index(group, groups, subgroup * lanes + lane, 32u));
    var pixels = work.pixels;
    let first_lane = lane & ~7u;
    var i = work.range.x;
    // All lanes continue until all are done: each loads for its neighbours.
    while subgroupAny(i < work.range.y && is_open(&pixels)) {
        let mine = splat_in(work.range, i + (lane & 7u));
        // Unrolled: software rasterisers limit the iterations of loops.
        blend(&pixels, i, splat_of(mine, first_lane));
        blend(&pixels, i + 1u, splat_of(mine, first_lane + 1u));
        blend(&pixels, i + 2u, splat_of(mine, first_lane + 2u));
        blend(&pixels, i + 3u, splat_of(mine, first_lane + 3u));
        blend(&pixels, i + 4u, splat_of(mine, first_lane + 4u));
        blend(&pixels, i + 5u, splat_of(mine, first_lane + 5u));
        blend(&pixels, i + 6u, splat_of(mine, first_lane + 6u));
        blend(&pixels, i + 7u, splat_of(mine, first_lane + 7u));
        i += 8u;
    }
    finish(&work, &pixels, i);
}
