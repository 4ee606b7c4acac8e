// Blends each tile's splats front to back. A workgroup handles one tile, an invocation 2x2 pixels.

import package::shared::blend::{
    area_of, blend, empty_pixels, is_open, report_cut_short, splat_at, store_pixels, tile_ranges
};
import package::shared::camera::view;

@compute @workgroup_size(16)
fn rasterize(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
             @builtin(local_invocation_index) local: u32) {
    let tile = group.x + group.y * groups.x;
    if tile >= view.tiles.x * view.tiles.y {
        return;
    }
    let area = area_of(tile, local);
    var pixels = empty_pixels(area);
    let range = tile_ranges[tile];
    // Two entries per iteration, because software rasterisers limit the number of iterations.
    var i = range.x;
    for (; i + 1u < range.y; i += 2u) {
        blend(&pixels, i, splat_at(i));
        blend(&pixels, i + 1u, splat_at(i + 1u));
        if !is_open(&pixels) {
            break;
        }
    }
    let cut_short = i + 1u < range.y && is_open(&pixels);
    if !cut_short && i < range.y && is_open(&pixels) {
        blend(&pixels, i, splat_at(i));
    }
    report_cut_short(&pixels, range, cut_short);
    store_pixels(&pixels, area, range);
}
