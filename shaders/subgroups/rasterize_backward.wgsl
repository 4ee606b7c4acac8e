// As rasterize_backward.wgsl, for subgroups of eight or more: eight neighbours of a subgroup share a tile, each with 4x2 of its
// pixels. Each loads one of eight entries, and they add up the entries' gradients with shuffles, so that a slot has one
// place, which the lane that has loaded the entry writes at once.

import package::shared::blend_backward::{
    ROWS, Row, SLOT_OPACITY, Sums, entries, last_end, load_row, row_sum, splats, tile_ranges, unblend
};
import package::shared::camera::{TILE_SIZE, view};
import package::shared::dispatch::flat_index;
import package::shared::splat::{Splat, slot_of};
import package::shared::splat_lanes::splat_of;

// By slot, where its mark is set: (mean x, mean y, red, green) and (blue, covariance xx, xy, yy).
@group(0) @binding(6) var<storage, read_write> slot_gradients: array<vec4<f32>>;
// By slot: 1 where there is a gradient, and, if requested, the bits of the opacity times its gradient. Cleared
// beforehand.
@group(0) @binding(7) var<storage, read_write> slot_marks: array<u32>;

const LANES: u32 = 8u;

// The gradient of an entry, or what some lanes have of it.
struct Gradient {
    first: vec4<f32>,
    second: vec4<f32>,
    power: f32,
}

// Adds up the gradients of two entries over lanes that differ in one bit: those without it get the first, the others the
// second. Three times this, and each of eight lanes has the sum of one of eight entries.
fn shared_out(a: Gradient, b: Gradient, bit: u32, member: u32) -> Gradient {
    let second = (member & bit) != 0u;
    var own = Gradient();
    own.first = select(a.first, b.first, second) + subgroupShuffleXor(select(b.first, a.first, second), bit);
    own.second = select(a.second, b.second, second) + subgroupShuffleXor(select(b.second, a.second, second), bit);
    if SLOT_OPACITY {
        own.power = select(a.power, b.power, second) + subgroupShuffleXor(select(b.power, a.power, second), bit);
    }
    return own;
}

fn or_over_lanes(value: u32) -> u32 {
    let two = value | subgroupShuffleXor(value, 1u);
    let four = two | subgroupShuffleXor(two, 2u);
    return four | subgroupShuffleXor(four, 4u);
}

fn max_over_lanes(value: u32) -> u32 {
    let two = max(value, subgroupShuffleXor(value, 1u));
    let four = max(two, subgroupShuffleXor(two, 2u));
    return max(four, subgroupShuffleXor(four, 4u));
}

// An invocation's pixels, and what it knows of the eight entries that are being removed.
struct Cell {
    rows: array<Row, ROWS>,
    x: vec4<f32>,
    y: f32,
    // A bit for each entry that one of the pixels has.
    touched: u32,
}

// Removes the entry that a lane has loaded, number k of eight: the one before `last`, or none if so many are not left.
fn take_off(cell: ptr<function, Cell>, last: u32, left: u32, k: u32, mine: Splat, first_lane: u32) -> Gradient {
    let splat = splat_of(mine, first_lane + k);
    let i = select(0xffffffffu, last - k - 1u, left > k);
    let dx = splat.mean.x - (*cell).x;
    var rows = (*cell).rows;
    var sums = Sums();
    unblend(&rows, 0u, &sums, i, splat, dx, splat.mean.y - (*cell).y);
    unblend(&rows, 1u, &sums, i, splat, dx, splat.mean.y - ((*cell).y + 1.0));
    (*cell).rows = rows;
    (*cell).touched |= u32(sums.touched) << k;
    return Gradient(vec4(row_sum(sums.mean_x), row_sum(sums.mean_y), row_sum(sums.red), row_sum(sums.green)),
                    vec4(row_sum(sums.blue), row_sum(sums.xx), row_sum(sums.xy), row_sum(sums.yy)),
                    row_sum(sums.power));
}

@compute @workgroup_size(32)
fn rasterize_backward(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                      @builtin(subgroup_id) subgroup: u32, @builtin(subgroup_size) lanes: u32,
                      @builtin(subgroup_invocation_id) lane: u32) {
    let index = flat_index(group, groups, subgroup * lanes + lane, 32u);
    let tile = index / LANES;
    let member = lane & (LANES - 1u);
    let first_lane = lane - member;
    let tile_place = vec2(tile % view.tiles.x, tile / view.tiles.x);
    let corner = tile_place * TILE_SIZE + vec2((member & 1u) * 4u, (member >> 1u) * 2u);
    var cell = Cell();
    cell.x = vec4<f32>(vec4(corner.x) + vec4(0u, 1u, 2u, 3u)) + 0.5;
    cell.y = f32(view.first_row + corner.y) + 0.5;
    var start = 0u;
    var i = 0u;
    if tile < view.tiles.x * view.tiles.y {
        cell.rows[0] = load_row(corner);
        cell.rows[1] = load_row(corner + vec2(0u, 1u));
        start = tile_ranges[tile].x;
        i = max(start, max(last_end(cell.rows[0]), last_end(cell.rows[1])));
    }
    // Remaining entries, the last first. All lanes continue until all are done: each loads for its neighbours.
    var left = max_over_lanes(i - start);
    while subgroupAny(left > 0u) {
        var mine = Splat();
        if member < left {
            mine = splats[entries[start + left - 1u - member]];
        }
        let last = start + left;
        cell.touched = 0u;
        // Unrolled: software rasterisers limit the iterations of loops. In pairs, so that few gradients wait.
        let d_0 = take_off(&cell, last, left, 0u, mine, first_lane);
        let d_1 = take_off(&cell, last, left, 1u, mine, first_lane);
        let d_01 = shared_out(d_0, d_1, 1u, member);
        let d_2 = take_off(&cell, last, left, 2u, mine, first_lane);
        let d_3 = take_off(&cell, last, left, 3u, mine, first_lane);
        let d_23 = shared_out(d_2, d_3, 1u, member);
        let d_0123 = shared_out(d_01, d_23, 2u, member);
        let d_4 = take_off(&cell, last, left, 4u, mine, first_lane);
        let d_5 = take_off(&cell, last, left, 5u, mine, first_lane);
        let d_45 = shared_out(d_4, d_5, 1u, member);
        let d_6 = take_off(&cell, last, left, 6u, mine, first_lane);
        let d_7 = take_off(&cell, last, left, 7u, mine, first_lane);
        let d_67 = shared_out(d_6, d_7, 1u, member);
        let d_own = shared_out(d_0123, shared_out(d_45, d_67, 2u, member), 4u, member);
        // The lane that has loaded an entry has its sum.
        if ((or_over_lanes(cell.touched) >> member) & 1u) != 0u {
            let slot = slot_of(mine, tile_place);
            slot_gradients[2u * slot] = d_own.first;
            slot_gradients[2u * slot + 1u] = d_own.second;
            if SLOT_OPACITY {
                slot_marks[2u * slot] = 1u;
                slot_marks[2u * slot + 1u] = bitcast<u32>(d_own.power);
            } else {
                slot_marks[slot] = 1u;
            }
        }
        left -= min(left, LANES);
    }
}
