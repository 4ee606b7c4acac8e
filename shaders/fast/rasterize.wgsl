// As rasterize.wgsl, for the fast tier: eight neighbours of a subgroup, which belong to one tile, load one of eight
// splats each and share them. A software rasteriser spends most of its time on loads.

import package::shared::blend::{
    area_of, blend, empty_pixels, last_end, report_cut_short, splat_at, store_pixels, tile_ranges
};
import package::shared::camera::view;
import package::shared::dispatch::flat_index;
import package::shared::splat::Splat;
import package::shared::splat_lanes::splat_of;

@compute @workgroup_size(32)
fn rasterize(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
             @builtin(subgroup_id) subgroup: u32, @builtin(subgroup_size) lanes: u32,
             @builtin(subgroup_invocation_id) lane: u32) {
    let index = flat_index(group, groups, subgroup * lanes + lane, 32u);
    let tile = index / 16u;
    let is_tile = tile < view.tiles.x * view.tiles.y;
    var area = area_of(tile, index & 15u);
    area.inside = area.inside & vec4(is_tile);
    var pixels = empty_pixels(area);
    var range = vec2(0u, 0u);
    if is_tile {
        range = tile_ranges[tile];
    }
    let first_lane = lane & ~7u;
    var i = range.x;
    // All lanes continue until all are done: each loads for its neighbours.
    while subgroupAny(i < range.y && any(pixels.live)) {
        // Splats beyond the end have opacity 0.
        var mine = Splat();
        let load_at = i + (lane & 7u);
        if load_at < range.y {
            mine = splat_at(load_at);
        }
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
    report_cut_short(range, last_end(&pixels), i < range.y && any(pixels.live));
    if is_tile {
        store_pixels(&pixels, area);
    }
}
