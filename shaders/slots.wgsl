// Numbers the slots of the Gaussians for the backward pass. A Gaussian has a slot for the gradient from each tile of its
// rectangle; its slots follow each other, row by row.

import package::shared::camera::view;
import package::shared::dispatch::flat_index;
import package::shared::splat::Splat;
import package::shared::tile_rects::{end_tile, first_tile, tile_count};

@group(0) @binding(1) var<storage, read> tile_rects: array<vec2<u32>>;
// By Gaussian: number of slots; after the scan: first slot.
@group(0) @binding(2) var<storage, read_write> slot_starts: array<u32>;
@group(0) @binding(3) var<storage, read_write> splats: array<Splat>;

@compute @workgroup_size(64)
fn count_slots(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
               @builtin(local_invocation_index) local: u32) {
    let i = flat_index(group, groups, local, 64u);
    if i < view.gaussian_count {
        slot_starts[i] = tile_count(tile_rects[i]);
    }
}

@compute @workgroup_size(64)
fn place_slots(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
               @builtin(local_invocation_index) local: u32) {
    let i = flat_index(group, groups, local, 64u);
    if i >= view.gaussian_count {
        return;
    }
    let first = first_tile(tile_rects[i]);
    let columns = end_tile(tile_rects[i]).x - first.x;
    splats[i].slot_origin = slot_starts[i] - (first.x + first.y * columns);
    splats[i].slot_columns = columns;
}
