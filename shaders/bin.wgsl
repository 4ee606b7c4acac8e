// Lists the Gaussians of every tile, front to back. Gaussians come sorted by depth; each emits one intersection for
// every tile of its rectangle, and a stable sort by tile keeps the depth order within a tile.

import package::shared::camera::view;
import package::shared::counters::Counters;
import package::shared::dispatch::flat_index;
import package::shared::tile_rects::{end_tile, first_tile, tile_count};

// Most tiles that a Gaussian may cover: later stages loop over them.
override MOST_TILES: u32 = 0xffffffffu;

@group(0) @binding(1) var<storage, read> tile_rects: array<vec2<u32>>;
@group(0) @binding(2) var<storage, read> depth_order: array<u32>;
// By rank: number of tiles; after the scan: first intersection.
@group(0) @binding(3) var<storage, read_write> first_intersections: array<u32>;
@group(0) @binding(4) var<storage, read_write> counters: Counters;
// By intersection: tile and Gaussian.
@group(0) @binding(5) var<storage, read_write> tile_keys: array<u32>;
@group(0) @binding(6) var<storage, read_write> entries: array<u32>;
// By tile: first entry and one past the last.
@group(0) @binding(7) var<storage, read_write> tile_ranges: array<vec2<u32>>;

@compute @workgroup_size(64)
fn count_tiles(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
               @builtin(local_invocation_index) local: u32) {
    let rank = flat_index(group, groups, local, 64u);
    if rank < view.gaussian_count {
        let count = tile_count(tile_rects[depth_order[rank]]);
        first_intersections[rank] = count;
        if count > MOST_TILES {
            atomicMax(&counters.too_wide, count);
        }
    }
}

// After the scan: the number of intersections, and how many of them fit.
@compute @workgroup_size(1)
fn limit_intersections() {
    atomicStore(&counters.intersections, min(atomicLoad(&counters.intersections_wanted), view.intersection_capacity));
}

@compute @workgroup_size(64)
fn emit_intersections(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                      @builtin(local_invocation_index) local: u32) {
    let rank = flat_index(group, groups, local, 64u);
    if rank >= view.gaussian_count {
        return;
    }
    let gaussian = depth_order[rank];
    let rect = tile_rects[gaussian];
    let first = first_tile(rect);
    let end = end_tile(rect);
    var i = first_intersections[rank];
    for (var y = first.y; y < end.y; y++) {
        for (var x = first.x; x < end.x; x++) {
            if i < view.intersection_capacity {
                tile_keys[i] = y * view.tiles.x + x;
                entries[i] = gaussian;
            }
            i++;
        }
    }
}

// The first intersection whose tile is not before this one; intersections are sorted.
fn first_of(tile: u32) -> u32 {
    var low = 0u;
    var high = atomicLoad(&counters.intersections);
    while low < high {
        let middle = (low + high) / 2u;
        if tile_keys[middle] < tile {
            low = middle + 1u;
        } else {
            high = middle;
        }
    }
    return low;
}

// After the sort: the intersections of each tile.
@compute @workgroup_size(64)
fn find_tile_ranges(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                    @builtin(local_invocation_index) local: u32) {
    let tile = flat_index(group, groups, local, 64u);
    if tile < view.tiles.x * view.tiles.y {
        tile_ranges[tile] = vec2(first_of(tile), first_of(tile + 1u));
    }
}
