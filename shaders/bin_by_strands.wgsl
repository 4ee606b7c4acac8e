// Lists the Gaussians of every tile, front to back, as `bin.wgsl` does, but by one counting pass instead of a sort: for
// software rasterisers. The intersections, in the order of the depth sort, are divided into contiguous strands, one
// invocation each. A strand counts its intersections with each tile, the counts (tile-major) are scanned, and the strand
// then writes its Gaussians to their places in order.

import package::shared::camera::view;
import package::shared::counters::Counters;
import package::shared::dispatch::flat_index;
import package::shared::tile_rects::{end_tile, first_tile};

struct StrandUniforms {
    strands: u32,
    padding_1: u32,
    padding_2: u32,
    padding_3: u32,
}

@group(0) @binding(1) var<uniform> uniforms: StrandUniforms;
@group(0) @binding(2) var<storage, read> tile_rects: array<vec2<u32>>;
// Culled Gaussians come last.
@group(0) @binding(3) var<storage, read> depth_order: array<u32>;
// By rank: first intersection.
@group(0) @binding(4) var<storage, read> first_intersections: array<u32>;
@group(0) @binding(5) var<storage, read_write> counters: Counters;
// By tile and strand: number of intersections; after the scan: place of the first; after the placing: one past the last.
// Cleared beforehand.
@group(0) @binding(6) var<storage, read_write> tile_counts: array<u32>;
@group(0) @binding(7) var<storage, read_write> entries: array<u32>;
// By tile: first entry and one past the last.
@group(0) @binding(8) var<storage, read_write> tile_ranges: array<vec2<u32>>;

// A walk over intersections: the Gaussian with its rectangle, and the tile.
struct Walk {
    rank: u32,
    gaussian: u32,
    first: vec2<u32>,
    end: vec2<u32>,
    tile: vec2<u32>,
}

fn at_rank(rank: u32) -> Walk {
    let gaussian = depth_order[rank];
    let rect = tile_rects[gaussian];
    return Walk(rank, gaussian, first_tile(rect), end_tile(rect), first_tile(rect));
}

fn walk_from(intersection: u32) -> Walk {
    // The last rank that does not start after the intersection.
    var low = 0u;
    var high = view.gaussian_count;
    while high - low > 1u {
        let middle = (low + high) / 2u;
        if first_intersections[middle] <= intersection {
            low = middle;
        } else {
            high = middle;
        }
    }
    var walk = at_rank(low);
    let done = intersection - first_intersections[low];
    let columns = walk.end.x - walk.first.x;
    walk.tile += vec2(done % columns, done / columns);
    return walk;
}

// To the next intersection, if there is one.
fn step(walk: ptr<function, Walk>) {
    (*walk).tile.x++;
    if (*walk).tile.x == (*walk).end.x {
        (*walk).tile = vec2((*walk).first.x, (*walk).tile.y + 1u);
        if (*walk).tile.y == (*walk).end.y {
            *walk = at_rank(min((*walk).rank + 1u, view.gaussian_count - 1u));
        }
    }
}

fn counter_of(tile: vec2<u32>, strand: u32) -> u32 {
    return (tile.y * view.tiles.x + tile.x) * uniforms.strands + strand;
}

fn strand_range(strand: u32) -> vec2<u32> {
    let count = atomicLoad(&counters.intersections);
    let length = (count + uniforms.strands - 1u) / uniforms.strands;
    let start = min(strand * length, count);
    return vec2(start, min(start + length, count));
}

@compute @workgroup_size(8)
fn count_by_tile(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= uniforms.strands {
        return;
    }
    let range = strand_range(id.x);
    if range.x == range.y {
        return;
    }
    var walk = walk_from(range.x);
    for (var i = range.x; i < range.y; i++) {
        tile_counts[counter_of(walk.tile, id.x)] += 1u;
        step(&walk);
    }
}

@compute @workgroup_size(8)
fn place_by_tile(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= uniforms.strands {
        return;
    }
    let range = strand_range(id.x);
    if range.x == range.y {
        return;
    }
    var walk = walk_from(range.x);
    for (var i = range.x; i < range.y; i++) {
        let counter = counter_of(walk.tile, id.x);
        let place = tile_counts[counter];
        tile_counts[counter] = place + 1u;
        entries[place] = walk.gaussian;
        step(&walk);
    }
}

@compute @workgroup_size(64)
fn read_tile_ranges(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                    @builtin(local_invocation_index) local: u32) {
    let tile = flat_index(group, groups, local, 64u);
    if tile >= view.tiles.x * view.tiles.y {
        return;
    }
    // A tile starts where the last strand of the tile before has ended.
    let end = (tile + 1u) * uniforms.strands - 1u;
    var start = 0u;
    if tile > 0u {
        start = tile_counts[end - uniforms.strands];
    }
    tile_ranges[tile] = vec2(start, tile_counts[end]);
}
