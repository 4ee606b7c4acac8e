// As rasterize.wgsl, for the fast tier: neighbours of a subgroup that belong to one tile load one splat each and share
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

// For subgroups of eight or more: eight share.
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

// For subgroups of sixteen, which are a tile each.
@compute @workgroup_size(32)
fn rasterize_by_subgroup(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                         @builtin(subgroup_id) subgroup: u32, @builtin(subgroup_invocation_id) lane: u32) {
    var work = begin(flat_index(group, groups, subgroup * TILE_LANES + lane, 32u));
    var pixels = work.pixels;
    var i = work.range.x;
    while subgroupAny(i < work.range.y && is_open(&pixels)) {
        let mine = splat_in(work.range, i + lane);
        let a = vec4(mine.mean, mine.depth, mine.opacity);
        let b = mine.conic;
        let c = mine.color;
        // A lane's number must be a constant here.
        blend(&pixels, i, whole(subgroupBroadcast(a, 0u), subgroupBroadcast(b, 0u), subgroupBroadcast(c, 0u)));
        blend(&pixels, i + 1u, whole(subgroupBroadcast(a, 1u), subgroupBroadcast(b, 1u), subgroupBroadcast(c, 1u)));
        blend(&pixels, i + 2u, whole(subgroupBroadcast(a, 2u), subgroupBroadcast(b, 2u), subgroupBroadcast(c, 2u)));
        blend(&pixels, i + 3u, whole(subgroupBroadcast(a, 3u), subgroupBroadcast(b, 3u), subgroupBroadcast(c, 3u)));
        blend(&pixels, i + 4u, whole(subgroupBroadcast(a, 4u), subgroupBroadcast(b, 4u), subgroupBroadcast(c, 4u)));
        blend(&pixels, i + 5u, whole(subgroupBroadcast(a, 5u), subgroupBroadcast(b, 5u), subgroupBroadcast(c, 5u)));
        blend(&pixels, i + 6u, whole(subgroupBroadcast(a, 6u), subgroupBroadcast(b, 6u), subgroupBroadcast(c, 6u)));
        blend(&pixels, i + 7u, whole(subgroupBroadcast(a, 7u), subgroupBroadcast(b, 7u), subgroupBroadcast(c, 7u)));
        blend(&pixels, i + 8u, whole(subgroupBroadcast(a, 8u), subgroupBroadcast(b, 8u), subgroupBroadcast(c, 8u)));
        blend(&pixels, i + 9u, whole(subgroupBroadcast(a, 9u), subgroupBroadcast(b, 9u), subgroupBroadcast(c, 9u)));
        blend(&pixels, i + 10u, whole(subgroupBroadcast(a, 10u), subgroupBroadcast(b, 10u), subgroupBroadcast(c, 10u)));
        blend(&pixels, i + 11u, whole(subgroupBroadcast(a, 11u), subgroupBroadcast(b, 11u), subgroupBroadcast(c, 11u)));
        blend(&pixels, i + 12u, whole(subgroupBroadcast(a, 12u), subgroupBroadcast(b, 12u), subgroupBroadcast(c, 12u)));
        blend(&pixels, i + 13u, whole(subgroupBroadcast(a, 13u), subgroupBroadcast(b, 13u), subgroupBroadcast(c, 13u)));
        blend(&pixels, i + 14u, whole(subgroupBroadcast(a, 14u), subgroupBroadcast(b, 14u), subgroupBroadcast(c, 14u)));
        blend(&pixels, i + 15u, whole(subgroupBroadcast(a, 15u), subgroupBroadcast(b, 15u), subgroupBroadcast(c, 15u)));
        i += TILE_LANES;
    }
    finish(&work, &pixels, i);
}

fn whole(a: vec4<f32>, conic: vec3<f32>, color: vec3<f32>) -> Splat {
    return Splat(a.xy, a.z, a.w, conic, 0u, color, 0u);
}
